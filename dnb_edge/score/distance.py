"""Distances between two polylines: dynamic time warping and the discrete Frechet distance.

Both are dynamic programmes over the table of local distances between the points. They are filled one anti-diagonal at a time,
because the cells of an anti-diagonal do not depend on one another: n + m vector steps instead of n * m scalar ones, both
programmes in the same steps, and memory for three diagonals and a block of local distances only. Knows points; knows nothing
of laps, percent or time.

Sources: H. Sakoe and S. Chiba, "Dynamic programming algorithm optimization for spoken word recognition", 1978; the step
patterns are called as in T. Giorgino, "Computing and visualizing dynamic time warping alignments in R: the dtw package", 2009:
symmetric1, where every step costs one local distance, and symmetric2 (Sakoe and Chiba's symmetric form, P = 0), where a
diagonal step, which goes on along both paths, costs two. T. Eiter and H. Mannila, "Computing discrete Frechet distance", 1994.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Self, TypeAlias

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from dnb_edge.values import Points

Floats: TypeAlias = NDArray[np.float64]

_BLOCK = 1 << 14
"""Local distances computed at a time: few enough to stay in a processor's cache."""


class Programme(StrEnum):
    """How a cell of the table follows from its local distance and its three predecessors."""

    DTW = "dtw"
    """Their least, plus the local distance: step pattern symmetric1."""
    DTW_SYMMETRIC = "dtw_symmetric"
    """The same, but a diagonal step costs the local distance twice: step pattern symmetric2. The first cell counts once, as in
    Giorgino's package."""
    FRECHET = "frechet"
    """The greater of the local distance and their least."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Headings:
    """Directions of two paths, and what it costs to differ in them.

    Between directions an angle theta apart the local distance grows by `cost_m` * (1 - cos(theta)) / 2: by nothing along,
    by half of `cost_m` across, by all of it against.
    """

    path: Points
    """(n, 2) unit vectors, one for each point of the path."""
    reference: Points
    """(m, 2) unit vectors, one for each point of the reference."""
    cost_m: float
    """Cost of the opposite direction, in the unit of the points."""


def dtw_distance(
    path: Points,
    reference: Points,
    clamp: float | None = None,
    *,
    symmetric: bool = False,
    headings: Headings | None = None,
) -> float:
    """Sum of the local distances along the cheapest warping of `path` onto `reference`.

    `path` is (n, 2), `reference` (m, 2), both float64 in one frame and unit, n and m at least 1. `clamp` bounds each
    point-to-point distance (delta in the paper); None leaves them unbounded. What `headings` adds is not clamped.
    `symmetric` takes step pattern symmetric2, whose sum is to be divided by n + m. The result has the unit of the points.
    """
    programme = Programme.DTW_SYMMETRIC if symmetric else Programme.DTW
    (total,) = distances(path, reference, clamp, (programme,), headings=headings)
    return total


def frechet_distance(
    path: Points, reference: Points, clamp: float | None = None, *, headings: Headings | None = None
) -> float:
    """The discrete Frechet distance: the shortest leash that lets both ends walk their points in order.

    Arguments as for `dtw_distance`.
    """
    (leash,) = distances(path, reference, clamp, (Programme.FRECHET,), headings=headings)
    return leash


def distances(
    path: Points,
    reference: Points,
    clamp: float | None,
    programmes: tuple[Programme, ...],
    *,
    headings: Headings | None = None,
) -> tuple[float, ...]:
    """The distance by each of `programmes`, in their order; each the same, bit for bit, as if it were asked for alone.

    Arguments as for `dtw_distance`. Raises `ValueError` where a path has no point.
    """
    n, m = len(path), len(reference)
    if n == 0 or m == 0:
        raise ValueError(f"a path of {n} points cannot be compared with one of {m}")
    before, last, current = (_Diagonal.of(len(programmes), n) for _ in range(3))
    best = np.empty(len(programmes) * (n + 1) - 1)
    ways = [best[row * (n + 1) : row * (n + 1) + n] for row in range(len(programmes))]
    joins = [np.maximum if programme is Programme.FRECHET else np.add for programme in programmes]
    doubled = [row for row, programme in enumerate(programmes) if programme is Programme.DTW_SYMMETRIC]
    first = True
    for local in _diagonals(path, reference, clamp, headings):
        if first:
            before.cells[:, 0] = [_corner(programme, float(local[0])) for programme in programmes]
        for row in doubled:
            before.cells[row, :-1] += local
        np.minimum(last.left, last.here, out=best)
        np.minimum(best, before.left, out=best)
        for join, way, cells in zip(joins, ways, current.rows, strict=True):
            join(local, way, out=cells)
        if first:
            before.cells[:, 0] = np.inf
            first = False
        before, last, current = last, current, before
    return tuple(float(total) for total in last.cells[:, n])


@dataclass(frozen=True, slots=True, eq=False)
class _Diagonal:
    """One diagonal of each programme's table, and the parts of it that the next two diagonals read."""

    cells: Floats
    """(programmes, n + 1), cell i at i + 1; at 0 is the table's border, where nothing begins."""
    left: Floats
    """All cells in a row but the last: cell i - 1 where `here` has cell i. One array for all programmes takes the least in one
    step; what it has where one programme ends and the next begins is never read."""
    here: Floats
    rows: tuple[Floats, ...]
    """(n,) for each programme, cell i at i."""

    @classmethod
    def of(cls, programmes: int, n: int) -> Self:
        """A diagonal before the table's beginning."""
        flat = np.full(programmes * (n + 1), np.inf)
        cells = flat.reshape(programmes, n + 1)
        return cls(cells=cells, left=flat[:-1], here=flat[1:], rows=tuple(cells[:, 1:]))


