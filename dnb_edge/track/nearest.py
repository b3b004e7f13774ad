"""The nearest place of a polyline to a point, found among few of its segments and yet the nearest of all.

The plane is cut into square cells. Let c be a cell's centre, r half its diagonal and m the distance of c from the polyline.
A point of the cell is at most r from c, so it has the polyline within m + r, and a segment farther than m + 2 r from c farther
than that: it is never the nearest to a point of this cell. What remains, a handful, is found at the first visit of a cell and
kept. Knows segments and points of one plane; knows no lane and no direction of travel.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import Points

Segment: TypeAlias = tuple[float, float, float, float, float, float]
"""Start (x, y), direction (x, y) as a unit vector, length, and arc length of its start along the polyline."""

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
        self._starts, self._tangents, self._lengths = starts, tangents, lengths
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
        self._blocks: dict[tuple[int, int], list[int]] = {}
        self._cells: dict[tuple[int, int], tuple[Segment, ...]] = {}

    def nearest(self, x: float, y: float) -> tuple[float, float] | None:
        """(arc length of the nearest place, distance from it), the distance positive to the polyline's left; of equally near
        places the first along the polyline. None beyond the surroundings of the polyline, where no cells are.
        """
        if not (self._low_x <= x <= self._high_x and self._low_y <= y <= self._high_y):
            return None
        cell = int((x - self._low_x) / self._side), int((y - self._low_y) / self._side)
        segments = self._cells.get(cell)
        if segments is None:
            segments = self._visited(cell)
        least, arc, side = math.inf, 0.0, 0.0
        for x0, y0, tx, ty, length, start in segments:
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

    def _visited(self, cell: tuple[int, int]) -> tuple[Segment, ...]:
        """The segments that can be the nearest to a point of the cell."""
        if len(self._cells) >= MOST_CELLS:
            self._cells.clear()
            self._blocks.clear()
        block = cell[0] // BLOCK, cell[1] // BLOCK
        if block not in self._blocks:
            self._blocks[block] = self._candidates(block, BLOCK * self._side, np.arange(len(self._lengths)))
        candidates = self._candidates(cell, self._side, np.array(self._blocks[block]))
        segments = self._cells[cell] = tuple(self._segments[i] for i in candidates)
        return segments

    def _candidates(self, cell: tuple[int, int], side: float, segments: NDArray[np.intp]) -> list[int]:
        """Those of `segments` that can be the nearest to a point of cell number `cell` of a grid of squares of `side`."""
        centre = (self._low_x + (cell[0] + 0.5) * side, self._low_y + (cell[1] + 0.5) * side)
        offsets, tangents = centre - self._starts[segments], self._tangents[segments]
        along = np.clip((offsets * tangents).sum(axis=1), 0.0, self._lengths[segments])
        apart = np.hypot(*(offsets - along[:, None] * tangents).T)
        bound = (float(apart.min()) + math.sqrt(2.0) * side) * (1.0 + _ROUNDING) + self._slack
        found: list[int] = segments[apart <= bound].tolist()
        return found
