"""How sharply a line of points bends.

Knows points in the plane and nothing of what they stand for.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import Points

Floats = NDArray[np.float64]


def curvature(points: Points, *, closed: bool, arm: float) -> Floats:
    """Curvature at each of `points` (n, 2), shape (n,), 1 / unit of the points, positive to the left for x right, y up.

    It is that of the circle through the point and those about `arm` before and after it (Menger curvature: four times the
    triangle's area over the product of its sides), so a circle's is exact, and what is finer than the arm is smoothed away.
    At an open line's ends, where there is no point on one side, it is the nearest one's that has both.
    """
    n = len(points)
    steps = np.hypot(*np.diff(points, axis=0).T)
    reach = int(np.clip(round(arm / float(np.median(steps))), 1, max(1, (n - 1) // 3)))
    before, at, after = (np.roll(points, k, axis=0) for k in (reach, 0, -reach))
    to, fro, across = at - before, after - at, after - before
    doubled_area = to[:, 0] * fro[:, 1] - to[:, 1] * fro[:, 0]
    sides = np.hypot(*to.T) * np.hypot(*fro.T) * np.hypot(*across.T)
    bend: Floats = np.divide(2 * doubled_area, sides, out=np.zeros(n), where=sides > 0)
    if closed:
        return bend
    whole = np.clip(np.arange(n), reach, max(reach, n - 1 - reach))
    return np.asarray(bend[np.minimum(whole, n - 1)], dtype=np.float64)
