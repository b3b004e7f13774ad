"""The floor ahead of a vehicle seen from straight above, made from its front picture, and the lane found on it.

Knows where the camera sits on the vehicle and what the lane looks like: darker than the tape and the floor beside it. Knows no
circuit and no control. Frame of reference, *vehicle m*: origin at the ground point, x ahead, y to the left, on the floor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.sim.front_camera import FrontMount
from dnb_edge.values import BgrImage, PointM

CELL_M = 0.01
NEAR_M = 0.16
FAR_M = 0.86
SIDE_M = 0.55
_ROWS = round((FAR_M - NEAR_M) / CELL_M)
_COLUMNS = round(2.0 * SIDE_M / CELL_M)

_DARK_SHARE = 0.42
"""The lane is darker than this share of the brightest on the floor, which is tape or, where there is none, bare floor."""
_BRIGHTEST_PERCENT = 95.0
_START_LINE_CELLS = 5
"""Bright stripes narrower than this across the lane do not part it."""
_STEP_RAD = 0.02
_EDGE_RAD = 0.06


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneSight:
    """The lane's middle at one distance from a point of the vehicle."""

    at_m: PointM
    """Vehicle m."""
    edges: int
    """Of the lane's two edges, how many were seen there."""


class BirdsEye:
    """Makes the view from above, for one size of picture. Not safe for use by several threads."""

    def __init__(self, picture_px: tuple[int, int], mount: FrontMount) -> None:
        width, height = picture_px
        to_picture = floor_to_picture(picture_px, mount) @ _cells_to_vehicle()
        rows, columns = np.mgrid[0:_ROWS, 0:_COLUMNS].astype(np.float64)
        u, v, w = np.einsum("ij,jrc->irc", to_picture, np.stack((columns, rows, np.ones_like(rows))))
        self._u, self._v = (u / w).astype(np.float32), (v / w).astype(np.float32)
        self._seen: NDArray[np.bool_] = (w > 0) & (u > 0) & (v > 0) & (u < (width - 1) * w) & (v < (height - 1) * w)
        x, y = (
            np.einsum("i,irc->rc", row, np.stack((columns, rows, np.ones_like(rows))))
            for row in _cells_to_vehicle()[:2]
        )
        self._x, self._y = x, y

    @property
    def seen(self) -> NDArray[np.bool_]:
        """(rows, columns): which cells of the view lie in the picture."""
        return self._seen

    def view(self, bgr: BgrImage) -> BgrImage:
        """(rows, columns, 3) from above: row 0 is `FAR_M` ahead, column 0 `SIDE_M` to the left; black where nothing is seen."""
        return cv2.remap(bgr, self._u, self._v, cv2.INTER_LINEAR).astype(np.uint8, copy=False)

    def lane(self, bgr: BgrImage) -> NDArray[np.bool_]:
        """(rows, columns): where the lane is, as one piece that begins near the vehicle; all False where none is found."""
        grey = cv2.cvtColor(self.view(bgr), cv2.COLOR_BGR2GRAY)
        brightest = float(np.percentile(grey[self._seen], _BRIGHTEST_PERCENT))
        dark = ((grey < _DARK_SHARE * brightest) & self._seen).astype(np.uint8)
        whole = cv2.morphologyEx(dark, cv2.MORPH_CLOSE, np.ones((_START_LINE_CELLS, _START_LINE_CELLS), np.uint8))
        _, pieces = cv2.connectedComponents(whole, connectivity=4)
        near = pieces[(self._x < NEAR_M + 0.20) & (np.abs(self._y) < 0.20) & (whole > 0)]
        if not len(near):
            return np.zeros(pieces.shape, dtype=np.bool_)
        return np.asarray((pieces == np.bincount(near).argmax()) & self._seen)

    def middle(
        self, lane: NDArray[np.bool_], *, centre_m: PointM, distance_m: float, towards_rad: float, half_width_m: float
    ) -> LaneSight | None:
        """The middle of `lane`, as `lane` gave it, on the circle of `distance_m` round `centre_m` (vehicle m), the stretch
        nearest to the direction `towards_rad`; None where there is none.

        An edge that lies outside the picture is taken to be where the lane's width puts it.
        """
        angles = np.arange(-1.4, 1.4, _STEP_RAD)
        x, y = centre_m[0] + distance_m * np.cos(angles), centre_m[1] + distance_m * np.sin(angles)
        rows, columns = (
            np.rint((FAR_M - x) / CELL_M - 0.5).astype(int),
            np.rint((SIDE_M - y) / CELL_M - 0.5).astype(int),
        )
        inside = (rows >= 0) & (rows < _ROWS) & (columns >= 0) & (columns < _COLUMNS)
        rows, columns = np.clip(rows, 0, _ROWS - 1), np.clip(columns, 0, _COLUMNS - 1)
        seen, on_lane = inside & self._seen[rows, columns], inside & lane[rows, columns]
        stretch = _nearest_stretch(on_lane, angles, towards_rad)
        if stretch is None:
            return None
        first, last = stretch
        margin = round(_EDGE_RAD / _STEP_RAD)
        right, left = bool(seen[max(0, first - margin)]), bool(seen[min(len(seen) - 1, last + margin)])
        half_rad = math.asin(min(1.0, half_width_m / distance_m))
        angle = _between(float(angles[first]), float(angles[last]), half_rad, right=right, left=left)
        at = (centre_m[0] + distance_m * math.cos(angle), centre_m[1] + distance_m * math.sin(angle))
        return LaneSight(at_m=at, edges=int(right) + int(left))


