"""A judge's edits laid over what a race said: its events with the laps as they count, new laps scored, standings anew.

Knows events and edited laps; knows no file. What the race itself said stays beside it, in `Marshalled`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from dnb_edge.core import CoreSetup
from dnb_edge.core.views import ViewLog
from dnb_edge.race.edit import Edit
from dnb_edge.race.marshal import Marshalled, MarshalledLap, apply, in_sequence
from dnb_edge.race.standings import CarResult, standings
from dnb_edge.report.run import lap_paths
from dnb_edge.score.similarity import score_lap
from dnb_edge.values import Crossing, Event, Lap, Observation, RunSummary, Score, Standings


@dataclass(frozen=True, slots=True, kw_only=True)
class RaceFacts:
    """What a race leaves besides its events."""

    frames_t_ns: Sequence[int]
    """Stamps of all frames."""
    views: ViewLog
    """How far the camera was known to have moved."""
    results: tuple[CarResult, ...]
    """What standings are made of."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Overlaid:
    """A race after a judge's edits."""

    events: tuple[Event, ...]
    """As the race said them, but for laps, scores, standings and the summary, which are as they count now. Standings before the
    last are left out: they were of other laps."""
    marshalled: Marshalled


def laid_over(events: Sequence[Event], edits: Sequence[Edit], setup: CoreSetup, facts: RaceFacts) -> Overlaid:
    """The race that said `events`, its last the summary, after `edits`."""
    crossings = [event for event in events if isinstance(event, Crossing)]
    made = apply([event for event in events if isinstance(event, Lap)], edits, crossings)
    if not made.removed and not any(one.edits for one in made.laps):
        return Overlaid(events=tuple(events), marshalled=made)
    seen = _Seen(events, crossings, facts)
    scores: dict[tuple[int, int], Score] = {}
    laps = []
    for one in made.laps:
        lap = one.lap
        if len(one.raw) != 1:
            lap, score = seen.looked_at(one, setup)
            if score is not None:
                scores[lap.car, lap.number] = score
        laps.append(replace(one, lap=lap))
    marshalled = replace(made, laps=tuple(laps))
    results = tuple(_results(facts.results, marshalled))
    told = _merged(events, marshalled, scores)
    return Overlaid(events=tuple(_with_standings(told, results, setup)), marshalled=marshalled)


def _merged(events: Sequence[Event], marshalled: Marshalled, scores: dict[tuple[int, int], Score]) -> Iterator[Event]:
    """The events in their order: an edited lap where its last raw lap was, an added one where its end was."""
    instead = {_key(one.raw[-1]): one for one in marshalled.laps if one.raw}
    added = [one.lap for one in marshalled.laps if not one.raw]
    untouched = {_key(one.raw[0]) for one in marshalled.laps if len(one.raw) == 1}
    for event in events:
        at_ns = event.t_ns if isinstance(event, Observation) else None
        while added and (isinstance(event, RunSummary) or (at_ns is not None and added[0].end_t_ns < at_ns)):
            lap = added.pop(0)
            yield from _with_score(lap, scores)
        match event:
            case Lap():
                one = instead.get(_key(event))
                if one is not None:
                    yield from _with_score(one.lap, scores)
            case Score():
                if (event.car, event.lap) in untouched:
                    yield event
            case RunSummary():
                yield replace(event, laps=len(marshalled.laps))
            case _:
                yield event


def _with_standings(events: Iterable[Event], results: Sequence[CarResult], setup: CoreSetup) -> Iterator[Event]:
    """The events with the last standings made anew of `results`; those before were of other laps, and are left out."""
    for event in events:
        if not isinstance(event, Standings):
            yield event
        elif event.final:
            yield standings(results, setup.format, setup.laps.laps, t_ns=event.t_ns, t_s=event.t_s, final=True)


def _results(results: Sequence[CarResult], marshalled: Marshalled) -> Iterator[CarResult]:
    """Each car's result with the laps that count now, until a judge ended its race."""
    laps = in_sequence(marshalled)
    ended = {one.car: one for one in marshalled.ended}
    forgiven = {(one.lap.car, reason) for one in marshalled.laps for reason in _ends_forgiven(one)}
    for result in results:
        mine, end = laps.get(result.car, ()), ended.get(result.car)
        if end is None:
            dnf = None if (result.car, result.dnf) in forgiven else result.dnf
            yield replace(result, laps=mine, dnf=dnf)
            continue
        begun_ns = end.t_ns if result.start_t_ns is None else result.start_t_ns
        yield replace(
            result,
            laps=tuple(lap for lap in mine if lap.end_t_ns <= end.t_ns),
            elapsed_s=max(0.0, (end.t_ns - begun_ns) * 1e-9),
            running=0.0,
            penalties=(),
            dnf=end.reason,
        )


def _ends_forgiven(one: MarshalledLap) -> list[str]:
    """Why the rules ended the car's race in this lap, as far as a judge has forgiven it."""
    given = [penalty for lap in one.raw for penalty in lap.penalties if penalty.dnf]
    return [penalty.reason for penalty in given if penalty not in one.lap.penalties]


def _with_score(lap: Lap, scores: dict[tuple[int, int], Score]) -> Iterator[Event]:
    yield lap
    score = scores.get((lap.car, lap.number))
    if score is not None:
        yield score


def _key(lap: Lap) -> tuple[int, int]:
    return lap.car, lap.number


class _Seen:
    """What was seen of the cars, to score laps that a judge made."""

    def __init__(self, events: Sequence[Event], crossings: Sequence[Crossing], facts: RaceFacts) -> None:
        self._observations = [event for event in events if isinstance(event, Observation)]
        self._crossings = crossings
        self._facts = facts

    def looked_at(self, one: MarshalledLap, setup: CoreSetup) -> tuple[Lap, Score | None]:
        """The lap with the share of its frames in which the car was seen and, where it can be scored, its similarity."""
        lap = one.lap
        mine = self._of_car(lap.car) if setup.motion.cars > 1 else self._observations
        inside = {seen.t_ns for seen in mine if lap.start_t_ns < seen.t_ns <= lap.end_t_ns}
        frames = sum(lap.start_t_ns < t_ns <= lap.end_t_ns for t_ns in self._facts.frames_t_ns)
        seen = len(inside) / frames if frames else 0.0
        lap = replace(lap, observed_fraction=seen, suspect=self._facts.views.suspect(lap))
        if setup.not_scored_because is not None or len(inside) < 2:
            return lap, None
        (path_m,) = lap_paths((lap,), mine, self._crossings)
        try:
            score = score_lap(
                path_m,
                setup.track.centreline,
                setup.score,
                lap=lap.number,
                completion_time_s=lap.time_s,
                lap_route_m=setup.track.lap_route_m(),
            )
        except ValueError:
            # A car that stood all the time has no path.
            return lap, None
        score = replace(score, target_id=lap.target_id, car=lap.car)
        return replace(lap, similarity_percent=score.similarity_percent), score

    def _of_car(self, car: int) -> list[Observation]:
        targets = {crossing.target_id for crossing in self._crossings if crossing.car == car}
        return [seen for seen in self._observations if seen.target_id in targets]
