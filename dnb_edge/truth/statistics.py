"""The certificate's arithmetic: quantiles, shares with intervals, and errors that share crossings or last over frames.

Two laps in a row share a crossing: its error lengthens one and shortens the other, so neighbouring laps' errors are correlated
(about -1/2), and within one drive their sum is only the last crossing's error less the first one's. Nothing here treats laps as
independent: whole drives are. The interval of a share comes from the spread between drives (the design effect of a cluster
sample, Kish 1965), by Wilson's formula with as many laps as would be worth the same if they were independent. Pure functions.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnb_edge.score.student import two_sided_quantile

Z95 = 1.959963984540054
"""Two-sided 95 % of a normal distribution, in standard deviations."""

LAGS = 20
"""Lags, in frames, for which correlations are told."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Share:
    """A share with its 95 % interval."""

    hits: int
    count: int
    share: float
    low: float
    high: float
    design_effect: float
    """By how much more (or less, below 1) the share varies than it would if all were independent."""


def wilson(share: float, count: float, z: float = Z95) -> tuple[float, float]:
    """Wilson's interval (1927) of a share found in `count` independent trials; `count` need not be whole."""
    if count <= 0:
        return 0.0, 1.0
    middle = (share + z * z / (2 * count)) / (1 + z * z / count)
    half = z / (1 + z * z / count) * math.sqrt(share * (1 - share) / count + z * z / (4 * count * count))
    # At the ends the formula meets the share itself but for rounding.
    return max(0.0, min(share, middle - half)), min(1.0, max(share, middle + half))


def clustered_share(drives: Sequence[Sequence[bool]]) -> Share | None:
    """The share of True over all drives, its interval from the spread between drives; None where there is nothing."""
    full = [np.asarray(drive, dtype=np.float64) for drive in drives if len(drive)]
    count = sum(len(drive) for drive in full)
    if not count:
        return None
    hits = float(sum(drive.sum() for drive in full))
    share = hits / count
    effect = _design_effect(full, share, count)
    low, high = wilson(share, count / effect)
    return Share(hits=round(hits), count=count, share=share, low=low, high=high, design_effect=effect)


def _design_effect(drives: Sequence[NDArray[np.float64]], share: float, count: int) -> float:
    """Variance of the share between drives over that of as many independent trials, at least 1: never a narrower interval
    than independent laps would give. 1 where too few drives, or all alike, tell nothing.
    """
    plain = count * share * (1 - share)
    if len(drives) < 2 or plain <= 0.0:
        return 1.0
    between = sum(float((drive - share).sum()) ** 2 for drive in drives) * len(drives) / (len(drives) - 1)
    return max(1.0, between / plain)


def clustered_mean(drives: Sequence[Sequence[float]]) -> tuple[float, float] | None:
    """(mean, half width of its 95 % interval) over all drives' values, from the spread between drives (Student's t).

    None where there are no values; the half width is that of independent values where there is one drive only.
    """
    full = [np.asarray(drive, dtype=np.float64) for drive in drives if len(drive)]
    if not full:
        return None
    every = np.concatenate(full)
    mean, count = float(every.mean()), len(every)
    if len(full) < 2:
        if count < 2:
            return mean, 0.0
        return mean, two_sided_quantile(0.95, count - 1) * float(every.std(ddof=1)) / math.sqrt(count)
    between = sum(float((drive - mean).sum()) ** 2 for drive in full) * len(full) / (len(full) - 1)
    return mean, two_sided_quantile(0.95, len(full) - 1) * math.sqrt(between) / count


def quantiles(values: Sequence[float]) -> dict[str, float | None]:
    """p50, p95 and the greatest of `values`; None each where there are none."""
    if not len(values):
        return {"p50": None, "p95": None, "max": None}
    p50, p95 = np.percentile(np.asarray(values, dtype=np.float64), [50, 95]).tolist()
    return {"p50": p50, "p95": p95, "max": float(np.max(values))}


