"""The field: all cars of one race, from their fixes to laps that are judged, scored and ranked.

Knows cars, rules and scores; knows no detection, no picture and not how a car is told from another.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from dnb_edge.core.entrant import Entrant, numbered
from dnb_edge.core.setup import CoreSetup
from dnb_edge.core.views import ViewLog
from dnb_edge.race.car import CarRace, Passed
from dnb_edge.race.fix import Fix
from dnb_edge.race.lap_table import LapState
from dnb_edge.race.laps import DrivenLap
from dnb_edge.race.rules import StartMode
from dnb_edge.race.standings import CarResult, standings
from dnb_edge.race.start import Grid, StartProcedure
from dnb_edge.score.live import LiveLap
from dnb_edge.score.profile import lap_trace
from dnb_edge.score.similarity import score_lap
from dnb_edge.track.line import DirectedLine
from dnb_edge.values import Crossing, Event, Incident, IncidentKind, Lap, RacePhase, Score, Standings
from dnb_edge.view.across_line import across_sigma_m


class Field:
    """Feed it each frame's fixes, by seat; it returns the events that they cause, in order."""

    def __init__(self, setup: CoreSetup, views: ViewLog, *, tell_running: bool) -> None:
        self._setup = setup
        self._views = views
        self._first_t_ns: int | None = None
        self._t_ns = 0
        self._numbers = 0
        self._final = False
        self._grid = setup.start.mode is StartMode.GRID
        self._states: dict[int, LapState] = {}
        self._may_end = any(setup.penalties.of(kind).dnf for kind in IncidentKind)
        self._places = Grid.of(setup.track)
        self._start = StartProcedure(
            setup.start,
            self._places,
            cars=range(1, setup.motion.cars + 1),
            time_limit_s=setup.format.time_limit_s,
        )
        self.entrants = [self._entrant(seat, tell_running=tell_running) for seat in range(setup.motion.cars)]

    def _entrant(self, seat: int, *, tell_running: bool) -> Entrant:
        setup = self._setup
        track = setup.track
        sigma_m = {line.name: _map_sigma_m(setup, line) for line in track.lines}
        score = setup.score if setup.not_scored_because is None else None
        described = seat < len(setup.cars)
        return Entrant(
            race=CarRace.begin(
                track,
                setup.crossing,
                setup.laps,
                map_sigma_m=sigma_m,
                car=seat + 1,
                start=setup.start,
                format_rules=setup.format,
            ),
            live=LiveLap(track, score, car=seat + 1) if tell_running else None,
            lap_m=track.lap_m()[1],
            name=setup.cars[seat].name if described else None,
            number=seat + 1 if described or setup.motion.cars == 1 else None,
        )

    @property
    def finished(self) -> bool:
        """Whether the race is over for every car."""
        return all(entrant.race.finished for entrant in self.entrants)

    def frame(
        self,
        t_ns: int,
        fixes: Mapping[int, Sequence[Fix]],
        *,
        waiting: Collection[int],
        elsewhere: Collection[int] = (),
    ) -> list[Event]:
        """Takes one frame with the fixes that became known in it; for the seats in `waiting` more may come of this frame, and
        those `elsewhere` are where its picture does not show them."""
        if self._first_t_ns is None:
            self._first_t_ns = t_ns
        self._t_ns = t_ns
        events = self._begun(t_ns, fixes)
        for seat, entrant in enumerate(self.entrants):
            new = fixes.get(seat, ())
            running = entrant.seen(new)
            events += self._told(
                entrant, entrant.race.frame(t_ns, new, more_may_come=seat in waiting, shows=seat not in elsewhere)
            )
            if self._may_end and seat not in waiting:
                events += self._told(entrant, entrant.over(self._setup.penalties, t_ns))
            events += [numbered(one, self._number(entrant)) for one in running]
        if self.finished and not self._final:
            events += self._standings(final=True)
        return events

    @property
    def awaited_on_grid(self) -> Grid | None:
        """Where standing cars are awaited now; None where none are."""
        return self._places if self._grid and self._start.phase is RacePhase.WAITING else None

    def _begun(self, t_ns: int, fixes: Mapping[int, Sequence[Fix]]) -> list[Event]:
        """What the start procedure says of a frame: phases, countdown, and cars that moved too early."""
        assert self._first_t_ns is not None, "a frame is told before"
        states = {seat + 1: entrant.race.laps.state for seat, entrant in enumerate(self.entrants)}
        if states == self._states and self._start.phase not in (RacePhase.WAITING, RacePhase.COUNTDOWN):
            return []
        self._states = states
        waited = self._start.go_t_ns is None
        latest = {seat + 1: new[-1] for seat, new in fixes.items() if new}
        events: list[Event] = []
        for news in self._start.step(t_ns, (t_ns - self._first_t_ns) * 1e-9, latest, states):
            if isinstance(news, Incident):
                entrant = self.entrants[news.car - 1]
                events += self._told(entrant, [entrant.race.laps.jumped(news)])
            elif self._grid or news.phase not in (RacePhase.WAITING, RacePhase.RACING):
                events.append(news)
            elif news.phase is RacePhase.RACING:
                # In a rolling start the crossing itself says what has happened.
                events.append(replace(news, text=""))
        if self._grid and waited and self._start.go_t_ns is not None:
            for entrant in self.entrants:
                entrant.race.laps.go(self._start.go_t_ns)
                entrant.start_t_ns = self._start.go_t_ns
        return events

    def finish(self) -> list[Event]:
        """Says that no frame will follow; returns the events that were still waiting for one, and the last standings."""
        events: list[Event] = [event for one in self.entrants for event in self._told(one, one.race.finish())]
        return events if self._final else [*events, *self._standings(final=True)]

    def results(self) -> tuple[CarResult, ...]:
        """What each car that takes part has done so far: what standings are made of."""
        taking_part = (entrant for entrant in self.entrants if entrant.number is not None)
        return tuple(entrant.result(self._t_ns, self._setup.penalties) for entrant in taking_part)

    def _told(self, entrant: Entrant, passed: Sequence[Passed]) -> list[Event]:
        """What a car's crossings, incidents and laps lead to."""
        events: list[Event] = []
        for one in passed:
            if isinstance(one, DrivenLap):
                events += self._lap(entrant, one)
                continue
            told = numbered(one, self._number(entrant))
            events.append(told)
            if isinstance(told, Crossing):
                entrant.crossed(told)
            elif isinstance(told, Incident):
                entrant.incidents.append(told)
                ended = entrant.retired(self._setup.penalties, self._t_ns)
                if entrant.dnf is not None:
                    events += [*self._told(entrant, ended), *self._standings()]
        return events

    def _number(self, entrant: Entrant) -> int:
        """The car's number; the next one where it has none yet."""
        if entrant.number is None:
            self._numbers += 1
            entrant.number = self._numbers
        return entrant.number

    def _lap(self, entrant: Entrant, driven: DrivenLap) -> list[Event]:
        lap = replace(
            entrant.judged(driven, self._setup.penalties),
            car=self._number(entrant),
            suspect=self._views.suspect(driven.lap),
        )
        score = self._score(driven, lap)
        if score is not None:
            lap = replace(lap, similarity_percent=score.similarity_percent)
        entrant.done(driven, lap)
        if entrant.race.finished and entrant.end_t_ns is None:
            entrant.end_t_ns = lap.end_t_ns
        return [lap, *(() if score is None else (score,)), *self._standings()]

    def _score(self, driven: DrivenLap, lap: Lap) -> Score | None:
        if self._setup.not_scored_because is not None:
            return None
        track = self._setup.track
        score = score_lap(
            np.array(driven.path_m),
            track.centreline,
            self._setup.score,
            lap=lap.number,
            completion_time_s=lap.time_s,
            lap_route_m=track.lap_route_m(),
            trace=lap_trace(driven, track),
        )
        return replace(score, target_id=lap.target_id, car=lap.car)

    def _standings(self, *, final: bool = False) -> list[Standings]:
        """Who leads now; nothing before a car has begun its race."""
        self._final = self._final or final
        if self._first_t_ns is None or all(entrant.start_t_ns is None for entrant in self.entrants):
            return []
        setup = self._setup
        return [
            standings(
                self.results(),
                setup.format,
                setup.laps.laps,
                t_ns=self._t_ns,
                t_s=(self._t_ns - self._first_t_ns) * 1e-9,
                final=final,
            )
        ]


def _map_sigma_m(setup: CoreSetup, line: DirectedLine) -> float:
    """One sigma of the map's place across `line`: of the camera that knows least of those that see it; 0 where none says."""
    return max(
        across_sigma_m(view.ground, view.map_covariance, line) if view.map_covariance is not None else 0.0
        for view in setup.views
    )
