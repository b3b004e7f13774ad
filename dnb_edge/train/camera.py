"""A real camera over a floor, for drawing: pinhole, lens distortion, and where a point in metres falls in the picture.

Knows geometry only: no colours, no objects, no files. World frame: right-handed metres, z up, the floor is z = 0. Camera frame:
x right, y down, z ahead. Lens model: radial, Brown (1966), r' = r (1 + k1 r^2 + k2 r^4), held constant beyond the radius at
which it would turn back.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

LEAST_DEPTH_M = 0.05
_GRID_STEP_PX = 8
_SMALL_M = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class View:
    """A camera and the part of its picture that is drawn."""

    rotation: FloatArray
    """World to camera, shape (3, 3)."""
    eye_m: FloatArray
    """The camera's place, shape (3,), metres."""
    focal_px: float
    principal_px: tuple[float, float]
    """Where the optical axis meets the picture; may lie outside, for a crop."""
    radial: tuple[float, float]
    """k1, k2."""
    width_px: int
    height_px: int

    @property
    def size_px(self) -> int:
        """Side of a square picture, px."""
        return self.width_px

    def camera_m(self, points_m: FloatArray) -> FloatArray:
        """Points (n, 3) in the camera's frame, metres."""
        return np.asarray((points_m - self.eye_m) @ self.rotation.T, dtype=np.float64)

    def project(self, points_m: FloatArray) -> FloatArray:
        """Camera px, shape (n, 2), of world points, shape (n, 3), metres; points should be in front of the camera."""
        return self.project_camera(self.camera_m(points_m))

    def project_camera(self, camera_m: FloatArray) -> FloatArray:
        """Camera px, shape (n, 2), of points (n, 3) in the camera's frame, metres."""
        depth = np.maximum(camera_m[:, 2:3], LEAST_DEPTH_M)
        return np.asarray(
            self._distorted(camera_m[:, :2] / depth) * self.focal_px + self.principal_px, dtype=np.float64
        )

    def _distorted(self, ideal: FloatArray) -> FloatArray:
        k1, k2 = self.radial
        squared = np.minimum((ideal**2).sum(axis=1, keepdims=True), _turning_point(k1, k2))
        return np.asarray(ideal * (1.0 + k1 * squared + k2 * squared**2), dtype=np.float64)

    def _ideal(self, distorted: FloatArray) -> FloatArray:
        """The inverse of `_distorted`, by fixed-point iteration (converges for the mild lenses that are drawn here)."""
        k1, k2 = self.radial
        limit, ideal = _turning_point(k1, k2), distorted.copy()
        for _ in range(12):
            squared = np.minimum((ideal**2).sum(axis=1, keepdims=True), limit)
            ideal = distorted / (1.0 + k1 * squared + k2 * squared**2)
        return ideal

    def floor_points(self, camera_px: FloatArray) -> FloatArray:
        """Floor points (n, 2), metres, seen at `camera_px` (n, 2); rays that do not go down end 200 m away."""
        ideal = self._ideal((camera_px - self.principal_px) / self.focal_px)
        rays = np.column_stack([ideal, np.ones(len(ideal))]) @ self.rotation
        reach = self.eye_m[2] / np.maximum(-rays[:, 2:3], self.eye_m[2] / 200.0)
        return np.asarray(self.eye_m[:2] + rays[:, :2] * reach, dtype=np.float64)

    def floor_point(self, camera_px: tuple[float, float]) -> FloatArray:
        """The floor point (3,), metres, seen at `camera_px`."""
        return np.append(self.floor_points(np.array([camera_px], dtype=np.float64))[0], 0.0)

    def floor_map(self) -> NDArray[np.float32]:
        """Floor metres (x, y) seen at each pixel, shape (h, w, 2): exact on a coarse grid, interpolated between."""
        columns = np.linspace(0.0, self.width_px - 1.0, max(2, self.width_px // _GRID_STEP_PX))
        rows = np.linspace(0.0, self.height_px - 1.0, max(2, self.height_px // _GRID_STEP_PX))
        u, v = np.meshgrid(columns, rows)
        coarse = self.floor_points(np.column_stack([u.ravel(), v.ravel()])).reshape(len(rows), len(columns), 2)
        at_u = np.arange(self.width_px, dtype=np.float32) * np.float32((len(columns) - 1) / (self.width_px - 1))
        at_v = np.arange(self.height_px, dtype=np.float32) * np.float32((len(rows) - 1) / (self.height_px - 1))
        grid_u, grid_v = np.meshgrid(at_u, at_v)
        return np.asarray(
            cv2.remap(coarse.astype(np.float32), grid_u, grid_v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE),
            dtype=np.float32,
        )

    def distance_m(self, points_m: FloatArray) -> FloatArray:
        """Distances from the camera, shape (n,), metres, of world points, shape (n, 3)."""
        return np.asarray(np.linalg.norm(points_m - self.eye_m, axis=1), dtype=np.float64)

    def px_per_m(self, point_m: FloatArray) -> float:
        """Scale at a world point (3,), px a metre, across the line of sight, the lens left aside."""
        return float(self.focal_px / np.linalg.norm(point_m - self.eye_m))

    def lean(self, camera_px: FloatArray) -> FloatArray:
        """Lean (n, 2) at camera px (n, 2): see `dnb_edge.detect.lean`."""
        floor = np.column_stack([self.floor_points(camera_px), np.zeros(len(camera_px))])
        away = floor[:, :2] - self.eye_m[:2]
        away /= np.linalg.norm(away, axis=1, keepdims=True) + 1e-9
        across = np.column_stack([-away[:, 1], away[:, 0], np.zeros(len(away))])
        across[(away == 0).all(axis=1)] = (1.0, 0.0, 0.0)
        here = self.project(floor)
        up = self.project(floor + np.array([0.0, 0.0, _SMALL_M])) - here
        aside = np.linalg.norm(self.project(floor + across * _SMALL_M) - here, axis=1, keepdims=True)
        return np.asarray(up / np.maximum(aside, 1e-9), dtype=np.float64)

    def cropped(self, *, centre_px: tuple[float, float], scale: float, size_px: tuple[int, int]) -> Self:
        """The part round `centre_px` of this picture, `scale` times as large, as a picture of `size_px` (width, height)."""
        width, height = size_px
        principal = (
            (self.principal_px[0] - centre_px[0]) * scale + (width - 1) / 2.0,
            (self.principal_px[1] - centre_px[1]) * scale + (height - 1) / 2.0,
        )
        return replace(self, focal_px=self.focal_px * scale, principal_px=principal, width_px=width, height_px=height)


def _turning_point(k1: float, k2: float) -> float:
    """The squared radius at which r (1 + k1 r^2 + k2 r^4) stops growing; 9 (a field of view of 143 degrees) where never."""
    if k2 == 0.0:
        return min(9.0, -1.0 / (3.0 * k1)) if k1 < 0.0 else 9.0
    root = 9.0 * k1 * k1 - 20.0 * k2
    if root < 0.0:
        return 9.0
    ends = [(-3.0 * k1 + sign * math.sqrt(root)) / (10.0 * k2) for sign in (-1.0, 1.0)]
    return min([9.0, *(end for end in ends if end > 0.0)])


def overhead_view(
    *,
    width_px: int,
    height_px: int,
    camera_height_m: float,
    pitch_rad: float,
    field_of_view_rad: float,
    roll_rad: float = 0.0,
    radial: tuple[float, float] = (0.0, 0.0),
) -> View:
    """A camera `camera_height_m` above the floor's origin that looks `pitch_rad` down along +y.

    `pitch_rad` is 0 for the horizon and pi/2 for straight down; `field_of_view_rad` is across the picture's width.
    """
    forward = np.array([0.0, math.cos(pitch_rad), -math.sin(pitch_rad)])
    right = np.array([1.0, 0.0, 0.0])
    down = np.cross(forward, right)
    c, s = math.cos(roll_rad), math.sin(roll_rad)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return View(
        rotation=turn @ np.stack([right, down, forward]),
        eye_m=np.array([0.0, 0.0, camera_height_m]),
        focal_px=width_px / 2.0 / math.tan(field_of_view_rad / 2.0),
        principal_px=((width_px - 1) / 2.0, (height_px - 1) / 2.0),
        radial=radial,
        width_px=width_px,
        height_px=height_px,
    )
