"""Whatever stalls or dies beside it, a live race's laps are those of the frames that came through, to the last bit.

The camera gives a frame when the race has looked at the one before: a race that waited for anybody would never end here.
"""

import contextlib
import errno
import os
import threading
from pathlib import Path

import pytest
from conducted import Conducted, Truth, camera_info, found_in, laps_of, race_live, setup_of
from played import wait_until

from dnb_edge.cli.demo import write_demo_config
from dnb_edge.core import CoreSetup
from dnb_edge.daemon import feed as feed_module
from dnb_edge.daemon.sinks import BoardSink, LiveJsonSink, RecordSink
from dnb_edge.display.serial_port import SerialDisplay
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.display.terminal import BoardConsole, TerminalDisplay
from dnb_edge.errors import TemporaryFault
from dnb_edge.record import durable
from dnb_edge.record.header import RunHeader
from dnb_edge.record.writer import Recorder, RecordingSettings
from dnb_edge.sim.rig import Rig
from dnb_edge.values import Health, Lap, LostFrames

MEANWHILE = 15
"""Frames that come in half a second."""


@pytest.fixture(scope="module")
def rig() -> Rig:
    """Two laps."""
    return Rig(laps=2)


@pytest.fixture(scope="module")
def setup(rig: Rig, tmp_path_factory: pytest.TempPathFactory) -> CoreSetup:
    """The demo's track and view."""
    return setup_of(write_demo_config(tmp_path_factory.mktemp("demo"), rig), rig)


@pytest.fixture(scope="module")
def undisturbed(rig: Rig, setup: CoreSetup) -> list[Lap]:
    """The laps of all frames."""
    laps = laps_of(setup, [found_in(rig, index, index) for index in range(rig.frames)])
    assert len(laps) == 2
    return laps


@pytest.fixture(autouse=True)
def no_manager(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)


def times(laps: list[Lap]) -> list[tuple[int, float, float]]:
    """What must not move."""
    return [(lap.start_t_ns, lap.time_s, lap.sigma_s) for lap in laps]


@pytest.mark.parametrize("second", [3.0, 8.0])
def test_a_detector_that_stalls_loses_frames_and_moves_no_lap(
    rig: Rig, setup: CoreSetup, undisturbed: list[Lap], second: float
) -> None:
    """Half a second's stall away from the line: all frames but the last two are lost to the queue, each of them told of, and
    the laps are those of the other frames; they lie within a millisecond of the laps of all frames."""
    truth = Truth(rig, stall_at=round(second * 30))
    diary = race_live(setup, Conducted(rig, truth, meanwhile=MEANWHILE), truth)
    lost = MEANWHILE - feed_module.QUEUE_FRAMES
    assert diary.healths[-1].lost == (LostFrames(reason="queue", frames=lost),)
    assert diary.healths[-1].dropped_frames == lost
    assert diary.healths[-1].frames == rig.frames - lost
    assert max(health.queued_frames or 0 for health in diary.healths) == feed_module.QUEUE_FRAMES
    assert times(diary.laps) == times(laps_of(setup, truth.seen))
    assert [lap.time_s for lap in diary.laps] == pytest.approx([lap.time_s for lap in undisturbed], abs=1e-3)


