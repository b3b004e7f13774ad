"""What really happens on the track while a vehicle drives: crossings, laps, way, collisions, and when the drive is over.

Knows the exact arcs that the vehicle drives, step by step. Knows no picture and no driver.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnb_edge.sim.circuit import Circuit, edge_line
from dnb_edge.sim.rig import TrueLap
from dnb_edge.sim.task import LoopTask
from dnb_edge.sim.vehicle import Arc, halved
from dnb_edge.values import Direction, PointM

LEFT_M = 0.6
"""Farther from the centreline than this the vehicle has left the track, and the drive ends."""
STUCK_S = 8.0
"""A vehicle that has not come on by `STUCK_M` within this time is stuck, and the drive ends."""
STUCK_M = 0.10
RUN_OUT_S = 0.8
"""Driven on after the last lap, so that the overhead camera sees the crossing well."""
LEAST_SHARE = 0.5
"""A lap is at least this share of the route, driven between its two crossings: not a turn about one end of the line."""
SLOWEST_MPS = 0.35
"""Who drives slower than this runs out of time, where the task sets no limit of its own."""

_LOOK_S = 0.02
_ROUTE_STEP_M = 0.005
_WINDOW = 60
"""Points of the route, either way, among which the vehicle is looked for first: 0.3 m."""
_NEAR = np.arange(-_WINDOW, _WINDOW + 1)
_OTHER_STRETCH_M = 0.15


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueCrossing:
    """An instant at which the ground point crossed the start line."""

    t_s: float
    direction: Direction


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueCollision:
    """An instant at which the vehicle ran into an obstacle, and stopped there."""

    t_s: float
    obstacle: int
    """Its index among the task's."""
    track_m: PointM
    """The vehicle's ground point then."""
    speed_mps: float
    """Of the vehicle, before it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopTruth:
    """What has really happened so far. Instants in seconds of the simulated clock, whose 0 is the first frame's stamp."""

    crossings: tuple[TrueCrossing, ...]
    laps: tuple[TrueLap, ...]
    """Complete ones: from one forward crossing to the next, with at least `LEAST_SHARE` of the route driven between them."""
    collisions: tuple[TrueCollision, ...]
    distance_m: float
    """Way of the ground point, forwards and back."""
    off_lane_s: float
    """Time in which the ground point was not on the lane."""
    duration_s: float
    completed: bool
    """Whether all laps of the task were driven."""
    ended: str | None
    """Why the drive is over: `laps`, `time`, `left` or `stuck`; None while it goes on."""


