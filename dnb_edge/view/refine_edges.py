"""The lane's edges on the twin, as points with their outward normals, for the refinement to look for in the picture.

Knows a mask of the lane, twin px. Knows no camera and no picture of the floor.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.track.scale import TwinScale
from dnb_edge.track.twin import Mask
from dnb_edge.values import Points

_POINTS = 1000
"""About how many points stand for all edges together."""

_SMOOTHING = 0.012
"""Standard deviation, as a share of the lane's width, of the blur whose half level is the edge: a pixel's stairs and a
drawing's nicks vanish, bends do not."""

_REACH = 0.12
"""Share of the lane's width before and behind a point over which its edge must run straight on."""

_STRAIGHT_ON = 0.90
"""Cosine of the angle (26 degrees) by which an edge may turn there: corners of junctions are left out."""

_SHORTEST_LANES = 2.0
"""Contours shorter than so many lane widths are drawing, not lane."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LaneEdges:
    """Points on the borders between lane and floor, in the order of each border."""

    points_px: Points
    """Shape (n, 2), twin px."""
    outward: Points
    """Shape (n, 2), unit vectors on the twin (u, v) that point from the lane to the floor."""
    slot: NDArray[np.int64]
    """Shape (n,): place along the borders in steps of `step_px`; consecutive slots are neighbours, borders lie far apart."""
    step_px: float
    """From one slot to the next along a border, twin px."""
    width_px: float
    """The lane's usual width, twin px."""
    mask: Mask
    """The lane itself, shape (height, width)."""

    def __len__(self) -> int:
        return len(self.points_px)


def lane_edges(mask: Mask, *, source: str) -> LaneEdges:
    """The edges of the lane in a twin's mask. Raises `InputError` where there is none to speak of; `source` names the twin.

    Corners and what lies at the picture's border are left out: no place on them says where the edge runs.
    """
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    chains = [np.asarray(contour, dtype=np.float64)[:, 0] for contour in contours]
    total = float(sum(map(_length, chains)))
    width_px = 2.0 * float(np.count_nonzero(mask)) / total if total else 0.0
    chains = [chain for chain in chains if _length(chain) >= _SHORTEST_LANES * width_px]
    step_px = max(1.0, sum(map(_length, chains)) / _POINTS)
    blurred = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), max(1.0, _SMOOTHING * width_px))
    level = np.asarray(blurred, dtype=np.float32)
    pieces: list[tuple[Points, Points, NDArray[np.int64]]] = []
    at_slot = 0
    for chain in chains:
        even = _evenly(chain, step_px)
        points, outward, good = _on_edge(even, level, reach=max(1, round(_REACH * width_px / step_px)))
        pieces.append((points[good], outward[good], at_slot + np.flatnonzero(good)))
        at_slot += 2 * len(even)
    count = sum(len(piece[0]) for piece in pieces)
    if count < 50 or not width_px > 4.0:
        raise InputError(f"{source}: hardly an edge of a lane in it: set the lane colour to the lane's")
    return LaneEdges(
        points_px=np.concatenate([piece[0] for piece in pieces]),
        outward=np.concatenate([piece[1] for piece in pieces]),
        slot=np.concatenate([piece[2] for piece in pieces]),
        step_px=step_px,
        width_px=width_px,
        mask=mask,
    )


def strip_mask(left_m: Points, right_m: Points, scale: TwinScale, *, closed: bool) -> Mask:
    """The lane between its left and its right edge, each (n, 2) track m, as a mask on a twin of `scale`.

    What lies off the twin's paper is cut off. For tracks that come without a picture of their twin.
    """
    height = round(scale.height_px)
    left, right = scale.to_twin_px(left_m), scale.to_twin_px(right_m)
    width = int(np.ceil(max(left[:, 0].max(), right[:, 0].max()))) + 4
    canvas = np.zeros((height, max(4, width)), dtype=np.uint8)
    count = len(left)
    for k in range(count if closed else count - 1):
        nxt = (k + 1) % count
        quad = np.array([left[k], left[nxt], right[nxt], right[k]])
        hull = cv2.convexHull(np.rint(quad * 16).astype(np.int32))
        cv2.fillConvexPoly(canvas, hull, 1.0, cv2.LINE_8, 4)
    return np.asarray(canvas > 0)


def _length(chain: Points) -> float:
    """Length of a closed chain, twin px, with the corners of the pixels' stairs cut (by 5-point means)."""
    if len(chain) < 6:
        return float(len(chain))
    smooth = _mean_of_neighbours(chain, 2)
    step = np.roll(smooth, -1, axis=0) - smooth
    return float(np.hypot(step[:, 0], step[:, 1]).sum())


def _mean_of_neighbours(chain: Points, reach: int) -> Points:
    total = sum(np.roll(chain, k, axis=0) for k in range(-reach, reach + 1))
    return np.asarray(total / (2 * reach + 1))


def _evenly(chain: Points, step_px: float) -> Points:
    """Points about `step_px` apart along a closed chain."""
    smooth = _mean_of_neighbours(chain, 2)
    around = np.vstack((smooth, smooth[:1]))
    step = np.diff(around, axis=0)
    at = np.concatenate(([0.0], np.cumsum(np.hypot(step[:, 0], step[:, 1]))))
    count = max(8, round(at[-1] / step_px))
    s = np.arange(count) * at[-1] / count
    return np.column_stack([np.interp(s, at, around[:, axis]) for axis in (0, 1)])


def _on_edge(points: Points, level: NDArray[np.float32], *, reach: int) -> tuple[Points, Points, NDArray[np.bool_]]:
    """`points` moved to the half level of the blurred mask, their outward normals, and which of them are good."""
    down, across = (np.asarray(slope, dtype=np.float32) for slope in np.gradient(level))
    moved = points.copy()
    for _ in range(3):
        here, slope = _sample(level, moved), np.column_stack((_sample(across, moved), _sample(down, moved)))
        steep = np.maximum((slope**2).sum(axis=1), 1e-6)
        moved += np.clip(((0.5 - here) / steep)[:, None] * slope, -1.0, 1.0)
    slope = np.column_stack((_sample(across, moved), _sample(down, moved)))
    outward = -slope / np.maximum(np.linalg.norm(slope, axis=1), 1e-9)[:, None]
    ahead, behind = np.roll(moved, -reach, axis=0) - moved, moved - np.roll(moved, reach, axis=0)
    turn = (ahead * behind).sum(axis=1) / np.maximum(
        np.linalg.norm(ahead, axis=1) * np.linalg.norm(behind, axis=1), 1e-9
    )
    height, width = level.shape
    margin = 3.0
    inside = (moved > margin).all(axis=1) & (moved < (width - 1 - margin, height - 1 - margin)).all(axis=1)
    good = inside & (turn > _STRAIGHT_ON) & (np.abs(_sample(level, moved) - 0.5) < 0.1)
    return moved, outward, good


def _sample(plane: NDArray[np.float32], points: Points) -> NDArray[np.float64]:
    """`plane` at points (n, 2), bilinear."""
    at = points.astype(np.float32)
    return np.asarray(cv2.remap(plane, at[:, :1], at[:, 1:], cv2.INTER_LINEAR)[:, 0], dtype=np.float64)
