"""The camera's picture with what was found of the floor markers: outlines, numbers, the floor's grid and the point below it.

Knows a picture, its ground map and the corners. Knows no file.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import BgrImage, Points
from dnb_edge.view.ground import GroundMap

_GRID = (255, 160, 0)
_OUTLINE = (0, 0, 230)
_FIRST = (0, 200, 0)
_PAPER = (255, 255, 255)
_SUB = 16
"""OpenCV draws with this many steps a pixel."""
_STEPS_M = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
_MOST_LINES = 24
_POINTS = 40


def draw_markers(picture: BgrImage, ground: GroundMap, corners_px: Mapping[int, NDArray[np.float64]]) -> BgrImage:
    """`picture` with the markers' outlines, the first corner of each in green, and a grid over the floor about them."""
    drawn = picture.copy()
    thick = max(1, round(max(drawn.shape[:2]) / 900))
    step_m = _draw_grid(drawn, ground, np.concatenate(list(corners_px.values())), thick)
    for number, corners in corners_px.items():
        _polyline(drawn, np.vstack((corners, corners[:1])), _OUTLINE, thick)
        u, v = (round(float(c) * _SUB) for c in corners[0])
        cv2.circle(drawn, (u, v), 3 * thick * _SUB, _FIRST, -1, cv2.LINE_AA, shift=4)
        below = (float(corners[:, 0].mean()), float(corners[:, 1].max()) + 14.0 * thick)
        _write(drawn, str(number), np.array(below), thick)
    if ground.camera_m is not None:
        foot = ground.point_to_camera_px((ground.camera_m[0], ground.camera_m[1]))
        if foot is not None and 0 <= foot[0] < ground.width_px and 0 <= foot[1] < ground.height_px:
            centre = (round(foot[0] * _SUB), round(foot[1] * _SUB))
            cv2.circle(drawn, centre, 9 * thick * _SUB, _OUTLINE, thick, cv2.LINE_AA, shift=4)
            _write(drawn, "below the camera", np.array([foot[0] + 12.0 * thick, foot[1] + 26.0 * thick]), thick)
    _write(drawn, f"grid {step_m:g} m", np.array([60.0 * thick, drawn.shape[0] - 16.0 * thick]), thick)
    return drawn


def _draw_grid(drawn: BgrImage, ground: GroundMap, corners_px: Points, thick: int) -> float:
    """Draws lines of the track plane over the markers and around; returns their distance, m."""
    at = ground.to_track_m(corners_px)
    low, high = at.min(axis=0), at.max(axis=0)
    margin = 0.25 * (high - low) + 0.2
    low, high = low - margin, high + margin
    step = next((s for s in _STEPS_M if float((high - low).max()) / s <= _MOST_LINES), _STEPS_M[-1])
    share = np.linspace(0.0, 1.0, _POINTS)[:, None]
    for axis in (0, 1):
        for k in range(math.ceil(low[axis] / step), math.floor(high[axis] / step) + 1):
            start, end = low.copy(), high.copy()
            start[axis] = end[axis] = k * step
            line = [ground.point_to_camera_px((x, y)) for x, y in (start + share * (end - start)).tolist()]
            seen = np.array([point for point in line if point is not None and _near(point, ground)])
            if len(seen) > 1:
                _polyline(drawn, seen, _GRID, 1 if thick == 1 else thick - 1)
    return step


def _near(point: tuple[float, float], ground: GroundMap) -> bool:
    return abs(point[0]) < 3.0 * ground.width_px and abs(point[1]) < 3.0 * ground.height_px


def _polyline(drawn: BgrImage, points: Points, colour: tuple[int, int, int], thick: int) -> None:
    at = np.rint(points * _SUB).astype(np.int32)
    cv2.polylines(
        drawn, [at.reshape(-1, 1, 2)], isClosed=False, color=colour, thickness=thick, lineType=cv2.LINE_AA, shift=4
    )


def _write(drawn: BgrImage, text: str, at: NDArray[np.float64], thick: int) -> None:
    size = 0.55 * thick
    (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, size, thick)
    where = (round(float(at[0]) - width / 2), round(float(at[1]) + height / 2))
    for colour, width_px in ((_PAPER, 3 * thick), (_OUTLINE, thick)):
        cv2.putText(drawn, text, where, cv2.FONT_HERSHEY_SIMPLEX, size, colour, width_px, cv2.LINE_AA)