class Witness:
    """Watches one drive, arc by arc."""

    def __init__(self, task: LoopTask, circuit: Circuit, start_m: PointM) -> None:
        self._task = task
        (x, y), (end_x, end_y) = circuit.start_line_m
        self._line = _Line(start_m=(x, y), along_m=(end_x - x, end_y - y))
        self._route_m = edge_line(circuit, 0.0, _ROUTE_STEP_M)
        self._half_lane_m = 0.5 * circuit.lane_width_m
        self._ends_s = limit_s(task, circuit)
        self._crossings: list[TrueCrossing] = []
        self._laps: list[TrueLap] = []
        self._collisions: list[TrueCollision] = []
        self._lap_began_s: float | None = None
        """Instant of the forward crossing with which the running lap began."""
        self._place = int(self._away_m(start_m).argmin())
        """Index among `_route_m` of where the vehicle is on the route."""
        self._driven = np.zeros(len(self._route_m), dtype=np.bool_)
        """Which of `_route_m` it has passed forward since the running lap began."""
        self._distance_m = 0.0
        self._off_lane_s = 0.0
        self._now_s = 0.0
        self._looked_s = 0.0
        self._came_on = (0.0, start_m)
        """When and where the vehicle was last seen to have come on."""
        self.ended: str | None = None
        """Why the drive is over: `laps`, `time`, `left` or `stuck`; None while it goes on."""

    @property
    def truth(self) -> LoopTruth:
        """What has happened so far."""
        return LoopTruth(
            crossings=tuple(self._crossings),
            laps=tuple(self._laps),
            collisions=tuple(self._collisions),
            distance_m=self._distance_m,
            off_lane_s=self._off_lane_s,
            duration_s=self._now_s,
            completed=len(self._laps) >= self._task.laps,
            ended=self.ended,
        )

    def drove(self, arc: Arc, began_s: float, ended_s: float) -> None:
        """The vehicle drove `arc` between these instants."""
        before, after = arc.state(0.0), arc.state(ended_s - began_s)
        self._distance_m += math.dist(before.track_m, after.track_m)
        self._watch_line(arc, began_s, ended_s - began_s)
        self._now_s = ended_s
        if ended_s - self._looked_s >= _LOOK_S:
            self._look_round(after.track_m, ended_s - self._looked_s)
            self._looked_s = ended_s

    def ran_into(self, collision: TrueCollision) -> None:
        """The vehicle ran into something."""
        self._collisions.append(collision)

    def _watch_line(self, arc: Arc, began_s: float, step_s: float) -> None:
        before, after = (self._line.left_m(arc.state(t).track_m) < 0.0 for t in (0.0, step_s))
        if before == after:
            return
        at_s = halved(step_s, lambda t: (self._line.left_m(arc.state(t).track_m) < 0.0) == before)
        if self._line.holds(arc.state(at_s).track_m):
            self._crossed(began_s + at_s, Direction.FORWARD if before else Direction.REVERSE)

    def _crossed(self, t_s: float, direction: Direction) -> None:
        self._crossings.append(TrueCrossing(t_s=t_s, direction=direction))
        if direction is Direction.REVERSE:
            return
        if self._lap_began_s is not None:
            if self._driven.mean() < LEAST_SHARE:
                return
            self._laps.append(TrueLap(number=len(self._laps) + 1, start_s=self._lap_began_s, end_s=t_s))
        self._lap_began_s = t_s
        self._driven[:] = False

    def _away_m(self, at_m: PointM) -> NDArray[np.float64]:
        """(n,) distances to the points of the route."""
        offset = self._route_m - np.asarray(at_m)
        return np.asarray(np.sqrt(np.einsum("ij,ij->i", offset, offset)))

    def _come_on(self, away_m: NDArray[np.float64]) -> None:
        """Follows the vehicle along the route: near where it was, unless another stretch of it is nearer by far.

        What lies between two stretches was not driven.
        """
        count = len(away_m)
        moved = int(away_m[(self._place + _NEAR) % count].argmin()) - _WINDOW
        found = (self._place + moved) % count
        if away_m[found] > float(away_m.min()) + _OTHER_STRETCH_M:
            self._place = int(away_m.argmin())
            return
        if moved > 0:
            self._driven[(self._place + np.arange(1, moved + 1)) % count] = True
        self._place = found

    def _look_round(self, at_m: PointM, since_s: float) -> None:
        """Where the vehicle is on the track, and whether the drive is over."""
        away_m = self._away_m(at_m)
        self._come_on(away_m)
        aside_m = float(away_m.min())
        if aside_m > self._half_lane_m:
            self._off_lane_s += since_s
        if math.dist(at_m, self._came_on[1]) > STUCK_M:
            self._came_on = (self._now_s, at_m)
        if self.ended is not None:
            return
        if len(self._laps) >= self._task.laps and self._now_s >= self._laps[self._task.laps - 1].end_s + RUN_OUT_S:
            self.ended = "laps"
        elif self._now_s >= self._ends_s:
            self.ended = "time"
        elif aside_m > LEFT_M:
            self.ended = "left"
        elif self._now_s - self._came_on[0] >= STUCK_S:
            self.ended = "stuck"


def limit_s(task: LoopTask, circuit: Circuit) -> float:
    """Simulated seconds that a driver has for that task."""
    if task.time_limit_s is not None:
        return task.time_limit_s
    return 15.0 + (task.laps + 1) * circuit.centreline.length_m / SLOWEST_MPS


@dataclass(frozen=True, slots=True, kw_only=True)
class _Line:
    """The start line."""

    start_m: PointM
    along_m: PointM
    """From its start to its end."""

    def left_m(self, point_m: PointM) -> float:
        """Distance to the left of the line, which is beyond it; negative before it."""
        return self._offset(point_m)[1]

    def holds(self, point_m: PointM) -> bool:
        """Whether a point on the line's straight lies between its ends."""
        return 0.0 <= self._offset(point_m)[0] <= math.hypot(*self.along_m)

    def _offset(self, point_m: PointM) -> PointM:
        dx, dy = point_m[0] - self.start_m[0], point_m[1] - self.start_m[1]
        ax, ay = self.along_m
        length = math.hypot(ax, ay)
        return (ax * dx + ay * dy) / length, (ax * dy - ay * dx) / length
