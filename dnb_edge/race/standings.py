"""Who is first: each car's laps to a value, the values to places, and what cannot be told apart to ties.

Knows judged laps and how a format ranks; knows nothing of how laps were timed or judged. All times are official ones,
penalties included. Warm-up laps count for nothing but the numbers of laps.

*Order.* Each ranking compares counts or scores first, exactly, and then at most one measured time. Cars whose race ended early
(`dnf`) come last, in the same order among themselves; not so under `driving_score` and `survival`, which measure just that.
Cars without a value come before those and after all others. What is equal throughout goes by the car's number.

*Ties.* Neighbours are tied where all that is compared exactly is equal and their times differ by no more than 1.96 times the
root of the sum of the squares of their sigmas: then the difference is within its own 95 % interval. Tied cars share the better
place. Ties go on in chains: where A and B are tied, and B and C, all three share A's place, even if A and C alone could be told
apart. So places never contradict the order of the times. Cars without a value are tied with each other.

*Sigmas.* A lap's variance is taken as half its start's and half its end's, for more is not known of it. In a sum of laps in a
row each shared crossing ends one lap and begins the next, so what it has wrong cancels, and the halves at both ends remain.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import fmean
from types import MappingProxyType

from dnb_edge.race.rules import FormatRules, Ranking
from dnb_edge.values import Lap, Penalty, Standing, Standings

TIE_SIGMAS = 1.96
"""Sigmas on either side of the 95 % interval of a normal distribution."""

UNITS: Mapping[Ranking, str] = MappingProxyType(
    {
        Ranking.BEST_LAP: "s",
        Ranking.BEST_CONSECUTIVE: "s",
        Ranking.BEST_AVERAGE: "s",
        Ranking.TOTAL_TIME: "s",
        Ranking.MOST_LAPS: "laps",
        Ranking.SIMILARITY: "percent",
        Ranking.DRIVING_SCORE: "percent",
        Ranking.SURVIVAL: "s",
    }
)
"""The unit of `Standing.value` under each ranking."""

_ENDS_COUNT = (Ranking.DRIVING_SCORE, Ranking.SURVIVAL)
"""Rankings in which an early end is measured, not put last."""

_MORE_IS_BETTER = (Ranking.MOST_LAPS, Ranking.SIMILARITY, Ranking.DRIVING_SCORE, Ranking.SURVIVAL)


@dataclass(frozen=True, slots=True, kw_only=True)
class CarResult:
    """What one car has done in its race so far."""

    car: int
    name: str
    laps: tuple[Lap, ...] = ()
    """Its complete laps, judged, in their order; warm-up laps included."""
    start_t_ns: int | None = None
    """Where its race began: the start that was given (grid), or its first crossing of the start line (rolling); None before."""
    elapsed_s: float | None = None
    """Time from there to the end of its race, or to now, seconds; None before its race began."""
    distance_m: float = 0.0
    """Metres of the route driven in its laps, those that were given up before the last left out."""
    running: float = 0.0
    """Share of the lap that runs, or in which its race ended, that it has driven, 0..1; 0 where none runs."""
    penalties: tuple[Penalty, ...] = ()
    """What incidents of that lap cost; see `penalties.judged_run`."""
    dnf: str | None = None
    """Why its race ended early, a sentence; None where it did not."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TheoreticalLap:
    """The lap that a car's best sectors would make."""

    time_s: float
    sigma_s: float
    laps: tuple[int, ...]
    """For each sector in its order the number of the lap in which it was fastest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rank:
    """What a car is ranked by; everything compares as less is better."""

    exact: tuple[float, ...] = ()
    """Compared first, and exactly."""
    time_s: float = 0.0
    """Compared next; tied within its uncertainty."""
    time_sigma_s: float = 0.0
    value: float
    sigma: float | None = None
    laps: int | None = None
    """Laps that count, where they are compared first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Row:
    result: CarResult
    rank: _Rank | None
    last: bool
    """Whether it did not finish, and for that comes last."""

    @property
    def key(self) -> tuple[object, ...]:
        if self.rank is None:
            return (self.last, True, (), 0.0, self.result.car)
        return (self.last, False, self.rank.exact, self.rank.time_s, self.result.car)


