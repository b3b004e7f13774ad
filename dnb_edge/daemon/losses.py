"""Frames that never came to the detector, counted by reason so that every missing number is explained.

Knows frames' numbers and what a source says that it lost. Knows no thread, no clock and no picture.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from dnb_edge.values import LostFrames

GAP = "gap"
QUEUE = "queue"
STAMP = "stamp"
UNREADABLE = "unreadable"


class Ledger:
    """What was lost on the way from one source, which may go away and come back, to the queue.

    Numbers that are missing before a frame are those that the source itself lost since the frame before, and otherwise a `gap`:
    lost where nobody counts, in the camera or on the cable.
    """

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self._told: dict[str, int] | None = None
        self._sequence: int | None = None

    def reopened(self) -> None:
        """The source was opened anew: what it says that it lost, and its numbers, begin again."""
        self._told = None
        self._sequence = None

    def frame(self, sequence: int, told: tuple[LostFrames, ...]) -> None:
        """The frame `sequence` came, after the source had lost `told` since it was opened."""
        now = {lost.reason: lost.frames for lost in told}
        if self._sequence is not None and self._told is not None:
            missing = sequence - self._sequence - 1
            for reason, frames in now.items():
                new = min(missing, frames - self._told.get(reason, 0))
                self._counts[reason] += max(0, new)
                missing -= max(0, new)
            self._counts[GAP] += max(0, missing)
        self._sequence, self._told = sequence, now

    @property
    def lost(self) -> tuple[LostFrames, ...]:
        """The counts so far; reasons without frames are left out."""
        return as_lost(self._counts)


def as_lost(counts: dict[str, int]) -> tuple[LostFrames, ...]:
    """The counts by reason, in the order of the alphabet, without zeros."""
    return tuple(LostFrames(reason=reason, frames=frames) for reason, frames in sorted(counts.items()) if frames > 0)


def added(*losses: Iterable[LostFrames]) -> tuple[LostFrames, ...]:
    """Several accounts in one."""
    counts: Counter[str] = Counter()
    for account in losses:
        for lost in account:
            counts[lost.reason] += lost.frames
    return as_lost(counts)


def since(earlier: tuple[LostFrames, ...], later: tuple[LostFrames, ...]) -> tuple[LostFrames, ...]:
    """What of `later` came after `earlier`."""
    before = {lost.reason: lost.frames for lost in earlier}
    return as_lost({lost.reason: lost.frames - before.get(lost.reason, 0) for lost in later})
