"""The floor seen from straight above: a camera's picture brought through its lens and homography to even metres.

Knows one ground map and a rectangle of the track plane. Knows no lane and no keypoints. A *rectified picture* of the rectangle
(x0, y0, x1, y1), track m, lies as a twin does: x = x0 + u * metres_per_px, y = y0 + (height_px - v) * metres_per_px.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.values import BgrImage, Points
from dnb_edge.view.ground import GroundMap

Extent: TypeAlias = tuple[float, float, float, float]
"""A rectangle of the track plane, (x0, y0, x1, y1), track m."""
Mask = NDArray[np.bool_]

_MOST_PX = 64_000_000
"""A rectified picture of more pixels than this is a mistake in the scale, not a wish."""
_BAND_POINTS = 500_000
_MOST_SAMPLES = 4
"""Samples along each side of a px, at most, where it holds several px of the camera's picture."""
_OUTSIDE_PX = -1e4
_GREY = 190
_RIM_POINTS = 128


def rectified(
    picture: BgrImage, ground: GroundMap, *, metres_per_px: float, extent_m: Extent, unseen: int = _GREY
) -> BgrImage:
    """The floor in `extent_m` as `picture` shows it, in px of `metres_per_px`; grey `unseen` where it does not show it.

    Where a px holds several of the camera's it is their mean. `picture` has the size for which `ground` is (see
    `GroundMap.scaled_to`). Raises `InputError` where it has another, or the rectangle is empty or far too large for the scale.
    """
    height, width = picture.shape[:2]
    if (width, height) != (ground.width_px, ground.height_px):
        raise InputError(
            f"the picture is {width}x{height} px, the calibration for {ground.width_px}x{ground.height_px}: take a picture "
            "with the same camera and the same size"
        )
    columns, rows = rectified_size_px(metres_per_px=metres_per_px, extent_m=extent_m)
    samples = _samples(ground, metres_per_px, extent_m)
    seen = seen_mask(ground, metres_per_px=metres_per_px, extent_m=extent_m)
    floor = np.full((rows, columns, 3), unseen, dtype=np.uint8)
    band = max(1, _BAND_POINTS // (columns * samples * samples))
    for top in range(0, rows, band):
        bottom = min(rows, top + band)
        at = _camera_px(ground, metres_per_px, extent_m, (columns, rows), (top, bottom), samples)
        at = at.astype(np.float32)
        value = cv2.remap(picture, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        if samples > 1:
            value = cv2.resize(value, (columns, bottom - top), interpolation=cv2.INTER_AREA)
        shown = seen[top:bottom]
        floor[top:bottom][shown] = np.asarray(value)[shown]
    return floor


def seen_mask(ground: GroundMap, *, metres_per_px: float, extent_m: Extent) -> Mask:
    """Which px of the rectified picture of `extent_m` the camera sees, shape (rows, columns)."""
    columns, rows = rectified_size_px(metres_per_px=metres_per_px, extent_m=extent_m)
    mask = np.zeros((rows, columns), dtype=bool)
    band = max(1, _BAND_POINTS // columns)
    for top in range(0, rows, band):
        bottom = min(rows, top + band)
        at = _camera_px(ground, metres_per_px, extent_m, (columns, rows), (top, bottom), 1)
        mask[top:bottom] = _inside(at, ground)
    return mask


def rectified_size_px(*, metres_per_px: float, extent_m: Extent) -> tuple[int, int]:
    """(width, height) of the rectified picture of `extent_m`. Raises `InputError` where it is empty or far too large."""
    x0, y0, x1, y1 = extent_m
    if not (all(map(math.isfinite, extent_m)) and x1 > x0 and y1 > y0):
        raise InputError(f"a rectangle of the floor from ({x0}, {y0}) to ({x1}, {y1}) m is empty")
    if not (math.isfinite(metres_per_px) and metres_per_px > 0):
        raise InputError(f"a rectified picture needs a positive number of metres per px, not {metres_per_px}")
    across, down = (x1 - x0) / metres_per_px, (y1 - y0) / metres_per_px
    if across * down > _MOST_PX:
        raise InputError(
            f"{across:.0f}x{down:.0f} px for a floor of {x1 - x0:.1f}x{y1 - y0:.1f} m are too many: use more metres per px"
        )
    return max(1, round(across)), max(1, round(down))


def visible_extent_m(ground: GroundMap, *, margin_px: float = 0.0, most_shrunk: float = 6.0) -> Extent:
    """The least rectangle of the track plane that holds all floor that the camera sees well enough.

    `margin_px` at the picture's edge is left out. Floor is seen well enough where a camera px covers no more than `most_shrunk`
    times the length that it covers at best: towards the horizon everything is of one px, and the rectangle would have no end.
    Raises `InputError` where the camera sees no floor.
    """
    corners = _rim(ground, margin_px)
    below = corners[ground.sees_ground(corners)]
    size = _size_on_floor_m(ground, below)
    well = below[size <= most_shrunk * finest_metres_per_px(ground)] if len(size) else below
    if len(well) < 3:
        raise InputError("the calibration shows no floor in the picture: calibrate again")
    points = ground.to_track_m(well)
    (x0, y0), (x1, y1) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    return x0, y0, x1, y1


def finest_metres_per_px(ground: GroundMap) -> float:
    """The length on the floor, metres, that a camera px covers where the camera sees best.

    Raises `InputError` where the camera sees no floor.
    """
    points = _rim(ground, 0.0)
    size = _size_on_floor_m(ground, points[ground.sees_ground(points)])
    if not len(size):
        raise InputError("the calibration shows no floor in the picture: calibrate again")
    return float(size.min())


def _rim(ground: GroundMap, margin_px: float) -> Points:
    """Camera px (n, 2) all over the picture, its rim included."""
    u = np.linspace(margin_px - 0.5, ground.width_px - 0.5 - margin_px, _RIM_POINTS)
    v = np.linspace(margin_px - 0.5, ground.height_px - 0.5 - margin_px, _RIM_POINTS)
    across, down = np.meshgrid(u, v)
    return np.column_stack((across.ravel(), down.ravel()))


def _size_on_floor_m(ground: GroundMap, camera_px: Points) -> NDArray[np.float64]:
    """The length on the floor that each camera px (n, 2) covers in its longer direction, metres, shape (n,); infinite where
    its neighbour is beyond the horizon.
    """
    size = np.zeros(len(camera_px))
    for step in ((0.5, 0.0), (0.0, 0.5)):
        ends = [camera_px - np.array(step), camera_px + np.array(step)]
        both = ground.sees_ground(ends[0]) & ground.sees_ground(ends[1])
        length = np.full(len(camera_px), np.inf)
        if both.any():
            apart = ground.to_track_m(ends[1][both]) - ground.to_track_m(ends[0][both])
            length[both] = np.hypot(apart[:, 0], apart[:, 1])
        size = np.maximum(size, length)
    return size


def _samples(ground: GroundMap, metres_per_px: float, extent_m: Extent) -> int:
    """How many samples along its side a px needs, so that none of the camera's px between them is passed over."""
    points = _rim(ground, 0.0)
    points = points[ground.sees_ground(points)]
    if not len(points):
        return 1
    at = ground.to_track_m(points)
    x0, y0, x1, y1 = extent_m
    within = points[(at[:, 0] >= x0) & (at[:, 0] <= x1) & (at[:, 1] >= y0) & (at[:, 1] <= y1)]
    size = _size_on_floor_m(ground, within if len(within) else points)
    return int(np.clip(round(metres_per_px / size.min()), 1, _MOST_SAMPLES))


def _camera_px(
    ground: GroundMap,
    metres_per_px: float,
    extent_m: Extent,
    size_px: tuple[int, int],
    rows: tuple[int, int],
    samples: int,
) -> NDArray[np.float64]:
    """Camera px (n rows * samples, columns * samples, 2) of the rows from `rows[0]` to before `rows[1]`."""
    columns, height = size_px
    inside = (np.arange(samples) + 0.5) / samples - 0.5
    u = (np.arange(columns)[:, None] + inside).ravel()
    v = (np.arange(*rows)[:, None] + inside).ravel()
    x, y = np.meshgrid(extent_m[0] + u * metres_per_px, extent_m[1] + (height - v) * metres_per_px)
    points = np.column_stack((x.ravel(), y.ravel()))
    at = np.full((len(points), 2), _OUTSIDE_PX)
    ahead = _ahead(ground, points)
    if ahead.any():
        at[ahead] = np.clip(ground.to_camera_px(points[ahead]), _OUTSIDE_PX, -_OUTSIDE_PX)
    return at.reshape(len(v), len(u), 2)


def _ahead(ground: GroundMap, track_m: Points) -> Mask:
    """Which of the points (n, 2), track m, lie ahead of the camera, shape (n,)."""
    inverse = np.linalg.inv(np.array(ground.camera_to_twin).reshape(3, 3))
    twin_px = ground.scale.to_twin_px(track_m)
    return np.asarray(twin_px @ inverse[2, :2] + inverse[2, 2] > 0)


def _inside(at: NDArray[np.floating], ground: GroundMap) -> Mask:
    u, v = at[..., 0], at[..., 1]
    return np.asarray((u >= -0.5) & (u <= ground.width_px - 0.5) & (v >= -0.5) & (v <= ground.height_px - 0.5))
