"""A judge's case and decisions as the API answers them.

Pure but for the clock that `decide` reads: knows edited laps and models; knows no request.
"""

from __future__ import annotations

from collections.abc import Sequence

from dnb_edge.archive.case import Case, Decision
from dnb_edge.archive.overlay import Overlaid
from dnb_edge.archive.replayed import edit_warning
from dnb_edge.race.marshal import Marshalled, MarshalledLap
from dnb_edge.values import Crossing, Event, Incident, Standings
from dnb_edge.web.endpoint import API
from dnb_edge.web.judge_models import (
    BeforeAfter,
    Decided,
    Judged,
    JudgedEdit,
    JudgedIncident,
    JudgedLap,
    JudgedPass,
    LapChange,
    Passes,
    Totals,
)


def judged(run_id: str, case: Case, *, unfinished: bool) -> Judged:
    """The run as it stands."""
    raced, log = case.raced, case.log
    now = raced.overlaid(log.edits)
    frames = raced.facts.frames_t_ns
    undone = {edit.number for edit in now.marshalled.undone}
    idle = {told.edit.number: told.text for told in now.marshalled.without_effect}
    return Judged(
        run=run_id,
        name=raced.header.name,
        unfinished=unfinished,
        lasts_s=(frames[-1] - frames[0]) * 1e-9 if frames else 0.0,
        edits_so_far=len(log.edits),
        laps=tuple(sorted(_laps(now.marshalled), key=lambda one: (one.lap.end_t_ns, one.lap.car))),
        edits=tuple(
            JudgedEdit(
                edit=edit,
                subject=edit.subject,
                undone=edit.number in undone,
                without_effect=idle.get(edit.number),
            )
            for edit in log.edits
        ),
        incidents=tuple(
            JudgedIncident(incident=one, picture=f"{API}/runs/{run_id}/incidents/{one.car}/{one.number}.jpg")
            for one in raced.events
            if isinstance(one, Incident)
        ),
        standings=_last_standings(now.events),
        warnings=_warnings(case, now.marshalled),
    )


def passes(run_id: str, crossings: Sequence[Crossing]) -> Passes:
    """Every crossing of a line, in the order of time."""
    return Passes(
        run=run_id,
        passes=tuple(
            JudgedPass(number=number, crossing=one, picture=f"{API}/runs/{run_id}/passes/{number}.jpg")
            for number, one in enumerate(crossings, start=1)
        ),
    )


def decided(decision: Decision, *, saved: bool) -> Decided:
    """What one decision does, or would do."""
    before, after = decision.before.marshalled, decision.after.marshalled
    was, will = ({(one.lap.car, one.lap.number): one for one in _laps(side)} for side in (before, after))
    changed = sorted(key for key in {*was, *will} if was.get(key) != will.get(key))
    return Decided(
        saved=saved,
        edit=decision.edit,
        subject=decision.edit.subject,
        edits_so_far=len(decision.case.log.edits) + saved,
        changes=tuple(
            LapChange(car=car, number=number, before=was.get((car, number)), after=will.get((car, number)))
            for car, number in changed
        ),
        before=_side(decision.before),
        after=_side(decision.after),
        warnings=_warnings(decision.case, after),
    )


def _laps(marshalled: Marshalled) -> list[JudgedLap]:
    """All laps, those that were removed behind the others."""
    return [
        *(_lap(one, counts=True) for one in marshalled.laps),
        *(_lap(one, counts=False) for one in marshalled.removed),
    ]


def _lap(one: MarshalledLap, *, counts: bool) -> JudgedLap:
    return JudgedLap(lap=one.lap, counts=counts, edits=tuple(edit.number for edit in one.edits), raw=one.raw)


def _side(overlaid: Overlaid) -> BeforeAfter:
    kept = overlaid.marshalled.kept
    valid = [lap for lap in kept if lap.valid]
    times_s = [lap.time_s if lap.official_time_s is None else lap.official_time_s for lap in valid]
    totals = Totals(laps=len(kept), valid=len(valid), best_s=min(times_s, default=None))
    return BeforeAfter(totals=totals, standings=_last_standings(overlaid.events))


def _last_standings(events: Sequence[Event]) -> Standings | None:
    return next((event for event in reversed(events) if isinstance(event, Standings)), None)


def _warnings(case: Case, marshalled: Marshalled) -> tuple[str, ...]:
    told = (*marshalled.without_effect, *marshalled.moved)
    return (*case.raced.warnings, *case.log.warnings, *map(edit_warning, told))
