"""A track drawn over its twin, so that a person can see what was understood.

Knows a picture and a route or track. Knows no file and no display.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.track.line import DirectedLine
from dnb_edge.track.loop import Loop
from dnb_edge.track.model import Track
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import BgrImage, PointPx, Points

_MIDDLE = (40, 40, 40)
_EDGE = (60, 140, 0)
_START = (0, 0, 210)
_FINISH = (160, 0, 120)
_SECTOR = (200, 90, 0)
_LOOPS = ((200, 90, 0), (0, 90, 210), (0, 140, 60), (160, 0, 120))
"""Blue, orange, green and purple, in turn; letters tell loops apart, too."""
_DIRECTION_ARROWS = 12
_LEAST_SIDE_PX = 400
_SHIFT = 4
"""OpenCV draws at 1/16 px with this shift."""


def draw_loops(image: BgrImage, loops: Sequence[Loop]) -> BgrImage:
    """A copy of the twin with each loop that the route may be in a colour of its own, and its letter at its waypoints."""
    canvas = _canvas(image)
    thickness = 2 * _thickness(canvas)
    size = 9.0 * thickness
    for k, loop in enumerate(loops):
        colour = _LOOPS[k % len(_LOOPS)]
        _polyline(canvas, loop.points_px, colour, closed=True, thickness=thickness)
        for at in loop.waypoints_px:
            _draw_letter(canvas, loop.letter, at, colour, size)
    return canvas


def _draw_letter(canvas: BgrImage, letter: str, at_px: PointPx, colour: tuple[int, int, int], size_px: float) -> None:
    """The letter on a disc of `size_px` radius about `at_px`."""
    u, v = at_px
    cv2.circle(canvas, (round(u * (1 << _SHIFT)), round(v * (1 << _SHIFT))), round(size_px * (1 << _SHIFT)), colour, -1,
               cv2.LINE_AA, _SHIFT)  # fmt: skip
    scale, thickness = size_px / 18, max(1, round(size_px / 8))
    (width, height), _ = cv2.getTextSize(letter, cv2.FONT_HERSHEY_SIMPLEX, scale, thickness)
    place = (round(u - width / 2), round(v + height / 2))
    cv2.putText(canvas, letter, place, cv2.FONT_HERSHEY_SIMPLEX, scale, (255, 255, 255), thickness, cv2.LINE_AA)


def draw_track(image: BgrImage | None, track: Track) -> BgrImage:
    """A copy of the twin, or white paper without one, with the route, its direction, the start, finish and sector lines."""
    scale = track.scale
    middle = scale.to_twin_px(track.centreline.points_m)
    if image is None:
        margin = 2 * float(track.centreline.half_left_m.max()) / scale.metres_per_px
        width = max(_LEAST_SIDE_PX, round(float(middle[:, 0].max()) + margin))
        canvas: BgrImage = np.full((max(_LEAST_SIDE_PX, round(scale.height_px)), width, 3), 255, dtype=np.uint8)
    else:
        canvas = _canvas(image)
    half_left, half_right = (
        half / scale.metres_per_px for half in (track.centreline.half_left_m, track.centreline.half_right_m)
    )
    _draw_lane(canvas, middle, half_left, half_right, closed=track.centreline.closed)
    _draw_direction(canvas, middle, float(np.median(half_left)))
    for line in track.sector_lines:
        _draw_line(canvas, line, scale, _SECTOR)
    if track.finish_line is not None:
        _draw_line(canvas, track.finish_line, scale, _FINISH)
    _draw_line(canvas, track.start_line, scale, _START)
    return canvas


def _canvas(image: BgrImage) -> BgrImage:
    """A paler copy, so that lines stand out from any lane colour."""
    return (255 - (255 - image.astype(np.uint16)) * 3 // 5).astype(np.uint8)


def _thickness(canvas: BgrImage) -> int:
    height, width = canvas.shape[:2]
    return max(1, round(float(max(height, width)) / 500))


def _polyline(canvas: BgrImage, points: Points, colour: tuple[int, int, int], *, closed: bool, thickness: int) -> None:
    # OpenCV wants 32-bit integers; a line far outside the picture is cut short of their range.
    fixed = np.clip(points * (1 << _SHIFT), -(2**30), 2**30).round().astype(np.int32).reshape(-1, 1, 2)
    cv2.polylines(canvas, [fixed], closed, colour, thickness, cv2.LINE_AA, _SHIFT)


def _draw_lane(
    canvas: BgrImage, middle: Points, left: NDArray[np.float64], right: NDArray[np.float64], *, closed: bool
) -> None:
    ahead = np.roll(middle, -1, axis=0) - np.roll(middle, 1, axis=0) if closed else np.gradient(middle, axis=0)
    ahead /= np.maximum(np.hypot(ahead[:, 0], ahead[:, 1]), 1e-12)[:, None]
    lefts = np.column_stack((ahead[:, 1], -ahead[:, 0]))
    thickness = _thickness(canvas)
    _polyline(canvas, middle + lefts * left[:, None], _EDGE, closed=closed, thickness=max(1, thickness // 2))
    _polyline(canvas, middle - lefts * right[:, None], _EDGE, closed=closed, thickness=max(1, thickness // 2))
    _polyline(canvas, middle, _MIDDLE, closed=closed, thickness=thickness)


def _draw_direction(canvas: BgrImage, middle: Points, size_px: float) -> None:
    """Arrow heads along the route; the first one a little after the start line."""
    n = len(middle)
    for k in range(_DIRECTION_ARROWS):
        i = (n * k // _DIRECTION_ARROWS + n // (2 * _DIRECTION_ARROWS)) % n
        ahead = middle[(i + 1) % n] - middle[i]
        ahead = ahead / max(float(np.hypot(*ahead)), 1e-12)
        across = np.array([ahead[1], -ahead[0]])
        tip, tail = middle[i] + ahead * size_px * 0.3, middle[i] - ahead * size_px * 0.3
        head = np.vstack((tail + across * size_px * 0.3, tip, tail - across * size_px * 0.3))
        _polyline(canvas, head, _MIDDLE, closed=False, thickness=_thickness(canvas))


def _draw_line(canvas: BgrImage, line: DirectedLine, scale: TwinScale, colour: tuple[int, int, int]) -> None:
    """The line, and a short arrow from its middle in the forward direction."""
    start, end = scale.to_twin_px(np.array([line.start_m, line.end_m]))
    thickness = 2 * _thickness(canvas)
    _polyline(canvas, np.vstack((start, end)), colour, closed=False, thickness=thickness)
    x, y = line.forward
    middle = (start + end) / 2
    tip = middle + np.array([x, -y]) * float(np.hypot(*(end - start))) * 0.3
    barb = (middle - tip) * 0.4
    sides = [
        tip + np.array([c * barb[0] - s * barb[1], s * barb[0] + c * barb[1]]) for c, s in ((0.8, 0.6), (0.8, -0.6))
    ]
    _polyline(canvas, np.vstack((middle, tip)), colour, closed=False, thickness=thickness)
    _polyline(canvas, np.vstack((sides[0], tip, sides[1])), colour, closed=False, thickness=thickness)
