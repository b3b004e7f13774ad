"""A pinhole camera on a mast beside the track: projection of points in space, and the exact homography of the floor.

Frame of reference in space, *world m*: x and y as track m, z up from the floor. Knows no picture and no track.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import Points


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PinholeCamera:
    """An ideal camera without lens distortion. Camera px have their origin at the centre of the top-left pixel."""

    width_px: int
    height_px: int
    matrix: NDArray[np.float64]
    """(3, 3) intrinsic matrix, px."""
    rotation: NDArray[np.float64]
    """(3, 3) world to camera axes (x right, y down, z ahead)."""
    position_m: NDArray[np.float64]
    """(3,) optical centre, world m."""

    def project(self, points_m: NDArray[np.float64]) -> Points:
        """(n, 3) points, world m, to (n, 2) camera px. The points must lie ahead of the camera."""
        ahead = (points_m - self.position_m) @ self.rotation.T
        if not np.all(ahead[:, 2] > 0.0):
            raise ValueError("a point lies behind the camera")
        uvw = ahead @ self.matrix.T
        return np.asarray(uvw[:, :2] / uvw[:, 2:])

    def shows(self, camera_px: Points) -> NDArray[np.bool_]:
        """Which of the camera px (n, 2) are in the picture, shape (n,)."""
        u, v = camera_px[:, 0], camera_px[:, 1]
        return np.asarray((u >= 0) & (u <= self.width_px - 1) & (v >= 0) & (v <= self.height_px - 1))

    def floor_homography(self) -> NDArray[np.float64]:
        """(3, 3) H with camera px ~ H (x, y, 1), track m; scaled to H[2, 2] = 1."""
        translation = -self.rotation @ self.position_m
        h = self.matrix @ np.column_stack((self.rotation[:, 0], self.rotation[:, 1], translation))
        return np.asarray(h / h[2, 2])

    def resized(self, size_px: tuple[int, int]) -> PinholeCamera:
        """This camera with its pictures scaled to `size_px` (width, height)."""
        across, down = size_px[0] / self.width_px, size_px[1] / self.height_px
        # Pixel centres: px u lies at (u + 0.5) * across - 0.5 of the scaled picture.
        scale = np.array([[across, 0.0, 0.5 * across - 0.5], [0.0, down, 0.5 * down - 0.5], [0.0, 0.0, 1.0]])
        return replace(self, width_px=size_px[0], height_px=size_px[1], matrix=scale @ self.matrix)

    def distance_m(self, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) straight distance from the optical centre to (n, 3) points, metres."""
        return np.asarray(np.linalg.norm(points_m - self.position_m, axis=1))


def mast_camera(
    *,
    position_m: tuple[float, float, float],
    pitch_deg: float,
    yaw_deg: float = 0.0,
    roll_deg: float = 0.0,
    hfov_deg: float = 70.0,
    size_px: tuple[int, int] = (1280, 720),
) -> PinholeCamera:
    """A camera at `position_m` that looks along +y, turned `yaw_deg` to the right, `pitch_deg` below the horizon, and
    rolled clockwise by `roll_deg` about its axis. `hfov_deg` is the angle between the picture's left and right edges."""
    width, height = size_px
    focal = 0.5 * width / math.tan(math.radians(hfov_deg) / 2.0)
    matrix = np.array([[focal, 0.0, (width - 1) / 2.0], [0.0, focal, (height - 1) / 2.0], [0.0, 0.0, 1.0]])
    pitch, yaw, roll = (math.radians(angle) for angle in (pitch_deg, yaw_deg, roll_deg))
    ahead = np.array([math.sin(yaw) * math.cos(pitch), math.cos(yaw) * math.cos(pitch), -math.sin(pitch)])
    right = np.array([math.cos(yaw), -math.sin(yaw), 0.0])
    down = np.cross(ahead, right)
    turned_right = math.cos(roll) * right + math.sin(roll) * down
    turned_down = -math.sin(roll) * right + math.cos(roll) * down
    return PinholeCamera(
        width_px=width,
        height_px=height,
        matrix=matrix,
        rotation=np.vstack((turned_right, turned_down, ahead)),
        position_m=np.asarray(position_m, dtype=np.float64),
    )
