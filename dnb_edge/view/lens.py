"""The lens: camera px as the picture has them, and the ideal px that a pinhole of the same focal lengths would have.

Knows one camera's focal lengths, optical centre and distortion. Knows no floor and no twin: `ground` maps ideal px to the
track plane. Points are undistorted, never pictures. The two models are OpenCV's: `pinhole` is Brown's (k1 k2 p1 p2 [k3 [k4 k5
k6]]), `fisheye` Kannala and Brandt's (k1..k4), for lenses wider than about 110 degrees. What a fisheye shows beyond 85 degrees
off its axis has no true ideal px (at 90 they end): it gets one further out, and comes back from there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cache
from typing import Any, Self

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge import wire
from dnb_edge.errors import InputError
from dnb_edge.values import Points

_ITERATE = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 1000, 1e-10)
_GRID = 13
_RETURNS_WITHIN_PX = 0.05
_BEYOND = 1.1
"""Up to this many times the picture's own reach the lens is believed; further out it goes on straight."""
_WIDEST_RAD = math.radians(85.0)
"""A fisheye is believed up to this angle off its axis: at 90 degrees ideal px end."""
_LEAST_SLOPE = 0.05
"""Where camera px move outwards more slowly than this share of ideal px, the formula is about to fold and is no lens's."""
_TABLE = 257
_NEWTON_STEPS = 4
_FOLDS = (
    "lens: its distortion folds the picture over near the edges: take photographs with the board nearer to the "
    "picture's corners and calibrate again"
)


class LensModel(StrEnum):
    """Formula of the distortion."""

    PINHOLE = "pinhole"
    FISHEYE = "fisheye"


_COEFFICIENTS = {LensModel.PINHOLE: (4, 5, 8), LensModel.FISHEYE: (4,)}


@dataclass(frozen=True, slots=True, kw_only=True)
class Lens:
    """One camera's lens, for pictures of `width_px` x `height_px`. Lengths are camera px."""

    model: LensModel
    fx_px: float
    fy_px: float
    cx_px: float
    """Optical centre; (0, 0) is the centre of the picture's top-left pixel."""
    cy_px: float
    distortion: tuple[float, ...]
    """In OpenCV's order: pinhole k1 k2 p1 p2 [k3 [k4 k5 k6]], fisheye k1 k2 k3 k4."""
    width_px: int
    height_px: int

    def __post_init__(self) -> None:
        """Raises `InputError` for numbers that no lens has, or a distortion that folds the picture over."""
        numbers = (self.fx_px, self.fy_px, self.cx_px, self.cy_px, *self.distortion)
        if not all(map(math.isfinite, numbers)) or not (self.fx_px > 0 and self.fy_px > 0):
            raise InputError("lens: focal lengths must be positive and all numbers finite: calibrate the lens again")
        if self.width_px <= 0 or self.height_px <= 0:
            raise InputError(f"lens: the picture's size {self.width_px}x{self.height_px} is not a picture's")
        allowed = _COEFFICIENTS[self.model]
        if len(self.distortion) not in allowed:
            raise InputError(
                f"lens: {len(self.distortion)} distortion coefficients, a {self.model.value} lens has "
                f"{' or '.join(map(str, allowed))}"
            )
        if self.model is LensModel.FISHEYE:
            rim = _rim(self)
            if np.any(np.diff(rim.bent) < _LEAST_SLOPE * np.diff(rim.angle)):
                raise InputError(_FOLDS)
            return
        grid = self._grid()
        # Not through `to_camera_px`, which never folds.
        back = self._distorted(_normalised(self.to_ideal_px(grid), self))
        if not np.abs(back - grid).max() < _RETURNS_WITHIN_PX or _reach(self) < _corner_radius(self):
            raise InputError(_FOLDS)

    @property
    def matrix(self) -> NDArray[np.float64]:
        """(3, 3) intrinsic matrix, camera px."""
        return np.array([[self.fx_px, 0.0, self.cx_px], [0.0, self.fy_px, self.cy_px], [0.0, 0.0, 1.0]])

    def to_ideal_px(self, camera_px: Points) -> Points:
        """Ideal px (n, 2) of camera px (n, 2) inside the picture."""
        points = np.asarray(camera_px, dtype=np.float64).reshape(-1, 2)
        if len(points) == 0:
            return np.empty((0, 2))
        if self.model is LensModel.FISHEYE:
            return self._fisheye_ideal(points)
        ideal = cv2.undistortImagePoints(
            points.reshape(-1, 1, 2), self.matrix, np.array(self.distortion), None, _ITERATE
        )
        return np.asarray(ideal, dtype=np.float64).reshape(-1, 2)

    def to_camera_px(self, ideal_px: Points) -> Points:
        """Camera px (n, 2) of ideal px (n, 2). What lies well outside the picture goes on straight from its rim, so that it
        stays outside: the formulas themselves would fold it back in.
        """
        points = _normalised(np.asarray(ideal_px, dtype=np.float64).reshape(-1, 2), self)
        radius = np.hypot(points[:, 0], points[:, 1])
        reach = _reach(self)
        within = points * np.minimum(1.0, reach / np.maximum(radius, 1e-12))[:, None]
        return self._distorted(within) + (points - within) * (self.fx_px, self.fy_px)

    def scaled_to(self, width_px: int, height_px: int) -> Self:
        """The same lens for pictures of another size, all of the sensor's mode scaled plainly."""
        across, down = width_px / self.width_px, height_px / self.height_px
        return replace(
            self,
            fx_px=self.fx_px * across, cx_px=self.cx_px * across, fy_px=self.fy_px * down, cy_px=self.cy_px * down,
            width_px=width_px, height_px=height_px,
        )  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON types; `from_dict` gives back an equal lens, bit for bit."""
        return wire.to_dict(self)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Self:
        """The lens that `to_dict` wrote. Raises `InputError` where a member is missing or of the wrong kind."""
        try:
            return wire.from_dict(cls, data)
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"lens: {error!r} in its stored form: calibrate the lens again") from error

    def _distorted(self, points: Points) -> Points:
        """Camera px (n, 2) of normalised points (n, 2), by the model's formula alone."""
        if len(points) == 0:
            return np.empty((0, 2))
        if self.model is LensModel.FISHEYE:
            radius = np.hypot(points[:, 0], points[:, 1])
            bent = _bent(np.arctan(radius), self.distortion)
            shrunk = points * np.where(radius > 0, bent / np.maximum(radius, 1e-300), 1.0)[:, None]
            return np.asarray(shrunk * (self.fx_px, self.fy_px) + (self.cx_px, self.cy_px), dtype=np.float64)
        ahead = np.column_stack((points, np.ones(len(points))))
        camera, _ = cv2.projectPoints(ahead, np.zeros(3), np.zeros(3), self.matrix, np.array(self.distortion))
        return np.asarray(camera, dtype=np.float64).reshape(-1, 2)

    def _fisheye_ideal(self, points: Points) -> Points:
        """Exactly what `to_camera_px` undoes, out to wherever: the own way, since OpenCV's ends at 90 degrees of *bent*
        angle and gives -1e6 for what it cannot solve.
        """
        rim = _rim(self)
        off = _normalised(points, self)
        bent = np.hypot(off[:, 0], off[:, 1])
        within = np.minimum(bent, rim.bent[-1])
        angle = np.interp(within, rim.bent, rim.angle)
        for _ in range(_NEWTON_STEPS):
            angle = angle - (_bent(angle, self.distortion) - within) / _slope(angle, self.distortion)
        radius = np.tan(angle) + (bent - within)
        grown = off * np.where(bent > 0, radius / np.maximum(bent, 1e-300), 1.0)[:, None]
        return np.asarray(grown * (self.fx_px, self.fy_px) + (self.cx_px, self.cy_px), dtype=np.float64)

    def _grid(self) -> Points:
        """Camera px (n, 2) all over the picture, its corners included."""
        u, v = np.meshgrid(
            np.linspace(-0.5, self.width_px - 0.5, _GRID), np.linspace(-0.5, self.height_px - 0.5, _GRID)
        )
        return np.column_stack((u.ravel(), v.ravel()))


