"""A pinhole camera over a floor, for drawing: where a point in metres falls in the picture.

Knows geometry only: no colours, no objects, no files. World frame: right-handed metres, z up, the floor is z = 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class View:
    """A camera that looks at the floor's origin."""

    matrix: FloatArray
    """Projection (3, 4): homogeneous camera px = matrix @ (x, y, z, 1), metres."""
    eye_m: FloatArray
    """The camera's place, shape (3,), metres."""
    size_px: int
    """The picture is square: side in px."""

    def project(self, points_m: FloatArray) -> FloatArray:
        """Camera px, shape (n, 2), of world points, shape (n, 3), metres; points must be in front of the camera."""
        homogeneous = points_m @ self.matrix[:, :3].T + self.matrix[:, 3]
        depth = np.maximum(homogeneous[:, 2:3], 0.05)
        return np.asarray(homogeneous[:, :2] / depth, dtype=np.float64)

    def floor_homography(self) -> FloatArray:
        """The (3, 3) homography from floor metres (x, y) to camera px."""
        return np.asarray(self.matrix[:, [0, 1, 3]], dtype=np.float64)

    def floor_point(self, camera_px: tuple[float, float]) -> FloatArray:
        """The floor point (3,), metres, seen at `camera_px`."""
        ground = np.linalg.solve(self.floor_homography(), np.array([camera_px[0], camera_px[1], 1.0]))
        return np.array([ground[0] / ground[2], ground[1] / ground[2], 0.0])

    def distance_m(self, points_m: FloatArray) -> FloatArray:
        """Distances from the camera, shape (n,), metres, of world points, shape (n, 3)."""
        return np.asarray(np.linalg.norm(points_m - self.eye_m, axis=1), dtype=np.float64)


def look_at_floor(
    *,
    size_px: int,
    elevation_rad: float,
    distance_m: float,
    px_per_m: float,
    roll_rad: float,
    shear: FloatArray,
) -> View:
    """A camera at `distance_m` from the floor's origin, `elevation_rad` above it, that sees it at the picture's centre.

    `px_per_m` is the scale at the origin across the line of sight; `shear` is a (2, 2) matrix near the identity applied to the
    picture about its centre, which stands for the off-axis stretch of a wide lens. In the picture the camera's side of the
    floor is down before `roll_rad` turns it.
    """
    eye = distance_m * np.array([0.0, -math.cos(elevation_rad), math.sin(elevation_rad)])
    forward = -eye / distance_m
    right = np.array([1.0, 0.0, 0.0])
    down = np.cross(forward, right)
    rotation = np.stack([right, down, forward])
    focal = px_per_m * distance_m
    turn = np.array([[math.cos(roll_rad), -math.sin(roll_rad)], [math.sin(roll_rad), math.cos(roll_rad)]])
    intrinsics = np.eye(3)
    intrinsics[:2, :2] = focal * (turn @ shear)
    intrinsics[:2, 2] = (size_px - 1) / 2.0
    matrix = intrinsics @ np.column_stack([rotation, -rotation @ eye])
    return View(matrix=matrix, eye_m=eye, size_px=size_px)
