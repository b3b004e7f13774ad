"""Twin pixels to metres on the track plane and back.

Knows one number, metres per twin pixel, and the twin's height, since y points up in metres and down in pixels. Knows no
image, no route and no camera.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from dnb_edge.errors import InputError
from dnb_edge.values import PointPx, Points


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinScale:
    """The similarity between twin px (u right, v down) and track m (x right, y up):
    x = u * metres_per_px, y = (height_px - v) * metres_per_px.
    """

    metres_per_px: float
    """Metres on the track for one pixel of the twin; positive."""
    height_px: float
    """Height of the twin's image, twin px; positive."""

    def __post_init__(self) -> None:
        """Raises `InputError` where a number is not finite and positive."""
        for name in ("metres_per_px", "height_px"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"twin scale: {name} must be a positive number, not {value!r}")
            # A whole number from a file is stored as the fraction that it reads back as.
            object.__setattr__(self, name, float(value))

    @classmethod
    def from_measured_length(cls, *, from_px: PointPx, to_px: PointPx, length_m: float, height_px: float) -> Self:
        """The scale under which the straight line between two twin px measures `length_m` metres on the floor."""
        distance_px = math.dist(from_px, to_px)
        if not (math.isfinite(distance_px) and distance_px >= 1.0):
            raise InputError(
                f"twin scale: the measured line's ends {from_px} and {to_px} are the same twin pixel: "
                "choose two points far apart"
            )
        if not (math.isfinite(length_m) and length_m > 0):
            raise InputError(f"twin scale: the measured length must be a positive number of metres, not {length_m!r}")
        return cls(metres_per_px=length_m / distance_px, height_px=height_px)

    def to_track_m(self, points_px: Points) -> Points:
        """Points (n, 2), twin px, as (n, 2) track m."""
        points = np.asarray(points_px, dtype=np.float64).reshape(-1, 2)
        return np.column_stack((points[:, 0], self.height_px - points[:, 1])) * self.metres_per_px

    def to_twin_px(self, points_m: Points) -> Points:
        """Points (n, 2), track m, as (n, 2) twin px."""
        points = np.asarray(points_m, dtype=np.float64).reshape(-1, 2) / self.metres_per_px
        return np.column_stack((points[:, 0], self.height_px - points[:, 1]))