def _between(first_rad: float, last_rad: float, half_rad: float, *, right: bool, left: bool) -> float:
    if right == left:
        return 0.5 * (first_rad + last_rad)
    return first_rad + half_rad if right else last_rad - half_rad


def _nearest_stretch(
    on_lane: NDArray[np.bool_], angles: NDArray[np.float64], towards_rad: float
) -> tuple[int, int] | None:
    """(first, last) of the stretch of True that comes nearest to the angle `towards_rad`, single cells left out."""
    padded = np.concatenate(([0], on_lane.astype(np.int8), [0]))
    starts, ends = np.flatnonzero(np.diff(padded) == 1), np.flatnonzero(np.diff(padded) == -1) - 1
    stretches = [(int(a), int(b)) for a, b in zip(starts, ends, strict=True) if b - a >= 2]
    if not stretches:
        return None
    return min(stretches, key=lambda one: max(angles[one[0]] - towards_rad, towards_rad - angles[one[1]], 0.0))


def floor_to_picture(picture_px: tuple[int, int], mount: FrontMount) -> NDArray[np.float64]:
    """(3, 3) H with picture px ~ H (x, y, 1), vehicle m; the third coordinate is positive ahead of the camera."""
    width, height = picture_px
    focal = 0.5 * width / math.tan(0.5 * mount.hfov_rad)
    matrix = np.array([[focal, 0.0, 0.5 * (width - 1)], [0.0, focal, 0.5 * (height - 1)], [0.0, 0.0, 1.0]])
    cos, sin = math.cos(mount.pitch_rad), math.sin(mount.pitch_rad)
    # Rows: the picture's right, down and ahead, in vehicle axes; columns of the result: x, y, and the camera's own place.
    rotation = np.array([[0.0, -1.0, 0.0], [-sin, 0.0, -cos], [cos, 0.0, -sin]])
    shift = -rotation @ np.array([mount.ahead_m, 0.0, mount.height_m])
    return np.asarray(matrix @ np.column_stack((rotation[:, 0], rotation[:, 1], shift)))


def _cells_to_vehicle() -> NDArray[np.float64]:
    """(3, 3) (column, row, 1) of the view's cells to vehicle m, their middles."""
    return np.array([[0.0, -CELL_M, FAR_M - 0.5 * CELL_M], [-CELL_M, 0.0, SIDE_M - 0.5 * CELL_M], [0.0, 0.0, 1.0]])
