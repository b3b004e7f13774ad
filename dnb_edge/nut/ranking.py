"""The drivers of a campaign in order: what each came to over its seeds, how sure that is, and how far the order can be trusted.

Knows results of drives as plain values. All drivers drive the same seeds, and some seeds are harder for all: so drivers are
compared seed by seed (paired t test, Holm's correction), and the order is tried on resamples of the seeds, the same for all.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import combinations, pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dnb_edge.nut.campaign import TrialResult
from dnb_edge.score.compare import Estimate, Sample, compared, estimate
from dnb_edge.score.student import two_sided_p

RESAMPLES = 2000
_SEED = 20_262
_TRIFLE = 1e-9

_Values: TypeAlias = NDArray[np.float64]


class RankBy(StrEnum):
    """What drivers are ranked by."""

    SCORE = "score"
    """The mean over the seeds of `TrialResult.score`: most is best."""
    PACE = "pace"
    """The mean over the seeds of `TrialResult.pace`: most is best."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """One driver over all of its seeds."""

    entry: str
    place: int
    """From 1; drivers with equal figures share the lesser."""
    drives: int
    completed: int
    """Drives in which all wanted laps were driven."""
    failed: int
    """Drives in which the driver failed."""
    laps: int
    valid_laps: int
    wanted_laps: int
    collisions: int
    score: Estimate
    """Percent; see `TrialResult.score`."""
    pace: Estimate
    """Laps a minute; see `TrialResult.pace`."""
    time_s: Estimate | None
    """Official lap time, a mean of each completed seed; None where none was completed."""
    to_start_s: Estimate | None
    """Simulated seconds until the first lap began."""
    error_ms: float | None
    """The greatest difference between a lap as it was told and as it was driven."""
    letters: str | None
    """Drivers that share a letter cannot be told apart at 95 % by what they are ranked by; None with a single seed."""
    place_share: float | None
    """Resamples of the seeds in which it has that place, 0..1; None with a single seed or driver."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignRanking:
    """All drivers in order."""

    task: str
    by: RankBy
    seeds: int
    rows: tuple[Standing, ...]
    disjoint: bool
    """Whether the 95 % intervals of neighbours do not overlap; False with a single driver or where an interval is missing."""
    order_share: float | None
    """Resamples of the seeds in which the whole order is the same, 0..1."""


def ranked(task: str, results: Sequence[TrialResult], by: RankBy) -> CampaignRanking:
    """The ranking of all drivers in `results`, each of which drove the same seeds. Their order does not matter."""
    of: dict[str, list[TrialResult]] = {}
    for one in sorted(results, key=lambda one: (one.entry, one.seed)):
        of.setdefault(one.entry, []).append(one)
    measure = _score_of if by is RankBy.SCORE else _pace_of
    figure_of = {name: _over_seeds(some, measure) for name, some in of.items()}
    names = sorted(of, key=lambda name: (-figure_of[name].mean, name))
    figures = [figure_of[name] for name in names]
    table = np.array([[measure(one) for one in of[name]] for name in names])
    letters, holds = _letters(table), _holds(table)
    rows = (
        _standing(
            name,
            of[name],
            place=1 + sum(other.mean > figures[i].mean for other in figures),
            letters=letters[i],
            place_share=None if holds is None else holds[0][i],
        )
        for i, name in enumerate(names)
    )
    return CampaignRanking(
        task=task,
        by=by,
        seeds=len({one.seed for one in results}),
        rows=tuple(rows),
        disjoint=len(names) > 1 and all(_apart(one, other) for one, other in pairwise(figures)),
        order_share=None if holds is None else holds[1],
    )


def _standing(
    name: str, drives: Sequence[TrialResult], *, place: int, letters: str | None, place_share: float | None
) -> Standing:
    return Standing(
        entry=name,
        place=place,
        drives=len(drives),
        completed=sum(one.completed for one in drives),
        failed=sum(one.failure is not None for one in drives),
        laps=sum(len(one.laps) for one in drives),
        valid_laps=sum(lap.valid for one in drives for lap in one.laps),
        wanted_laps=sum(one.wanted_laps for one in drives),
        collisions=sum(one.collisions for one in drives),
        score=_over_seeds(drives, _score_of),
        pace=_over_seeds(drives, _pace_of),
        time_s=_lap_time(drives),
        to_start_s=_to_start(drives),
        error_ms=max((error for one in drives if (error := one.worst_error_ms) is not None), default=None),
        letters=letters,
        place_share=place_share,
    )


def _letters(table: _Values) -> tuple[str | None, ...]:
    """Groups of drivers that cannot be told apart; `table` has a row for each driver, a column for each seed."""
    drivers, seeds = len(table), len(table[0])
    if seeds < 2:
        return (None,) * drivers
    p_values = {(i, j): _paired_p(table[i] - table[j]) for i, j in combinations(range(drivers), 2)}
    return compared(p_values, range(drivers), candidates=drivers).letters


def _paired_p(differences: _Values) -> float:
    """Probability of differences at least so far from 0 on average, were there none: Student's paired t test, two-sided."""
    mean, spread = float(differences.mean()), float(differences.std(ddof=1))
    if spread <= _TRIFLE:
        return 1.0 if abs(mean) <= _TRIFLE else 0.0
    return two_sided_p(mean / spread * math.sqrt(len(differences)), len(differences) - 1.0)


def _holds(table: _Values) -> tuple[list[float], float] | None:
    """(share of resamples of the seeds in which each driver, best first, has its place; in which all have); None where there
    is nothing to resample. One seed fewer is drawn than there are, as in `score.ranking`."""
    drivers, seeds = len(table), len(table[0])
    if drivers < 2 or seeds < 2:
        return None
    draws = np.random.default_rng(_SEED).integers(seeds, size=(RESAMPLES, seeds - 1))
    # Rounded, so that equal draws in another order are equal.
    means = np.round(table[:, draws].mean(axis=2), 9)
    places = 1 + (means[None, :, :] > means[:, None, :]).sum(axis=1)
    whole = np.round(table.mean(axis=1), 9)
    same = places == (1 + (whole[None, :] > whole[:, None]).sum(axis=1))[:, None]
    return same.mean(axis=1).tolist(), float(same.all(axis=0).mean())


def _score_of(result: TrialResult) -> float:
    return result.score


def _pace_of(result: TrialResult) -> float:
    return result.pace


def _over_seeds(drives: Sequence[TrialResult], measure: Callable[[TrialResult], float]) -> Estimate:
    """Each seed counts alike."""
    figure = estimate(Sample(values=(measure(one),)) for one in drives)
    assert figure is not None, "every drive has that figure"
    return figure


def _lap_time(drives: Sequence[TrialResult]) -> Estimate | None:
    """Of the completed drives; each counts alike."""
    completed = (one for one in drives if one.completed)
    return estimate(Sample(values=tuple(lap.official_s for lap in one.laps[: one.wanted_laps])) for one in completed)


def _to_start(drives: Sequence[TrialResult]) -> Estimate | None:
    return estimate(Sample(values=(one.to_start_s,)) for one in drives if one.to_start_s is not None)


def _apart(one: Estimate, other: Estimate) -> bool:
    if one.low is None or other.low is None or one.high is None or other.high is None:
        return False
    return one.low > other.high or other.low > one.high