def test_a_disk_that_hangs_moves_no_lap(
    rig: Rig, setup: CoreSetup, undisturbed: list[Lap], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No sync comes back while the race lasts: every frame is raced, every lap is right, and nothing is "saved"."""
    disk = threading.Event()
    real = os.fdatasync

    def hanging(descriptor: int) -> None:
        disk.wait()
        real(descriptor)

    monkeypatch.setattr(durable.os, "fdatasync", hanging)
    recorder = Recorder(RecordingSettings(directory=tmp_path, image_fps=None), header(rig, setup))
    truth = Truth(rig)
    diary = race_live(setup, Conducted(rig, truth), truth, sinks=[RecordSink(recorder)], recorder=recorder)
    saved = recorder.is_saved(1)
    disk.set()
    recorder.close()
    assert not saved
    assert times(diary.laps) == times(undisturbed)
    assert diary.healths[-1].lost == ()
    assert {health.saved_laps for health in diary.healths} == {0}


def test_saved_laps_are_those_that_the_disk_has(rig: Rig, setup: CoreSetup, tmp_path: Path) -> None:
    """Health never counts a lap that was not told yet, and all at the end; one of the race that this one goes on with too."""
    recorder = Recorder(RecordingSettings(directory=tmp_path, image_fps=None), header(rig, setup))
    truth = Truth(rig)
    diary = race_live(
        setup, Conducted(rig, truth), truth, sinks=[RecordSink(recorder)], recorder=recorder, earlier_laps=1
    )
    recorder.close()
    told = 1
    for event in diary.events:
        told += isinstance(event, Lap)
        if isinstance(event, Health):
            assert event.saved_laps in range(1, told + 1)
    assert diary.healths[-1].saved_laps == 1 + len(diary.laps) == 3


def header(rig: Rig, setup: CoreSetup) -> RunHeader:
    """A recording's header, as far as a test needs it."""
    return RunHeader(
        name="test",
        setup={"core": setup.to_dict()},
        config={},
        source=camera_info(rig),
        versions={},
        wall_offset_ns=None,
    )


def test_displays_and_pipes_that_nobody_reads_move_no_lap(rig: Rig, setup: CoreSetup, undisturbed: list[Lap]) -> None:
    """A serial display, the board on a stopped terminal and JSON lines into a full pipe, all at once: every frame is raced."""
    master, slave = os.openpty()
    reading, writing = os.pipe()
    terminal = os.fdopen(os.dup(slave), "w", encoding="utf-8")
    board = TerminalDisplay(BoardConsole(file=terminal, force_terminal=True, width=80))
    displays = [SerialDisplay(os.ttyname(slave)), board]
    lines = LiveJsonSink(writing, observations=True)
    truth = Truth(rig)
    sinks = [BoardSink(displays, ServiceNotifier(), None), lines]
    diary = race_live(setup, Conducted(rig, truth), truth, sinks=sinks, displays=displays)
    for display in displays:
        display.close()
    stuck = board.stuck
    os.close(master)
    os.close(slave)
    os.close(reading)
    with lines:
        pass
    os.close(writing)
    wait_until(lambda: not board.stuck)
    with contextlib.suppress(OSError):
        terminal.close()
    assert times(diary.laps) == times(undisturbed)
    assert diary.healths[-1].lost == ()
    assert stuck, "the terminal took the whole board: nothing was tested"


def test_wall_clock_steps_move_nothing(
    rig: Rig, setup: CoreSetup, undisturbed: list[Lap], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The time of day jumps back and forth by years with every look at it: it is metadata only."""
    looks = iter(range(10**9))
    monkeypatch.setattr("time.time", lambda: (-1.0) ** next(looks) * 1e8 + 1e9)
    monkeypatch.setattr("time.time_ns", lambda: (-1) ** next(looks) * 10**17 + 10**18)
    truth = Truth(rig)
    assert times(race_live(setup, Conducted(rig, truth), truth).laps) == times(undisturbed)


@pytest.mark.parametrize("fault", [TemporaryFault("/dev/video7: the camera is gone"), OSError(errno.EIO, "I/O error")])
def test_a_lap_with_a_camera_gap_is_marked(
    rig: Rig, setup: CoreSetup, undisturbed: list[Lap], monkeypatch: pytest.MonkeyPatch, fault: Exception
) -> None:
    """The camera is away for three seconds of the second lap: the race goes on by itself, that lap and no other is marked."""
    monkeypatch.setattr(feed_module, "BACK_OFF_S", (0.01,))
    gone = round((undisturbed[1].start_s + 2.0) * 30)
    truth = Truth(rig)
    camera = Conducted(rig, truth, last=gone)
    camera.fault = fault
    back = Conducted(rig, truth, first=gone + 90)
    diary = race_live(setup, camera, truth, reopen=lambda: back)
    first, second = diary.laps
    assert times([first]) == times(undisturbed[:1])
    assert (first.valid, first.reasons) == (undisturbed[0].valid, undisturbed[0].reasons)
    assert second.suspect == ("camera gap: no frames came for 3.0 s",)
    assert second.reasons == ("the car was not seen for 3.0 s (limit 1.0 s)",)
    assert second.time_s == pytest.approx(undisturbed[1].time_s, abs=1e-3)
    assert diary.healths[-1].lost == ()