def reliability(z: Sequence[float], levels: Sequence[float]) -> list[float]:
    """Share of |z| within each of `levels`, in stated sigmas."""
    sizes = np.abs(np.asarray(z, dtype=np.float64))
    return [float(np.mean(sizes <= level)) for level in levels]


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorSeries:
    """One drive's errors of the observed ground point, frame by frame, in stated sigmas."""

    frame: NDArray[np.int64]
    """(n,) the frames' numbers, rising; frames without an observation are left out."""
    place_m: NDArray[np.float64]
    """(n,) distance along the lap."""
    z: NDArray[np.float64]
    """(n,) error along one axis over the sigma stated for it."""


def correlation(series: Sequence[ErrorSeries], lags: int = LAGS) -> list[float | None]:
    """Autocorrelation of the errors at lags 0, 1 ... in frames, about each drive's mean; None where no pair is so far apart."""
    sums, pairs, squares, count = np.zeros(lags), np.zeros(lags), 0.0, 0
    for one in series:
        if not len(one.z):
            continue
        filled = np.full(int(one.frame[-1] - one.frame[0]) + 1, np.nan)
        filled[one.frame - one.frame[0]] = one.z - one.z.mean()
        squares, count = squares + float(np.nansum(filled**2)), count + len(one.z)
        for lag in range(min(lags, len(filled))):
            products = filled[: len(filled) - lag] * filled[lag:]
            sums[lag] += float(np.nansum(products))
            pairs[lag] += int(np.count_nonzero(~np.isnan(products)))
    if squares <= 0.0:
        return [None] * lags
    variance = squares / count
    return [float(s / n / variance) if n else None for s, n in zip(sums.tolist(), pairs.tolist(), strict=True)]


def without_place(series: Sequence[ErrorSeries], cell_m: float = 0.05) -> list[ErrorSeries]:
    """What is left of each drive's errors when the mean of their place is taken away, made larger by what that mean has itself
    taken of chance: this part differs from lap to lap. Cells with one frame tell nothing and are left out.
    """
    rest = []
    for one in series:
        cells = (
            np.unique(np.floor(one.place_m / cell_m), return_inverse=True)[1] if len(one.z) else np.zeros(0, np.intp)
        )
        counts = np.bincount(cells)
        means = np.bincount(cells, weights=one.z) / np.maximum(counts, 1)
        several = counts[cells] > 1
        share = np.sqrt(counts[cells] / np.maximum(counts[cells] - 1, 1))
        left = (one.z - means[cells]) * share
        rest.append(ErrorSeries(frame=one.frame[several], place_m=one.place_m[several], z=left[several]))
    return rest


def repeated_share(series: Sequence[ErrorSeries], cell_m: float = 0.05) -> float | None:
    """Share of the errors' variance that repeats at the same place of each lap: it cancels between a lap's two crossings.

    An estimate without the part that chance puts into the cells' means (analysis of variance, one way); None where no cell
    has two frames.
    """
    repeated, total, degrees = 0.0, 0.0, 0
    for one in series:
        if len(one.z) < 3:
            continue
        cells = np.unique(np.floor(one.place_m / cell_m), return_inverse=True)[1]
        counts = np.bincount(cells)
        means = np.bincount(cells, weights=one.z) / counts
        within = float(((one.z - means[cells]) ** 2).sum())
        spare = len(one.z) - len(counts)
        if spare <= 0:
            continue
        total += float(((one.z - one.z.mean()) ** 2).sum())
        repeated += float((counts * (means - one.z.mean()) ** 2).sum()) - (len(counts) - 1) * within / spare
        degrees += 1
    return max(0.0, repeated / total) if degrees and total > 0.0 else None


def window_variance_ratio(correlations: Sequence[float | None], frames: int) -> float | None:
    """Variance of the mean over `frames` neighbouring errors over what it would be if they were independent."""
    if frames < 1 or any(value is None for value in correlations[:frames]) or len(correlations) < frames:
        return None
    known = [value for value in correlations[:frames] if value is not None]
    return 1.0 + 2.0 * sum((1.0 - lag / frames) * known[lag] for lag in range(1, frames))
