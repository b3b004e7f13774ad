"""The drivers of a campaign in order: what each came to over its seeds, how sure that is, and how far the order can be trusted.

Knows results of drives as plain values; the statistics are those of result tables (`score`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

from dnb_edge.nut.campaign import TrialResult
from dnb_edge.score.compare import Estimate, Sample, compare, estimate
from dnb_edge.score.ranking import Place, mean_units, ranking


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
    """Drivers that share a letter cannot be told apart at 95 % (Welch, Holm) by what they are ranked by."""
    place_share: float | None
    """Resamples of the seeds in which it has that place, 0..1."""
    place_low: int | None
    """Within `place_low` and `place_high` it is in 95 % of them."""
    place_high: int | None


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
    """The ranking of all drivers in `results`. Their order does not matter."""
    of: dict[str, list[TrialResult]] = {}
    for one in sorted(results, key=lambda one: (one.entry, one.seed)):
        of.setdefault(one.entry, []).append(one)
    measure = _score_of if by is RankBy.SCORE else _pace_of
    figure_of = {name: _over_seeds(some, measure) for name, some in of.items()}
    worth = {name: float("-inf") if figure is None else figure.mean for name, figure in figure_of.items()}
    names = sorted(of, key=lambda name: (-worth[name], name))
    figures = [figure_of[name] for name in names]
    order = ranking([mean_units(_samples(of[name], measure)) for name in names], most_is_best=True)
    letters = compare(figures).letters
    rows = (
        _standing(
            name,
            of[name],
            place=1 + sum(other > worth[name] for other in worth.values()),
            letters=letters[i],
            trust=order.places[i],
        )
        for i, name in enumerate(names)
    )
    return CampaignRanking(
        task=task,
        by=by,
        seeds=len({one.seed for one in results}),
        rows=tuple(rows),
        disjoint=len(names) > 1 and all(_apart(one, other) for one, other in pairwise(figures)),
        order_share=order.order_share,
    )


def _standing(
    name: str, drives: Sequence[TrialResult], *, place: int, letters: str | None, trust: Place | None
) -> Standing:
    score, pace = _over_seeds(drives, _score_of), _over_seeds(drives, _pace_of)
    assert score is not None, "every drive has a score"
    assert pace is not None, "every drive has a pace"
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
        score=score,
        pace=pace,
        time_s=_over_seeds(drives, _time_of),
        to_start_s=_over_seeds(drives, _start_of),
        error_ms=max((error for one in drives if (error := one.worst_error_ms) is not None), default=None),
        letters=letters,
        place_share=None if trust is None else trust.share,
        place_low=None if trust is None else trust.low,
        place_high=None if trust is None else trust.high,
    )


def _score_of(result: TrialResult) -> tuple[float, ...]:
    return (result.score,)


def _pace_of(result: TrialResult) -> tuple[float, ...]:
    return (result.pace,)


def _time_of(result: TrialResult) -> tuple[float, ...]:
    if not result.completed:
        return ()
    return tuple(lap.official_s for lap in result.laps[: result.wanted_laps])


def _start_of(result: TrialResult) -> tuple[float, ...]:
    return () if result.to_start_s is None else (result.to_start_s,)


def _samples(drives: Sequence[TrialResult], measure: Callable[[TrialResult], tuple[float, ...]]) -> list[Sample]:
    """One run each, so that each seed counts alike."""
    return [Sample(values=measure(one)) for one in drives]


def _over_seeds(drives: Sequence[TrialResult], measure: Callable[[TrialResult], tuple[float, ...]]) -> Estimate | None:
    return estimate(_samples(drives, measure))


def _apart(one: Estimate | None, other: Estimate | None) -> bool:
    if one is None or other is None or one.low is None or other.low is None or one.high is None or other.high is None:
        return False
    return one.low > other.high or other.low > one.high
