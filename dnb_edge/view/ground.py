"""Camera pixels to metres on the track plane and back: the map as the core uses it, on every frame.

Knows one 3x3 matrix, the twin's scale, the size of frame that both are valid for and, where they are known, the lens and the
camera's place. With a lens the matrix takes its ideal px, without one camera px are ideal themselves. Knows no keypoints (see
`homography`). Plain floats for single points, numpy for many.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dnb_edge import wire
from dnb_edge.errors import InputError
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import PointM, PointPx, Points
from dnb_edge.view.lens import Lens

Matrix3: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]
"""A 3x3 matrix, row by row."""

Slopes: TypeAlias = tuple[float, float, float, float]
"""d(x, y)/d(u, v) as (dx/du, dx/dv, dy/du, dy/dv), metres per px."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundMap:
    """The plane-to-plane map between a picture of `width_px` x `height_px` and the track plane."""

    camera_to_twin: Matrix3
    """Homography, ideal px -> twin px, of such a sign that the third coordinate is positive on the floor."""
    scale: TwinScale
    width_px: int
    height_px: int
    camera_m: tuple[float, float, float] | None = None
    """The optical centre: x and y as track m, z metres above the floor; None where nothing above the floor is looked at."""
    lens: Lens | None = None
    """The camera's lens, for the same size of frame; None where none is known: camera px are taken as ideal px."""

    def __post_init__(self) -> None:
        """Raises `InputError` where the matrix is not finite or not invertible, or the frame is empty."""
        if not all(math.isfinite(h) for h in self.camera_to_twin) or _determinant(self.camera_to_twin) == 0:
            raise InputError(f"ground map: the homography {self.camera_to_twin} cannot be inverted: calibrate again")
        if self.width_px <= 0 or self.height_px <= 0:
            raise InputError(f"ground map: the frame size {self.width_px}x{self.height_px} is not a picture's")
        if self.camera_m is not None and not (all(map(math.isfinite, self.camera_m)) and self.camera_m[2] > 0):
            raise InputError(f"ground map: a camera at {self.camera_m} m is not above the floor: calibrate again")
        if self.lens is not None and (self.lens.width_px, self.lens.height_px) != (self.width_px, self.height_px):
            raise InputError(
                f"ground map: its lens is for pictures of {self.lens.width_px}x{self.lens.height_px}, not of "
                f"{self.width_px}x{self.height_px}: calibrate again"
            )

    def point_to_track_m(self, camera_px: PointPx) -> PointM | None:
        """The floor point, track m, seen at one camera px; None at or beyond the horizon."""
        u, v = self._ideal_px(camera_px)
        a, b, c, d, e, f, g, h, i = self.camera_to_twin
        w = g * u + h * v + i
        if w <= 0:
            return None
        scale = self.scale.metres_per_px
        return (a * u + b * v + c) / w * scale, (self.scale.height_px - (d * u + e * v + f) / w) * scale

    def point_below_m(self, camera_px: PointPx, height_m: float) -> PointM | None:
        """The floor point, track m, below what is seen at one camera px, `height_m` above the floor; None at the horizon.

        The pixel's ray meets the floor at p' and the plane at `height_m` at p = c + (1 - h/H) (p' - c), c being the floor
        point below the camera and H its height. Raises `ValueError` where the camera's place is not known or not higher.
        """
        seen_m = self.point_to_track_m(camera_px)
        return None if seen_m is None else self.below_m(seen_m, height_m)

    def below_m(self, seen_m: PointM, height_m: float) -> PointM:
        """As `point_below_m`, for the pixel in which the floor point `seen_m`, track m, is seen."""
        if height_m == 0.0:
            return seen_m
        x, y, _ = self._camera()
        share = self.share_at(height_m)
        return x + share * (seen_m[0] - x), y + share * (seen_m[1] - y)

    def share_at(self, height_m: float) -> float:
        """Length of a step on the plane `height_m` above the floor for one on the floor behind it, 0..1.

        Raises `ValueError` where the camera's place is not known or not above that plane.
        """
        if height_m == 0.0:
            return 1.0
        _, _, above_m = self._camera()
        if not height_m < above_m:
            raise ValueError(f"something {height_m} m above the floor is not below the camera at {above_m} m")
        return 1.0 - height_m / above_m

    def _camera(self) -> tuple[float, float, float]:
        if self.camera_m is None:
            raise ValueError("something above the floor cannot be placed: the camera's place is not known")
        return self.camera_m

    def point_to_camera_px(self, track_m: PointM) -> PointPx | None:
        """The camera px at which one floor point, track m, appears; None for points behind the camera."""
        scale = self.scale.metres_per_px
        u, v = track_m[0] / scale, self.scale.height_px - track_m[1] / scale
        a, b, c, d, e, f, g, h, i = _inverse(self.camera_to_twin)
        w = g * u + h * v + i
        if w <= 0:
            return None
        ideal_px = (a * u + b * v + c) / w, (d * u + e * v + f) / w
        if self.lens is None:
            return ideal_px
        ((u, v),) = self.lens.to_camera_px(np.array([ideal_px])).tolist()
        return u, v

    def sees_ground(self, camera_px: Points) -> NDArray[np.bool_]:
        """Which of the camera px (n, 2) lie below the horizon, shape (n,)."""
        return np.asarray(_apply(self.camera_to_twin, self.to_ideal_px(camera_px))[:, 2] > 0)

    def to_ideal_px(self, camera_px: Points) -> Points:
        """Camera px (n, 2) as the ideal px (n, 2) of a camera whose lens bends nothing."""
        points = np.asarray(camera_px, dtype=np.float64).reshape(-1, 2)
        return points if self.lens is None else self.lens.to_ideal_px(points)

    def to_track_m(self, camera_px: Points) -> Points:
        """Camera px (n, 2) as track m (n, 2). Raises `ValueError` for a point beyond the horizon: see `sees_ground`."""
        homogeneous = _apply(self.camera_to_twin, self.to_ideal_px(camera_px))
        return self.scale.to_track_m(_divide(homogeneous, "camera px beyond the horizon"))

    def to_camera_px(self, track_m: Points) -> Points:
        """Track m (n, 2) as camera px (n, 2). Raises `ValueError` for a point behind the camera."""
        twin_px = self.scale.to_twin_px(track_m)
        ideal_px = _divide(_apply(_inverse(self.camera_to_twin), twin_px), "track m behind the camera")
        return ideal_px if self.lens is None else self.lens.to_camera_px(ideal_px)

    def seen(self, camera_px: PointPx) -> tuple[PointM, Slopes] | None:
        """The floor point, track m, seen at one camera px, and how it moves with that; None at or beyond the horizon."""
        lens = self.lens
        u, v = camera_px if lens is None else self._ideal_px(camera_px)
        a, b, c, d, e, f, g, h, i = self.camera_to_twin
        w = g * u + h * v + i
        if w <= 0:
            return None
        x, y, scale = (a * u + b * v + c) / w, (d * u + e * v + f) / w, self.scale.metres_per_px
        step = scale / w
        xu, xv, yu, yv = (a - x * g) * step, (b - x * h) * step, -(d - y * g) * step, -(e - y * h) * step
        if lens is not None:
            uu, uv, vu, vv = _bend(lens, camera_px)
            xu, xv, yu, yv = xu * uu + xv * vu, xu * uv + xv * vv, yu * uu + yv * vu, yu * uv + yv * vv
        return (x * scale, (self.scale.height_px - y) * scale), (xu, xv, yu, yv)

    def slopes(self, camera_px: PointPx) -> Slopes:
        """d(track m)/d(camera px) at one camera px below the horizon; raises `ValueError` beyond it."""
        seen = self.seen(camera_px)
        if seen is None:
            raise ValueError(f"camera px {camera_px} beyond the horizon")
        return seen[1]

    def jacobian(self, camera_px: PointPx) -> NDArray[np.float64]:
        """`slopes` as a matrix, shape (2, 2)."""
        return np.reshape(self.slopes(camera_px), (2, 2))

    def _ideal_px(self, camera_px: PointPx) -> PointPx:
        if self.lens is None:
            return camera_px
        ((u, v),) = self.lens.to_ideal_px(np.array([camera_px])).tolist()
        return u, v

    def scaled_to(self, width_px: int, height_px: int) -> Self:
        """The same map for frames of another size and the same aspect. Raises `InputError` for another aspect."""
        if width_px <= 0 or height_px <= 0 or abs(self.height_px * width_px / self.width_px - height_px) >= 1.0:
            raise InputError(
                f"frames are {width_px}x{height_px}, the view was calibrated on pictures of {self.width_px}x{self.height_px}: "
                "set the camera to the same aspect ratio, or calibrate again on one of its own pictures"
            )
        across, down = self.width_px / width_px, self.height_px / height_px
        a, b, c, d, e, f, g, h, i = self.camera_to_twin
        matrix = (a * across, b * down, c, d * across, e * down, f, g * across, h * down, i)
        lens = None if self.lens is None else self.lens.scaled_to(width_px, height_px)
        return replace(self, camera_to_twin=matrix, lens=lens, width_px=width_px, height_px=height_px)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON types; `from_dict` gives back an equal map, bit for bit."""
        return wire.to_dict(self)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Self:
        """The map that `to_dict` wrote. Raises `InputError` where a member is missing or of the wrong kind."""
        try:
            return wire.from_dict(cls, data)
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"ground map: {error!r} in its stored form: calibrate again") from error


def _bend(lens: Lens, camera_px: PointPx) -> tuple[float, float, float, float]:
    """d(ideal px)/d(camera px) at one camera px, row by row, by central differences."""
    u, v = camera_px
    around = np.array([[u + 0.5, v], [u - 0.5, v], [u, v + 0.5], [u, v - 0.5]])
    (u_right, v_right), (u_left, v_left), (u_down, v_down), (u_up, v_up) = lens.to_ideal_px(around).tolist()
    return u_right - u_left, u_down - u_up, v_right - v_left, v_down - v_up


def _apply(matrix: Matrix3, points: Points) -> NDArray[np.float64]:
    """Homogeneous images (n, 3) of points (n, 2)."""
    p = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    m = np.array(matrix).reshape(3, 3)
    homogeneous: NDArray[np.float64] = p[:, 0, None] * m[:, 0] + p[:, 1, None] * m[:, 1] + m[:, 2]
    return homogeneous


def _divide(homogeneous: NDArray[np.float64], fault: str) -> Points:
    w = homogeneous[:, 2]
    if not (w > 0).all():
        raise ValueError(f"{fault}: point {int(np.argmin(w))} of {len(w)}")
    points: Points = homogeneous[:, :2] / w[:, None]
    return points


def _determinant(matrix: Matrix3) -> float:
    a, b, c, d, e, f, g, h, i = matrix
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


@lru_cache(maxsize=16)
def _inverse(matrix: Matrix3) -> Matrix3:
    """Cofactors over the determinant; keeps the sign of the third coordinate, so 'in front' stays positive."""
    a, b, c, d, e, f, g, h, i = matrix
    k = 1.0 / _determinant(matrix)
    return (
        (e * i - f * h) * k, (c * h - b * i) * k, (b * f - c * e) * k,
        (f * g - d * i) * k, (a * i - c * g) * k, (c * d - a * f) * k,
        (d * h - e * g) * k, (b * g - a * h) * k, (a * e - b * d) * k,
    )  # fmt: skip
