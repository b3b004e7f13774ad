"""The lens: camera px as the picture has them, and the ideal px that a pinhole of the same focal lengths would have.

Knows one camera's focal lengths, optical centre and distortion. Knows no floor and no twin: `ground` maps ideal px to the
track plane. Points are undistorted, never pictures. The two models are OpenCV's: `pinhole` is Brown's (k1 k2 p1 p2 [k3 [k4 k5
k6]]), `fisheye` Kannala and Brandt's (k1..k4), for lenses wider than about 110 degrees.
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

_ITERATE = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-10)
_GRID = 13
_RETURNS_WITHIN_PX = 0.05
_BEYOND = 1.1
"""Up to this many times the picture's own reach the lens is believed; further out it goes on straight."""


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
        grid = self._grid()
        # Not through `to_camera_px`, which never folds.
        back = self._distorted(_normalised(self.to_ideal_px(grid), self))
        if not np.abs(back - grid).max() < _RETURNS_WITHIN_PX:
            raise InputError(
                "lens: its distortion folds the picture over near the edges: take photographs with the board nearer to the "
                "picture's corners and calibrate again"
            )

    @property
    def matrix(self) -> NDArray[np.float64]:
        """(3, 3) intrinsic matrix, camera px."""
        return np.array([[self.fx_px, 0.0, self.cx_px], [0.0, self.fy_px, self.cy_px], [0.0, 0.0, 1.0]])

    def to_ideal_px(self, camera_px: Points) -> Points:
        """Ideal px (n, 2) of camera px (n, 2) inside the picture."""
        points = np.asarray(camera_px, dtype=np.float64).reshape(-1, 1, 2)
        if len(points) == 0:
            return np.empty((0, 2))
        bent = np.array(self.distortion)
        if self.model is LensModel.FISHEYE:
            ideal = cv2.fisheye.undistortPoints(
                points, self.matrix, bent, R=np.eye(3), P=self.matrix, criteria=_ITERATE
            )
        else:
            ideal = cv2.undistortImagePoints(points, self.matrix, bent, None, _ITERATE)
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
        bent = np.array(self.distortion)
        if self.model is LensModel.FISHEYE:
            camera = cv2.fisheye.distortPoints(points.reshape(-1, 1, 2), self.matrix, bent)
        else:
            ahead = np.column_stack((points, np.ones(len(points))))
            camera, _ = cv2.projectPoints(ahead, np.zeros(3), np.zeros(3), self.matrix, bent)
        return np.asarray(camera, dtype=np.float64).reshape(-1, 2)

    def _grid(self) -> Points:
        """Camera px (n, 2) all over the picture, its corners included."""
        u, v = np.meshgrid(
            np.linspace(-0.5, self.width_px - 0.5, _GRID), np.linspace(-0.5, self.height_px - 0.5, _GRID)
        )
        return np.column_stack((u.ravel(), v.ravel()))


@cache
def _reach(lens: Lens) -> float:
    """Normalised radius up to which the lens is believed."""
    right, bottom = lens.width_px - 0.5, lens.height_px - 0.5
    corners = np.array([[-0.5, -0.5], [right, -0.5], [-0.5, bottom], [right, bottom]])
    return _BEYOND * float(np.linalg.norm(_normalised(lens.to_ideal_px(corners), lens), axis=1).max())


def _normalised(ideal_px: Points, lens: Lens) -> Points:
    """Ideal px (n, 2) as (x / z, y / z) ahead of the camera."""
    return np.asarray((ideal_px - (lens.cx_px, lens.cy_px)) / (lens.fx_px, lens.fy_px), dtype=np.float64)
