"""A core that is brought back to where the core of a run that was cut short was, while frames already come.

Knows the saved detections of that run and a core. What the old core had told is not told again; what it had not told of its
last saved frame is, and then all that the frames meanwhile lead to, with their own stamps. Nothing is lost by the time that
this takes; it is only told later.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence

from dnb_edge.core import Core, CoreSetup
from dnb_edge.values import Event, FrameDetections, Lap, Observation, SearchWindow

FEW_FRAMES = 8
"""So many frames that have waited are raced at once, in two milliseconds."""

log = logging.getLogger(__name__)

YIELD_FRAMES = 4
"""After so many frames other threads may go on: half a millisecond, where the interpreter would let them wait for five."""


class ResumedCore:
    """Takes the place of `Core` in a race that goes on with another."""

    def __init__(
        self,
        setup: CoreSetup,
        saved: Callable[[], Iterable[FrameDetections]],
        *,
        frames: int,
        after_last: int,
        laps: Sequence[Lap],
        name: str,
    ) -> None:
        """Starts to race the `saved` detections, of so many `frames`, in a thread of its own.

        `after_last` events of the last saved frame were saved too; `laps` are all laps that were, and must come out again;
        `name` is what the earlier run is called.
        """
        self._saved = saved
        self._frames = frames
        self._raced = 0
        self._after_last = after_last
        self._laps = tuple(laps)
        self._name = name
        self._core = Core(setup)
        # Follows what is seen meanwhile, only so that the detector looks in the right place.
        self._scout: Core | None = Core(setup, tell_running=False)
        # The race appends, the thread takes from the other end; once the thread has ended the race does both.
        self._backlog: deque[FrameDetections] = deque()
        self._untold: list[Event] = []
        self._stop = threading.Event()
        self._failure: Exception | None = None
        self._differs = False
        self.detected_frames = 0
        """Frames of the earlier run in which a car was found, as far as it had told them; 0 until it is caught up with."""
        self._thread = threading.Thread(target=self._run, name="catch-up", daemon=True)
        self._thread.start()

    @property
    def caught_up(self) -> bool:
        """Whether the core is where it would be had nothing happened."""
        return self._scout is None

    @property
    def finished(self) -> bool:
        """Whether the race is over, as soon as that is known."""
        return not self._thread.is_alive() and self._failure is None and not self._stop.is_set() and self._core.finished

    def step(self, found: FrameDetections) -> list[Event]:
        """As `Core.step`; nothing while the earlier run is being caught up with, then all at once."""
        self._backlog.append(found)
        if not self.caught_up and self._thread.is_alive():
            assert self._scout is not None, "it is not caught up"
            self._scout.step(found)
            return []
        return self._caught_up()

    def wait(self) -> None:
        """Waits until the saved frames have been raced, or the race was stopped."""
        self._thread.join()

    def windows(self, t_ns: int, camera: int = 0) -> tuple[SearchWindow, ...]:
        """As `Core.windows`."""
        return (self._scout or self._core).windows(t_ns, camera)

    def is_awaited(self, t_ns: int, camera: int) -> bool:
        """As `Core.is_awaited`."""
        return (self._scout or self._core).is_awaited(t_ns, camera)

    def notes(self) -> tuple[str, ...]:
        """As `Core.notes`, with what there is to say of the earlier run."""
        if not self.caught_up:
            percent = 100 * self._raced // max(1, self._frames)
            return (f"going on with {self._name}, which was cut short: {percent} % of its frames are raced again",)
        gone_on = f"going on with {self._name}, which was cut short"
        if self._differs:
            gone_on += ": raced again it gives other laps than were told; those of `dnb-edge score` count"
        return (gone_on, *self._core.notes())

    def finish(self) -> list[Event]:
        """As `Core.finish`. Where the race is stopped before it is caught up with, nothing: its recording tells the rest."""
        if not self.caught_up and self._thread.is_alive():
            self._stop.set()
            self._thread.join()
            log.warning("stopped before %s was caught up with: `dnb-edge score` tells what came of it", self._name)
            return []
        return [*self._caught_up(), *self._core.finish()]

    def _caught_up(self) -> list[Event]:
        """What the frames that wait lead to, behind what was never told of the last saved one."""
        if self._failure is not None:
            raise self._failure
        self._scout = None
        events, self._untold = self._untold, []
        while self._backlog:
            events += self._core.step(self._backlog.popleft())
        return events

    def _run(self) -> None:
        """Body of the thread."""
        try:
            self._race_again()
        except Exception as error:  # noqa: BLE001 handed to the race's thread, which raises it
            self._failure = error

    def _race_again(self) -> None:
        core, laps = self._core, list[Lap]()
        seen: set[int] = set()
        events: list[Event] = []
        for count, found in enumerate(self._saved(), start=1):
            if self._stop.is_set():
                return
            _note(events, laps, seen)
            events = core.step(found)
            self._raced = count
            if count % YIELD_FRAMES == 0:
                time.sleep(0)
        _note(events[: self._after_last], laps, seen)
        self._untold = events[self._after_last :]
        self.detected_frames = len(seen)
        self._differs = tuple(laps) != self._laps
        if self._differs:
            log.warning("%s: raced again it gives other laps than were told", self._name)
        # What came meanwhile, up to a few: the race must not stand still for it.
        while len(self._backlog) > FEW_FRAMES and not self._stop.is_set():
            self._untold += core.step(self._backlog.popleft())
            time.sleep(0)


def _note(events: Iterable[Event], laps: list[Lap], seen: set[int]) -> None:
    for event in events:
        if isinstance(event, Observation):
            seen.add(event.t_ns)
        elif isinstance(event, Lap):
            laps.append(event)
