"""The field: all cars of one race, from their fixes to laps that are judged and scored.

Knows cars, rules and scores; knows no detection, no picture and not how a car is told from another.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from dnb_edge.core.setup import CoreSetup
from dnb_edge.core.views import ViewLog
from dnb_edge.race.car import CarRace, Passed
from dnb_edge.race.fix import Fix
from dnb_edge.race.laps import DrivenLap
from dnb_edge.race.penalties import judged
from dnb_edge.score.similarity import score_lap
from dnb_edge.values import Event, Lap, Score
from dnb_edge.view.across_line import across_sigma_m


class Field:
    """Feed it each frame's fixes, by seat; it returns the events that they cause, in order."""

    def __init__(self, setup: CoreSetup, views: ViewLog) -> None:
        self._setup = setup
        self._views = views
        covariance = setup.map_covariance
        sigma_m = (
            {}
            if covariance is None
            else {line.name: across_sigma_m(setup.ground, covariance, line) for line in setup.track.lines}
        )
        self.cars = [
            CarRace.begin(setup.track, setup.crossing, setup.laps, map_sigma_m=sigma_m)
            for _ in range(setup.motion.cars)
        ]

    @property
    def finished(self) -> bool:
        """Whether as many cars as are wanted have completed the wanted number of laps."""
        return all(car.finished for car in self.cars)

    def frame(self, t_ns: int, fixes: Mapping[int, Sequence[Fix]], *, waiting: Collection[int]) -> list[Event]:
        """Takes one frame with the fixes that became known in it; for the seats in `waiting` more may come of this frame."""
        events: list[Event] = []
        for seat, car in enumerate(self.cars):
            events += self._told(car.frame(t_ns, fixes.get(seat, ()), more_may_come=seat in waiting))
        return events

    def finish(self) -> list[Event]:
        """Says that no frame will follow; returns the events that were still waiting for one."""
        return [event for car in self.cars for event in self._told(car.finish())]

    def _told(self, passed: Sequence[Passed]) -> list[Event]:
        events: list[Event] = []
        for one in passed:
            events += self._lap(one) if isinstance(one, DrivenLap) else [one]
        return events

    def _lap(self, driven: DrivenLap) -> list[Lap | Score]:
        lap = replace(
            judged(driven.lap, driven.incidents, self._setup.penalties), suspect=self._views.suspect(driven.lap)
        )
        if self._setup.not_scored_because is not None:
            return [lap]
        score = score_lap(
            np.array(driven.path_m),
            self._setup.track.centreline,
            self._setup.score,
            lap=lap.number,
            completion_time_s=lap.time_s,
            lap_route_m=self._setup.track.lap_route_m(),
        )
        lap = replace(lap, similarity_percent=score.similarity_percent)
        return [lap, replace(score, target_id=lap.target_id)]
