"""The nearest place of a polyline to a point, found among few of its segments and yet the nearest of all.

The plane is cut into square cells. Let c be a cell's centre, r half its diagonal and m the distance of c from the polyline.
A point of the cell is at most r from c, so it has the polyline within m + r, and a segment farther than m + 2 r from c farther
than that: it is never the nearest to a point of this cell. What remains, a handful, is found at the first visit of a cell and
kept. Knows segments and points of one plane; knows no lane and no direction of travel.
"""

from __future__ import annotations

import math
from itertools import chain
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import Points

Segment: TypeAlias = tuple[float, float, float, float, float, float]
"""Start (x, y), direction (x, y) as a unit vector, length, and arc length of its start along the polyline."""

_Cell: TypeAlias = tuple[list[int], float, float]
"""The segments that can be the nearest to a point of a cell, and bounds of such a point's distance from the polyline."""

CELL_LENGTHS = 1.0
"""Side of a cell in mean lengths of a segment."""

BLOCK = 8
"""Side of a block in cells: what can be the nearest in a cell is sought among what can be the nearest in its block."""

MOST_CELLS = 1 << 16
"""Cells that are remembered; with one more, all are forgotten."""

_ROUNDING = 1e-9
"""What the bound is wider by than it need be, of itself and of a thousandth of the greatest coordinate, so that no rounding
shuts out the nearest."""


class SegmentGrid:
    """Segments of one polyline, by the cells of the plane to which they can be the nearest."""

    def __init__(
        self, starts: Points, tangents: Points, lengths: NDArray[np.float64], arc: NDArray[np.float64]
    ) -> None:
        """`starts` and `tangents` are (k, 2), `lengths` and `arc` (k,): the segments in the order of the polyline."""
        self._starts, self._tangents, self._lengths, self._arc = starts, tangents, lengths, arc
        columns = (*starts.T.tolist(), *tangents.T.tolist(), lengths.tolist(), arc.tolist())
        self._segments: list[Segment] = list(zip(*columns, strict=True))
        self._side = CELL_LENGTHS * float(lengths.mean())
        ends = np.vstack((starts, starts[-1:] + tangents[-1:] * lengths[-1]))
        # Half as much again on every side is where cars and their neighbours are; beyond it nothing is remembered.
        low, high = ends.min(axis=0), ends.max(axis=0)
        margin = float((high - low).max()) / 2 + self._side
        self._slack = 1e-3 * _ROUNDING * (float(np.abs(ends).max()) + margin)
        self._low_x, self._low_y = (low - margin).tolist()
        self._high_x, self._high_y = (high + margin).tolist()
        self._blocks: dict[tuple[int, int], _Cell] = {}
        self._cells: dict[tuple[int, int], list[int]] = {}

    def nearest(self, x: float, y: float) -> tuple[float, float] | None:
        """(arc length of the nearest place, distance from it), the distance positive to the polyline's left; of equally near
        places the first along the polyline. None beyond the surroundings of the polyline, where no cells are.
        """
        candidates = self._candidates_at(x, y)
        if candidates is None:
            return None
        segments = self._segments
        least, arc, side = math.inf, 0.0, 0.0
        for i in candidates:
            x0, y0, tx, ty, length, start = segments[i]
            dx, dy = x - x0, y - y0
            along = dx * tx + dy * ty
            if along < 0.0:
                along = 0.0
            elif along > length:
                along = length
            off_x, off_y = dx - along * tx, dy - along * ty
            apart = off_x * off_x + off_y * off_y
            if apart < least:
                least, arc, side = apart, start + along, tx * dy - ty * dx
        return arc, math.copysign(math.sqrt(least), side)

    def distance_bounds(self, x: float, y: float) -> tuple[float, float] | None:
        """Between which two numbers the point's distance from the polyline surely lies, the first perhaps below nought; in
        less time than the distance itself. None where no cells are.
        """
        if not (self._low_x <= x <= self._high_x and self._low_y <= y <= self._high_y):
            return None
        side = BLOCK * self._side
        if len(self._blocks) >= MOST_CELLS:
            self._blocks.clear()
        _, least, most = self._block((int((x - self._low_x) / side), int((y - self._low_y) / side)))
        return least, most

    def nearest_of(self, points: Points) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """As `nearest` for each of the points (n, 2), n at least 1, as two arrays (n,); None where it is so for any of them."""
        candidates = [self._candidates_at(x, y) for x, y in points.tolist()]
        known = [each for each in candidates if each is not None]
        if len(known) < len(candidates):
            return None
        counts = np.array([len(each) for each in known])
        segments = np.fromiter(chain.from_iterable(known), np.intp, int(counts.sum()))
        owners = np.repeat(np.arange(len(known)), counts)
        offsets, tangents = points[owners] - self._starts[segments], self._tangents[segments]
        along = np.clip(offsets[:, 0] * tangents[:, 0] + offsets[:, 1] * tangents[:, 1], 0.0, self._lengths[segments])
        apart = (offsets[:, 0] - along * tangents[:, 0]) ** 2 + (offsets[:, 1] - along * tangents[:, 1]) ** 2
        firsts = np.cumsum(counts) - counts
        least = np.flatnonzero(apart == np.minimum.reduceat(apart, firsts)[owners])
        best = least[np.searchsorted(least, firsts)]
        side = tangents[best, 0] * offsets[best, 1] - tangents[best, 1] * offsets[best, 0]
        return self._arc[segments[best]] + along[best], np.copysign(np.sqrt(apart[best]), side)

    def _candidates_at(self, x: float, y: float) -> list[int] | None:
        """The segments, in their order, that can be the nearest to a point; None where no cells are."""
        if not (self._low_x <= x <= self._high_x and self._low_y <= y <= self._high_y):
            return None
        cell = int((x - self._low_x) / self._side), int((y - self._low_y) / self._side)
        candidates = self._cells.get(cell)
        return self._visited(cell) if candidates is None else candidates

    def _visited(self, cell: tuple[int, int]) -> list[int]:
        """The segments that can be the nearest to a point of the cell."""
        if len(self._cells) >= MOST_CELLS:
            self._cells.clear()
            self._blocks.clear()
        near, _, _ = self._block((cell[0] // BLOCK, cell[1] // BLOCK))
        found, _, _ = self._surveyed(cell, self._side, np.array(near))
        self._cells[cell] = found
        return found

    def _block(self, block: tuple[int, int]) -> _Cell:
        found = self._blocks.get(block)
        if found is None:
            found = self._blocks[block] = self._surveyed(block, BLOCK * self._side, np.arange(len(self._lengths)))
        return found

    def _surveyed(self, cell: tuple[int, int], side: float, segments: NDArray[np.intp]) -> _Cell:
        """Cell number `cell` of a grid of squares of `side`, `segments` being all that can be the nearest in it."""
        centre = (self._low_x + (cell[0] + 0.5) * side, self._low_y + (cell[1] + 0.5) * side)
        offsets, tangents = centre - self._starts[segments], self._tangents[segments]
        along = np.clip((offsets * tangents).sum(axis=1), 0.0, self._lengths[segments])
        apart = np.hypot(*(offsets - along[:, None] * tangents).T)
        least, across = float(apart.min()), math.sqrt(2.0) * side
        slack = (least + across) * _ROUNDING + self._slack
        near: list[int] = segments[apart <= least + across + slack].tolist()
        return near, least - across / 2 - slack, least + across / 2 + slack
