"""The map that fits keypoints and found edges together best: robust least squares over a homography's eight numbers.

Knows points and lines with their sigmas. Knows no picture: `refine_look` finds the edges. Everything is weighed in camera px,
where clicking and finding edges err.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import Points
from dnb_edge.view.ground import GroundMap, Matrix3
from dnb_edge.view.lens import Lens

Floats = NDArray[np.float64]

_BEHIND = -1e6
"""Camera px of what lies behind the camera: outside any picture."""

_LEAST_DEPTH = 1e-9

_TUKEY = 4.685
"""Tukey's biweight: edges further off than so many scales have no say; 95 % efficient for normal errors."""

_LEAST_SCALE_PX = 0.25
_STEPS = 12
_HARDLY = 30.0
"""By so much the known points' sigmas are raised to see what the edges say by themselves."""
_STILL_PX = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaneToPicture:
    """Twin px to camera px by eight numbers: a homography between coordinates of about unit size, its last number 1."""

    twin_middle: Floats
    twin_size: float
    ideal_middle: Floats
    ideal_size: float
    lens: Lens | None
    norm: float
    """Frobenius norm that `camera_to_twin` keeps."""

    @classmethod
    def about(cls, ground: GroundMap, twin_px: Points) -> PlaneToPicture:
        """Coordinates that suit `ground` and the twin px (n, 2) of interest."""
        middle = twin_px.mean(axis=0)
        return cls(
            twin_middle=middle,
            twin_size=float(np.abs(twin_px - middle).max()),
            ideal_middle=np.array([ground.width_px / 2.0, ground.height_px / 2.0]),
            ideal_size=ground.width_px / 2.0,
            lens=ground.lens,
            norm=float(np.linalg.norm(ground.camera_to_twin)),
        )

    def parameters(self, camera_to_twin: Matrix3 | Floats) -> Floats:
        """The eight numbers (8,) of a homography, ideal px -> twin px."""
        to_ideal = np.linalg.inv(np.asarray(camera_to_twin, dtype=np.float64).reshape(3, 3))
        g = np.linalg.inv(_spread(self.ideal_middle, self.ideal_size)) @ to_ideal
        g = g @ _spread(self.twin_middle, self.twin_size)
        return np.asarray((g / g[2, 2]).ravel()[:8])

    def camera_to_twin(self, p: Floats) -> Floats:
        """The homography (3, 3), ideal px -> twin px, of the eight numbers; positive depth where theirs is."""
        h = np.linalg.inv(self._to_ideal(p))
        return np.asarray(h * (self.norm / np.linalg.norm(h)))

    def project(self, p: Floats, twin_px: Points) -> Points:
        """Camera px (n, 2) of twin px (n, 2); far outside where they lie behind the camera."""
        ideal, depth, _ = self._ideal(p, twin_px)
        ahead = (depth > _LEAST_DEPTH)[:, None]
        if self.lens is not None:
            ideal = self.lens.to_camera_px(np.where(ahead, ideal, self.ideal_middle))
        return np.where(ahead, ideal, _BEHIND)

    def slopes(self, p: Floats, twin_px: Points) -> Floats:
        """d(camera px)/d(parameters), shape (n, 2, 8)."""
        ideal, depth, (x, y) = self._ideal(p, twin_px)
        u, v = ((ideal - self.ideal_middle) / self.ideal_size).T
        one, none = np.ones_like(x), np.zeros_like(x)
        across = np.stack((x, y, one, none, none, none, -u * x, -u * y), axis=1)
        down = np.stack((none, none, none, x, y, one, -v * x, -v * y), axis=1)
        flat = np.stack((across, down), axis=1) * (self.ideal_size / depth)[:, None, None]
        if self.lens is None:
            return np.asarray(flat)
        columns = [
            self.lens.to_camera_px(ideal + step) - self.lens.to_camera_px(ideal - step) for step in 0.5 * np.eye(2)
        ]
        return np.asarray(np.stack(columns, axis=2) @ flat)

    def _ideal(self, p: Floats, twin_px: Points) -> tuple[Points, Floats, Floats]:
        """Ideal px (n, 2), depths (n,), not below the least, and the twin's coordinates (2, n) of twin px (n, 2)."""
        x, y = at = ((twin_px - self.twin_middle) / self.twin_size).T
        depth = np.maximum(p[6] * x + p[7] * y + 1.0, _LEAST_DEPTH)
        unit = np.column_stack(((p[0] * x + p[1] * y + p[2]) / depth, (p[3] * x + p[4] * y + p[5]) / depth))
        return unit * self.ideal_size + self.ideal_middle, depth, at

    def covariance9(self, p: Floats, covariance: Floats) -> Floats:
        """The parameters' covariance (8, 8) as that of `camera_to_twin`'s nine numbers, (9, 9)."""
        columns = []
        for k in range(8):
            step = np.zeros(8)
            step[k] = 1e-6
            columns.append((self.camera_to_twin(p + step) - self.camera_to_twin(p - step)).ravel() / 2e-6)
        jacobian = np.column_stack(columns)
        return np.asarray(jacobian @ covariance @ jacobian.T)

    def information(self, camera_to_twin: Matrix3, covariance: Floats) -> Floats:
        """Inverse (8, 8) of the parameters' covariance, from that of a map's nine numbers, (9, 9)."""
        h = np.array(camera_to_twin)
        columns = []
        for k in range(9):
            step = np.zeros(9)
            step[k] = 1e-6 * max(abs(h[k]), 1e-9)
            columns.append((self.parameters(h + step) - self.parameters(h - step)) / (2.0 * step[k]))
        jacobian = np.column_stack(columns)
        return np.asarray(np.linalg.pinv(jacobian @ covariance @ jacobian.T, rcond=1e-12))

    def _to_ideal(self, p: Floats) -> Floats:
        g = _spread(self.ideal_middle, self.ideal_size) @ np.append(p, 1.0).reshape(3, 3)
        return np.asarray(g @ np.linalg.inv(_spread(self.twin_middle, self.twin_size)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KnownPoints:
    """What holds the map besides the edges: clicked keypoints, or the present map with its covariance."""

    twin_px: Points
    camera_px: Points
    """Shape (n, 2) each; empty where there are no keypoints."""
    sigma_px: float
    """Of a click along either axis, camera px."""
    at: Floats
    information: Floats
    """The present map's parameters (8,) and the inverse of their covariance (8, 8); zeros where keypoints say it."""
    spare: int | None = None
    """Degrees of freedom from which `sigma_px` was estimated; None where it is known."""

    def weaker(self, times: float) -> KnownPoints:
        """The same with sigmas so many times as large."""
        return replace(self, sigma_px=self.sigma_px * times, information=self.information / times**2)

    def normal(self, plane: PlaneToPicture, p: Floats) -> tuple[Floats, Floats]:
        """These terms' normal matrix (8, 8) and right side (8,) about `p`."""
        matrix, side = self.information.copy(), self.information @ (self.at - p)
        if len(self.twin_px):
            slopes = plane.slopes(p, self.twin_px).reshape(-1, 8) / self.sigma_px
            off = (self.camera_px - plane.project(p, self.twin_px)).ravel() / self.sigma_px
            matrix += slopes.T @ slopes
            side += slopes.T @ off
        return matrix, side


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoundLines:
    """Short stretches of edge as found in the picture: a point of the twin lies on the line through `on_px` across
    `outward`. Arrays of n; camera px, but `twin_px`."""

    twin_px: Points
    on_px: Points
    outward: Points
    slot: NDArray[np.int64]
    """Place along the borders, as in `LaneEdges`."""

    def off_px(self, plane: PlaneToPicture, p: Floats) -> Floats:
        """How far outwards the found edge lies from where `p` puts it, (n,)."""
        return np.asarray(((self.on_px - plane.project(p, self.twin_px)) * self.outward).sum(axis=1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solved:
    """The fitted parameters."""

    p: Floats
    covariance: Floats
    """Of `p`, (8, 8)."""
    scale_px: float
    """Robust standard deviation of an edge about the fit, camera px."""
    run: float
    """About how many neighbouring edge points err alike: where the twin is drawn a little wrong, all along do."""
    weight: Floats
    """What each line had to say, 0..1."""
    tension: float
    """How surprising it is, in sigmas, that the edges' own map differs so much from the known points'; 0: not."""


def solve_points(plane: PlaneToPicture, p: Floats, known: KnownPoints) -> tuple[Floats, Floats]:
    """Parameters (8,) and covariance (8, 8) by the known points alone."""
    for _ in range(_STEPS):
        matrix, side = known.normal(plane, p)
        step = _solve(matrix, side)
        p = p + step
        if np.abs(step).max() < 1e-9:
            break
    return p, np.asarray(np.linalg.pinv(known.normal(plane, p)[0], rcond=1e-14, hermitian=True))


def solve(plane: PlaneToPicture, p: Floats, known: KnownPoints, lines: FoundLines) -> Solved:
    """The joint fit of known points and edges, from `p` on.

    How well edges tell is learnt where they are fitted by themselves: their scale about that fit, and how many neighbours
    err alike, so that n of them say no more than n / run independent ones would.
    """
    alone = _fit(plane, p, known.weaker(_HARDLY), lines, noise=None)
    together = _fit(plane, alone.p, known, lines, noise=(alone.scale_px, alone.run))
    return replace(together, tension=_tension(plane, alone, known))


def _fit(
    plane: PlaneToPicture, p: Floats, known: KnownPoints, lines: FoundLines, *, noise: tuple[float, float] | None
) -> Solved:
    """Iteratively reweighted least squares: Gauss and Newton's steps, Tukey's weights. `noise` is the edges' (scale, run);
    None to learn it.
    """
    off = lines.off_px(plane, p)
    scale_px, run = noise if noise is not None else (_scale_px(off, np.ones(len(off))), 1.0)
    weight = _tukey(off, scale_px)
    for _ in range(_STEPS):
        off = lines.off_px(plane, p)
        slopes = np.einsum("nij,ni->nj", plane.slopes(p, lines.twin_px), lines.outward)
        matrix, side = known.normal(plane, p)
        share = weight / (scale_px**2 * run)
        step = _solve(matrix + (slopes * share[:, None]).T @ slopes, side + slopes.T @ (share * off))
        moved = plane.project(p + step, lines.twin_px) - plane.project(p, lines.twin_px)
        p = p + step
        off = lines.off_px(plane, p)
        if noise is None:
            scale_px = _scale_px(off, weight)
        weight = _tukey(off, scale_px)
        if noise is None:
            run = _run(off, weight, lines.slot)
        if np.abs(moved).max() < _STILL_PX:
            break
    slopes = np.einsum("nij,ni->nj", plane.slopes(p, lines.twin_px), lines.outward)
    share = weight / (scale_px**2 * run)
    matrix = known.normal(plane, p)[0] + (slopes * share[:, None]).T @ slopes
    covariance = np.asarray(np.linalg.pinv(matrix, rcond=1e-14, hermitian=True))
    return Solved(p=p, covariance=covariance, scale_px=scale_px, run=run, weight=weight, tension=0.0)


def _tension(plane: PlaneToPicture, alone: Solved, known: KnownPoints) -> float:
    """How surprising it is that the edges' own map and the known points' differ so much, sigmas of a normal variable.

    The difference squared over its covariance, a degree of freedom, follows the F distribution; that is brought to a normal
    variable by Paulson's approximation, An approximate normalization of the analysis of variance distribution (1942).
    """
    points, covariance = solve_points(plane, known.at, known)
    apart = alone.p - points
    spread = np.linalg.pinv(alone.covariance + covariance, rcond=1e-14, hermitian=True)
    root = float(np.cbrt(max(0.0, float(apart @ spread @ apart)) / 8.0))
    ours, theirs = 2.0 / (9.0 * 8.0), 0.0 if known.spare is None else 2.0 / (9.0 * known.spare)
    return max(0.0, ((1.0 - theirs) * root - (1.0 - ours)) / float(np.sqrt(theirs * root**2 + ours)))


def with_own_sigma(plane: PlaneToPicture, known: KnownPoints) -> KnownPoints:
    """The keypoints with the sigma of a click by their residuals about their own fit; not below the one assumed.

    With four points nothing is left over to tell it.
    """
    spare = 2 * len(known.twin_px) - 8
    if spare <= 0:
        return known
    own, _ = solve_points(plane, known.at, known)
    off = known.camera_px - plane.project(own, known.twin_px)
    sigma_px = float(np.sqrt((off**2).sum() / spare))
    return known if sigma_px <= known.sigma_px else replace(known, sigma_px=sigma_px, spare=spare)


def _scale_px(off: Floats, weight: Floats) -> float:
    """Robust standard deviation about 0 of residuals (n,)."""
    heard = np.abs(off)[weight > 0]
    return max(_LEAST_SCALE_PX, 1.4826 * float(np.median(heard if len(heard) > 10 else np.abs(off))))


def _tukey(off: Floats, scale_px: float) -> Floats:
    return np.asarray(np.square(np.maximum(0.0, 1.0 - np.square(off / (_TUKEY * scale_px)))))


def _run(off: Floats, weight: Floats, slot: NDArray[np.int64]) -> float:
    """One plus twice the sum of the residuals' autocorrelation along the borders, up to where it ends."""
    series = np.zeros(int(slot.max()) + 1)
    there = np.zeros(len(series))
    series[slot], there[slot] = off * (weight > 0), weight > 0
    power = float((series**2).sum() / max(1.0, there.sum()))
    run = 1.0
    for lag in range(1, max(2, len(off) // 8)):
        pairs = float((there[lag:] * there[:-lag]).sum())
        if pairs < 20 or power == 0.0:
            break
        alike = float((series[lag:] * series[:-lag]).sum()) / pairs / power
        if alike < 0.05:
            break
        run += 2.0 * alike
    return run


def _solve(matrix: Floats, side: Floats) -> Floats:
    return np.asarray(np.linalg.lstsq(matrix, side, rcond=1e-14)[0])


def _spread(middle: Floats, size: float) -> Floats:
    """(3, 3) from coordinates of unit size to px."""
    return np.array([[size, 0.0, middle[0]], [0.0, size, middle[1]], [0.0, 0.0, 1.0]])
