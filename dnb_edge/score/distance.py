"""Distances between two polylines: dynamic time warping and the discrete Frechet distance.

Both are dynamic programmes over the table of point-to-point distances. They are filled one anti-diagonal at a time, because
the cells of an anti-diagonal do not depend on one another: n + m vector steps instead of n * m scalar ones, and memory for
three diagonals only. Knows points; knows nothing of laps, percent or time.

Sources: H. Sakoe and S. Chiba, "Dynamic programming algorithm optimization for spoken word recognition", 1978 (step pattern
symmetric1: every step costs one local distance); T. Eiter and H. Mannila, "Computing discrete Frechet distance", 1994.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import Points

Row: TypeAlias = NDArray[np.float64]
Join: TypeAlias = np.ufunc
"""How a cell follows from its own distance and the best of its three predecessors: a sum for DTW, a maximum for Frechet."""


def dtw_distance(path: Points, reference: Points, clamp: float | None = None) -> float:
    """Sum of the point-to-point distances along the cheapest warping of `path` onto `reference`.

    `path` is (n, 2), `reference` (m, 2), both float64 in one frame and unit, n and m at least 1. `clamp` bounds each
    point-to-point distance (delta in the paper); None leaves them unbounded. The result has the unit of the points.
    """
    return _anti_diagonals(path, reference, clamp, np.add)


def frechet_distance(path: Points, reference: Points, clamp: float | None = None) -> float:
    """The discrete Frechet distance: the shortest leash that lets both ends walk their points in order.

    Arguments as for `dtw_distance`.
    """
    return _anti_diagonals(path, reference, clamp, np.maximum)


def _anti_diagonals(path: Points, reference: Points, clamp: float | None, join: Join) -> float:
    n, m = len(path), len(reference)
    if n == 0 or m == 0:
        raise ValueError(f"a path of {n} points cannot be compared with one of {m}")
    forward = np.ascontiguousarray(path.T, dtype=np.float64)
    # With the reference reversed, the cells (i, k - i) of diagonal k read both arrays in the same direction.
    backward = np.ascontiguousarray(reference[::-1].T, dtype=np.float64)
    # Three diagonals, indexed by i + 1; entry 0 is the table's border. Before the first diagonal only the corner is free.
    before_last, last, current = np.full(n + 1, np.inf), np.full(n + 1, np.inf), np.full(n + 1, np.inf)
    before_last[0] = 0.0 if join is np.add else -np.inf
    delta, cost, best = np.empty((2, n)), np.empty(n), np.empty(n)
    for k in range(n + m - 1):
        low, high = max(0, k - m + 1), min(n, k + 1)
        shift = m - 1 - k
        d, c, b = delta[:, : high - low], cost[: high - low], best[: high - low]
        np.subtract(forward[:, low:high], backward[:, shift + low : shift + high], out=d)
        np.multiply(d, d, out=d)
        np.add(d[0], d[1], out=c)
        np.sqrt(c, out=c)
        if clamp is not None:
            np.minimum(c, clamp, out=c)
        np.minimum(last[low:high], last[low + 1 : high + 1], out=b)
        np.minimum(b, before_last[low:high], out=b)
        join(c, b, out=current[low + 1 : high + 1])
        current[low] = np.inf
        if high < n:
            current[high + 1] = np.inf
        before_last, last, current = last, current, before_last
    return float(last[n])
