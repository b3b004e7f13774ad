"""A full race through the real thing: uvcvideo, the unit, the serial display and the recording.

Emulation is slow: the car is found by the marker on its roof, since a network would take a second a frame there, and the race
takes as many of the camera's 30 frames a second as it can. What it cannot take must be counted, to the last frame.
"""

import itertools
import statistics

from harness import reel
from harness.appliance import DISPLAY_URI, PATIENCE_S, RUNS, account, laps, note, stamps_s, the_run, timed

from dnb_edge.display import protocol
from dnb_edge.values import Health

LAPS = 4
LEAST_TIMED = 2
LAP_LIMIT_S = 0.1
"""Largest error of a lap's time. Stamps are those of the payload's arrival, and an emulated processor that shares its host
comes late by tens of milliseconds; the mean over the race is far nearer."""
MEAN_LIMIT_S = 0.02
MEMORY_LIMIT_BYTES = 250e6


def test_a_race_is_counted_timed_shown_and_recorded(guest, appliance, webcam, logs):
    """All laps, none twice, each time near the truth, on the display as in the file, every lost frame accounted for."""
    webcam.plug(guest)
    config = reel.configuration(
        logs / "config",
        source=f"v4l2:{webcam.node}",
        race={"laps": LAPS, "max_gap_s": 4.0},
        display={"uri": DISPLAY_URI},
    )
    appliance.install(config)
    ready_s = appliance.start()
    appliance.display.wait(protocol.State, lambda state: state.word == "FINISHED", since_s=0.0, timeout_s=PATIENCE_S)
    guest.wait_for(f"! ls {RUNS} | grep -q part", timeout_s=PATIENCE_S)
    # The box stays up for the next race.
    assert appliance.shown("ActiveState", "NRestarts") == {"ActiveState": "active", "NRestarts": "0"}
    appliance.stop()

    run = the_run(appliance.recordings(logs / "runs"))
    driven = laps(run)
    assert [lap.number for lap in driven] == list(range(1, LAPS + 1))
    errors_s = [lap.time_s - reel.lap_s() for lap in timed(run)]
    assert len(errors_s) >= LEAST_TIMED
    frames = account(run)
    stamps = stamps_s(run)
    memory_bytes = max(event.memory_bytes or 0 for event in run.events() if isinstance(event, Health))
    note(
        logs,
        ready_s=round(ready_s, 1),
        lap_error_ms=[round(1e3 * error) for error in errors_s],
        sigma_ms=[round(1e3 * lap.sigma_s, 1) for lap in driven],
        raced=frames.raced,
        missing=frames.missing,
        lost=frames.lost,
        raced_fps=round(len(stamps) / (stamps[-1] - stamps[0]), 1),
        camera_skipped=webcam.skipped_frames,
        memory_mb=round(memory_bytes / 1e6),
    )
    assert max(map(abs, errors_s)) < LAP_LIMIT_S
    assert abs(statistics.mean(errors_s)) < MEAN_LIMIT_S
    assert frames.unexplained == 0
    assert 0 < memory_bytes <= MEMORY_LIMIT_BYTES
    shown = [message for _, message in appliance.display.lines if isinstance(message, protocol.Lap)]
    shown_s = {message.lap: message.time_s for message in shown}
    assert shown_s == {lap.number: round(lap.time_s, 3) for lap in driven}
    assert appliance.display.refused == []
    assert guest.run(f"ls {RUNS} | grep -c part || true").strip() == "0"


def test_laps_follow_each_other_without_a_gap(guest, appliance, webcam, logs):
    """Where one lap ends the next begins, and SIGTERM in the middle of one finishes the file within the unit's time."""
    webcam.plug(guest)
    appliance.install(reel.configuration(logs / "config", source=f"v4l2:{webcam.node}", display={"uri": DISPLAY_URI}))
    appliance.start()
    appliance.display.wait(protocol.Lap, lambda lap: lap.lap == 3, since_s=0.0, timeout_s=PATIENCE_S)
    stopped_s = appliance.stop()
    assert appliance.shown("Result") == {"Result": "success"}
    driven = laps(the_run(appliance.recordings(logs / "runs")))
    assert len(driven) >= 3
    assert all(before.end_t_ns == after.start_t_ns for before, after in itertools.pairwise(driven))
    note(logs, stopped_s=round(stopped_s, 1))
    assert stopped_s < 8.0
