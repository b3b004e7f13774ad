"""Tracks on a floor: tape, painted and printed roads, foam-tile roads, slot-car rails, kerbs, and walls along a lane.

Knows lanes in metres on the floor and their colours; nothing of textures or cars. Draws through `View.project` alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.train.camera import View
from dnb_edge.train.clutter_shapes import paint, placed, rubber, slab, tube, wood
from dnb_edge.train.floor_textures import floor_colour
from dnb_edge.train.solids import FloatArray, Solid

Rng = np.random.Generator
Picture = NDArray[np.float32]
_POINTS = 200
_RED, _WHITE, _YELLOW = ((40.0, 40.0, 200.0), (235.0, 235.0, 235.0), (60.0, 200.0, 235.0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lane:
    """A lane's middle line and width."""

    path_m: FloatArray
    """Shape (n, 2), evenly spaced."""
    left: FloatArray
    """Unit normals to the left, shape (n, 2)."""
    width_m: float

    def step_m(self) -> float:
        """Distance between neighbouring points."""
        return float(np.linalg.norm(self.path_m[1] - self.path_m[0]))


def any_lane(view: View, width_m: float, rng: Rng) -> Lane:
    """A winding way or a loop through a random place of the picture."""
    u, v = float(rng.uniform(0.2, 0.8)) * view.width_px, float(rng.uniform(0.25, 0.85)) * view.height_px
    anchor = view.floor_point((u, v))[:2]
    beside = view.floor_point((u + 10.0, v))[:2]
    extent = min(12.0, 0.1 * view.width_px * float(np.linalg.norm(beside - anchor)))
    if rng.random() < 0.45:
        path = _loop(rng, max(extent * float(rng.uniform(0.25, 0.9)), 1.2 * width_m))
    else:
        path = _winding(rng, 2.6 * extent)
    path = path - path[int(rng.integers(_POINTS // 4, 3 * _POINTS // 4))] + anchor
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True) + 1e-12
    return Lane(path_m=path, left=np.column_stack([-tangent[:, 1], tangent[:, 0]]), width_m=width_m)


def _evenly(path: FloatArray) -> FloatArray:
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    at = np.linspace(0.0, along[-1], _POINTS)
    return np.column_stack([np.interp(at, along, path[:, 0]), np.interp(at, along, path[:, 1])])


def _winding(rng: Rng, length_m: float) -> FloatArray:
    bend = cv2.GaussianBlur(rng.normal(0, 1.0, (60, 1)), (0, 0), 5.0, borderType=cv2.BORDER_REFLECT).ravel()
    turn = np.cumsum(bend * float(rng.uniform(0.0, 0.5))) + float(rng.uniform(0, 2 * math.pi))
    return _evenly(np.cumsum(np.column_stack([np.cos(turn), np.sin(turn)]) * length_m / 60, axis=0))


def _loop(rng: Rng, radius_m: float) -> FloatArray:
    """An oval of straights and half circles, or a bean of smooth radius."""
    angle = np.linspace(0.0, 2 * math.pi, 181)
    if rng.random() < 0.5:
        half = radius_m * float(rng.uniform(0.0, 1.2))
        x = np.cos(angle) * radius_m * 0.7 + np.where(np.cos(angle) > 0, half, -half)
        path = np.column_stack([x, np.sin(angle) * radius_m * 0.7])
    else:
        waves = [float(rng.normal(0, 0.13)) * np.cos(k * angle + float(rng.uniform(0, 6))) for k in (2, 3, 4)]
        reach = radius_m * (1.0 + np.sum(waves, axis=0))
        path = np.column_stack([np.cos(angle) * reach, np.sin(angle) * reach])
    yaw = float(rng.uniform(0, 2 * math.pi))
    c, s = math.cos(yaw), math.sin(yaw)
    return _evenly(path @ np.array([[c, s], [-s, c]]))


class _Painter:
    """Fills strips of one lane into a picture, in place."""

    def __init__(self, picture: Picture, view: View, lane: Lane) -> None:
        self._picture, self._view, self._lane = picture, view, lane
        detail = cv2.transform(picture, np.full((1, 3), 1.0 / 3.0, dtype=np.float32)) / (float(picture.mean()) + 1.0)
        self._shade = (0.75 + 0.25 * np.clip(detail, 0.4, 1.6)).reshape(*picture.shape[:2], 1).astype(np.float32)

    def strip(
        self,
        centre_m: float,
        width_m: float,
        colour: tuple[float, float, float] | Picture,
        *,
        opacity: float = 0.95,
        dash_m: tuple[float, float] | None = None,
        phase_m: float = 0.0,
    ) -> None:
        """Paint a strip `centre_m` to the left of the lane's middle; with `dash_m` (mark, gap) only its dashes."""
        path, left, step = self._lane.path_m, self._lane.left, self._lane.step_m()
        edges = [path + left * (centre_m + side * width_m / 2) for side in (1, -1)]
        floor = np.column_stack([np.vstack(edges), np.zeros(2 * len(path))])
        ahead = self._view.camera_m(floor)[:, 2].reshape(2, -1).min(axis=0) > 0.15
        pixels = self._view.project(floor)
        corners = np.rint(np.clip(((pixels + 0.5) * 2 - 0.5) * 16, -4e5, 4e5)).astype(np.int32).reshape(2, -1, 2)
        height, width = self._picture.shape[:2]
        mask = np.zeros((height * 2, width * 2), dtype=np.uint8)
        for i in range(len(path) - 1):
            along = i * step + phase_m
            if not (ahead[i] and ahead[i + 1]) or (dash_m is not None and along % (dash_m[0] + dash_m[1]) > dash_m[0]):
                continue
            quad = np.stack([corners[0, i], corners[0, i + 1], corners[1, i + 1], corners[1, i]])
            cv2.fillConvexPoly(mask, quad, (255.0,), cv2.LINE_8, 4)
        self._blend(mask, np.asarray(colour, dtype=np.float32), opacity)

    def across(self, at: int, length_m: float, colour: tuple[float, float, float], *, opacity: float = 0.95) -> None:
        """Paint a bar over the whole lane, `length_m` along it, at point number `at`."""
        half = self._lane.width_m / 2
        self.block(at, (-half, half), (0.0, length_m), colour, opacity=opacity)

    def block(
        self,
        at: int,
        across_m: tuple[float, float],
        along_m: tuple[float, float],
        colour: tuple[float, float, float],
        *,
        opacity: float = 0.95,
    ) -> None:
        """Paint a rectangle at point number `at`: from and to, metres to the left of the lane's middle and along it."""
        base, left = self._lane.path_m[at], self._lane.left[at]
        forward = np.array([left[1], -left[0]])
        outline = [base + left * across_m[i] + forward * along_m[j] for i, j in ((0, 0), (0, 1), (1, 1), (1, 0))]
        floor = np.column_stack([np.array(outline), np.zeros(4)])
        if float(self._view.camera_m(floor)[:, 2].min()) < 0.15:
            return
        height, width = self._picture.shape[:2]
        mask = np.zeros((height * 2, width * 2), dtype=np.uint8)
        corners = np.clip(((self._view.project(floor) + 0.5) * 2 - 0.5) * 16, -4e5, 4e5)
        cv2.fillConvexPoly(mask, np.rint(corners).astype(np.int32), (255.0,), cv2.LINE_8, 4)
        self._blend(mask, np.asarray(colour, dtype=np.float32), opacity)

    def _blend(self, mask: NDArray[np.uint8], colour: Picture, opacity: float) -> None:
        height, width = self._picture.shape[:2]
        x, y, w, h = cv2.boundingRect(mask)
        if w == 0 or h == 0:
            return
        top, left, bottom, right = y // 2, x // 2, min(height, (y + h + 1) // 2), min(width, (x + w + 1) // 2)
        alpha = cv2.resize(
            mask[top * 2 : bottom * 2, left * 2 : right * 2], (right - left, bottom - top), interpolation=cv2.INTER_AREA
        ).astype(np.float32)
        alpha *= np.float32(opacity / 255.0)
        part = self._picture[top:bottom, left:right]
        part += (colour * self._shade[top:bottom, left:right] - part) * alpha[:, :, None]


def _grey(rng: Rng, low: float, high: float) -> tuple[float, float, float]:
    value = float(rng.uniform(low, high))
    return (value, value, value)


def _tape(painter: _Painter, lane: Lane, rng: Rng) -> None:
    """Two lines of tape, or one, of any colour; often with a dashed middle."""
    colour = paint(rng)
    line = float(rng.choice([0.012, 0.019, 0.025, 0.05]))
    for side in (-0.5, 0.5) if rng.random() < 0.75 else (0.0,):
        painter.strip(side * lane.width_m, line, colour, opacity=float(rng.uniform(0.75, 1.0)))
    if rng.random() < 0.4:
        mark = float(rng.uniform(0.04, 0.25))
        painter.strip(0.0, line, paint(rng), dash_m=(mark, mark * float(rng.uniform(0.6, 1.5))))


def _road(painter: _Painter, lane: Lane, rng: Rng) -> None:
    """A filled lane, any colour, with edge lines and perhaps dashes, kerbs, a start line or chequers."""
    kind = rng.random()
    fill = _grey(rng, 12, 110) if kind < 0.5 else (_grey(rng, 170, 240) if kind < 0.7 else tuple(floor_colour(rng)))
    painter.strip(0.0, lane.width_m * 1.08, np.asarray(fill, dtype=np.float32), opacity=float(rng.uniform(0.7, 1.0)))
    line = lane.width_m * float(rng.uniform(0.025, 0.08))
    edge = _WHITE if rng.random() < 0.6 else paint(rng)
    if rng.random() < 0.75:
        for side in (-0.5, 0.5):
            painter.strip(side * lane.width_m, line, edge)
    if rng.random() < 0.5:
        mark = lane.width_m * float(rng.uniform(0.2, 0.6))
        painter.strip(0.0, line, _WHITE if rng.random() < 0.6 else _YELLOW, dash_m=(mark, mark))
    if rng.random() < 0.3:
        _kerbs(painter, lane, rng)


def _kerbs(painter: _Painter, lane: Lane, rng: Rng) -> None:
    mark, broad = lane.width_m * float(rng.uniform(0.12, 0.3)), lane.width_m * float(rng.uniform(0.05, 0.12))
    for side in (-0.55, 0.55) if rng.random() < 0.6 else (0.55,):
        painter.strip(side * lane.width_m, broad, _WHITE)
        painter.strip(side * lane.width_m, broad, _RED if rng.random() < 0.85 else paint(rng), dash_m=(mark, mark))


def _tile_road(painter: _Painter, lane: Lane, rng: Rng) -> None:
    """Black foam tiles with white edges, yellow dashes and red stop lines."""
    painter.strip(0.0, lane.width_m * 1.35, _grey(rng, 18, 55))
    for side in (-0.5, 0.5):
        painter.strip(side * lane.width_m, lane.width_m * 0.11, _WHITE)
    painter.strip(0.0, lane.width_m * 0.06, _YELLOW, dash_m=(lane.width_m * 0.12, lane.width_m * 0.06))
    for _ in range(int(rng.integers(0, 3))):
        painter.across(int(rng.integers(5, _POINTS - 5)), lane.width_m * 0.11, _RED)


def _slot(painter: _Painter, lane: Lane, rng: Rng) -> None:
    """Slot-car track: dark plastic with two grooves between metal rails, borders, and joints between the pieces."""
    width, base = lane.width_m, _grey(rng, 22, 75)
    if rng.random() < 0.5:
        painter.strip(0.0, width * float(rng.uniform(1.15, 1.6)), _grey(rng, 30, 120) if rng.random() < 0.6 else _WHITE)
        if rng.random() < 0.6:
            for side in (-0.56, 0.56):
                painter.strip(side * width, width * 0.09, _RED, dash_m=(width * 0.3, width * 0.3))
    painter.strip(0.0, width, base)
    if rng.random() < 0.4:
        for side in (-0.47, 0.47):
            painter.strip(side * width, width * 0.03, _WHITE)
    metal = _grey(rng, 110, 205)
    for groove in (-0.24, 0.24):
        for rail in (-0.034, 0.034):
            painter.strip((groove + rail) * width, width * 0.03, metal, opacity=0.9)
        painter.strip(groove * width, width * 0.03, (8.0, 8.0, 8.0))
    piece = max(2, int(width * float(rng.uniform(1.0, 1.8)) / lane.step_m()))
    for at in range(int(rng.integers(0, piece)), _POINTS - 1, piece):
        painter.across(at, width * 0.015, (12.0, 12.0, 12.0), opacity=0.6)
    if rng.random() < 0.3:
        painter.strip(0.0, width * 0.02, _WHITE, dash_m=(width * 0.3, width * 0.3))


_MAKES: tuple[tuple[Callable[[_Painter, Lane, Rng], None], float], ...] = (
    (_tape, 0.34), (_road, 0.36), (_tile_road, 0.12), (_slot, 0.18),
)  # fmt: skip


def paint_lanes(picture: Picture, view: View, car_length_m: float, rng: Rng) -> None:
    """Lay one to three lanes of a random make on the floor, in place; picture (h, w, 3) of the view's size."""
    make = _MAKES[int(rng.choice(len(_MAKES), p=[weight for _, weight in _MAKES]))][0]
    for _ in range(int(rng.choice([1, 2, 3], p=[0.6, 0.28, 0.12]))):
        wide = rng.uniform(1.1, 1.7) if make is _slot else rng.uniform(0.7, 2.8)
        lane = any_lane(view, car_length_m * float(wide), rng)
        painter = _Painter(picture, view, lane)
        make(painter, lane, rng)
        if rng.random() < 0.25:
            _start_line(painter, lane, rng)


def _start_line(painter: _Painter, lane: Lane, rng: Rng) -> None:
    """A bar or chequers over the lane."""
    at, long = int(rng.integers(5, _POINTS - 5)), lane.width_m * float(rng.uniform(0.06, 0.2))
    painter.across(at, long, _WHITE if rng.random() < 0.6 else paint(rng))
    if rng.random() < 0.4:
        square = lane.width_m / 8
        for row in range(2):
            for column in range(4):
                low = (2 * column + row - 4) * square
                painter.block(at, (low, low + square), (row * square, (row + 1) * square), (15.0, 15.0, 15.0))


def track_walls(view: View, car_length_m: float, rng: Rng) -> list[Solid]:
    """A low wall beside a lane, in the floor's metres (not about the origin): tube, boards, foam blocks or toy barriers."""
    lane = any_lane(view, car_length_m * float(rng.uniform(1.5, 3.5)), rng)
    side = float(rng.choice([-0.55, 0.55])) * lane.width_m
    every = max(1, _POINTS // 40)
    line = (lane.path_m + lane.left * side)[::every]
    kind = rng.random()
    if kind < 0.35:
        radius = float(rng.uniform(0.01, 0.04))
        points = np.column_stack([line, np.full(len(line), radius)])
        return tube(points, radius, paint(rng) if rng.random() < 0.6 else rubber(rng))
    high, thick = float(rng.uniform(0.03, 0.15)), float(rng.uniform(0.008, 0.05))
    first, second = (wood(rng), wood(rng)) if kind < 0.6 else (paint(rng), paint(rng))
    share = 1.02 if kind < 0.75 else float(rng.uniform(0.4, 0.9))
    out: list[Solid] = []
    for number in range(len(line) - 1):
        a, b = line[number], line[number + 1]
        length = float(np.linalg.norm(b - a)) * share
        board = slab((length, thick, high), second if number % 2 and kind >= 0.6 else first)
        yaw = math.atan2(float(b[1] - a[1]), float(b[0] - a[0]))
        out += placed([board], yaw, (float(a[0] + b[0]) / 2, float(a[1] + b[1]) / 2, 0.0))
    return out
