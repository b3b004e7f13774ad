"""What the vehicle's own camera sees: the floor with its lane, the obstacles on it, and a wall behind all.

Knows how to draw one picture for one pose of the vehicle, fast: the floor is drawn once from above, and a picture is that
drawing seen through a homography, the farther parts from smaller copies of it. Knows no driver and no time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.sim.circuit import Circuit, edge_line
from dnb_edge.sim.control import Obstacle, VehicleState
from dnb_edge.sim.floor import RESOLUTION_M, draw_floor
from dnb_edge.values import BgrImage

_MARGIN_M = 0.7
_NEAR_M = 0.015
_STRIPS = 8
_NOISE_SIGMA = 2.5
_NOISE_SHEET_PX = 64
OBSTACLE_BGR = ((40.0, 90.0, 235.0), (60.0, 170.0, 240.0), (190.0, 80.0, 50.0))
"""Colours of obstacles, in turn."""
_FARTHEST_ROW_M = 12.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FrontMount:
    """Where the camera sits on the vehicle, and what it takes in."""

    ahead_m: float = 0.095
    """Ahead of the ground point."""
    height_m: float = 0.135
    pitch_rad: float = math.radians(24.0)
    """Below the horizon."""
    hfov_rad: float = math.radians(100.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrontFloor:
    """A circuit's floor as the front camera needs it: from above, in several sizes."""

    levels: tuple[BgrImage, ...]
    """The floor, and copies of it each half as large as the one before."""
    track_to_px: NDArray[np.float64]
    """(3, 3) track m to px of the first of `levels`."""
    beyond_bgr: tuple[float, ...]
    """The floor's colour where nothing was drawn."""


def front_floor(circuit: Circuit, seed: int) -> FrontFloor:
    """The floor of that circuit as `seed` lays it. It takes about half a second."""
    line = edge_line(circuit, 0.0, 0.02)
    low, high = line.min(axis=0) - _MARGIN_M, line.max(axis=0) + _MARGIN_M
    floor = draw_floor(circuit, (float(low[0]), float(low[1])), (float(high[0]), float(high[1])), seed)
    beyond = tuple(float(value) for value in np.asarray(floor.bgr[:40].mean(axis=(0, 1))))
    return FrontFloor(levels=_levels(floor.bgr), track_to_px=floor.track_to_px, beyond_bgr=beyond)


