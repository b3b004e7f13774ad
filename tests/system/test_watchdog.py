"""The daemon hangs: systemd's watchdog kills it and starts it again, and the laps that were told stand."""

import time

from harness import reel
from harness.appliance import DISPLAY_URI, PATIENCE_S, laps, note

from dnb_edge.display import protocol
from dnb_edge.record.reader import read_run

LIMIT_S = 110.0
"""The watchdog's 10 s and a start on an emulated machine."""


def test_a_hung_daemon_is_killed_and_started_again(guest, appliance, webcam, logs):
    """SIGSTOP stands for any hang; the laps before it are in the recording, and laps come again."""
    webcam.plug(guest)
    appliance.install(reel.configuration(logs / "config", source=f"v4l2:{webcam.node}", display={"uri": DISPLAY_URI}))
    appliance.start()
    _, told = appliance.display.wait(protocol.Lap, lambda lap: lap.lap == 1, since_s=0.0, timeout_s=PATIENCE_S)
    pid = appliance.main_pid()
    guest.run(f"kill -STOP {pid}")
    hung_s = time.monotonic()
    again_s, _ = appliance.display.wait(protocol.Hello, lambda _: True, since_s=hung_s, timeout_s=PATIENCE_S)
    appliance.display.wait(protocol.Lap, lambda lap: lap.lap == 2, since_s=again_s, timeout_s=PATIENCE_S)
    assert appliance.shown("NRestarts") == {"NRestarts": "1"}
    assert appliance.main_pid() != pid
    assert "watchdog" in appliance.journal().lower()
    appliance.stop()
    finished = [path for path in appliance.recordings(logs / "runs") if path.suffix == ".mcap"]
    recorded = laps(read_run(finished[-1]))
    note(
        logs,
        hung_to_display_s=round(again_s - hung_s, 1),
        laps=[(lap.number, round(lap.time_s, 2)) for lap in recorded],
    )
    assert any(lap.number == 1 and round(lap.time_s, 3) == told.time_s for lap in recorded)
    assert again_s - hung_s <= LIMIT_S
