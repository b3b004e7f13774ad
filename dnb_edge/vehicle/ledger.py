"""Which lines are taken and which are too many, and what is counted of them: for each sender a limit, for all together another.

Knows words and their stamps. Knows no channel.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Hashable
from dataclasses import dataclass, field, replace

from dnb_edge.live.vehicle_word import MOST_SEQ, VehicleWord

MOST_HZ = 200.0
"""Lines a second that are taken of all senders together: what a race takes."""
SENDER_HZ = 100.0
"""Of one sender. One that says ever so much leaves as much for the others."""
BURST_S = 0.2
"""How long a sender that was silent may say twice as much."""
MOST_SENDERS = 64
RATE_NS = 1_000_000_000
MOST_GAP = 1000
"""A count that jumps farther ahead has begun anew, as one that runs backwards has."""


@dataclass(slots=True, kw_only=True)
class _Bucket:
    """Room for so many lines a second."""

    hz: float
    room: float = math.inf
    """Full at first."""
    filled_ns: int = 0

    def has_room(self, now_ns: int) -> bool:
        self.room = min(1.0 + self.hz * BURST_S, self.room + (now_ns - self.filled_ns) * 1e-9 * self.hz)
        self.filled_ns = now_ns
        return self.room >= 1.0


@dataclass(slots=True)
class _Car:
    """What is counted of one car."""

    came_ns: deque[int] = field(default_factory=deque)
    """Of the lines of the last second."""
    seq: int | None = None
    missing: int = 0


class Ledger:
    """Takes words or refuses them. `refused` counts what was said in vain, for whatever reason."""

    def __init__(self) -> None:
        self.taken = 0
        self.nonsense = 0
        """Lines that were no telemetry."""
        self.over = 0
        """Lines over a limit, those that the kernel threw away among them."""
        self._all = _Bucket(hz=MOST_HZ)
        self._senders: dict[Hashable, _Bucket] = {}
        self._cars: dict[int, _Car] = {}

    @property
    def refused(self) -> int:
        """All lines that were not taken."""
        return min(self.nonsense + self.over, MOST_SEQ)

    def has_room(self, sender: Hashable, now_ns: int) -> bool:
        """Whether a line of `sender` may be looked at now; where not it is counted. Asked before anything is read of it."""
        bucket = self._senders.get(sender)
        if bucket is None:
            if len(self._senders) >= MOST_SENDERS:
                # The one that has been silent for longest is forgotten.
                del self._senders[min(self._senders, key=lambda one: self._senders[one].filled_ns)]
            bucket = self._senders[sender] = _Bucket(hz=SENDER_HZ, filled_ns=now_ns)
        mine, ours = bucket.has_room(now_ns), self._all.has_room(now_ns)
        if not (mine and ours):
            self.over += 1
            return False
        bucket.room -= 1.0
        self._all.room -= 1.0
        return True

    def take(self, word: VehicleWord) -> VehicleWord:
        """The word with what is known of its car besides: the rate, and how many lines are missing."""
        car = self._cars.setdefault(word.car, _Car())
        self.taken += 1
        if word.seq is not None:
            gap = 0 if car.seq is None else word.seq - car.seq - 1
            car.missing += gap if 0 < gap <= MOST_GAP else 0
            car.seq = word.seq
        while car.came_ns and word.came_ns - car.came_ns[0] > RATE_NS:
            car.came_ns.popleft()
        car.came_ns.append(word.came_ns)
        span_ns = word.came_ns - car.came_ns[0]
        rate_hz = (len(car.came_ns) - 1) * 1e9 / span_ns if span_ns > 0 else None
        return replace(
            word,
            # Two lines read in one breath say nothing of a rate.
            rate_hz=None if rate_hz is None or rate_hz > 2.0 * MOST_HZ else rate_hz,
            missing=min(car.missing, MOST_SEQ),
            refused=self.refused,
        )
