"""A live camera over a simulated drive that gives each frame when the race is ready for it, so that time plays no part.

What the detector finds is the drive's truth. A stall of the detector is told to the camera, which goes on regardless.
"""

import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from played import PATIENCE_S, frame, info

from dnb_edge.assembly import assemble
from dnb_edge.capture.source import FrameSource
from dnb_edge.config.load import load_config
from dnb_edge.core import Core, CoreSetup
from dnb_edge.daemon.eye import Eye
from dnb_edge.daemon.feed import FrameFeed
from dnb_edge.daemon.loop import Race
from dnb_edge.daemon.meter import Meter
from dnb_edge.daemon.sinks import Sink
from dnb_edge.display.base import Display
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.record.writer import Recorder
from dnb_edge.sim.rig import Rig
from dnb_edge.values import (
    BgrImage,
    Detection,
    Event,
    Frame,
    FrameDetections,
    Health,
    Lap,
    LostFrames,
    SearchWindow,
    SourceInfo,
    StampSource,
)

FPS = 30.0


def setup_of(config_file, rig: Rig) -> CoreSetup:
    """The core's setup for the rig's own pictures."""
    return assemble(load_config(config_file), camera_info(rig)).setup


def camera_info(rig: Rig) -> SourceInfo:
    """What the camera says of itself."""
    return replace(info(live=True), width_px=rig.camera.width_px, height_px=rig.camera.height_px, camera_id="overhead")


class Truth:
    """A detector that sees what the drive really does; at frame `stall_at` it stalls until the camera has gone on."""

    def __init__(self, rig: Rig, *, stall_at: int | None = None) -> None:
        self._rig = rig
        self._stall_at = stall_at
        self.stalled = threading.Event()
        self.released = threading.Event()
        self.taken = threading.Semaphore(0)
        self.seen: list[FrameDetections] = []

    def detect(self, image: BgrImage, *, sequence: int, t_ns: int, windows: Sequence[SearchWindow]) -> FrameDetections:
        if self._stall_at is not None and sequence >= self._stall_at and not self.released.is_set():
            self.stalled.set()
            assert self.released.wait(PATIENCE_S)
        found = found_in(self._rig, round(t_ns * FPS / 1e9), sequence)
        self.seen.append(found)
        self.taken.release()
        return found


def found_in(rig: Rig, index: int, sequence: int) -> FrameDetections:
    """What there is to be found in frame `index` of the drive."""
    truth = rig.frame_truth(index)
    car = Detection(
        camera_px=truth.camera_px, sigma_px=0.5, length_px=60.0, confidence=0.95, heading_rad=truth.heading_px_rad
    )
    return FrameDetections(
        sequence=sequence,
        t_ns=truth.t_ns,
        detections=(car,),
        full_frame=True,
        stamp_source=StampSource.MEDIA,
    )


class Conducted:
    """A live camera: frames `first` to `last` of the drive, each once the one before was looked at."""

    def __init__(self, rig: Rig, truth: Truth, *, first: int = 0, last: int | None = None, meanwhile: int = 0) -> None:
        """`meanwhile`: how many frames come while the detector stalls."""
        self.info = camera_info(rig)
        self.lost: tuple[LostFrames, ...] = ()
        self._rig = rig
        self._truth = truth
        self._range = range(first, rig.frames if last is None else last)
        self._meanwhile = meanwhile
        self.fault: Exception | None = None
        """What it ends with; None to end well."""

    def frames(self) -> Iterator[Frame]:
        free = 0
        for index in self._range:
            yield replace(frame(index, t_ns=self._rig.t_ns(index)), sequence=index)
            if self._truth.stalled.is_set() and not self._truth.released.is_set():
                free = free or self._meanwhile
                free -= 1
                if free == 0:
                    self._truth.released.set()
                    self._settle()
                continue
            while not self._truth.taken.acquire(timeout=0.005):
                if self._truth.stalled.is_set() and not self._truth.released.is_set():
                    break
        if self.fault is not None:
            raise self.fault

    def _settle(self) -> None:
        """Until the stalled frame and the two that waited were looked at."""
        for _ in range(3):
            assert self._truth.taken.acquire(timeout=PATIENCE_S)

    def close(self) -> None:
        """Nothing to let go of."""


class Diary:
    """A listener that keeps all events."""

    warnings: tuple[str, ...] = ()

    def __init__(self) -> None:
        self.events: list[Event] = []

    def frame(self, frame: Frame, found: FrameDetections) -> None:
        """Frames are not kept."""

    def event(self, event: Event) -> None:
        self.events.append(event)

    @property
    def laps(self) -> list[Lap]:
        return [event for event in self.events if isinstance(event, Lap)]

    @property
    def healths(self) -> list[Health]:
        return [event for event in self.events if isinstance(event, Health)]


def never() -> FrameSource:
    raise AssertionError("a source that did not go away is not opened again")


def race_live(
    setup: CoreSetup,
    source: Conducted,
    truth: Truth,
    *,
    sinks: Sequence[Sink] = (),
    displays: Sequence[Display] = (),
    recorder: Recorder | None = None,
    reopen: Callable[[], FrameSource] = never,
    earlier_laps: int = 0,
) -> Diary:
    """Races the camera to its end; what was told. `earlier_laps`: of the race that it goes on with."""
    diary = Diary()
    with FrameFeed(source, reopen) as feed:
        Race(
            info=source.info,
            feed=feed,
            eyes=[Eye(detector=truth, live=source.info.live)],
            core=Core(setup),
            meter=Meter(view_error_mean_px=None, view_error_mean_m=None),
            sinks=[*sinks, diary],
            displays=displays,
            notifier=ServiceNotifier(),
            recorder=recorder,
            stop=threading.Event(),
            laps=earlier_laps,
        ).run()
    return diary


def laps_of(setup: CoreSetup, found: Sequence[FrameDetections]) -> list[Lap]:
    """The laps that a core alone tells of these detections."""
    core = Core(setup)
    events = [event for one in found for event in core.step(one)]
    return [event for event in (*events, *core.finish()) if isinstance(event, Lap)]
