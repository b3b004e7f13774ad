"""The distances of `distance`, while a path still grows: of its points so far to the beginning of the reference.

One row of the table is added for each new point of the path, over the whole reference. Within a row a cell follows from the
one to its left: for DTW that is one running minimum over sums, for Frechet a short loop. Points may come in batches of any
size. Knows points; knows nothing of laps, percent or time. For an end that is left open: P. Tormene et al., "Matching
incomplete time series with dynamic time warping: an algorithm and an application to post-stroke rehabilitation", 2009.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dnb_edge.score.distance import Programme
from dnb_edge.values import Points

Floats: TypeAlias = NDArray[np.float64]


class PrefixTable:
    """The last row of one programme's table, fed with the path's points."""

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

    def extend(self, points: Points, extra: Floats | None = None) -> None:
        """Takes the path's next points, (k, 2), k at least 1; `extra`, (k, m), is added to their distances after the clamp."""
        across = points[:, 1, None] - self._y
        local = points[:, 0, None] - self._x
        local *= local
        across *= across
        local += across
        np.sqrt(local, out=local)
        if self._clamp is not None:
            np.minimum(local, self._clamp, out=local)
        if extra is not None:
            local += extra
        total = np.cumsum(local, axis=1)
        if self._row is None:
            first = np.maximum.accumulate(local[0]) if self._programme is Programme.FRECHET else total[0].copy()
            self._row, local, total = first, local[1:], total[1:]
        if self._programme is Programme.FRECHET:
            self._row = _leashed(self._row, local)
        else:
            self._row = _summed(self._row, local, total, doubled=self._programme is Programme.DTW_SYMMETRIC)
        self._points += len(points)

    def to(self, first: int, last: int) -> Floats:
        """The distances of the points so far to the reference's points up to each of those from `first` to `last`, which are
        among them: (last - first + 1,). Raises `ValueError` before the path's first point.
        """
        if self._row is None:
            raise ValueError("a path of 0 points has no distance")
        return self._row[first : last + 1].copy()


def _summed(row: Floats, local: Floats, total: Floats, *, doubled: bool) -> Floats:
    """The row that follows `row`, (m,), by the local distances `local`, (k, m), whose sums from the left are `total`.

    In a row t[j] = local[j] + min(way[j], t[j - 1]), `way` being the least of the row above at j and j - 1. That is the least,
    over all places i up to j, of way[i] and all distances from i to j: one running minimum.
    """
    before = total - local
    for distances, sums, sums_before in zip(local, total, before, strict=True):
        way = row.copy()
        np.minimum(way[1:], row[:-1] + distances[1:] if doubled else row[:-1], out=way[1:])
        way -= sums_before
        row = np.minimum.accumulate(way)
        row += sums
    return row


def _leashed(row: Floats, local: Floats) -> Floats:
    """The same for t[j] = max(local[j], min(way[j], t[j - 1]))."""
    for distances in local:
        way = row.copy()
        np.minimum(way[1:], row[:-1], out=way[1:])
        cells, leash = [], np.inf
        for above, distance in zip(way.tolist(), distances.tolist(), strict=True):
            # Plain comparisons: this is the one loop over scalars, and calls of min and max would triple it.
            leash = above if above < leash else leash
            leash = distance if distance > leash else leash
            cells.append(leash)
        row = np.array(cells)
    return row