class FrontCamera:
    """Pictures from the vehicle; all follow from the seed. Not safe for use by several threads."""

    def __init__(
        self,
        floor: FrontFloor,
        obstacles: Sequence[Obstacle],
        *,
        seed: int,
        size_px: tuple[int, int] = (160, 120),
        mount: FrontMount | None = None,
    ) -> None:
        self.mount = mount or FrontMount()
        self.size_px = size_px
        self._seed = seed
        self._obstacles = tuple(obstacles)
        width, height = size_px
        focal = 0.5 * width / math.tan(0.5 * self.mount.hfov_rad)
        self._matrix = np.array([[focal, 0.0, 0.5 * (width - 1)], [0.0, focal, 0.5 * (height - 1)], [0.0, 0.0, 1.0]])
        self._floor = floor
        self._bands = self._rows(focal)
        self._sky = self._wall(seed)
        random = np.random.default_rng([seed, 84])
        sheet = random.standard_normal((height + _NOISE_SHEET_PX, width + _NOISE_SHEET_PX, 3), dtype=np.float32)
        self._noise = np.rint(sheet * np.float32(_NOISE_SIGMA)).astype(np.int16)

    def picture(self, index: int, state: VehicleState, gain: float = 1.0) -> BgrImage:
        """(h, w, 3): picture number `index` (it chooses the noise) of a vehicle at `state`, in that share of full light."""
        rotation, position = self._pose(state)
        picture = self._sky.copy()
        h = self._matrix @ np.column_stack((rotation[:, 0], rotation[:, 1], -rotation @ position))
        for top, bottom, level in self._bands:
            self._draw_floor(picture[top:bottom], h, top, level)
        for number in self._far_to_near(position):
            self._draw_obstacle(picture, rotation, position, number)
        if gain != 1.0:
            picture = cv2.convertScaleAbs(picture, alpha=gain).astype(np.uint8, copy=False)
        row, column = _scattered(self._seed, index)
        width, height = self.size_px
        noise = self._noise[row : row + height, column : column + width]
        noisy = cv2.add(picture, noise, dtype=cv2.CV_8U).astype(np.uint8, copy=False)
        noisy.flags.writeable = False
        return noisy

    def _rows(self, focal: float) -> list[tuple[int, int, int]]:
        """(top, bottom, level): the rows that see the floor, and the copy of the floor that is as fine as they see it."""
        height = self.size_px[1]
        levels: list[tuple[int, int]] = []
        for row in range(height):
            below = self.mount.pitch_rad + math.atan((row - 0.5 * (height - 1)) / focal)
            if below <= math.asin(min(1.0, self.mount.height_m / _FARTHEST_ROW_M)):
                continue
            distance = self.mount.height_m / math.sin(below)
            # How much floor a px takes in: across it by its distance, along by the slant too. Their mean in proportion.
            across = distance / focal
            seen = across / math.sqrt(math.sin(below))
            levels.append((row, min(max(round(math.log2(seen / RESOLUTION_M)), 0), len(self._floor.levels) - 1)))
        bands: list[tuple[int, int, int]] = []
        for row, level in levels:
            if bands and bands[-1][2] == level:
                bands[-1] = (bands[-1][0], row + 1, level)
            else:
                bands.append((row, row + 1, level))
        return bands

    def _wall(self, seed: int) -> BgrImage:
        """What is above the horizon, and the floor's own colour below it, far off."""
        width, height = self.size_px
        tone = float(np.random.default_rng([seed, 83]).uniform(150.0, 205.0))
        sky = np.empty((height, width, 3), dtype=np.uint8)
        sky[:] = np.array([tone * 0.98, tone, tone * 1.02])
        first = self._bands[0][0] if self._bands else height
        skirting = max(0, first - max(1, height // 40))
        sky[skirting:first] = np.array([70.0, 72.0, 74.0])
        return sky

    def _pose(self, state: VehicleState) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Rotation (3, 3) from world to camera axes (x right, y down, z ahead), and the optical centre, world m."""
        cos, sin = math.cos(state.heading_rad), math.sin(state.heading_rad)
        cos_p, sin_p = math.cos(self.mount.pitch_rad), math.sin(self.mount.pitch_rad)
        right, ahead = (sin, -cos, 0.0), (cos * cos_p, sin * cos_p, -sin_p)
        down = (-cos * sin_p, -sin * sin_p, -cos_p)
        x, y = state.track_m
        position = (x + self.mount.ahead_m * cos, y + self.mount.ahead_m * sin, self.mount.height_m)
        return np.array([right, down, ahead]), np.array(position)

    def _draw_floor(self, rows: BgrImage, h: NDArray[np.float64], top: int, level: int) -> None:
        """`rows` begin at picture row `top`; `h` takes track m to camera px."""
        shift = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, -float(top)], [0.0, 0.0, 1.0]])
        shrink = 1.0 / (1 << level)
        # Pixel centres: px u of the large floor lies at (u + 0.5) * shrink - 0.5 of the small one.
        smaller = np.array([[shrink, 0.0, 0.5 * shrink - 0.5], [0.0, shrink, 0.5 * shrink - 0.5], [0.0, 0.0, 1.0]])
        back = smaller @ self._floor.track_to_px @ np.linalg.inv(shift @ h)
        cv2.warpPerspective(
            self._floor.levels[level],
            back,
            (rows.shape[1], rows.shape[0]),
            dst=rows,
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=self._floor.beyond_bgr,
        )

    def _far_to_near(self, position: NDArray[np.float64]) -> list[int]:
        def distance(number: int) -> float:
            x, y = self._obstacles[number].track_m
            return math.hypot(x - position[0], y - position[1])

        return sorted(range(len(self._obstacles)), key=distance, reverse=True)

    def _draw_obstacle(
        self, picture: BgrImage, rotation: NDArray[np.float64], position: NDArray[np.float64], number: int
    ) -> None:
        """The upright strips of the near side of a round thing, and its top where the camera looks down on it."""
        thing = self._obstacles[number]
        x, y = thing.track_m
        towards = math.atan2(position[1] - y, position[0] - x)
        colour = np.array(OBSTACLE_BGR[number % len(OBSTACLE_BGR)])
        angles = towards + np.linspace(-0.5 * math.pi, 0.5 * math.pi, _STRIPS + 1)
        low = np.column_stack(
            (x + thing.radius_m * np.cos(angles), y + thing.radius_m * np.sin(angles), np.zeros(_STRIPS + 1))
        )
        foot = np.column_stack((low[:, :2] + 0.15 * (low[:, :2] - np.array([x, y])), low[:, 2]))
        self._fill(picture, (foot - position) @ rotation.T, np.array([42.0, 42.0, 42.0]))
        high = low + np.array([0.0, 0.0, thing.height_m])
        for k in range(_STRIPS):
            middle = 0.5 * (angles[k] + angles[k + 1])
            light = 0.55 + 0.45 * max(0.0, math.cos(middle - 2.5))
            face = np.array([low[k], low[k + 1], high[k + 1], high[k]])
            self._fill(picture, (face - position) @ rotation.T, colour * light)
        if position[2] > thing.height_m:
            ring = np.linspace(0.0, 2.0 * math.pi, 2 * _STRIPS, endpoint=False)
            top = np.column_stack(
                (
                    x + thing.radius_m * np.cos(ring),
                    y + thing.radius_m * np.sin(ring),
                    np.full(len(ring), thing.height_m),
                )
            )
            self._fill(picture, (top - position) @ rotation.T, np.minimum(colour * 1.1 + 12.0, 255.0))

    def _fill(self, picture: BgrImage, corners: NDArray[np.float64], colour: NDArray[np.float64]) -> None:
        """A flat polygon, (n, 3) in camera axes, metres, as far as it lies ahead of the camera."""
        ahead = _clipped(corners)
        if len(ahead) < 3:
            return
        uvw = ahead @ self._matrix.T
        fixed = np.rint(np.clip(uvw[:, :2] / uvw[:, 2:], -2000.0, 2000.0) * 16.0).astype(np.int32)
        cv2.fillConvexPoly(picture, fixed, colour.tolist(), cv2.LINE_AA, 4)


def _clipped(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """The part of a convex polygon with z of at least `_NEAR_M` (Sutherland and Hodgman, one plane)."""
    depth = corners[:, 2] - _NEAR_M
    if depth.min() >= 0.0:
        return corners
    kept: list[NDArray[np.float64]] = []
    for k in range(len(corners)):
        n = (k + 1) % len(corners)
        if depth[k] >= 0.0:
            kept.append(corners[k])
        if (depth[k] >= 0.0) != (depth[n] >= 0.0):
            kept.append(corners[k] + depth[k] / (depth[k] - depth[n]) * (corners[n] - corners[k]))
    return np.array(kept).reshape(-1, 3)


def _levels(floor: BgrImage) -> tuple[BgrImage, ...]:
    """The floor, and copies of it each half as large as the one before."""
    levels = [floor]
    while min(levels[-1].shape[:2]) > 16 and len(levels) < 8:
        height, width = levels[-1].shape[:2]
        even = levels[-1][: height - height % 2, : width - width % 2]
        levels.append(
            cv2.resize(even, (width // 2, height // 2), interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)
        )
    return tuple(levels)


def _scattered(seed: int, index: int) -> tuple[int, int]:
    """(row, column) within the noise sheet; a multiplicative hash (Knuth), since a generator a picture costs more."""
    mixed = ((seed + 1) * 0x9E3779B1 ^ (index + 1) * 0x85EBCA6B) & 0xFFFFFFFF
    mixed = (mixed ^ (mixed >> 15)) * 0x2C1B3C6D & 0xFFFFFFFF
    return mixed >> 8 & 63, mixed >> 20 & 63
