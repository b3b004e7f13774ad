"""The camera's pose from squares of one known size that lie anywhere on the floor, at places that nobody measured.

Knows corners in camera px with their covariance, the squares' size and, where they are known, the lens, the camera's height and
some squares' measured places. Knows no picture and no twin. Frame of reference, *foot m*: right-handed metres on the floor, the
origin below the camera, x along the picture's rows as the start has it, y away from the camera; z up.

Bundle adjustment (Triggs et al., Bundle Adjustment - A Modern Synthesis, 2000) by Levenberg and Marquardt's method over the
plane's tilt and distance and each square's place and turn; where no lens is known also its focal length, its optical centre and
its first radial coefficient, the last two held near what lenses have.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.view.least_squares import Fit, minimise
from dnb_edge.view.lens import Lens, LensModel
from dnb_edge.view.marker_edges import MarkerFit
from dnb_edge.view.marker_start import CORNERS, Start, likely_starts, local_points, turn

FloatArray = NDArray[np.float64]

FEWEST = 3

_STARTS = 3
_GOOD_MISFIT = 1.5
"""With this no other start can do better."""
_HEIGHT_SIGMA = 0.01
"""How well people measure the camera's height, as a share of it, one standard deviation."""
_OFF_CENTRE_SIGMA = 0.01
"""How far an unknown lens's optical centre is from the picture's middle along either axis, as a share of the width."""
_BENDING_SIGMA = 0.15
"""Size of k1 of an unknown lens."""
_STEEPEST_DEG = 80.0
_VAGUEST_HEIGHT = 0.06
"""An estimated height of a greater sigma than this share of it is none."""
_WORST_MISFIT_PX = 1.5
_ODD_MISFIT = 3.0
_ODD_PX = 0.3
_BETTER = 0.5
"""A marker is set aside where the others alone fit better than this share of all together."""
_STEP = 1e-6
_FIELDS_DEG = np.geomspace(20.0, 140.0, 15)
_BASE = 7
"""Tilt about foot x, about foot y, ln height; of an unknown lens ln focal length, optical centre u and v, k1."""


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
        step = np.zeros(_BASE) if change is None else change
        rotation = self.rotation @ turn(np.array([step[0], step[1], 0.0]))
        return floor_homography(self.lens_at(step).matrix, rotation, self.height_m * math.exp(float(step[2])))

    def lens_at(self, change: FloatArray) -> Lens:
        """The lens with `change` (7,) added to the first seven parameters."""
        return _lens_like(self.lens, change)


def solve_markers(
    markers: Sequence[MarkerFit],
    optics: Optics,
    *,
    size_m: float,
    height_m: float | None = None,
    measured: Sequence[MeasuredPoint] = (),
) -> MarkerSolution:
    """The pose from `markers`, all of side `size_m`. `height_m` is the camera's measured height; it counts for an unknown lens.

    A marker that is not like the others is set aside where three others are left. Raises `InputError` for fewer than three
    markers, and where they fit no camera or do not tell its height.
    """
    kept = list(markers)
    aside: tuple[int, ...] = ()
    solution = _solve(kept, optics, size_m, height_m, measured, aside)
    while _suspicious(solution):
        others = [[one for one in kept if one is not odd] for odd in kept] if len(kept) > FEWEST else []
        tried = [
            _solve(few, optics, size_m, height_m, measured, (*aside, odd.number))
            for few, odd in zip(others, kept, strict=False)
        ]
        best = min(tried, key=lambda one: one.misfit, default=None)
        if best is None or best.misfit > _BETTER * solution.misfit or 3 * len(best.aside) > len(markers):
            break
        solution, aside = best, best.aside
        kept = [one for one in kept if one.number not in aside]
    _check_pose(solution, height_m)
    return solution


def _solve(
    markers: Sequence[MarkerFit],
    optics: Optics,
    size_m: float,
    height_m: float | None,
    measured: Sequence[MeasuredPoint],
    aside: tuple[int, ...],
) -> MarkerSolution:
    if len(markers) < FEWEST:
        raise InputError(f"{_count(len(markers))}: lay at least {FEWEST} in view, better 4 to 8, spread over the floor")
    best: MarkerSolution | None = None
    for start in likely_starts(_ideal_px(markers, optics), _lenses(optics), size_m)[:_STARTS]:
        problem = _Problem(
            markers=tuple(markers),
            optics=optics,
            size_m=size_m,
            height_m=None if optics.lens is not None else height_m,
            measured=tuple(point for point in measured if point.number in {marker.number for marker in markers}),
            start=start,
        )
        solution = problem.solve(aside)
        if solution is not None and (best is None or solution.misfit < best.misfit):
            best = solution
        if best is not None and best.misfit < _GOOD_MISFIT:
            break
    if best is None:
        raise InputError(
            "the markers fit no camera above a floor: check that all lie flat and that --lens is this camera's"
        )
    return best