@cache
def _reach(lens: Lens) -> float:
    """Normalised radius up to which the lens is believed."""
    if lens.model is LensModel.FISHEYE:
        return math.tan(_rim(lens).angle[-1])
    radius = np.linspace(0.0, _BEYOND * _corner_radius(lens), 4 * _TABLE)
    k1, k2, _, _, k3, k4, k5, k6 = (*lens.distortion, *[0.0] * (8 - len(lens.distortion)))
    s = radius * radius
    bent = radius * (1.0 + s * (k1 + s * (k2 + s * k3))) / (1.0 + s * (k4 + s * (k5 + s * k6)))
    slow = np.flatnonzero(np.diff(bent) < _LEAST_SLOPE * np.diff(radius))
    return float(radius[slow[0]] if len(slow) else radius[-1])


def _corner_radius(lens: Lens) -> float:
    """Normalised radius of the picture's farthest corner, through a pinhole."""
    return float(np.linalg.norm(_normalised(lens.to_ideal_px(_corners(lens)), lens), axis=1).max())


def _corners(lens: Lens) -> Points:
    """(4, 2) the outer corners of the picture, camera px."""
    right, bottom = lens.width_px - 0.5, lens.height_px - 0.5
    return np.array([[-0.5, -0.5], [right, -0.5], [-0.5, bottom], [right, bottom]])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Rim:
    """A fisheye's formula as a table, up to where it is believed."""

    angle: NDArray[np.float64]
    """Off the axis, rad, rising from 0."""
    bent: NDArray[np.float64]
    """The same in the picture, shares of the focal length."""


@cache
def _rim(lens: Lens) -> _Rim:
    """Up to a little beyond the picture's corners, or to `_WIDEST_RAD` where the picture shows more than that."""
    corner = float(np.linalg.norm(_normalised(_corners(lens), lens), axis=1).max())
    angle = np.linspace(0.0, _WIDEST_RAD, 4 * _TABLE)
    bent = _bent(angle, lens.distortion)
    outside = np.flatnonzero(bent > _BEYOND * corner)
    end = float(angle[outside[0]]) if len(outside) else _WIDEST_RAD
    angle = np.linspace(0.0, end, _TABLE)
    return _Rim(angle=angle, bent=_bent(angle, lens.distortion))


def _bent(angle: NDArray[np.float64], k: tuple[float, ...]) -> NDArray[np.float64]:
    """Kannala and Brandt: angle in the picture of an angle off the axis, rad."""
    s = angle * angle
    return np.asarray(angle * (1.0 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3])))), dtype=np.float64)


def _slope(angle: NDArray[np.float64], k: tuple[float, ...]) -> NDArray[np.float64]:
    """Derivative of `_bent`."""
    s = angle * angle
    return np.asarray(1.0 + s * (3 * k[0] + s * (5 * k[1] + s * (7 * k[2] + s * 9 * k[3]))), dtype=np.float64)


def _normalised(ideal_px: Points, lens: Lens) -> Points:
    """Ideal px (n, 2) as (x / z, y / z) ahead of the camera."""
    return np.asarray((ideal_px - (lens.cx_px, lens.cy_px)) / (lens.fx_px, lens.fy_px), dtype=np.float64)
