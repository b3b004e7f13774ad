"""The distances of `distance`, while a path still grows: of its points so far to the beginning of the reference.

One row of the table is added for each new point of the path, over the whole reference. Within a row a cell follows from the
one to its left: for DTW that is one running minimum over sums, for Frechet a short loop. Knows points; knows nothing of laps,
percent or time. For an end that is left open: P. Tormene et al., "Matching incomplete time series with dynamic time warping:
an algorithm and an application to post-stroke rehabilitation", 2009.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dnb_edge.score.distance import Programme
from dnb_edge.values import PointM, Points

Floats: TypeAlias = NDArray[np.float64]


class PrefixTable:
    """The last row of one programme's table, fed with the path's points one by one."""

    def __init__(self, reference: Points, programme: Programme, clamp: float | None = None) -> None:
        """`reference` is (m, 2), m at least 1; `clamp` is as for `dtw_distance`."""
        self._x, self._y = np.ascontiguousarray(reference.T, dtype=np.float64)
        self._programme = programme
        self._clamp = clamp
        self._row: Floats | None = None
        self._points = 0

    @property
    def points(self) -> int:
        """Number of the path's points so far."""
        return self._points

    def add(self, point: PointM, extra: Floats | None = None) -> None:
        """Takes the path's next point; `extra`, (m,), is added to its distances from the reference, after the clamp."""
        across = self._y - point[1]
        local = self._x - point[0]
        local *= local
        across *= across
        local += across
        np.sqrt(local, out=local)
        if self._clamp is not None:
            np.minimum(local, self._clamp, out=local)
        if extra is not None:
            local += extra
        self._row = self._next_row(local)
        self._points += 1

    def to(self, first: int, last: int) -> Floats:
        """The distances of the points so far to the reference's points up to each of those from `first` to `last`, which are
        among them: (last - first + 1,). Raises `ValueError` before the path's first point.
        """
        if self._row is None:
            raise ValueError("a path of 0 points has no distance")
        return self._row[first : last + 1].copy()

    def _next_row(self, local: Floats) -> Floats:
        frechet = self._programme is Programme.FRECHET
        if self._row is None:
            return np.maximum.accumulate(local) if frechet else np.cumsum(local)
        way = self._row.copy()
        if self._programme is Programme.DTW_SYMMETRIC:
            np.minimum(way[1:], self._row[:-1] + local[1:], out=way[1:])
        else:
            np.minimum(way[1:], self._row[:-1], out=way[1:])
        return _leashed(way, local) if frechet else _summed(way, local)


def _summed(way: Floats, local: Floats) -> Floats:
    """Row t of t[j] = local[j] + min(way[j], t[j - 1]): the least way in at any place before, and all distances from there."""
    total = np.cumsum(local)
    way += local
    way -= total
    np.minimum.accumulate(way, out=way)
    way += total
    return way


def _leashed(way: Floats, local: Floats) -> Floats:
    """Row t of t[j] = max(local[j], min(way[j], t[j - 1]))."""
    row, leash = [], np.inf
    for above, distance in zip(way.tolist(), local.tolist(), strict=True):
        # Plain comparisons: this is the one loop over scalars, and calls of min and max would triple it.
        leash = above if above < leash else leash
        leash = distance if distance > leash else leash
        row.append(leash)
    return np.array(row)
