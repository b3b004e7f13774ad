"""What of the machine's state is worth a warning, and who reads it."""

from pathlib import Path

from played import wait_until

from dnb_edge.daemon.machine import MachineJudge, MachineWatch
from dnb_edge.machine.state import MachineState


def test_warnings_come_once_and_stay_until_it_is_well_again() -> None:
    """Just under a limit, what was over it is not well yet: no warning flickers."""
    judge = MachineJudge()
    said = [judge.warnings(MachineState(temperature_c=celsius)) for celsius in (79.9, 80.0, 79.0, 77.0, 76.9, 79.0)]
    hot = [bool(warnings) for warnings in said]
    assert hot == [False, True, True, True, False, False]
    assert said[1] == ("processor at 80 C: cool the box",)
    low = [bool(judge.warnings(MachineState(disk_free_bytes=mb * 10**6))) for mb in (501, 499, 520, 551, 520)]
    assert low == [False, True, True, False, False]
    (slow,) = judge.warnings(MachineState(throttled=True))
    assert "heat or a weak supply" in slow
    assert judge.warnings(MachineState(throttled=False)) == ()


def test_the_watch_reads_by_itself(tmp_path: Path) -> None:
    """The race looks at what was read last, wherever the recording is by then."""
    with MachineWatch(lambda: tmp_path) as watch:
        wait_until(lambda: watch.state.disk_free_bytes is not None)
        assert watch.state.memory_bytes is not None
