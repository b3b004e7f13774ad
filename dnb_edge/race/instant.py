"""The instant at which a signed distance is zero, from noisy stamped samples round it, and how sure that is.

Knows numbers only: seconds, metres, variances. Which samples belong to a crossing, and whether it is one, is `crossing`'s.

Round the crossing's instant t* the signed distance is h(t) = b u + c u^2 / 2 + r(u), u = t - t*, with a departure r from the
parabola whose acceleration is a Wiener process on either side of t*, of intensity q (m^2/s^5): what a driver does to the pedal
is the less known the longer before or after. Its jerk is taken as constant over stretches from one knot to the next: a stretch
from a to b has jerk of variance q / (b - a), and moves the car by ((u - a)+^3 - (u - b)+^3) / 6 times that. All together
var r(u) = q |u|^5 / 20, so samples far from t* count the less the further they are, by themselves, and a gap at the line widens
sigma by what a car can do in it. The fit is generalised least squares (Aitken) under that covariance and that of the
samples, times s^2.

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

JERKS: Floats = np.array([0.01, 0.1, 1.0, 10.0, 100.0, 1e3, 1e4, 1e5])
"""Grid of q / v^2, 1/s^3: 0.1 is a car whose acceleration wanders by 0.22 m/s^2 in half a second at 1 m/s; at 1e5 it jolts."""

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
"""With fewer samples the acceleration is not told by them; it is then taken as 0."""

_KNOTS: Floats = np.array([0.0, 0.08, 0.17, 0.3, 0.47, 0.7, 1.0])
"""Between the crossing and the last sample on either side, as shares of the time between them."""

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
    """The fits of `measured` (n, 2) at `u` (n,) for the whole grid.

    In units of the samples' sigmas their covariance is s^2 I + q B B^T. With the few eigenvectors U and eigenvalues l of B B^T
    that are not zero, its inverse is I / s^2 within their complement and 1 / (s^2 + q l) along each.
    """
    root = np.sqrt(variance_m2)[:, None]
    degree = 2 if len(u) >= FEW else 1
    # The design and what was measured, side by side.
    columns = np.hstack((np.vander(u, degree + 1, increasing=True), measured)) / root
    departures = stretches(u) * speed_mps / root
    eigenvalues, vectors = np.linalg.eigh(departures.T @ departures)
    kept = eigenvalues > max(float(eigenvalues[-1]), 1e-12) * 1e-9
    eigenvalues = eigenvalues[kept]
    along = (departures @ (vectors[:, kept] / np.sqrt(eigenvalues))).T @ columns
    rest = columns.T @ columns - along.T @ along
    products = (along[:, :, None] * along[:, None, :]).reshape(len(along), rest.size)
    variances = (SCALES**2)[:, None]
    diagonal = variances[:, :, None] + JERKS[None, :, None] * eigenvalues
    gram = ((1.0 / diagonal) @ products).reshape(*diagonal.shape[:2], *rest.shape) + rest / variances[:, :, None, None]
    normal, right = gram[:, :, : degree + 1, : degree + 1], gram[:, :, : degree + 1, degree + 1 :]
    inverse = np.linalg.inv(normal)
    values = inverse @ right
    chi2 = gram[:, :, degree + 1, degree + 1] - (values[..., 0] * right[..., 0]).sum(axis=-1)
    size = np.log(diagonal).sum(axis=-1) + (len(u) - len(eigenvalues)) * np.log(variances)
    likelihood = -0.5 * (chi2 + size + np.linalg.slogdet(normal)[1])
    return _Fits(values=values, variances=inverse[:, :, 0, 0], likelihood=likelihood)


def stretches(u: Floats) -> Floats:
    """(n, stretches) how far each stretch of jerk moves the car at `u` (n,) seconds from the crossing, one sigma, metres, for
    q = 1 m^2/s^5."""
    sides = []
    for lag in (np.maximum(u, 0.0), np.maximum(-u, 0.0)):
        knots = _KNOTS * max(float(lag.max()), 1e-3)
        moved = np.maximum(lag[:, None] - knots, 0.0) ** 3 / 6.0
        sides.append((moved[:, :-1] - moved[:, 1:]) / np.sqrt(np.diff(knots)))
    return np.hstack(sides)


def expected_sigma_s(u: Floats, *, sigma_m: float, speed_mps: float) -> float:
    """The sigma that the instant will have from samples `u` (n,) seconds from the crossing, of `sigma_m` each, of a car that
    drives smoothly: the least of JERKS."""
    degree = 2 if len(u) >= FEW else 1
    departures = stretches(u) * max(speed_mps, LEAST_SPEED_MPS) * math.sqrt(JERKS[0])
    design = np.vander(u, degree + 1, increasing=True)
    spread = sigma_m**2 * np.eye(len(u)) + departures @ departures.T
    return math.sqrt(float(np.linalg.inv(design.T @ np.linalg.solve(spread, design))[0, 0])) / speed_mps


def _prior() -> Floats:
    of_scale = -0.5 * (np.log(SCALES) / _SCALE_SPREAD) ** 2
    of_jerk = -_JERK_SLOPE * np.arange(len(JERKS))
    return np.asarray(of_scale[:, None] + of_jerk[None, :])


def _slope(t_s: Floats, x_m: Floats) -> float:
    """Of the straight line through the samples, metres per second; not negative."""
    away = t_s - t_s.mean()
    return max(float(away @ x_m) / float(away @ away), 0.0)
