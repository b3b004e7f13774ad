"""Which keypoints contradict the others: one clicked wrongly, two exchanged, a twin that is mirrored.

Knows places with their noise (`weighted`). Knows no names, no file and no words. The noise that is stated beforehand counts as
if it had been seen in `PRIOR_FREEDOM` numbers, so that the places' own scatter takes over where there are many.

Outliers are found by a forward search (Atkinson and Riani, Robust Diagnostic Regression Analysis, 2000): from the half of the
places that agree best (least trimmed squares over fits to four, Rousseeuw 1984) the fit grows by the nearest place at a time,
until the nearest one left is further off than noise puts it: d' (noise + the map's own covariance)^-1 d / 2 against
Fisher's F of 2 and all degrees of freedom so far, at 1 % over all places together (Bonferroni). Then all that are left must
stand out together, too, against every choice of as many.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import Points
from dnb_edge.view.weighted import Floats, NoFitError, WeightedPoints, fit_weighted, plain_fit

PRIOR_FREEDOM = 4
"""How many numbers the stated sigma is worth beside those seen."""

LEVEL = 0.01
"""Chance of a false alarm, all keypoints of a calibration together."""

_ODDS = 100.0
"""So many times likelier must the places be without the outlier than without any other, or it is not told which is wrong."""

_SWAP_GAIN = 5.0
"""Exchanging two twin points must bring the mean error down by this factor..."""
_SWAP_LEAD = 3.0
"""...and be better than any other exchange by this one."""

_FITS_TO_FOUR = 1000
_STARTS = 5
_SETTLED = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """What contradicts the other places, by index."""

    outliers: tuple[int, ...] = ()
    suspects: tuple[int, ...] = ()
    """Places of which one is wrong, and it cannot be told which."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Swap:
    """Two places whose twin points seem exchanged."""

    first: int
    second: int
    before_px: float
    """Mean error over all places, twin px, as they are..."""
    after_px: float
    """...and with the two exchanged."""


def variance_factor(chi_squared: float, freedom: int) -> float:
    """By what the stated variances must be multiplied: (PRIOR_FREEDOM + chi_squared) / (PRIOR_FREEDOM + freedom), the scaled
    inverse chi-square's estimate with its prior at 1.
    """
    return (PRIOR_FREEDOM + chi_squared) / (PRIOR_FREEDOM + freedom)


