"""What floor markers tell of the camera: the pose, the lens, each marker's place, and how sure all of that is.

Knows numbers and their geometry; how they are found is `marker_solve`'s knowledge. Frame of reference, *foot m*: right-handed
metres on the floor, the origin below the camera, x along the picture's rows as the search's start has it, y away; z up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dnb_edge.view.lens import Lens
from dnb_edge.view.marker_start import turn

FloatArray = NDArray[np.float64]

BASE = 7
"""Parameters before the places: tilt about foot x, about foot y, ln height, ln focal length, optical centre u and v, k1."""

_STEP = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Optics:
    """What is known of the camera: its lens, or only the picture's size."""

    width_px: int
    height_px: int
    lens: Lens | None
    lens_sigmas: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Of the lens: focal length as a share of it, optical centre u and v, px."""

    def middle_px(self) -> tuple[float, float]:
        """The picture's middle."""
        return (self.width_px - 1) / 2.0, (self.height_px - 1) / 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredPoint:
    """A point of a marker whose place on the floor somebody measured, in a frame of their own."""

    number: int
    local: tuple[float, float]
    """The point in units of the marker's side, from its middle, x right and y up as printed."""
    at_m: tuple[float, float]
    sigma_m: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MarkerSolution:
    """The pose, each marker's place, and the covariance of both."""

    optics: Optics
    size_m: float
    rotation: FloatArray
    """(3, 3) foot m to camera axes (x right, y down, z ahead)."""
    height_m: float
    lens: Lens
    """The lens that was given, or as it was estimated."""
    numbers: tuple[int, ...]
    corners_px: FloatArray
    """(n, 4, 2) corners as they were seen, camera px."""
    places: FloatArray
    """(n, 3): x and y, foot m, of each marker's middle, and the angle of its right as printed, anticlockwise from x, rad."""
    frame: FloatArray
    """(3,): the measured frame's origin, x and y, foot m, and its x axis's angle, rad; zeros where nothing was measured."""
    covariance: FloatArray
    """Of tilt about foot x, tilt about foot y, ln height, ln focal length, optical centre u and v (px), k1, the places row by
    row, and the frame."""
    residual_px: FloatArray
    """(n, 4) distance of each corner from where the solution has it, px."""
    aside: tuple[int, ...]
    """Numbers of markers that were set aside since they are not like the others."""
    misfit: float
    """Root of the weighted squares' sum over the degrees of freedom: 1 where the corners are as good as they were taken for."""

    @property
    def pitch_deg(self) -> float:
        """Angle of the optical axis below the horizon."""
        return math.degrees(math.asin(min(1.0, max(-1.0, -float(self.rotation[2, 2])))))

    @property
    def roll_deg(self) -> float:
        """Angle by which the picture's rows are turned clockwise from the horizon; 0 where the camera looks straight down."""
        level, upright = float(self.rotation[0, 2]), float(self.rotation[1, 2])
        return math.degrees(math.atan2(-level, -upright)) if math.hypot(level, upright) > 1e-3 else 0.0

    @property
    def height_sigma_m(self) -> float:
        """One standard deviation of `height_m`."""
        return self.height_m * math.sqrt(float(self.covariance[2, 2]))

    @property
    def pitch_sigma_deg(self) -> float:
        """One standard deviation of `pitch_deg`."""
        slope = np.zeros(2)
        for k in range(2):
            tilt = np.zeros(3)
            tilt[k] = _STEP
            ends = [-(self.rotation @ turn(sign * tilt))[2, 2] for sign in (1.0, -1.0)]
            slope[k] = np.diff(np.arcsin(np.clip(ends, -1.0, 1.0)))[0] / (2.0 * _STEP)
        # At straight down the pitch has an edge: a tilt either way lowers it.
        if self.pitch_deg > 89.0:
            slope = np.ones(2) / math.sqrt(2.0)
        return math.degrees(math.sqrt(float(slope @ self.covariance[:2, :2] @ slope)))

    @property
    def focal_sigma_px(self) -> float:
        """One standard deviation of the focal length; 0 where the lens was given."""
        return self.lens.fx_px * math.sqrt(float(self.covariance[3, 3]))

    def floor_homography(self, change: FloatArray | None = None) -> FloatArray:
        """(3, 3) foot m -> ideal px of `lens_at`; `change` (7,) is added to the first seven parameters."""
        step = np.zeros(BASE) if change is None else change
        rotation = self.rotation @ turn(np.array([step[0], step[1], 0.0]))
        return floor_homography(self.lens_at(step).matrix, rotation, self.height_m * math.exp(float(step[2])))

    def lens_at(self, change: FloatArray) -> Lens:
        """The lens with `change` (7,) added to the first seven parameters."""
        return lens_like(self.lens, change)


def lens_like(lens: Lens, p: FloatArray) -> Lens:
    """`lens` changed by the parameters `p` (7 or more)."""
    factor = math.exp(float(p[3]))
    k1, *others = lens.distortion
    return replace(
        lens, fx_px=lens.fx_px * factor, fy_px=lens.fy_px * factor, cx_px=lens.cx_px + float(p[4]),
        cy_px=lens.cy_px + float(p[5]), distortion=(k1 + float(p[6]), *others),
    )  # fmt: skip


def floor_homography(matrix: FloatArray, rotation: FloatArray, height_m: float) -> FloatArray:
    """(3, 3) foot m -> ideal px of a camera at (0, 0, `height_m`)."""
    return np.asarray(matrix @ np.column_stack((rotation[:, 0], rotation[:, 1], -height_m * rotation[:, 2])))


def fit_frame(here_m: FloatArray, there_m: FloatArray) -> FloatArray:
    """The frame (3,), origin and angle in foot m, in which the points `here_m` (n, 2), foot m, are nearest to `there_m`."""
    here, there = (points[:, 0] + 1j * points[:, 1] for points in (here_m, there_m))
    angle = float(np.angle(((here - here.mean()) * (there - there.mean()).conjugate()).sum()))
    origin = here.mean() - np.exp(1j * angle) * there.mean()
    return np.array([origin.real, origin.imag, angle])


def to_frame(foot_m: FloatArray, frame: FloatArray) -> FloatArray:
    """(n, 2) points in the frame (3,) of points (n, 2), foot m."""
    c, s = math.cos(float(frame[2])), math.sin(float(frame[2]))
    return np.asarray((foot_m - frame[:2]) @ np.array([[c, -s], [s, c]]))
