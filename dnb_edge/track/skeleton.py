"""Thinning: a lane's pixels down to lines one pixel wide that keep its loops and branches.

Knows binary pictures only. The rule is Guo and Hall, "Parallel thinning with two-subiteration algorithms", CACM 32 (3),
1989, algorithm A1; each of its two subiterations is a table of the 256 possible neighbourhoods.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

_WEIGHTS = np.array([[128, 1, 2], [64, 0, 4], [32, 16, 8]], dtype=np.float32)
"""Bit of each neighbour, clockwise from the north: p2 = 1, p3 = 2, ... p9 = 128, as the paper numbers them."""


def thin(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The skeleton (height, width) of `mask` (height, width); what lies beyond the picture counts as background."""
    lane = np.pad(mask, 1).astype(np.uint8)
    changed = True
    while changed:
        changed = False
        for table in _DELETE:
            code = cv2.filter2D(lane, cv2.CV_8U, _WEIGHTS, borderType=cv2.BORDER_CONSTANT)
            gone = lane & np.asarray(cv2.LUT(code, table), dtype=np.uint8)
            if gone.any():
                lane = lane ^ gone
                changed = True
    return np.asarray(lane[1:-1, 1:-1] > 0, dtype=np.bool_)


def _deletions(subiteration: int) -> NDArray[np.uint8]:
    """1 for each neighbourhood code whose centre the subiteration deletes, shape (256,)."""
    codes = np.arange(256)
    p2, p3, p4, p5, p6, p7, p8, p9 = ((codes >> bit) & 1 == 1 for bit in range(8))
    pieces = sum((~a & (b | c)).astype(int) for a, b, c in ((p2, p3, p4), (p4, p5, p6), (p6, p7, p8), (p8, p9, p2)))
    pairs_a = sum((a | b).astype(int) for a, b in ((p9, p2), (p3, p4), (p5, p6), (p7, p8)))
    pairs_b = sum((a | b).astype(int) for a, b in ((p2, p3), (p4, p5), (p6, p7), (p8, p9)))
    pairs = np.minimum(pairs_a, pairs_b)
    side = (p2 | p3 | ~p5) & p4 if subiteration == 0 else (p6 | p7 | ~p9) & p8
    return np.asarray((pieces == 1) & (pairs >= 2) & (pairs <= 3) & ~side, dtype=np.uint8)


_DELETE = (_deletions(0), _deletions(1))
