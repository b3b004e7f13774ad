"""Sources, a detector and a display that play their parts by the book: peers of the real ones, told what to do by a test."""

import queue
import threading
import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from dnb_edge.display.base import DisplayStatus
from dnb_edge.display.state import BoardState
from dnb_edge.errors import TemporaryFault
from dnb_edge.values import BgrImage, Clock, Frame, FrameDetections, LostFrames, SearchWindow, SourceInfo, StampSource

SIZE_PX = (64, 36)
PATIENCE_S = 10.0


def wait_until(true: Callable[[], bool]) -> None:
    """Waits for `true()`; how long says only when a broken test gives up."""
    deadline_s = time.monotonic() + PATIENCE_S
    while not true():
        assert time.monotonic() < deadline_s, "waited in vain"
        time.sleep(0.002)


def scene(sequence: int) -> BgrImage:
    """A picture that shows something, no two alike, as a camera's noise makes them."""
    v, u = np.mgrid[0 : SIZE_PX[1], 0 : SIZE_PX[0]]
    picture = np.where((u // 8 + v // 8) % 2 == 0, 60, 180) + np.random.default_rng(sequence).integers(-3, 4, u.shape)
    return np.repeat(picture[..., None], 3, axis=2).astype(np.uint8)


def frame(sequence: int, *, t_ns: int | None = None, jpeg: bytes | None = None, bgr: BgrImage | None = None) -> Frame:
    """Frame `sequence` of a source of 100 frames a second."""
    return Frame(
        sequence=sequence,
        t_ns=sequence * 10_000_000 if t_ns is None else t_ns,
        stamp_source=StampSource.MEDIA,
        width_px=SIZE_PX[0],
        height_px=SIZE_PX[1],
        jpeg=jpeg,
        bgr=(scene(sequence) if bgr is None else bgr) if jpeg is None else None,
    )


def info(*, live: bool) -> SourceInfo:
    """What both sources say of themselves."""
    clock = Clock.MONOTONIC if live else Clock.MEDIA
    return SourceInfo(
        uri="played:", width_px=SIZE_PX[0], height_px=SIZE_PX[1], nominal_fps=100.0, clock=clock, live=live
    )


class Clip:
    """A file: gives its frames, then ends, or raises `fault`."""

    def __init__(self, frames: Sequence[Frame], *, fault: Exception | None = None) -> None:
        self.info = info(live=False)
        self._frames = frames
        self._fault = fault
        self.lost: tuple[LostFrames, ...] = ()
        self.given = 0
        self.closed = False

    def frames(self) -> Iterator[Frame]:
        for one in self._frames:
            if self.closed:
                return
            self.given += 1
            yield one
        if self._fault is not None:
            raise self._fault

    def close(self) -> None:
        self.closed = True


class Camera:
    """A live camera: gives what `shoot` puts before it, until it is unplugged or closed."""

    def __init__(self) -> None:
        self.info = info(live=True)
        self.lost: tuple[LostFrames, ...] = ()
        self._shots: queue.SimpleQueue[Frame | Exception | None] = queue.SimpleQueue()
        self.given = 0
        self.closings = 0

    @property
    def closed(self) -> bool:
        return self.closings > 0

    def shoot(self, *frames: Frame) -> None:
        for one in frames:
            self._shots.put(one)

    def unplug(self) -> None:
        self._shots.put(TemporaryFault("/dev/video7: the camera went away"))

    def frames(self) -> Iterator[Frame]:
        while (shot := self._shots.get()) is not None:
            if isinstance(shot, Exception):
                raise shot
            yield shot
            self.given += 1

    def close(self) -> None:
        self.closings += 1
        self._shots.put(None)


class Watcher:
    """A detector that finds nothing and remembers what it looked at; a `gate` holds it up."""

    def __init__(self, gate: threading.Event | None = None) -> None:
        self._gate = gate
        self.seen: list[int] = []

    def detect(self, image: BgrImage, *, sequence: int, t_ns: int, windows: Sequence[SearchWindow]) -> FrameDetections:
        if self._gate is not None:
            assert self._gate.wait(PATIENCE_S)
        self.seen.append(sequence)
        return FrameDetections(sequence=sequence, t_ns=t_ns, detections=(), full_frame=not windows)


class Panel:
    """A display that remembers what it was told; offline where it has a fault."""

    def __init__(self) -> None:
        self.shown: list[BoardState] = []
        self.status = DisplayStatus.ONLINE
        self.fault: str | None = None

    def post(self, state: BoardState) -> None:
        self.shown.append(state)

    def close(self) -> None:
        """Nothing to let go of."""
