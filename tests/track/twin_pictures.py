"""Twins drawn for tests: pink lanes on white paper, with exactly known middles."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.track.twin import LaneColour
from dnb_edge.values import BgrImage, Points

PINK = LaneColour(hue_deg=330, saturation_percent=23, value_percent=84)
PINK_BGR = (190, 165, 214)
SIZE = 400
HALF_WIDTH = 16.0


def canvas(size: int = SIZE) -> NDArray[np.bool_]:
    return np.zeros((size, size), dtype=bool)


def painted(mask: NDArray[np.bool_]) -> BgrImage:
    """The mask as a twin: pink on white."""
    image = np.full((*mask.shape, 3), 255, dtype=np.uint8)
    image[mask] = PINK_BGR
    return image


def stroke(mask: NDArray[np.bool_], points: Points, *, closed: bool = True, half: float = HALF_WIDTH) -> None:
    """Adds to `mask` every pixel within `half` of the polyline `points` (n, 2)."""
    ends = np.roll(points, -1, axis=0) if closed else points[1:]
    for start, end in zip(points if closed else points[:-1], ends, strict=True):
        low = np.maximum(np.floor(np.minimum(start, end) - half), 0).astype(int)
        high = np.ceil(np.maximum(start, end) + half).astype(int) + 1
        part = mask[low[1] : high[1], low[0] : high[0]]
        rows, columns = np.indices(part.shape)
        (x, y), (dx, dy) = start - low, end - start
        share = np.clip(((columns - x) * dx + (rows - y) * dy) / (dx * dx + dy * dy), 0, 1)
        part |= np.hypot(columns - x - share * dx, rows - y - share * dy) <= half


def circle(centre: tuple[float, float], radius: float, count: int = 180) -> Points:
    angles = np.arange(count) * (2 * math.pi / count)
    return np.column_stack((centre[0] + radius * np.cos(angles), centre[1] + radius * np.sin(angles)))


def rounded(x0: float, y0: float, x1: float, y1: float, radius: float) -> Points:
    """A rectangle with round corners, clockwise on the picture."""
    corners = [(x1 - radius, y0 + radius, -90), (x1 - radius, y1 - radius, 0), (x0 + radius, y1 - radius, 90),
               (x0 + radius, y0 + radius, 180)]  # fmt: skip
    arcs = []
    for cx, cy, first in corners:
        angles = np.radians(first + np.arange(0, 91, 5))
        arcs.append(np.column_stack((cx + radius * np.cos(angles), cy + radius * np.sin(angles))))
    return np.vstack(arcs)


def ring(radius: float = 130.0) -> NDArray[np.bool_]:
    """One circular lane."""
    mask = canvas()
    stroke(mask, circle((200, 200), radius))
    return mask


def theta() -> NDArray[np.bool_]:
    """A rounded square with a lane across its middle, top to bottom: two forks, three loops."""
    mask = canvas()
    stroke(mask, rounded(50, 50, 350, 350, 70))
    stroke(mask, np.array([[200.0, 50.0], [200.0, 350.0]]), closed=False)
    return mask


def figure_eight() -> NDArray[np.bool_]:
    """Two lobes whose lanes cross at the middle, at right angles."""
    mask = canvas()
    t = np.arange(240) * (2 * math.pi / 240)
    stroke(mask, np.column_stack((200 + 150 * np.cos(t), 200 + 110 * np.sin(2 * t))), half=12)
    return mask


def two_rings() -> NDArray[np.bool_]:
    """Two circular lanes side by side."""
    mask = canvas()
    stroke(mask, circle((110, 200), 60), half=10)
    stroke(mask, circle((290, 200), 60), half=10)
    return mask


def winding() -> tuple[NDArray[np.bool_], Points]:
    """An S-shaped lane with two ends, and its drawn middle."""
    share = np.linspace(0, 1, 200)
    drawn = np.column_stack((50 + 300 * share, 200 + 100 * np.sin(6 * share)))
    mask = canvas()
    stroke(mask, drawn, closed=False)
    return mask, drawn


def open_eight() -> tuple[NDArray[np.bool_], Points]:
    """A figure eight with a gap in its right lobe: one lane with two ends that crosses itself; and its drawn middle."""
    t = np.linspace(0.3, 2 * math.pi - 0.3, 300)
    drawn = np.column_stack((200 + 150 * np.cos(t), 200 + 110 * np.sin(2 * t)))
    mask = canvas()
    stroke(mask, drawn, closed=False, half=12)
    return mask, drawn


def with_seams(image: BgrImage) -> BgrImage:
    """Hair lines across the lane and a ragged, blurred, noisy picture, as a drawing program exports it."""
    noisy = image.copy()
    cv2.line(noisy, (0, 200), (399, 203), (120, 120, 120), 1)
    cv2.line(noisy, (203, 0), (200, 399), (255, 255, 255), 1)
    ok, data = cv2.imencode(".jpg", noisy, [cv2.IMWRITE_JPEG_QUALITY, 80])
    assert ok
    decoded = cv2.imdecode(data, cv2.IMREAD_COLOR)
    return np.asarray(decoded, dtype=np.uint8)