def standings(
    results: Iterable[CarResult],
    rules: FormatRules,
    laps_wanted: int | None,
    *,
    t_ns: int,
    t_s: float,
    final: bool,
) -> Standings:
    """The event that tells the standings at `t_ns`; see `classify`."""
    return Standings(
        t_ns=t_ns,
        t_s=t_s,
        rank_by=rules.rank_by.value,
        unit=UNITS[rules.rank_by],
        final=final,
        rows=classify(results, rules, laps_wanted),
    )


def classify(
    results: Iterable[CarResult],
    rules: FormatRules,
    laps_wanted: int | None,
) -> tuple[Standing, ...]:
    """A line for each car, the first first. `laps_wanted` is `race.laps`, which `driving_score` needs (`ValueError`)."""
    rows = sorted((_row(result, rules, laps_wanted) for result in results), key=lambda row: row.key)
    with_previous = [_tied(before, after) for before, after in pairwise(rows)]
    lines: list[Standing] = []
    for k, row in enumerate(rows):
        up, down = k > 0 and with_previous[k - 1], k < len(with_previous) and with_previous[k]
        place = lines[-1].place if up else k + 1
        lines.append(
            _line(row, rules, place=place, tied=up or down, leader=rows[0], ahead=rows[k - 1] if k > 0 else None)
        )
    return tuple(lines)


def best_theoretical(laps: Iterable[Lap]) -> TheoreticalLap | None:
    """The sum of the best sectors of the valid laps; None where a sector has no time in any of them, or there are none.

    Two sectors in a row from one lap share a crossing, which cancels; others are independent of each other.
    """
    best: dict[int, tuple[float, float, int]] = {}
    wanted = set()
    for lap in laps:
        for sector in lap.sectors:
            wanted.add(sector.number)
            if lap.valid and sector.time_s is not None:
                found = (sector.time_s, sector.sigma_s or 0.0, lap.number)
                best[sector.number] = min(best.get(sector.number, found), found)
    if not wanted or set(best) != wanted:
        return None
    sectors = [best[number] for number in sorted(best)]
    joined = [before[2] == after[2] for before, after in pairwise(sectors)]
    return TheoreticalLap(
        time_s=math.fsum(time_s for time_s, _, _ in sectors),
        sigma_s=_sum_sigma([sigma for _, sigma, _ in sectors], joined),
        laps=tuple(number for _, _, number in sectors),
    )


def official_s(lap: Lap) -> float:
    """The lap's time with its penalties, seconds; of a lap that was never judged, as timed."""
    return lap.time_s if lap.official_time_s is None else lap.official_time_s


def _row(result: CarResult, rules: FormatRules, laps_wanted: int | None) -> _Row:
    counted = sorted((lap for lap in result.laps if lap.number > rules.warm_up_laps), key=lambda lap: lap.number)
    rank = _rank(result, counted, rules, laps_wanted)
    return _Row(result=result, rank=rank, last=result.dnf is not None and rules.rank_by not in _ENDS_COUNT)


def _rank(result: CarResult, counted: Sequence[Lap], rules: FormatRules, laps_wanted: int | None) -> _Rank | None:
    valid = [lap for lap in counted if lap.valid]
    match rules.rank_by:
        case Ranking.BEST_LAP:
            return _by_time(sorted(valid, key=official_s)[:1])
        case Ranking.BEST_CONSECUTIVE:
            return _best_consecutive(valid, rules.best_of)
        case Ranking.BEST_AVERAGE:
            return _best_average(valid, rules.best_of)
        case Ranking.TOTAL_TIME:
            return _total_time(result, counted, rules)
        case Ranking.MOST_LAPS:
            return _most_laps(result, counted, rules)
        case Ranking.SIMILARITY:
            return _similarity(valid)
        case Ranking.DRIVING_SCORE:
            return _driving_score(result, counted, rules, laps_wanted)
        case Ranking.SURVIVAL:
            return _survival(result, rules)


