"""A closed circuit to drive on and its digital twin drawn by code; the demo's track, with a chicane, is one.

Knows the layout in metres, the colours of the twin, and the start line. Knows no camera and no car.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from dnb_edge.sim.path import ClosedPath, closed_path
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import BgrImage, PointM, PointPx, Points

TWIN_WIDTH_PX = 1200
TWIN_HEIGHT_PX = 800
METRES_PER_PX = 0.0025
TWIN_SCALE = TwinScale(metres_per_px=METRES_PER_PX, height_px=TWIN_HEIGHT_PX)
LANE_WIDTH_M = 0.26
LANE_HSV = (206.0, 38.0, 72.0)
"""Colour of the lane on the twin: hue in degrees, saturation and value in percent."""

_WHITE = (255, 255, 255)
_GRID = (244, 241, 238)
_INK = (70, 62, 58)
_SUPERSAMPLE = 4

_CORNERS_M: tuple[PointM, ...] = (
    (1.50, 0.30),
    (2.42, 0.30),
    (2.74, 0.66),
    (2.74, 1.36),
    (2.42, 1.74),
    (2.00, 1.74),
    (1.70, 1.16),
    (1.18, 1.16),
    (0.92, 1.74),
    (0.52, 1.74),
    (0.26, 1.42),
    (0.26, 0.62),
    (0.56, 0.30),
)
_ROUNDING_M = 0.15
"""Standard deviation of the smoothing that turns the polygon's corners into bends and leaves its straights straight."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Circuit:
    """A track to drive on. All lengths in metres on the track plane."""

    centreline: ClosedPath
    lane_width_m: float
    start_s_m: float
    """Arc length of the start line on the centreline."""
    start_line_m: tuple[PointM, PointM]
    """(start, end) of the directed start line, across the whole lane and a little more; driving crosses it forward."""
    name: str = "demo track"
    twin_size_px: tuple[int, int] = (TWIN_WIDTH_PX, TWIN_HEIGHT_PX)
    """(width, height) of the twin's picture, of which one px is `METRES_PER_PX`."""

    @property
    def scale(self) -> TwinScale:
        """Twin px to track m and back."""
        return TwinScale(metres_per_px=METRES_PER_PX, height_px=self.twin_size_px[1])


def demo_circuit() -> Circuit:
    """Our own track, driven counter-clockwise seen from above."""
    return circuit_along(closed_path(rounded(_CORNERS_M, _ROUNDING_M)), start_s_m=0.25)


def circuit_along(
    centreline: ClosedPath,
    *,
    start_s_m: float,
    lane_width_m: float = LANE_WIDTH_M,
    name: str = "demo track",
    twin_size_px: tuple[int, int] = (TWIN_WIDTH_PX, TWIN_HEIGHT_PX),
) -> Circuit:
    """The circuit along `centreline` with its start line `start_s_m` along it."""
    point = centreline.at(np.array([start_s_m]))[0]
    left = centreline.normal(np.array([start_s_m]))[0]
    half = 0.5 * lane_width_m + 0.03
    # A car that crosses forward moves to the left of the line's direction, so the line runs from the lane's left to its right.
    start, end = point + half * left, point - half * left
    return Circuit(
        centreline=centreline,
        lane_width_m=lane_width_m,
        start_s_m=start_s_m,
        start_line_m=((float(start[0]), float(start[1])), (float(end[0]), float(end[1]))),
        name=name,
        twin_size_px=twin_size_px,
    )


def rounded(corners_m: tuple[PointM, ...], sigma_m: float) -> list[PointM]:
    """Knots about 0.1 m apart on the closed polygon `corners_m` after circular Gaussian smoothing along its length."""
    corners = np.asarray([*corners_m, corners_m[0]])
    at = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))))
    count = 16 * round(at[-1] / 0.1)
    s = np.arange(count) * at[-1] / count
    polygon = np.column_stack([np.interp(s, at, corners[:, axis]) for axis in (0, 1)])
    distance = np.minimum(s, at[-1] - s)
    weights = np.exp(-0.5 * (distance / sigma_m) ** 2)
    spectrum = np.fft.rfft(polygon, axis=0) * np.fft.rfft(weights / weights.sum())[:, None]
    smooth = np.fft.irfft(spectrum, n=count, axis=0)
    return [(float(x), float(y)) for x, y in smooth[::16]]


