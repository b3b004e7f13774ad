"""The instant at which a signed distance is zero, from noisy stamped samples round it, and how sure that is.

Knows numbers only: seconds, metres, variances. Which samples belong to a crossing, and whether it is one, is `crossing`'s.

Round the crossing's instant t* the signed distance is h(t) = b u + c u^2 / 2 + r(u), u = t - t*, with a departure r from the
parabola whose acceleration is a Wiener process on either side of t*, of intensity q (m^2/s^5): what a driver does to the pedal
is the less known the longer before or after. Hence

    cov(r(u), r(w)) = q (y^5 / 5 + d y^4 / 2 + d^2 y^3 / 3) / 4,    y = min(|u|, |w|), d = ||u| - |w||, for u w > 0, else 0,

so samples far from t* count the less the further they are, by themselves, and a gap at the line widens sigma by what a car can
do in it. The fit is generalised least squares (Aitken) under that covariance and that of the samples, times s^2.

Neither s, by how much the samples' own sigmas are wrong, nor q is known. Both are averaged over, on a grid: each point of it
has the weight of its restricted likelihood (D. A. Harville, J. Am. Stat. Assoc. 72, 1977) times its prior. The variance is that
of the mixture, which has the width of Student's distribution where samples are few. The posterior of one crossing, part of it
forgotten, is the prior of the next.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SCALES: Floats = 2.0 ** np.arange(-2.0, 3.01, 0.125)
"""Grid of s: from a quarter of what the samples say to eight times as much."""

JERKS: Floats = np.array([0.1, 1.0, 10.0, 100.0, 1e3, 1e4, 1e5])
"""Grid of q / v^2, 1/s^3: 0.1 is a car whose acceleration wanders by 0.22 m/s^2 within half a second at 1 m/s."""

LEAST_SPEED_MPS = 0.5
"""Slower cars can accelerate as much as one of this speed."""

_SCALE_SPREAD = math.log(2.0)
"""Standard deviation of ln s before anything was seen: a detector's own sigma is right within a factor of two."""

_JERK_SLOPE = 1.0
"""How much less likely is each next point of JERKS before anything was seen, natural log."""

_MEMORY = 0.9
"""Share of what was learnt that one more crossing leaves."""

_LEAST_LOG = -10.0
"""No point of the grid is ever thought less likely than this against the likeliest: the next crossing may be another."""

FEW = 5
"""With fewer samples the acceleration is not told by them; it is then 0 with the spread below."""

ACCELERATION_SIGMA_MPS2 = 4.0

_PASSES = 6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Samples:
    """What was measured round one crossing, n samples in the order of time."""

    t_s: Floats
    """(n,) seconds, from any origin near the crossing."""
    across_m: Floats
    """(n,) signed distance from the line, metres."""
    along_m: Floats
    """(n,) place along the line, metres from its start."""
    variance_m2: Floats
    """(n,) of `across_m`."""
    stamp_sigma_s: Floats
    """(n,) one sigma of each sample's own stamp, seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Instant:
    """When, how surely, how fast and where the line was crossed."""

    t_s: float
    """Seconds, from the samples' origin."""
    sigma_s: float
    speed_mps: float
    """Across the line; positive."""
    along_m: float


class Belief:
    """What is thought of s and q: logarithms of weights, shape (len(SCALES), len(JERKS)), greatest 0."""

    __slots__ = ("logs",)

    def __init__(self, logs: Floats | None = None) -> None:
        self.logs = _prior() if logs is None else logs

    def after(self, likelihood: Floats) -> Belief:
        """The belief for the next crossing, after one whose log likelihood over the grid is `likelihood`."""
        first = _prior()
        learnt = first + _MEMORY * (self.logs + likelihood - first)
        return Belief(np.maximum(learnt - learnt.max(), _LEAST_LOG))


