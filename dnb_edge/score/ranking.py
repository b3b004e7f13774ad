"""How far an order of candidates can be trusted: their ranks in resamples of the runs.

Knows numbers in groups, as `compare` does. The bootstrap of Efron, Ann. Stat. 7, 1 (1979), over runs where a candidate has
several and over the laps of its only one. Each resample draws one unit fewer than there are, which gives means the spread that
they have (McCarthy and Snowden, Vital and Health Statistics 2-95, 1985); as many as there are would show too little of it.
Runs that come in pairs, one of each candidate under the very same conditions, are drawn together. Draws come from a fixed seed:
the same runs give the same figures.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dnb_edge.score.compare import CONFIDENCE, Sample
from dnb_edge.score.share import Tally

RESAMPLES = 2000
_SEED = 20_261

Unit: TypeAlias = tuple[float, float]
"""A sum and what it is over; a candidate's figure is the sum of the first for the sum of the second."""

_Values: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where a candidate stands. Ranks count from 1, the best; equal ones share the lesser."""

    rank: int
    """By its figure over everything."""
    low: int
    """Within `low` and `high` it is in 95 % of the resamples."""
    high: int
    share: float
    """Resamples in which it has `rank`, 0..1."""
    shares: tuple[float, ...]
    """For each rank, from 1: resamples in which it has that."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranking:
    """The order of the candidates by one figure."""

    places: tuple[Place | None, ...]
    """None for a candidate of whose spread nothing is known, which has no rank."""
    order_share: float | None
    """Resamples in which all have the ranks that they have over everything, 0..1; None where fewer than two are ranked."""


def mean_units(runs: Iterable[Sample]) -> tuple[Unit, ...]:
    """What a mean is over: its runs' means, or the values of its only run."""
    kept = [run.values for run in runs if run.values]
    if len(kept) == 1:
        return tuple((value, 1.0) for value in kept[0])
    return tuple((math.fsum(values) / len(values), 1.0) for values in kept)


def share_units(runs: Iterable[Tally]) -> tuple[Unit, ...]:
    """What a share is over: its runs, or the attempts of its only run."""
    kept = [run for run in runs if run.attempts]
    if len(kept) == 1:
        return tuple((float(k < kept[0].successes), 1.0) for k in range(kept[0].attempts))
    return tuple((float(run.successes), float(run.attempts)) for run in kept)


def joint_units(runs: Sequence[Sequence[Sample | Tally]]) -> list[tuple[Unit, ...]] | None:
    """The units of candidates whose runs all come in the same pairs, in the order of these, so that all can be drawn together;
    a run without a value is a unit of nothing. None where they do not, or there are fewer than two.
    """
    pairs = [[run.pair for run in of_one] for of_one in runs]
    names = {pair for of_one in pairs for pair in of_one if pair is not None}
    if len(names) < 2 or any(set(of_one) != names or len(of_one) != len(names) for of_one in pairs):
        return None
    return [tuple(_unit(run) for run in sorted(of_one, key=lambda run: str(run.pair))) for of_one in runs]


def _unit(run: Sample | Tally) -> Unit:
    if isinstance(run, Tally):
        return (float(run.successes), float(run.attempts))
    return (math.fsum(run.values) / len(run.values), 1.0) if run.values else (0.0, 0.0)


def ranking(
    candidates: Sequence[Sequence[Unit]], *, most_is_best: bool, joint: bool = False, resamples: int = RESAMPLES
) -> Ranking:
    """The order of `candidates` and how it holds. One without any unit comes last in every resample; one with a single unit, or
    of which nobody else is to be compared with, has no place. The order of a candidate's units changes nothing, unless they are
    drawn together (`joint`, with units from `joint_units`): then a resample has the same runs of all.
    """
    ranked = [i for i, units in enumerate(candidates) if len(units) != 1]
    if len(ranked) < 2 or not any(weight for i in ranked for _, weight in candidates[i]):
        return Ranking(places=(None,) * len(candidates), order_share=None)
    sign = -1.0 if most_is_best else 1.0
    rows = [
        _resampled(candidates[i], 0, resamples) if joint else _resampled(sorted(candidates[i]), number, resamples)
        for number, i in enumerate(ranked)
    ]
    drawn = sign * np.stack(rows)
    drawn[~np.isfinite(drawn)] = np.inf
    whole = np.array([np.inf if (figure := _figure(candidates[i])) is None else sign * figure for i in ranked])
    ranks, own = _ranks(drawn), _ranks(whole[:, None])
    places: list[Place | None] = [None] * len(candidates)
    for row, i in enumerate(ranked):
        places[i] = _place(ranks[row], int(own[row, 0]), len(ranked))
    return Ranking(places=tuple(places), order_share=float((ranks == own).all(axis=0).mean()))


def _figure(units: Sequence[Unit]) -> float | None:
    """None where the units come to nothing."""
    weight = math.fsum(weight for _, weight in units)
    return math.fsum(value for value, _ in units) / weight if weight else None


def _resampled(units: Sequence[Unit], number: int, resamples: int) -> _Values:
    """The figure in each resample; NaN where there is none."""
    if not units:
        return np.full(resamples, np.nan)
    draw = np.random.Generator(np.random.PCG64((_SEED, number)))
    sums = np.array(units)[draw.integers(len(units), size=(resamples, len(units) - 1))].sum(axis=1)
    # Rounded, so that equal draws in another order are equal.
    figures: _Values = np.divide(sums[:, 0], sums[:, 1], out=np.full(resamples, np.nan), where=sums[:, 1] > 0.0)
    return figures.round(9)


def _ranks(figures: _Values) -> NDArray[np.int64]:
    """Ranks (candidates, resamples) from 1 where the least figure is the best: one more than how many are better."""
    order = np.argsort(figures, axis=0, kind="stable")
    sorted_ = np.take_along_axis(figures, order, axis=0)
    places = np.arange(len(figures), dtype=np.int64)[:, None]
    new = np.concatenate([np.ones((1, figures.shape[1]), dtype=bool), sorted_[1:] != sorted_[:-1]])
    ranks = np.empty(figures.shape, dtype=np.int64)
    np.put_along_axis(ranks, order, 1 + np.maximum.accumulate(np.where(new, places, 0), axis=0), axis=0)
    return ranks


def _place(ranks: NDArray[np.int64], own: int, count: int) -> Place:
    shares = np.bincount(ranks, minlength=count + 1)[1:] / len(ranks)
    outside = (1 - CONFIDENCE) / 2
    low, high = np.quantile(ranks, (outside, 1 - outside), method="inverted_cdf")
    return Place(rank=own, low=int(low), high=int(high), share=float(shares[own - 1]), shares=tuple(shares.tolist()))
