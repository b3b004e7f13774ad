"""Where the search for the camera's pose over floor markers starts: the floor as each single square has it.

Knows squares of one size in ideal px; knows no covariance. A single small square tells the floor's tilt badly, and twice (the
two poses of IPPE: Collins and Bartoli, Infinitesimal plane-based pose estimation, 2014); the one that all squares agree with
best is good enough to start from. Frame of reference: foot m, see `marker_solution`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.view.lens import Lens

FloatArray = NDArray[np.float64]

CORNERS = np.array([[-0.5, 0.5], [0.5, 0.5], [0.5, -0.5], [-0.5, -0.5]])
"""A square's corners in units of its side, clockwise from the top left as printed, x right and y up as printed."""

_LARGEST = 5
"""So many of the largest squares are asked."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Start:
    """A likely pose."""

    rotation: FloatArray
    """(3, 3) foot m to camera axes."""
    height_m: float
    lens: Lens
    places: FloatArray
    """(n, 3) x, y and angle of each square, foot m and rad."""
    misfit: float
    """How far the squares are from squares of one size, in their own px."""


def likely_starts(seen: FloatArray, lenses: Sequence[Lens], size_m: float) -> list[Start]:
    """Poses that `seen` (n, 4, 2), ideal px, allow with any of the lenses, best first."""
    areas = [abs(float(cv2.contourArea(square.astype(np.float32)))) for square in seen]
    largest = np.argsort(areas)[::-1][:_LARGEST]
    starts = []
    for lens in lenses:
        rays = np.concatenate((seen, np.ones((*seen.shape[:2], 1))), axis=2) @ np.linalg.inv(lens.matrix).T
        for k in largest:
            for up in _normals(rays[k]):
                start = _start(rays, up, lens, size_m, np.sqrt(areas))
                if start is not None:
                    starts.append(start)
    return sorted(starts, key=lambda start: start.misfit)


def turn(vector: FloatArray) -> FloatArray:
    """(3, 3) rotation by the vector (3,), rad, about its own direction (Rodrigues' formula)."""
    rotation, _ = cv2.Rodrigues(np.asarray(vector, dtype=np.float64).reshape(3, 1))
    return np.asarray(rotation, dtype=np.float64)


def _normals(rays: FloatArray) -> list[FloatArray]:
    """The floor's upward normals (3,), camera axes, by one square's corner rays (4, 3)."""
    square = np.column_stack((CORNERS, np.zeros(4)))
    count, turns, *_ = cv2.solvePnPGeneric(
        square, np.ascontiguousarray(rays[:, :2]), np.eye(3), None, flags=cv2.SOLVEPNP_IPPE_SQUARE
    )
    return [turn(np.asarray(turns[k], dtype=np.float64))[:, 2] for k in range(count)]


def _start(rays: FloatArray, up: FloatArray, lens: Lens, size_m: float, sides_px: FloatArray) -> Start | None:
    """The start on the floor with the normal `up` (3,); None where a corner would lie above the horizon."""
    right = np.array([1.0, 0.0, 0.0]) - up[0] * up
    if not np.linalg.norm(right) > 1e-6:
        return None
    right /= np.linalg.norm(right)
    rotation = np.column_stack((right, np.cross(up, right), up))
    down = rays @ rotation
    if not (down[..., 2] < -1e-6).all():
        return None
    corners = down[..., :2] / -down[..., 2:]
    middles = corners.mean(axis=1)
    # The best similarity from the unit square, as complex numbers: corners ~ middle + scale * e^(i angle) * square.
    square = CORNERS[:, 0] + 1j * CORNERS[:, 1]
    about = corners - middles[:, None]
    fitted = ((about[..., 0] + 1j * about[..., 1]) * square.conjugate()).sum(axis=1) / (abs(square) ** 2).sum()
    scale = float(np.average(abs(fitted), weights=sides_px))
    angles = np.angle(fitted)
    ideal = scale * np.exp(1j * angles)[:, None] * square
    apart = abs(about[..., 0] + 1j * about[..., 1] - ideal) / scale
    height = size_m / scale
    return Start(
        rotation=rotation,
        height_m=height,
        lens=lens,
        places=np.column_stack((middles * height, angles)),
        misfit=math.sqrt(float(((apart * sides_px[:, None]) ** 2).mean())),
    )


def local_points(numbers: Sequence[tuple[float, float]], place: FloatArray, size_m: float) -> FloatArray:
    """(n, 2) foot m of points of one square, given in units of its side, that lies at `place` (3,)."""
    c, s = math.cos(float(place[2])), math.sin(float(place[2]))
    return np.asarray(size_m * np.array(numbers) @ np.array([[c, s], [-s, c]]) + place[:2])