def f_tail(f: float, even: int, other: int) -> float:
    """Chance that Fisher's F of (even, other) degrees of freedom exceeds f; `even` is an even number, which makes the beta
    function a sum (Abramowitz and Stegun 26.6.4).
    """
    x = other / (other + even * f)
    term, total = 1.0, 0.0
    for j in range(even // 2):
        total += term
        term *= (0.5 * other + j) / (j + 1) * (1.0 - x)
    return float(min(1.0, total * x ** (0.5 * other)))


def disagree(points: WeightedPoints) -> bool:
    """Whether the places contradict one another by more than the stated noise makes them, at `LEVEL`."""
    freedom = 2 * len(points) - 8
    if freedom <= 0:
        return False
    try:
        chi_squared = fit_weighted(points).chi_squared
    except NoFitError:
        return True
    return f_tail(chi_squared / freedom, freedom, PRIOR_FREEDOM) < LEVEL


def most_outliers(count: int) -> int:
    """How many wrong ones of so many places can be told: the search starts from the others."""
    return max(0, count - _half(count))


def find_outliers(points: WeightedPoints) -> Findings:
    """The places that the others contradict. With five a fault shows, but not where; with four none shows."""
    n = len(points)
    if n < 5:
        return Findings()
    if n == 5:
        return Findings(suspects=tuple(range(n)) if disagree(points) else ())
    inside = _most_alike(points)
    if inside is None:
        return Findings()
    while len(inside) < n:
        fit = fit_weighted(points.at(np.array(inside)))
        outside = [k for k in range(n) if k not in inside]
        far = fit.distances(points.at(np.array(outside)))
        nearest = int(np.argmin(far))
        freedom = 2 * len(inside) - 8
        factor = variance_factor(fit.chi_squared, freedom)
        if n * f_tail(float(far[nearest]) / (2 * factor), 2, PRIOR_FREEDOM + freedom) < LEVEL and _stands_out(
            points, inside
        ):
            return _told_apart(points, inside, outside)
        inside = sorted([*inside, outside[nearest]])
    return Findings()


def find_swap(points: WeightedPoints) -> Swap | None:
    """The two places whose exchange on the twin mends the map, where one exchange alone does."""
    n = len(points)
    before = _mean_error(points.ideal_px, points.twin_px)
    if n == 4 and before is not None:
        return None
    if n > 4 and not disagree(points):
        return None
    tried: list[tuple[float, int, int]] = []
    for i, j in combinations(range(n), 2):
        order = np.arange(n)
        order[[i, j]] = j, i
        after = _mean_error(points.ideal_px, points.twin_px[order])
        if after is not None:
            tried.append((after, i, j))
    tried.sort()
    if not tried:
        return None
    after, i, j = tried[0]
    folded = _mean_error(points.ideal_px, points.twin_px, folded=True)
    was = math.inf if folded is None else folded
    runner_up = tried[1][0] if len(tried) > 1 else math.inf
    # With four places every exchange that fits at all fits exactly.
    better = len(tried) == 1 if n == 4 else (after * _SWAP_GAIN < was and after * _SWAP_LEAD < runner_up)
    return Swap(first=i, second=j, before_px=was, after_px=after) if better else None


def is_mirrored(points: WeightedPoints) -> bool:
    """Whether the places run the other way round on the twin than in the picture."""
    return (
        _mean_error(points.ideal_px, points.twin_px) is None
        and _mean_error(points.ideal_px, points.twin_px * (-1.0, 1.0)) is not None
    )


def _stands_out(points: WeightedPoints, inside: list[int]) -> bool:
    """Whether leaving all others out mends the fit by more than it would for the worst of all choices of as many: those
    inside were chosen for agreeing, which makes what is left look worse than it is.
    """
    out = len(points) - len(inside)
    freedom = PRIOR_FREEDOM + 2 * len(inside) - 8
    within = fit_weighted(points.at(np.array(inside))).chi_squared
    try:
        gain = fit_weighted(points).chi_squared - within
    except NoFitError:
        return True
    f = max(0.0, gain) / (2 * out) / ((PRIOR_FREEDOM + within) / freedom)
    return math.comb(len(points), out) * f_tail(f, 2 * out, freedom) < LEVEL


def _told_apart(points: WeightedPoints, inside: list[int], outside: list[int]) -> Findings:
    """The outliers, or the suspects where leaving out another place explains as much."""
    freedom = 2 * len(inside) - 8
    best = fit_weighted(points.at(np.array(inside))).chi_squared
    rivals = set()
    for wrong in outside:
        for right in inside:
            other = sorted({*inside, wrong} - {right})
            try:
                chi_squared = fit_weighted(points.at(np.array(other))).chi_squared
            except NoFitError:
                continue
            odds = ((PRIOR_FREEDOM + chi_squared) / (PRIOR_FREEDOM + best)) ** (0.5 * (PRIOR_FREEDOM + freedom))
            if odds < _ODDS:
                rivals |= {wrong, right}
    if rivals:
        return Findings(outliers=tuple(k for k in outside if k not in rivals), suspects=tuple(sorted(rivals)))
    return Findings(outliers=tuple(outside))


def _most_alike(points: WeightedPoints) -> list[int] | None:
    """The half of the places (and a little more) that agree best with one map; None where no four fix one."""
    n = len(points)
    half = _half(n)
    squares = _squares_by_fours(points)
    if not len(squares):
        return None
    scores = np.sort(squares, axis=1)[:, :half].sum(axis=1)
    best: tuple[float, list[int]] | None = None
    for row in np.argsort(scores)[:_STARTS]:
        chosen = np.sort(np.argsort(squares[row], kind="stable")[:half])
        settled = _settled(points, chosen, half)
        if settled is not None and (best is None or settled[0] < best[0]):
            best = settled
    return None if best is None else best[1]


def _half(count: int) -> int:
    return max(5, (count + 5) // 2)


def _settled(points: WeightedPoints, chosen: NDArray[np.intp], half: int) -> tuple[float, list[int]] | None:
    """Fit, take the nearest half, and again, until they stay: (chi squared, places)."""
    try:
        for _ in range(_SETTLED):
            fit = fit_weighted(points.at(chosen))
            nearest = np.sort(np.argsort(fit.distances(points), kind="stable")[:half])
            if np.array_equal(nearest, chosen):
                break
            chosen = nearest
        return fit_weighted(points.at(chosen)).chi_squared, chosen.tolist()
    except NoFitError:
        return None


def _squares_by_fours(points: WeightedPoints) -> Floats:
    """(m, n): squared distances of all places, over the click's variance, from the map that four of them fix exactly."""
    n = len(points)
    fours = np.array(list(combinations(range(n), 4))) if n <= 12 else _some_fours(n)
    centre_p, centre_q = points.ideal_px.mean(axis=0), points.twin_px.mean(axis=0)
    p, q = points.ideal_px - centre_p, points.twin_px - centre_q
    p, q = p / np.abs(p).max(), q / np.abs(q).max()
    x, y = q[fours, 0], q[fours, 1]
    u, v = p[fours, 0], p[fours, 1]
    one, none = np.ones_like(x), np.zeros_like(x)
    rows_u = np.stack((x, y, one, none, none, none, -u * x, -u * y), axis=2)
    rows_v = np.stack((none, none, none, x, y, one, -v * x, -v * y), axis=2)
    system = np.concatenate((rows_u, rows_v), axis=1)
    sound = np.abs(np.linalg.det(system)) > 1e-12
    answer = np.linalg.solve(system[sound], np.concatenate((u, v), axis=1)[sound][:, :, None])[:, :, 0]
    g = np.concatenate((answer, np.ones((len(answer), 1))), axis=1).reshape(-1, 3, 3)
    h = np.column_stack((q, np.ones(n))) @ g.transpose(0, 2, 1)
    w = np.where(h[:, :, 2] > 1e-9, h[:, :, 2], np.nan)
    off = (h[:, :, :2] / w[:, :, None] - p) * np.abs(points.ideal_px - centre_p).max()
    variance = 0.5 * np.trace(points.click_cov_px2, axis1=1, axis2=2)
    return np.asarray(np.nan_to_num((off**2).sum(axis=2) / variance, nan=1e18))


def _some_fours(n: int) -> NDArray[np.intp]:
    chance = np.random.default_rng(n)
    return np.array([chance.choice(n, 4, replace=False) for _ in range(_FITS_TO_FOUR)])


def _mean_error(ideal_px: Points, twin_px: Points, *, folded: bool = False) -> float | None:
    """Mean error of plain least squares, twin px; None for a map that is mirrored or, unless `folded` ones are wanted too,
    has places beyond the horizon.
    """
    try:
        matrix = plain_fit(ideal_px, twin_px)
    except NoFitError:
        return None
    h = np.column_stack((ideal_px, np.ones(len(ideal_px)))) @ matrix.T
    sign = 1.0 if np.median(h[:, 2]) > 0 else -1.0
    # A plane seen from above keeps its sense of turning: det H / w^3 is that of d(twin px)/d(ideal px).
    if not folded and not ((h[:, 2] * sign > 0).all() and np.linalg.det(matrix) * sign > 0):
        return None
    return float(np.hypot(*(h[:, :2] / h[:, 2:] - twin_px).T).mean())
