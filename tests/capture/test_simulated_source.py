"""The simulator as a source: whole laps, then the end; pacing that can be interrupted."""

import threading

import pytest

from dnb_edge.capture.source import open_source
from dnb_edge.sim.rig import Rig
from dnb_edge.values import Clock


def test_a_drive_ends_by_itself_after_its_laps():
    """The stamps begin at 0 and end a little after the last crossing of the drive that the rig describes."""
    source = open_source("sim:?laps=1&seed=3&fps=10")
    stamps = [frame.t_ns for frame in source.frames()]
    rig = Rig(seed=3, fps=10.0, laps=1)
    assert stamps == [rig.t_ns(i) for i in range(rig.frames)]
    assert 0.2 < stamps[-1] * 1e-9 - rig.truth.crossings_s[-1] < 2.0
    assert (source.info.clock, source.info.live) == (Clock.SIMULATED, False)
    source.close()


def test_close_interrupts_the_pace():
    """Paced at one simulated second in eleven days, the first frame comes at once, and `close` ends the wait for another."""
    source = open_source("sim:?laps=1&fps=1&pace=0.000001")
    taken = []
    first = threading.Event()

    def read() -> None:
        for frame in source.frames():
            taken.append(frame.t_ns)
            first.set()

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    assert first.wait(30)
    source.close()
    reader.join(30)
    assert not reader.is_alive()
    assert taken == [0]


@pytest.mark.parametrize("pace", ["", "&pace=1000"])
def test_pace_changes_no_frame(pace):
    """Real-time pacing only delays: stamps and numbers stay those of the drive."""
    source = open_source(f"sim:?laps=1&fps=4{pace}")
    frames = [(frame.sequence, frame.t_ns) for frame in source.frames()]
    source.close()
    assert len(frames) > 20
    assert frames == [(i, i * 250_000_000) for i in range(len(frames))]