def _corner(programme: Programme, first: float) -> float:
    """What lies before the first cell, such that this cell is worth its local distance `first`."""
    return {Programme.DTW: 0.0, Programme.DTW_SYMMETRIC: -first, Programme.FRECHET: -np.inf}[programme]


def _diagonals(path: Points, reference: Points, clamp: float | None, headings: Headings | None) -> Iterator[Floats]:
    """The local distances, diagonal by diagonal: at i, (n,), that of path point i and reference point k - i. Where
    there is no such point it is any number: no way leads from the first cell to there and back to the last. Each is good until
    the next one is asked for.
    """
    n, m = len(path), len(reference)
    count = n + m - 1
    step = max(1, _BLOCK // n)
    x, y = np.ascontiguousarray(path.T, dtype=np.float64)
    # With the reference reversed, the cells (i, k - i) of diagonal k read both arrays in the same direction.
    to_x, to_y = (_windows(axis, n) for axis in reference.T)
    if headings is not None:
        (u, v), (to_u, to_v) = headings.path.T, (_windows(axis, n) for axis in headings.reference.T)
    # The same memory for every block: to ask for it anew costs more than to fill it.
    blocks = np.empty((2, step, n))
    for k in range(0, count, step):
        rows = slice(k, min(k + step, count))
        local, across = blocks[:, : rows.stop - k]
        np.subtract(x, to_x[rows], out=local)
        np.subtract(y, to_y[rows], out=across)
        np.multiply(local, local, out=local)
        np.multiply(across, across, out=across)
        np.add(local, across, out=local)
        np.sqrt(local, out=local)
        if clamp is not None:
            np.minimum(local, clamp, out=local)
        if headings is not None:
            # |u - v|^2 / 4 is (1 - cos) / 2, and exactly nothing between equal directions.
            local += 0.25 * headings.cost_m * ((u - to_u[rows]) ** 2 + (v - to_v[rows]) ** 2)
        yield from local


def _windows(values: Floats, n: int) -> Floats:
    """(n + m - 1, n): at (k, i) the `values` (m,) at k - i, 0 where there is none."""
    padded = np.zeros(len(values) + 2 * (n - 1))
    padded[n - 1 : n - 1 + len(values)] = values[::-1]
    windows: Floats = sliding_window_view(padded, n)[::-1]
    return windows