def _rms_px(solution: MarkerSolution) -> float:
    return float(np.sqrt((solution.residual_px**2).mean()))


def _suspicious(solution: MarkerSolution) -> bool:
    """Whether the corners fit so badly that a marker may be of another size, bent or moved."""
    return solution.misfit > _ODD_MISFIT and _rms_px(solution) > _ODD_PX


def _check_pose(solution: MarkerSolution, height_m: float | None) -> None:
    """Raises `InputError` where the solution is no camera, or says nothing of its height."""
    if _rms_px(solution) > _WORST_MISFIT_PX:
        raise InputError(
            "the markers do not lie as squares of one size on one flat floor: check that every sheet lies flat and was printed "
            "at one size, and that --lens is this camera's"
        )
    if solution.optics.lens is not None or height_m is not None:
        return
    vague = solution.height_sigma_m / solution.height_m
    if solution.pitch_deg > _STEEPEST_DEG or vague > _VAGUEST_HEIGHT:
        raise InputError(
            f"the camera looks {solution.pitch_deg:.0f} degrees down: without its lens the markers do not tell how high it is: "
            "measure the height from the floor to the lens and give --height, or calibrate the lens and give --lens"
        )


def _count(count: int) -> str:
    return (
        "no floor marker is seen" if count == 0 else f"only {count} floor marker{'s are' if count > 1 else ' is'} seen"
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Problem:
    """The residuals of one set of markers about one start."""

    markers: tuple[MarkerFit, ...]
    optics: Optics
    size_m: float
    height_m: float | None
    measured: tuple[MeasuredPoint, ...]
    start: Start

    def solve(self, aside: tuple[int, ...]) -> MarkerSolution | None:
        """The solution nearest to the start; None where there is none."""
        count = len(self.markers)
        first = np.concatenate((np.zeros(_BASE), self.start.places.ravel(), self._first_frame()))
        free = np.ones(len(first), dtype=np.bool_)
        free[3:_BASE] = self.optics.lens is None
        free[-3:] = bool(self.measured)
        fit = minimise(self._residuals, first, free)
        if fit is None:
            return None
        misfit = math.sqrt(fit.cost / fit.freedom)
        p = fit.parameters
        try:
            lens = self.optics.lens if self.optics.lens is not None else _lens_like(self.start.lens, p)
        except InputError:
            return None  # bent so far that the picture folds over: no lens does that
        return MarkerSolution(
            optics=self.optics,
            size_m=self.size_m,
            rotation=self._rotation(p),
            height_m=self._height(p),
            lens=lens,
            numbers=tuple(marker.number for marker in self.markers),
            corners_px=np.array([marker.camera_px for marker in self.markers]),
            places=p[_BASE : _BASE + 3 * count].reshape(count, 3),
            frame=p[-3:],
            covariance=self._with_lens_sigmas(fit, max(1.0, misfit) ** 2),
            residual_px=np.linalg.norm(self._apart(p), axis=2),
            aside=aside,
            misfit=misfit,
        )

    def _rotation(self, p: FloatArray) -> FloatArray:
        return np.asarray(self.start.rotation @ turn(np.array([p[0], p[1], 0.0])))

    def _height(self, p: FloatArray) -> float:
        return self.start.height_m * math.exp(min(float(p[2]), 50.0))

    def _apart(self, p: FloatArray) -> FloatArray:
        """(n, 4, 2) of where the corners are seen less where `p` has them, ideal px of a known lens, else camera px."""
        flat = floor_homography(np.eye(3), self._rotation(p), self._height(p))
        x, y, angle = p[_BASE:-3].reshape(-1, 3).T[:, :, None]
        across, up = self.size_m * CORNERS.T[:, None, :]
        points = np.stack(
            (x + np.cos(angle) * across - np.sin(angle) * up, y + np.sin(angle) * across + np.cos(angle) * up), axis=2
        )
        homogeneous = np.concatenate((points, np.ones((*points.shape[:2], 1))), axis=2) @ flat.T
        depth = homogeneous[..., 2:]
        ahead = homogeneous[..., :2] / np.where(depth > 0.0, depth, np.nan)
        # What is not estimated is zero in `p`: a known lens is one without bending.
        bent = ahead * (1.0 + p[6] * (ahead**2).sum(axis=2, keepdims=True))
        lens = self.start.lens
        focal = np.array([lens.fx_px, lens.fy_px]) * math.exp(min(float(p[3]), 50.0))
        return np.asarray(_ideal_px(self.markers, self.optics) - bent * focal - (lens.cx_px, lens.cy_px) - p[4:6])

    def _residuals(self, p: FloatArray) -> FloatArray:
        apart = self._apart(p).reshape(len(self.markers), 8)
        parts = [np.einsum("nij,nj->ni", self._whitening(), apart).ravel()]
        if self.optics.lens is None:
            parts += [p[4:6] / (_OFF_CENTRE_SIGMA * self.optics.width_px), p[6:7] / _BENDING_SIGMA]
        if self.height_m is not None:
            parts.append(np.array([math.log(self._height(p) / self.height_m) / _HEIGHT_SIGMA]))
        places = dict(zip((marker.number for marker in self.markers), p[_BASE:-3].reshape(-1, 3), strict=True))
        for point in self.measured:
            at = local_points([point.local], places[point.number], self.size_m)
            parts.append((to_frame(at, p[-3:])[0] - point.at_m) / point.sigma_m)
        return np.concatenate(parts)

    def _whitening(self) -> FloatArray:
        # With L L^T = C^-1 the elements of L^T r are independent and of unit variance.
        inverse = np.linalg.inv(np.array([marker.covariance_px2 for marker in self.markers]))
        return np.asarray(np.linalg.cholesky(inverse).transpose(0, 2, 1))

    def _with_lens_sigmas(self, fit: Fit, factor: float) -> FloatArray:
        """The covariance where the given lens is not quite right either: its numbers are not estimated, but count ("consider"
        parameters; Jazwinski, Stochastic Processes and Filtering Theory, 1970, 8.4)."""
        total = fit.inverse * factor
        sigmas = self.optics.lens_sigmas
        if self.optics.lens is None or not any(sigmas):
            return total
        for k, sigma in zip((3, 4, 5), sigmas, strict=True):
            step = np.zeros(len(fit.parameters))
            step[k] = _STEP
            slope = (self._residuals(fit.parameters + step) - self._residuals(fit.parameters - step)) / (2.0 * _STEP)
            moved = -fit.inverse @ fit.jacobian.T @ slope
            moved[k] = 1.0
            total = total + np.outer(moved, moved) * sigma**2
        return np.asarray(total)

    def _first_frame(self) -> FloatArray:
        """The measured frame (3,) in foot m by the start's places; zeros where nothing is measured."""
        if not self.measured:
            return np.zeros(3)
        places = dict(zip((marker.number for marker in self.markers), self.start.places, strict=True))
        here = np.array([local_points([m.local], places[m.number], self.size_m)[0] for m in self.measured])
        return fit_frame(here, np.array([m.at_m for m in self.measured]))


def _ideal_px(markers: Sequence[MarkerFit], optics: Optics) -> FloatArray:
    """(n, 4, 2) corners, ideal px where the lens is known, else camera px."""
    corners = np.array([marker.camera_px for marker in markers])
    return corners if optics.lens is None else optics.lens.to_ideal_px(corners.reshape(-1, 2)).reshape(-1, 4, 2)


def _lenses(optics: Optics) -> list[Lens]:
    """The lens, or lenses of all usual fields of view."""
    if optics.lens is not None:
        return [optics.lens]
    u, v = optics.middle_px()
    focals = 0.5 * optics.width_px / np.tan(0.5 * np.radians(_FIELDS_DEG))
    return [
        Lens(
            model=LensModel.PINHOLE, fx_px=focal, fy_px=focal, cx_px=u, cy_px=v, distortion=(0.0, 0.0, 0.0, 0.0),
            width_px=optics.width_px, height_px=optics.height_px,
        )
        for focal in focals.tolist()
    ]  # fmt: skip


def _lens_like(lens: Lens, p: FloatArray) -> Lens:
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
