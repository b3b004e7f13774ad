"""Where in the whole frame a car may be: the whole at reduced size, finer tiles in turn, what moves, and what was there before.

Knows rectangles, cells that have moved and candidates; runs no network of its own and knows no followed target but the discs
to leave out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.detect.background import CELL_PX, MOVED_LEVEL, Disc
from dnb_edge.values import Detection, PointPx

LEAST_SIDE = 0.012
"""Shortest side of a car's blob, as a share of the frame's width."""
MOST_SIDE = 0.2
"""Longest side of a car's blob, as a share of the frame's width."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A place worth a close look."""

    camera_px: PointPx
    length_px: float
    """Presumed length of the car, camera px."""


def moved_blobs(cells: NDArray[np.uint8], *, scale: float, frozen: Sequence[Disc] = ()) -> list[Candidate]:
    """Connected groups of moved cells of about a car's size, the most moved first.

    `cells` are a background's `moved_cells`, of CELL_PX px of a picture `scale` times the frame's size; what lies in the
    `frozen` discs is left out.
    """
    _, mask = cv2.threshold(cells, MOVED_LEVEL, 255.0, cv2.THRESH_BINARY)
    cell_px = CELL_PX / scale
    for disc in frozen:
        u, v = ((at + 0.5) / cell_px - 0.5 for at in disc.centre_px)
        cv2.circle(mask, (round(u), round(v)), math.ceil(disc.radius_px / cell_px), (0.0,), -1)
    if not cv2.countNonZero(mask):
        return []
    count, _, boxes, centres = cv2.connectedComponentsWithStats(mask, connectivity=8)
    width_px = cells.shape[1] * cell_px
    fits: list[tuple[float, Candidate]] = []
    for number in range(1, count):
        columns, rows, area = boxes[number, 2:].tolist()
        side_px = max(columns, rows) * cell_px
        if not LEAST_SIDE * width_px <= side_px <= MOST_SIDE * width_px:
            continue
        u, v = ((at + 0.5) * cell_px - 0.5 for at in centres[number].tolist())
        fits.append((float(area), Candidate(camera_px=(u, v), length_px=side_px)))
    fits.sort(key=lambda one: (-one[0], one[1].camera_px))
    return [candidate for _, candidate in fits]


def close_looks(found: Sequence[Detection], blobs: Sequence[Candidate], most: int) -> list[Candidate]:
    """At most `most` places for a close look: the two best finds, up to two blobs beside them, then further finds."""
    finds = [Candidate(camera_px=one.camera_px, length_px=one.length_px) for one in found]
    chosen = finds[:2]
    beside = [blob for blob in blobs if all(apart(blob.camera_px, one) for one in finds)]
    chosen += beside[: min(2, most - len(chosen))]
    return [*chosen, *finds[2:]][:most]


def apart(at: PointPx, other: Candidate | Detection) -> bool:
    """True where `at` is farther than a car's length from `other`."""
    return math.dist(at, other.camera_px) > other.length_px
