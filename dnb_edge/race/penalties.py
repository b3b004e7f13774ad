"""What incidents cost: the rule set's prices put on what happened in a lap.

Knows laps, incidents and prices; knows nothing of how an incident was noticed. A lap's own numbers (`time_s`, `sigma_s`) are
never touched: a penalty is a value beside them, so the same lap can be judged again under other rules.

An incident belongs to the lap in which it began, and a jump start to the first lap. What else happens outside laps (on the way
to the start line, after the end) costs nothing.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from dnb_edge.race.rules import PenaltyRules
from dnb_edge.values import Incident, IncidentKind, Lap, Penalty

FIRST_LAP = 1
"""Number of a car's first lap."""


def charged_to(incident: Incident) -> int | None:
    """Number of the lap to which the incident belongs; None where it belongs to none and costs nothing."""
    if incident.lap is None and incident.kind is IncidentKind.JUMP_START:
        return FIRST_LAP
    return incident.lap


def penalties_of(
    incidents: Sequence[Incident], rules: PenaltyRules, spent: Mapping[IncidentKind, int]
) -> tuple[Penalty, ...]:
    """The penalty of each of the incidents, in their order, that costs anything.

    `spent` says how many of a kind the car had before in its run: as many of a kind as are `free` cost nothing.
    """
    had = Counter(spent)
    penalties = []
    for incident in incidents:
        effect = rules.of(incident.kind)
        had[incident.kind] += 1
        costs = effect.seconds > 0 or effect.factor < 1 or effect.invalid or effect.dnf
        if costs and had[incident.kind] > effect.free:
            penalties.append(
                Penalty(
                    offence=incident.kind.value,
                    seconds=effect.seconds,
                    factor=effect.factor,
                    invalid=effect.invalid,
                    dnf=effect.dnf,
                    reason=incident.text,
                    incident=incident.number,
                )
            )
    return tuple(penalties)


def judged(
    lap: Lap, incidents: Sequence[Incident], rules: PenaltyRules, spent: Mapping[IncidentKind, int] | None = None
) -> Lap:
    """The lap with what `incidents`, those that belong to it, cost under `rules`; earlier judgements of it are forgotten.

    `spent` is as for `penalties_of`; see `counted`.
    """
    return with_penalties(unjudged(lap), penalties_of(incidents, rules, spent or {}))


def with_penalties(lap: Lap, penalties: Iterable[Penalty]) -> Lap:
    """The lap with `penalties` after those that it has; its sums, its validity and its reasons follow."""
    added = tuple(penalties)
    every = (*lap.penalties, *added)
    seconds = math.fsum(penalty.seconds for penalty in every)
    return replace(
        lap,
        penalties=every,
        penalty_s=seconds,
        penalty_factor=math.prod((penalty.factor for penalty in every), start=1.0),
        official_time_s=lap.time_s + seconds,
        valid=lap.valid and not any(penalty.invalid for penalty in added),
        reasons=(*lap.reasons, *(penalty.reason for penalty in added if penalty.invalid)),
    )


def unjudged(lap: Lap) -> Lap:
    """The lap as it was before any penalty: `unjudged(judged(lap, ...)) == lap` for a lap without penalties."""
    if not lap.penalties:
        return replace(lap, official_time_s=None)
    invalidating = sum(penalty.invalid for penalty in lap.penalties)
    # Penalties put their reasons last.
    reasons = lap.reasons[: len(lap.reasons) - invalidating]
    valid = not reasons if invalidating else lap.valid
    return replace(
        lap, penalties=(), penalty_s=0.0, penalty_factor=1.0, official_time_s=None, valid=valid, reasons=reasons
    )


def counted(incidents: Iterable[Incident]) -> Counter[IncidentKind]:
    """How many of each kind there are among those that belong to a lap: the `spent` of what comes after them."""
    return Counter(incident.kind for incident in incidents if charged_to(incident) is not None)


def judged_run(
    laps: Sequence[Lap], incidents: Sequence[Incident], rules: PenaltyRules
) -> tuple[tuple[Lap, ...], tuple[Penalty, ...]]:
    """All complete laps of one car's run with what its incidents cost, and the penalties that belong to no complete lap.

    The latter are of laps that were never finished; of one that was given up for a new one, which bears its number, is what
    began before the new one did. What is `free` goes by the incidents' numbers. Lap by lap, as a race
    runs, it comes to the same.
    """
    charged = sorted(
        (incident for incident in incidents if charged_to(incident) is not None), key=lambda incident: incident.number
    )
    start_ns = {lap.number: lap.start_t_ns for lap in laps}
    lap_of: dict[int, int | None] = {}
    for incident in charged:
        number = charged_to(incident)
        given_up = incident.kind is not IncidentKind.JUMP_START and incident.start_t_ns < start_ns.get(number or 0, 0)
        lap_of[incident.number] = None if given_up else number
    penalties: dict[int | None, list[Penalty]] = defaultdict(list)
    for penalty in penalties_of(charged, rules, {}):
        assert penalty.incident is not None, "it comes of an incident"
        penalties[lap_of[penalty.incident]].append(penalty)
    judged_laps = tuple(with_penalties(unjudged(lap), penalties.pop(lap.number, ())) for lap in laps)
    return judged_laps, tuple(penalty for of_lap in penalties.values() for penalty in of_lap)


def ends_the_race(kind: IncidentKind, incidents: Iterable[Incident], rules: PenaltyRules) -> bool:
    """Whether one more incident of `kind` in a lap, after `incidents`, would end the car's race."""
    effect = rules.of(kind)
    return effect.dnf and counted(incidents)[kind] >= effect.free


def retires(incidents: Sequence[Incident], rules: PenaltyRules) -> Penalty | None:
    """The penalty that ends the car's race, of all its incidents so far in their order; None while it races on."""
    charged = [incident for incident in incidents if charged_to(incident) is not None]
    return next((penalty for penalty in penalties_of(charged, rules, {}) if penalty.dnf), None)
