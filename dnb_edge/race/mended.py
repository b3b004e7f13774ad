"""Laps that a judge makes: one that the race missed, one of two that the race took for two, one that was forgiven.

Knows laps and crossings; knows nothing of who decided it. Such a lap has no path similarity until its path is scored.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from dnb_edge.race.crossing import lap_sigma_s
from dnb_edge.race.edit import AddedLap
from dnb_edge.values import Crossing, Direction, Lap, Penalty, SectorTime


def added_lap(added: AddedLap, number: int, crossings: Sequence[Crossing], lines: Sequence[str] = ()) -> Lap:
    """The lap that a judge adds, as lap `number` of its car: driven by whichever target crossed a line nearest to its end.

    `lines` are those at which sectors end, the last of them where laps do; `crossings` are in the order of time.
    """
    key = added.key
    time_s = (key.end_t_ns - key.start_t_ns) * 1e-9
    driver = min(
        (crossing for crossing in crossings if crossing.car == key.car),
        key=lambda crossing: abs(crossing.t_ns - key.end_t_ns),
        default=None,
    )
    ends = _at(crossings, key.start_t_ns, key.car), _at(crossings, key.end_t_ns, key.car)
    lap = Lap(
        number=number,
        start_t_ns=key.start_t_ns,
        end_t_ns=key.end_t_ns,
        start_s=added.start_s,
        time_s=time_s,
        sigma_s=added.sigma_s,
        valid=True,
        reasons=(),
        similarity_percent=None,
        observed_fraction=0.0,
        target_id=None if driver is None else driver.target_id,
        car=key.car,
        official_time_s=time_s,
        estimated=any(one is not None and one.estimated for one in ends),
    )
    return replace(lap, sectors=_sectors(lap, lines, crossings))


def merged_lap(first: Lap, second: Lap, crossings: Sequence[Crossing]) -> Lap:
    """Two laps that meet at one crossing as one. Its sigma and its sectors come from `crossings`, in the order of time."""
    ends = _at(crossings, first.start_t_ns, first.car), _at(crossings, second.end_t_ns, first.car)
    time_s = (second.end_t_ns - first.start_t_ns) * 1e-9
    sigma_s, estimated = math.hypot(first.sigma_s, second.sigma_s), first.estimated or second.estimated
    if ends[0] is not None and ends[1] is not None:
        sigma_s = lap_sigma_s(ends[0], ends[1])
        estimated = ends[0].estimated or ends[1].estimated
    reasons = tuple(dict.fromkeys((*first.reasons, *second.reasons)))
    merged = replace(
        first,
        end_t_ns=second.end_t_ns,
        time_s=time_s,
        sigma_s=sigma_s,
        valid=not reasons,
        reasons=reasons,
        similarity_percent=None,
        observed_fraction=(first.observed_fraction * first.time_s + second.observed_fraction * second.time_s) / time_s,
        target_id=second.target_id,
        suspect=tuple(dict.fromkeys((*first.suspect, *second.suspect))),
        estimated=estimated,
    )
    merged = replace(merged, sectors=_sectors(merged, [sector.line for sector in first.sectors], crossings))
    return priced(merged, (*first.penalties, *second.penalties), reasons)


def _at(crossings: Sequence[Crossing], t_ns: int, car: int) -> Crossing | None:
    return next((one for one in crossings if (one.t_ns, one.car) == (t_ns, car)), None)


def _sectors(lap: Lap, lines: Sequence[str], crossings: Sequence[Crossing]) -> tuple[SectorTime, ...]:
    """The lap's sectors, which end at `lines`, the last where the lap does: each line's first forward crossing in it, where
    that comes after the line before it; otherwise no time."""
    before = _at(crossings, lap.start_t_ns, lap.car)
    sectors = []
    for number, line in enumerate(lines, start=1):
        is_last = number == len(lines)
        after = _at(crossings, lap.end_t_ns, lap.car) if is_last else _first(crossings, line, lap)
        time_s = sigma_s = None
        if before is not None and after is not None and before.t_ns < after.t_ns:
            time_s = (after.t_ns - before.t_ns) * 1e-9
            sigma_s = lap_sigma_s(before, after)
        sectors.append(SectorTime(number=number, line=line, time_s=time_s, sigma_s=sigma_s))
        before = after
    return tuple(sectors)


def _first(crossings: Sequence[Crossing], line: str, lap: Lap) -> Crossing | None:
    return next(
        (
            one
            for one in crossings
            if (one.line, one.car, one.direction) == (line, lap.car, Direction.FORWARD)
            and lap.start_t_ns < one.t_ns < lap.end_t_ns
        ),
        None,
    )


def pardoned(lap: Lap, offence: str | None) -> Lap:
    """The lap without what the rules gave it for `offence`, None for all: penalties, and the reasons that came of them."""
    forgiven = [one for one in lap.penalties if offence in (None, one.offence)]
    excused = {one.reason for one in forgiven}
    reasons = () if offence is None else [reason for reason in lap.reasons if reason not in excused]
    return priced(lap, [one for one in lap.penalties if one not in forgiven], reasons)


def priced(lap: Lap, penalties: Sequence[Penalty], reasons: Sequence[str]) -> Lap:
    """The lap with these penalties and reasons alone; its sums, its official time and its validity follow."""
    penalty_s = math.fsum(penalty.seconds for penalty in penalties)
    return replace(
        lap,
        valid=not reasons,
        reasons=tuple(reasons),
        penalties=tuple(penalties),
        penalty_s=penalty_s,
        penalty_factor=math.prod((penalty.factor for penalty in penalties), start=1.0),
        official_time_s=lap.time_s + penalty_s,
    )