def _by_time(laps: Sequence[Lap]) -> _Rank | None:
    if not laps:
        return None
    time_s, sigma_s = _sum(laps)
    return _Rank(time_s=time_s, time_sigma_s=sigma_s, value=time_s, sigma=sigma_s)


def _best_consecutive(valid: Sequence[Lap], best_of: int) -> _Rank | None:
    """Laps are in a row where their numbers are: an invalid one between them, or one that was taken out, parts them."""
    windows = [valid[k : k + best_of] for k in range(len(valid) - best_of + 1)]
    in_a_row = [laps for laps in windows if laps[-1].number - laps[0].number == best_of - 1]
    return _by_time(min(in_a_row, key=lambda laps: _sum(laps)[0], default=()))


def _best_average(valid: Sequence[Lap], best_of: int) -> _Rank | None:
    if len(valid) < best_of:
        return None
    time_s, sigma_s = _sum(sorted(sorted(valid, key=official_s)[:best_of], key=lambda lap: lap.number))
    mean_s, mean_sigma_s = time_s / best_of, sigma_s / best_of
    return _Rank(time_s=mean_s, time_sigma_s=mean_sigma_s, value=mean_s, sigma=mean_sigma_s)


def _total_time(result: CarResult, counted: Sequence[Lap], rules: FormatRules) -> _Rank | None:
    if not counted:
        return None
    time_s, sigma_s = _since_start(result, counted, rules)
    laps = len(counted)
    return _Rank(exact=(-float(laps),), time_s=time_s, time_sigma_s=sigma_s, value=time_s, sigma=sigma_s, laps=laps)


def _most_laps(result: CarResult, counted: Sequence[Lap], rules: FormatRules) -> _Rank | None:
    """An invalid lap is none, but the time that it took has gone by for those after it."""
    if result.start_t_ns is None:
        return None
    valid = [lap for lap in counted if lap.valid]
    if not valid:
        return _Rank(exact=(0.0,), value=0.0, laps=0)
    until_last = [lap for lap in counted if lap.number <= valid[-1].number]
    time_s, sigma_s = _since_start(result, until_last, rules)
    laps = len(valid)
    return _Rank(exact=(-float(laps),), time_s=time_s, time_sigma_s=sigma_s, value=float(laps), laps=laps)


def _since_start(result: CarResult, laps: Sequence[Lap], rules: FormatRules) -> tuple[float, float]:
    """The time from where the car's race began, or without warm-up laps from the first of `laps`, to the end of the last, and
    its sigma, seconds; with all penalties. What was driven between laps, and in laps that a judge took away, is in it.
    """
    first, last = laps[0], laps[-1]
    given_ns = result.start_t_ns if rules.warm_up_laps == 0 else None
    start_ns = first.start_t_ns if given_ns is None else min(given_ns, first.start_t_ns)
    # A start that was given is exactly known; otherwise it is the crossing that began the first lap, or one like it.
    is_exact = given_ns is not None and start_ns < first.start_t_ns
    halves = (0.0 if is_exact else first.sigma_s**2, last.sigma_s**2)
    penalties_s = (official_s(lap) - lap.time_s for lap in laps)
    return math.fsum([(last.end_t_ns - start_ns) * 1e-9, *penalties_s]), math.sqrt(0.5 * math.fsum(halves))


def _similarity(valid: Sequence[Lap]) -> _Rank | None:
    """Nobody knows a sigma of a similarity: equal ones are told apart by the mean time of the same laps."""
    scored = [(lap, lap.similarity_percent) for lap in valid if lap.similarity_percent is not None]
    if not scored:
        return None
    percent = fmean(similarity * lap.penalty_factor for lap, similarity in scored)
    time_s, sigma_s = _sum([lap for lap, _ in scored])
    return _Rank(exact=(-percent,), time_s=time_s / len(scored), time_sigma_s=sigma_s / len(scored), value=percent)


