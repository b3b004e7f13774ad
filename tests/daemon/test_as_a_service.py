"""Under a service manager: a start that must wait, and a watchdog that only progress feeds."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from service_manager import Manager, environment

from dnb_edge.daemon.keep_trying import WAITS_S, keep_trying
from dnb_edge.daemon.progress import Progress
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.errors import DnbEdgeError, InputError, TemporaryFault, WorkError

pytest.importorskip("systemd.daemon", reason="the systemd binding is not installed")

NO_CAMERA = InputError("/dev/video9: there is no such camera:\nno camera is connected")


@pytest.fixture
def manager(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Manager]:
    """With a watchdog of 10 s."""
    manager = Manager(tmp_path / "notify")
    for name, value in environment(manager.path, watchdog_s=10.0).items():
        monkeypatch.setenv(name, value)
    yield manager
    manager.close()


class Attempts:
    """A start that fails in these ways, then succeeds."""

    def __init__(self, *faults: Exception, ready: bool = False) -> None:
        self._faults = list(faults)
        self._ready = ready

    def __call__(self, notifier: ServiceNotifier) -> str:
        if self._ready:
            notifier.ready()
        if self._faults:
            raise self._faults.pop(0)
        return "raced"


def test_a_wrong_start_is_told_and_tried_again(manager: Manager, caplog: pytest.LogCaptureFixture) -> None:
    """The reason stands in the status line and once in the log, however often it is tried; waits grow to two seconds."""
    waited: list[float] = []
    busy = TemporaryFault("busy")
    attempts = Attempts(NO_CAMERA, NO_CAMERA, NO_CAMERA, NO_CAMERA, busy)
    assert keep_trying(attempts, ServiceNotifier(), sleep=waited.append) == "raced"
    reason = "cannot start yet: /dev/video9: there is no such camera: no camera is connected"
    assert manager.heard() == [f"STATUS={reason}", "STATUS=cannot start yet: busy"]
    assert [record.getMessage() for record in caplog.records] == [reason, "cannot start yet: busy"]
    assert waited == [*WAITS_S, WAITS_S[-1], WAITS_S[-1]]
    assert max(WAITS_S) <= 2.0


@pytest.mark.parametrize("fault", [NO_CAMERA, WorkError("the disk is full")])
def test_at_a_terminal_the_fault_is_raised_at_once(fault: DnbEdgeError, monkeypatch: pytest.MonkeyPatch) -> None:
    """A user sees it and exits with its code."""
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    with pytest.raises(type(fault)):
        keep_trying(Attempts(fault), ServiceNotifier(), sleep=lambda _: None)


@pytest.mark.parametrize(("fault", "ready"), [(NO_CAMERA, True), (WorkError("the disk is full"), False)])
@pytest.mark.usefixtures("manager")
def test_what_comes_after_the_start_or_is_no_input_is_raised(fault: DnbEdgeError, ready: bool) -> None:
    """The manager restarts the service then."""
    with pytest.raises(type(fault)):
        keep_trying(Attempts(fault, ready=ready), ServiceNotifier(), sleep=lambda _: None)


@dataclass
class Disk:
    """A recorder's thread, as the watchdog sees it."""

    progress: int = 0
    state: str = "recording"


class Time:
    """A clock that the test turns."""

    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


def fed(manager: Manager, seconds: range, disk: Disk | None, *, captured: bool, writes: bool) -> list[int]:
    """In which of the seconds the watchdog was fed, with ten rounds of the race's loop in each."""
    clock = Time()
    progress = Progress(ServiceNotifier(clock_s=clock), disk)
    told = []
    for second in seconds:
        clock.now_s = float(second)
        if disk is not None and writes:
            disk.progress += 1
        for tenth in range(10):
            progress.stepped(captured=1 + 10 * second + tenth if captured else 0)
        told += [second] * len(manager.heard())
    return told


@pytest.mark.parametrize(
    ("disk", "captured", "writes", "when"),
    [
        (Disk(), True, True, [0, 5, 10, 15]),
        (None, True, False, [0, 5, 10, 15]),
        (Disk(), False, True, []),
        (Disk(), True, False, []),
        (Disk(state="failed"), True, False, [0, 5, 10, 15]),
    ],
    ids=["all move", "no recording", "capture hangs", "the recorder hangs", "the recorder has said that it failed"],
)
def test_only_progress_of_all_feeds_the_watchdog(
    manager: Manager, disk: Disk | None, captured: bool, writes: bool, when: list[int]
) -> None:
    """Every five seconds where frames come, or a lost camera is looked for, and the recorder moves or has given up aloud."""
    assert fed(manager, range(18), disk, captured=captured, writes=writes) == when


def test_a_recorder_that_hangs_after_a_while_starves_the_watchdog(manager: Manager) -> None:
    """What it did before the last feeding counts no more."""
    clock, disk = Time(), Disk()
    progress = Progress(ServiceNotifier(clock_s=clock), disk)
    told = []
    for second in range(30):
        clock.now_s = float(second)
        disk.progress += second < 12
        progress.stepped(captured=second + 1)
        told += [second] * len(manager.heard())
    assert told == [0, 5, 10, 15]
