"""What vehicles say of themselves, on its way into a race: bounded in number and in memory, and never waited for.

Knows words with their stamps and the frames' stamps. Knows no socket, and nothing of what a race makes of frames: the core
never hears of any of this. One thread puts, the race takes.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable

from dnb_edge.live.vehicle_word import VehicleWord, fault
from dnb_edge.values import VehicleReport

MOST_HZ = 200.0
"""Lines a second that a race takes, of all vehicles together: four of them at 50 Hz."""
BURST = 50
MOST_WAITING = 400
"""Lines that wait for a frame; the oldest go."""
MOST_A_FRAME = 32
OLDEST_NS = 10_000_000_000
"""A line that says that it came earlier is not believed."""


class VehicleInbox:
    """The words that wait for the race's next frame."""

    def __init__(self, clock_ns: Callable[[], int] = time.monotonic_ns) -> None:
        """`clock_ns` is CLOCK_MONOTONIC."""
        self._clock_ns = clock_ns
        self._waiting: deque[VehicleWord] = deque(maxlen=MOST_WAITING)
        self._room = float(BURST)
        self._filled_ns = clock_ns()
        self.left_out = 0
        """Words over the limit, or with a member or a stamp that cannot be meant."""

    def clear(self) -> None:
        """Another run begins: what came before is none of its business."""
        self._waiting.clear()

    def put(self, words: Iterable[VehicleWord]) -> None:
        """Lets words wait, as many as there is room for. Never blocks."""
        now_ns = self._clock_ns()
        self._room = min(BURST, self._room + (now_ns - self._filled_ns) * 1e-9 * MOST_HZ)
        self._filled_ns = now_ns
        for word in words:
            if self._room < 1.0 or fault(word) is not None or not now_ns - OLDEST_NS <= word.came_ns <= now_ns:
                self.left_out += 1
            else:
                self._room -= 1.0
                self._waiting.append(word)

    def take(self, t_ns: int, *, first_t_ns: int, monotonic: bool) -> list[VehicleReport]:
        """What belongs to the frame stamped `t_ns`, once it is raced; `first_t_ns` is the stamp of the race's first frame.

        Where the source's clock is CLOCK_MONOTONIC, what came after that instant waits for a later frame, and what came before
        the run's first frame is left out: in a recording the words never reach beyond the frames.
        """
        taken: list[VehicleReport] = []
        while self._waiting and len(taken) < MOST_A_FRAME:
            word = self._waiting[0]
            if monotonic and word.came_ns > t_ns:
                break
            self._waiting.popleft()
            when_ns = word.came_ns if monotonic else t_ns
            if when_ns >= first_t_ns:
                taken.append(_report(word, when_ns, first_t_ns))
        return taken


def _report(word: VehicleWord, t_ns: int, first_t_ns: int) -> VehicleReport:
    return VehicleReport(
        t_ns=t_ns,
        t_s=(t_ns - first_t_ns) * 1e-9,
        came_ns=word.came_ns,
        car=word.car,
        seq=word.seq,
        inference_ms=word.inference_ms,
        steering=word.steering,
        throttle=word.throttle,
        rate_hz=word.rate_hz,
        missing=word.missing,
        refused=word.refused,
    )
