"""A camera that freezes without an error, three ways: no frames, the same frame again and again, frames marked as bad."""

import time

import pytest
from harness import reel
from harness.appliance import DISPLAY_URI, PATIENCE_S, account, note, the_run
from harness.webcam import Show

from dnb_edge.display import protocol


@pytest.mark.parametrize(
    ("show", "limit_s", "word"),
    [(Show.NOTHING, 4.0, "/dev/v4l"), (Show.SAME, 9.0, "frozen"), (Show.DAMAGED, 4.0, "/dev/v4l")],
    ids=["silent", "same-picture", "damaged"],
)
def test_a_camera_that_gives_nothing_new_is_said_and_recovers(guest, appliance, webcam, logs, show, limit_s, word):
    """The display warns (nothing new for 2 s, the same for 5 s), and the race goes on by itself when the camera does."""
    webcam.plug(guest)
    config = reel.configuration(logs / "config", source=f"v4l2:{webcam.node}", display={"uri": DISPLAY_URI})
    appliance.install(config)
    appliance.start()
    appliance.display.wait(protocol.State, lambda state: state.word == "LAP", since_s=0.0, timeout_s=PATIENCE_S)
    webcam.show = show
    begun_s = time.monotonic()
    said_s, warning = appliance.display.wait(
        protocol.Warn, lambda warn: word in warn.text, since_s=begun_s, timeout_s=PATIENCE_S
    )
    time.sleep(2.0)
    webcam.show = Show.PLAY
    playing_s = time.monotonic()
    lap_s, _ = appliance.display.wait(protocol.Lap, lambda _: True, since_s=playing_s, timeout_s=PATIENCE_S)
    appliance.stop()
    frames = account(the_run(appliance.recordings(logs / "runs")))
    note(
        logs,
        said_s=round(said_s - begun_s, 1),
        words=warning.text,
        lap_after_s=round(lap_s - playing_s, 1),
        lost=frames.lost,
    )
    assert appliance.shown("NRestarts") == {"NRestarts": "0"}
    assert frames.unexplained == 0
    assert said_s - begun_s <= limit_s
