"""Percentiles of many durations in little memory: a histogram whose bins are 2 % wide.

Knows numbers only.
"""

from __future__ import annotations

import math

_LEAST_MS = 0.01
_GREATEST_MS = 1e6
_RATIO = 1.02


class Spread:
    """Durations, counted. A percentile told is at most 2 % above the true one, and never above the greatest."""

    def __init__(self) -> None:
        self._counts = [0] * (_bin(_GREATEST_MS) + 1)
        self._count = 0
        self._greatest_ms = 0.0

    def add(self, milliseconds: float) -> None:
        """Counts one duration; below 10 us or above 1,000 s it counts as that."""
        self._counts[_bin(milliseconds)] += 1
        self._count += 1
        self._greatest_ms = max(self._greatest_ms, milliseconds)

    def percentile(self, percent: float) -> float | None:
        """The smallest duration that so many percent do not exceed (nearest rank), milliseconds; None where there is none."""
        if self._count == 0:
            return None
        rank = max(1, math.ceil(percent / 100.0 * self._count))
        below = 0
        for place, count in enumerate(self._counts):
            below += count
            if below >= rank:
                return min(_LEAST_MS * _RATIO**place, self._greatest_ms)
        raise AssertionError("every duration is in a bin")


def _bin(milliseconds: float) -> int:
    """The bin whose upper edge is the first at or above the duration."""
    inside = min(max(milliseconds, _LEAST_MS), _GREATEST_MS)
    return math.ceil(math.log(inside / _LEAST_MS) / math.log(_RATIO) - 1e-9)