def find_instant(samples: Samples, near_s: float, forward: bool, belief: Belief) -> tuple[Instant, Belief] | None:
    """The instant near `near_s` at which the samples pass zero, upwards where `forward`, and the belief after it.

    None where no line of that direction goes through them: the car stands, as far as one can tell.
    """
    sense = 1.0 if forward else -1.0
    measured = np.column_stack((sense * samples.across_m, samples.along_m))
    t, at_s = samples.t_s, near_s
    speed = _slope(t, measured[:, 0])
    for _ in range(_PASSES):
        variance = samples.variance_m2 + (speed * samples.stamp_sigma_s) ** 2
        fits = _fit(t - at_s, measured, variance, max(speed, LEAST_SPEED_MPS))
        usable = fits.values[:, :, 1, 0] > 0
        if not usable.any():
            return None
        logs = np.where(usable, belief.logs + fits.likelihood, -np.inf)
        weights = np.exp(logs - logs.max())
        weights /= weights.sum()
        slopes = np.where(usable, fits.values[:, :, 1, 0], 1.0)
        steps = np.clip(-fits.values[:, :, 0, 0] / slopes, t[0] - at_s, t[-1] - at_s)
        step = float((weights * steps).sum())
        speed = float((weights * slopes).sum())
        at_s += step
        if abs(step) < 1e-8:
            break
    spread = fits.variances / slopes**2 + (steps - step) ** 2
    along = fits.values[:, :, 0, 1] + steps * fits.values[:, :, 1, 1]
    instant = Instant(
        t_s=at_s,
        sigma_s=math.sqrt(float((weights * spread).sum())),
        speed_mps=speed,
        along_m=float((weights * along).sum()),
    )
    return instant, belief.after(fits.likelihood)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Fits:
    """The fits for all points of the grid."""

    values: Floats
    """(scales, jerks, 3 or 2, 2): value, slope and curvature at u = 0, across and along the line."""
    variances: Floats
    """(scales, jerks) of the value across the line."""
    likelihood: Floats
    """(scales, jerks) log."""


def _fit(u: Floats, measured: Floats, variance_m2: Floats, speed_mps: float) -> _Fits:
    """The fits of `measured` (n, 2) at `u` (n,) for the whole grid, by one eigendecomposition of the departure's covariance."""
    root = np.sqrt(variance_m2)
    spread = departure_covariance(u) * speed_mps**2 / np.outer(root, root)
    eigenvalues, vectors = np.linalg.eigh(spread)
    degree = 2 if len(u) >= FEW else 1
    design = vectors.T @ (np.vander(u, degree + 1, increasing=True) / root[:, None])
    turned = vectors.T @ (measured / root[:, None])
    # (scales, jerks, n): the covariance is diagonal here.
    diagonal = SCALES[:, None, None] ** 2 + JERKS[None, :, None] * np.maximum(eigenvalues, 0.0)
    weights = 1.0 / diagonal
    normal = np.einsum("sjn,na,nb->sjab", weights, design, design, optimize=True)
    right = np.einsum("sjn,na,nb->sjab", weights, design, turned, optimize=True)
    inverse = np.linalg.inv(normal)
    values = inverse @ right
    chi2 = np.einsum("sjn,n->sj", weights, turned[:, 0] ** 2) - (values[..., 0] * right[..., 0]).sum(axis=-1)
    likelihood = -0.5 * (chi2 + np.log(diagonal).sum(axis=-1) + np.linalg.slogdet(normal)[1])
    return _Fits(values=values, variances=inverse[:, :, 0, 0], likelihood=likelihood)


def expected_sigma_s(u: Floats, *, sigma_m: float, speed_mps: float) -> float:
    """The sigma that the instant will have from samples `u` (n,) seconds from the crossing, of `sigma_m` each, of a car that
    drives smoothly: the least of JERKS."""
    degree = 2 if len(u) >= FEW else 1
    jerk = JERKS[0] * max(speed_mps, LEAST_SPEED_MPS) ** 2
    design = np.vander(u, degree + 1, increasing=True)
    spread = sigma_m**2 * np.eye(len(u)) + jerk * departure_covariance(u)
    return math.sqrt(float(np.linalg.inv(design.T @ np.linalg.solve(spread, design))[0, 0])) / speed_mps


def departure_covariance(u: Floats) -> Floats:
    """(n, n) covariance of the departure from the parabola at `u` (n,) seconds from the crossing, m^2, for q = 1 m^2/s^5."""
    lag = np.abs(u)
    near = np.minimum(lag[:, None], lag[None, :])
    apart = np.abs(lag[:, None] - lag[None, :])
    one_side = (u[:, None] > 0) == (u[None, :] > 0)
    covariance = near**3 * (near * near / 5.0 + apart * near / 2.0 + apart * apart / 3.0) / 4.0
    return np.asarray(np.where(one_side, covariance, 0.0))


def _prior() -> Floats:
    of_scale = -0.5 * (np.log(SCALES) / _SCALE_SPREAD) ** 2
    of_jerk = -_JERK_SLOPE * np.arange(len(JERKS))
    return np.asarray(of_scale[:, None] + of_jerk[None, :])


def _slope(t_s: Floats, x_m: Floats) -> float:
    """Of the straight line through the samples, metres per second; not negative."""
    away = t_s - t_s.mean()
    return max(float(away @ x_m) / float(away @ away), 0.0)