def _driving_score(result: CarResult, counted: Sequence[Lap], rules: FormatRules, wanted: int | None) -> _Rank | None:
    """Valid laps and the share of the running one, of all that are wanted; times every factor of the ranked part of the run."""
    if wanted is None:
        raise ValueError("format.rank_by: driving_score is a share of the wanted laps: set race.laps")
    if result.start_t_ns is None:
        return None
    ranked_is_running = len(result.laps) >= rules.warm_up_laps
    done = sum(lap.valid for lap in counted) + (result.running if ranked_is_running else 0.0)
    factor = math.prod((lap.penalty_factor for lap in counted), start=1.0)
    if ranked_is_running:
        factor *= math.prod((penalty.factor for penalty in result.penalties), start=1.0)
    percent = 100.0 * min(1.0, done / (wanted - rules.warm_up_laps)) * factor
    return _Rank(exact=(-percent,), value=percent)


def _survival(result: CarResult, rules: FormatRules) -> _Rank | None:
    if result.elapsed_s is None:
        return None
    survived_s = result.elapsed_s if rules.time_limit_s is None else min(result.elapsed_s, rules.time_limit_s)
    return _Rank(exact=(-survived_s, -result.distance_m), value=survived_s)


def _sum(laps: Sequence[Lap]) -> tuple[float, float]:
    """The sum of the laps' official times, at least one in the order of numbers, and its sigma, seconds."""
    joined = [before.end_t_ns == after.start_t_ns for before, after in pairwise(laps)]
    return math.fsum(official_s(lap) for lap in laps), _sum_sigma([lap.sigma_s for lap in laps], joined)


def _sum_sigma(sigmas: Sequence[float], joined: Sequence[bool]) -> float:
    """Sigma of the sum of times between crossings; `joined` says for each neighbouring two whether they share one."""
    starts = [False, *joined]
    ends = [*joined, False]
    return math.sqrt(
        math.fsum(
            0.5 * sigma**2 * ((not start) + (not end)) for sigma, start, end in zip(sigmas, starts, ends, strict=True)
        )
    )


def _tied(before: _Row, after: _Row) -> bool:
    if before.last != after.last:
        return False
    if before.rank is None or after.rank is None:
        return before.rank is after.rank
    apart_s = abs(after.rank.time_s - before.rank.time_s)
    limit_s = TIE_SIGMAS * math.hypot(before.rank.time_sigma_s, after.rank.time_sigma_s)
    return before.rank.exact == after.rank.exact and apart_s <= limit_s


def _line(
    row: _Row,
    rules: FormatRules,
    *,
    place: int,
    tied: bool,
    leader: _Row,
    ahead: _Row | None,
) -> Standing:
    result, rank = row.result, row.rank
    ranked = [lap for lap in result.laps if lap.number > rules.warm_up_laps]
    gap, gap_laps = _behind(leader, row, rules.rank_by) if row is not leader else (None, None)
    interval, interval_laps = _behind(ahead, row, rules.rank_by) if ahead is not None else (None, None)
    last = max(result.laps, key=lambda lap: lap.number, default=None)
    return Standing(
        place=place,
        tied=tied,
        car=result.car,
        name=result.name,
        laps=len(result.laps),
        valid_laps=sum(lap.valid for lap in result.laps),
        value=None if rank is None else rank.value,
        sigma=None if rank is None else rank.sigma,
        best_lap_s=min((official_s(lap) for lap in ranked if lap.valid), default=None),
        last_lap_s=None if last is None else official_s(last),
        gap=gap,
        interval=interval,
        penalty_s=math.fsum(lap.penalty_s for lap in ranked),
        dnf=result.dnf,
        gap_laps=gap_laps,
        interval_laps=interval_laps,
    )


def _behind(ahead: _Row, row: _Row, ranking: Ranking) -> tuple[float | None, int | None]:
    """How far `row` is behind, in the unit of values, and in laps; the times of different numbers of laps say nothing."""
    if ahead.rank is None or row.rank is None or ahead.last != row.last:
        return None, None
    laps = None if ahead.rank.laps is None or row.rank.laps is None else ahead.rank.laps - row.rank.laps
    if laps and ranking is Ranking.TOTAL_TIME:
        return None, laps
    behind = row.rank.value - ahead.rank.value
    return (-behind if ranking in _MORE_IS_BETTER else behind) + 0.0, laps
