"""A closed-loop drive as a source of frames: the overhead pictures of a world in which a driver drives.

Knows a task and a driver, and hands out the frames as any source does. Knows neither detector nor laps: the appliance times the
vehicle from the pictures, as it does in reality.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator

from dnb_edge.sim.control import Driver
from dnb_edge.sim.task import LoopTask
from dnb_edge.sim.world import World
from dnb_edge.values import Clock, Frame, LostFrames, SourceInfo


class ClosedLoopSource:
    """One drive. The same task and driver give the same frames; they wait to be taken."""

    lost: tuple[LostFrames, ...] = ()
    """Nothing: frames wait to be taken."""

    def __init__(self, task: LoopTask, driver: Driver, *, uri: str | None = None, pace: float = 0.0) -> None:
        """`driver` is new; it is started, asked and closed in the thread that takes the frames. `pace`: how many simulated
        seconds pass in one real second; 0 gives frames as fast as they are taken."""
        self.world = World(task)
        """What is really driven; ask it for its `truth` once the frames have ended."""
        self._driver = driver
        self._pace = pace
        self._closed = threading.Event()
        self._begun = threading.Lock()
        self.info = SourceInfo(
            uri=uri if uri is not None else f"loop:{driver.name}?task={task.kind}&seed={task.seed}&laps={task.laps}",
            width_px=task.size_px[0],
            height_px=task.size_px[1],
            nominal_fps=task.fps,
            clock=Clock.SIMULATED,
            live=False,
        )

    def frames(self) -> Iterator[Frame]:
        """The frames of the drive, to its end or until `close`. Raises `DriverFailed` where the driver fails."""
        if not self._begun.acquire(blocking=False):
            return
        try:
            self._driver.start(self.world.brief(self._driver))
            index, began_s = 0, time.monotonic()
            while self.world.ended is None and not self._closed.is_set():
                self.world.drive_until(self.world.frame_t_ns(index), self._driver)
                frame = self.world.frame(index)
                if self._pace > 0.0:
                    due_s = began_s + frame.t_ns * 1e-9 / self._pace
                    if self._closed.wait(max(0.0, due_s - time.monotonic())):
                        return
                yield frame
                index += 1
        finally:
            self._driver.close()

    def close(self) -> None:
        """End the iteration; safe to repeat and to call from another thread."""
        self._closed.set()
        if self._begun.acquire(blocking=False):
            # Nobody has taken a frame, and nobody will: the driver is closed here.
            self._driver.close()
