"""A judge's edits laid over what a race said: its events with the laps as they count, new laps scored, standings anew.

Knows events and edited laps; knows no file. What the race itself said stays beside it, in `Marshalled`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from dnb_edge.core import CoreSetup
from dnb_edge.core.views import ViewLog
from dnb_edge.race.edit import Edit
from dnb_edge.race.marshal import Marshalled, MarshalledLap, apply
from dnb_edge.report.run import lap_paths
from dnb_edge.score.similarity import score_lap
from dnb_edge.values import Crossing, Event, Lap, Observation, RunSummary, Score, Standings


@dataclass(frozen=True, slots=True, kw_only=True)
class Frames:
    """What there is to know of a run's frames besides what was found in them."""

    t_ns: tuple[int, ...]
    """Their stamps."""
    views: ViewLog
    """How far the camera was known to have moved."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Overlaid:
    """A race after a judge's edits."""

    events: tuple[Event, ...]
    """As the race said them, but for laps, scores, standings and the summary, which are as they count now. Standings before the
    last are left out: they were of other laps."""
    marshalled: Marshalled


def laid_over(events: Sequence[Event], edits: Sequence[Edit], setup: CoreSetup, frames: Frames) -> Overlaid:
    """The race that said `events`, its last the summary, after `edits`."""
    crossings = [event for event in events if isinstance(event, Crossing)]
    made = apply([event for event in events if isinstance(event, Lap)], edits, crossings)
    seen = _Seen(events, crossings, frames)
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
    return Overlaid(events=tuple(_merged(events, marshalled, scores)), marshalled=marshalled)


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
            case Standings():
                if event.final:
                    yield event
            case RunSummary():
                yield replace(event, laps=len(marshalled.laps))
            case _:
                yield event


def _with_score(lap: Lap, scores: dict[tuple[int, int], Score]) -> Iterator[Event]:
    yield lap
    score = scores.get((lap.car, lap.number))
    if score is not None:
        yield score


def _key(lap: Lap) -> tuple[int, int]:
    return lap.car, lap.number


class _Seen:
    """What was seen of the cars, to score laps that a judge made."""

    def __init__(self, events: Sequence[Event], crossings: Sequence[Crossing], frames: Frames) -> None:
        self._observations = [event for event in events if isinstance(event, Observation)]
        self._crossings = crossings
        self._frames = frames

    def looked_at(self, one: MarshalledLap, setup: CoreSetup) -> tuple[Lap, Score | None]:
        """The lap with the share of its frames in which the car was seen and, where it can be scored, its similarity."""
        lap = one.lap
        mine = self._of_car(lap.car) if setup.motion.cars > 1 else self._observations
        inside = {seen.t_ns for seen in mine if lap.start_t_ns < seen.t_ns <= lap.end_t_ns}
        frames = sum(lap.start_t_ns < t_ns <= lap.end_t_ns for t_ns in self._frames.t_ns)
        seen = len(inside) / frames if frames else 0.0
        lap = replace(lap, observed_fraction=seen, suspect=self._frames.views.suspect(lap))
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