def start_line_px(circuit: Circuit) -> tuple[PointPx, PointPx]:
    """The start line in twin px, (start, end)."""
    start, end = circuit.scale.to_twin_px(np.asarray(circuit.start_line_m))
    return (float(start[0]), float(start[1])), (float(end[0]), float(end[1]))


def demo_twin() -> BgrImage:
    """The digital twin of the demo track, shape (800, 1200, 3)."""
    return draw_twin(demo_circuit())


def draw_twin(circuit: Circuit) -> BgrImage:
    """The digital twin of a circuit, of its size: the lane in its plain colour on white.

    The start line is marked beside the lane only, so that the lane's colour stays one unbroken band.
    """
    scale, (width_px, height_px) = _SUPERSAMPLE, circuit.twin_size_px
    canvas = np.full((height_px * scale, width_px * scale, 3), 255, dtype=np.uint8)
    _draw_grid(canvas, scale)
    outline = _canvas_px(circuit, edge_line(circuit, 0.0), scale)
    width = round(circuit.lane_width_m / METRES_PER_PX * scale)
    border = round(0.012 / METRES_PER_PX * scale)
    cv2.polylines(canvas, [outline], isClosed=True, color=_INK, thickness=width + 2 * border)
    cv2.polylines(canvas, [outline], isClosed=True, color=lane_bgr(), thickness=width)
    _draw_start_marks(canvas, circuit, scale)
    small: BgrImage = cv2.resize(canvas, circuit.twin_size_px, interpolation=cv2.INTER_AREA).astype(np.uint8)
    return small


def edge_line(circuit: Circuit, offset_m: float, step_m: float = 0.005) -> Points:
    """(n, 2) points of the line that lies `offset_m` to the left of the centreline, track m."""
    s = np.arange(0.0, circuit.centreline.length_m, step_m)
    return np.asarray(circuit.centreline.at(s) + offset_m * circuit.centreline.normal(s))


def lane_bgr() -> tuple[int, int, int]:
    """`LANE_HSV` as 8-bit blue, green, red."""
    hue, saturation, value = LANE_HSV
    pixel = np.array([[[hue, saturation / 100.0, value / 100.0]]], dtype=np.float32)
    blue, green, red = cv2.cvtColor(pixel, cv2.COLOR_HSV2BGR)[0, 0] * 255.0
    return round(float(blue)), round(float(green)), round(float(red))


def _canvas_px(circuit: Circuit, points_m: Points, scale: int) -> np.ndarray[tuple[int, ...], np.dtype[np.int32]]:
    # Pixel centres: twin px u lies at scale * (u + 0.5) - 0.5 on the enlarged canvas.
    return np.asarray(np.rint((circuit.scale.to_twin_px(points_m) + 0.5) * scale - 0.5), dtype=np.int32)


def _draw_grid(canvas: BgrImage, scale: int) -> None:
    for u in range(0, canvas.shape[1] // scale, 100):
        cv2.line(canvas, (u * scale, 0), (u * scale, canvas.shape[0]), _GRID, scale)
    for v in range(0, canvas.shape[0] // scale, 100):
        cv2.line(canvas, (0, v * scale), (canvas.shape[1], v * scale), _GRID, scale)


def _draw_start_marks(canvas: BgrImage, circuit: Circuit, scale: int) -> None:
    """A small chequered flag on either side of the lane, in line with the start line."""
    s, line, cell = np.array([circuit.start_s_m]), circuit.centreline, 0.02
    point, left, ahead = line.at(s)[0], line.normal(s)[0], line.tangent(s)[0]
    for side in (-1.0, 1.0):
        out, across = side * left, cell * ahead
        for row in range(4):
            for column in range(2):
                corner = point + out * (0.5 * circuit.lane_width_m + 0.02 + row * cell) + (column - 1) * across
                square = np.array([corner, corner + across, corner + across + out * cell, corner + out * cell])
                colour = _INK if (row + column) % 2 == 0 else _WHITE
                cv2.fillConvexPoly(canvas, _canvas_px(circuit, square, scale), colour)
