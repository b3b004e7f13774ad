"""The daemon is killed in the middle of a lap: it is back by itself, and the session goes on where it was."""

import time

from harness import reel
from harness.appliance import DISPLAY_URI, PATIENCE_S, laps, note

from dnb_edge.display import protocol
from dnb_edge.record.reader import read_run

BACK_S = 90.0
"""On an emulated machine, where Python alone takes 15 to 30 s to import what the appliance needs."""


def test_a_killed_session_goes_on(guest, appliance, webcam, logs):
    """After SIGKILL the display shows the laps from before, the next has the next number, and the last file tells of all."""
    webcam.plug(guest)
    appliance.install(reel.configuration(logs / "config", source=f"v4l2:{webcam.node}", display={"uri": DISPLAY_URI}))
    appliance.start()
    display = appliance.display
    display.wait(protocol.Lap, lambda lap: lap.lap == 2, since_s=0.0, timeout_s=PATIENCE_S)
    time.sleep(0.4 * reel.lap_s())
    before = {message.lap: message.time_s for _, message in display.lines if isinstance(message, protocol.Lap)}
    guest.run(f"kill -KILL {appliance.main_pid()}")
    killed_s = time.monotonic()
    back_s, _ = display.wait(protocol.Hello, lambda _: True, since_s=killed_s, timeout_s=PATIENCE_S)
    most = max(before)
    display.wait(protocol.Lap, lambda lap: lap.lap == most + 1, since_s=back_s, timeout_s=PATIENCE_S)
    repainted = {
        message.lap: message.time_s
        for at_s, message in display.lines
        if at_s > killed_s and isinstance(message, protocol.Lap)
    }
    appliance.stop()
    assert appliance.shown("NRestarts", "Result") == {"NRestarts": "1", "Result": "success"}
    paths = [path for path in appliance.recordings(logs / "runs") if path.suffix == ".mcap"]
    told = {lap.number: round(lap.time_s, 3) for lap in laps(read_run(paths[-1]))}
    note(logs, killed_to_display_s=round(back_s - killed_s, 1), laps=told, files=len(paths))
    assert {number: repainted.get(number) for number in before} == before
    assert {number: told.get(number) for number in before} == before
    assert sorted(told) == list(range(1, len(told) + 1))
    assert back_s - killed_s <= BACK_S
