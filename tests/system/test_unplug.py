"""The camera is unplugged and plugged in again while a car races: said at once, back soon, and the laps know of it."""

import time

import pytest
from harness import reel
from harness.appliance import DISPLAY_URI, PATIENCE_S, laps, note, stamps_s, the_run
from harness.webcam import Webcam

from dnb_edge.display import protocol

GAP_LIMIT_S = 0.5
"""Largest error of a lap during which the camera was away."""
SAID_S = 2.0
BACK_S = 5.0
CYCLES = 20


@pytest.fixture
def racing(guest, appliance, webcam, logs):
    """The appliance in a race that has seen the car cross the line once."""
    webcam.plug(guest)
    config = reel.configuration(logs / "config", source=f"v4l2:{webcam.node}", display={"uri": DISPLAY_URI})
    appliance.install(config)
    appliance.start()
    appliance.display.wait(protocol.State, lambda state: state.word == "LAP", since_s=0.0, timeout_s=PATIENCE_S)
    return appliance


def until_frames(webcam: Webcam, *, timeout_s: float) -> float:
    """Seconds until the camera has been asked for frames and has sent three."""
    begun_s, before = time.monotonic(), webcam.sent_frames
    while webcam.sent_frames < before + 3:
        assert time.monotonic() - begun_s < timeout_s, "no frames were asked for"
        time.sleep(0.02)
    return time.monotonic() - begun_s


def test_an_unplugged_camera_is_said_and_comes_back(racing, guest, webcam, logs):
    """The display warns within 2 s, frames are raced within 5 s of the node's return, and the lap in between is marked."""
    pulled_s = time.monotonic()
    webcam.unplug()
    warned_s, warning = racing.display.wait(
        protocol.Warn, lambda warn: "/dev/v4l" in warn.text, since_s=pulled_s, timeout_s=PATIENCE_S
    )
    node_s = webcam.plug(guest)
    plugged_s = time.monotonic()
    suspect_s, suspect = racing.display.wait(protocol.Suspect, lambda _: True, since_s=plugged_s, timeout_s=PATIENCE_S)
    racing.display.wait(protocol.Lap, lambda _: True, since_s=suspect_s + 1.0, timeout_s=PATIENCE_S)
    racing.stop()
    assert racing.shown("NRestarts") == {"NRestarts": "0"}
    run = the_run(racing.recordings(logs / "runs"))
    back_s = next(stamp for stamp in stamps_s(run) if stamp > node_s) - node_s
    driven = laps(run)
    note(
        logs,
        said_s=round(warned_s - pulled_s, 2),
        words=warning.text,
        frames_s=round(back_s, 2),
        marked=suspect.text,
        laps=[(lap.number, round(lap.time_s, 2), lap.suspect) for lap in driven],
    )
    assert "camera gap" in suspect.text
    # The car drove on all the while, and so did the clock.
    (marked,) = (lap for lap in driven if lap.number == suspect.lap)
    assert abs(marked.time_s - reel.lap_s()) < GAP_LIMIT_S
    assert any("camera gap" in why for lap in driven for why in lap.suspect)
    assert warned_s - pulled_s <= SAID_S
    assert back_s <= BACK_S


def test_twenty_times_unplugged_is_twenty_times_back(racing, guest, webcam, logs):
    """Each time frames are taken again within 5 s of the node's return; no process dies, no descriptor is left behind."""
    pid = racing.main_pid()
    before = int(guest.run(f"ls /proc/{pid}/fd | wc -l"))
    waits_s = []
    for _ in range(CYCLES):
        webcam.unplug()
        time.sleep(1.0)
        webcam.plug(guest)
        waits_s.append(until_frames(webcam, timeout_s=PATIENCE_S))
    after = int(guest.run(f"ls /proc/{pid}/fd | wc -l"))
    note(logs, cycles=CYCLES, frames_s=[round(wait, 2) for wait in waits_s], descriptors=[before, after])
    assert racing.main_pid() == pid
    assert after <= before + 1
    assert max(waits_s) <= BACK_S


def test_another_camera_in_its_place_is_refused(guest, appliance, webcam, logs):
    """Opened as /dev/video0, a camera with another serial number is not raced under the first one's calibration."""
    webcam.plug(guest)
    appliance.install(reel.configuration(logs / "config", source="v4l2:/dev/video0", display={"uri": DISPLAY_URI}))
    appliance.start()
    webcam.unplug()
    other = Webcam(reel.pictures, serial="B2")
    try:
        other.plug(guest)
        plugged_s = time.monotonic()
        _, warning = appliance.display.wait(
            protocol.Warn, lambda warn: "B2" in warn.text, since_s=plugged_s, timeout_s=PATIENCE_S
        )
        note(logs, words=warning.text)
        other.unplug()
        webcam.plug(guest)
        appliance.display.wait(
            protocol.Health, lambda health: (health.fps or 0) > 0, since_s=time.monotonic(), timeout_s=PATIENCE_S
        )
    finally:
        other.close()
    appliance.stop()
    assert appliance.shown("NRestarts") == {"NRestarts": "0"}
    the_run(appliance.recordings(logs / "runs"))
