"""All that is watched for in one lap, joined: one watch for each lap, begun with it and closed with it.

Knows the watchers and in which order they are asked; knows nothing of states, crossings' meanings or penalties.
"""

from __future__ import annotations

from dnb_edge.race.collision import Body, Collision
from dnb_edge.race.incidents import Draft, Lost, Stalled, Step, WrongWay, lifted
from dnb_edge.race.off_track import Lane, OffTrack, Overhang
from dnb_edge.race.rules import LapRules
from dnb_edge.race.way import Way
from dnb_edge.values import Crossing


class LapWatch:
    """Takes the steps of one lap and returns incidents as they end."""

    def __init__(self, rules: LapRules, begin: Crossing, way: Way, *, seen_t_ns: int, lane: Lane | None) -> None:
        """`way`: the lap's way, not begun; `seen_t_ns`: stamp at which the car is known to have been seen last."""
        self._begin = begin
        self._margin_m = rules.off_lane_margin_m
        self._lost = Lost(rules, begin, seen_t_ns)
        self._stalled = Stalled(rules, begin)
        self._wrong_way = WrongWay(rules)
        self._overhang = Overhang(rules, lane)
        self._off_track = OffTrack(rules)
        self._body = Body(rules, lane) if rules.obstacles and lane is not None else None
        self._collisions = tuple(Collision(rules, number) for number in range(len(rules.obstacles)))
        self.way = way
        """How far the car has driven."""

    def feed(self, step: Step) -> list[Draft]:
        """Takes the next step; returns what ended with it."""
        fix = step.fix
        found = [
            self._lost.feed(fix),
            lifted(step, self._begin),
            self.way.feed(step),
            self._stalled.feed(step),
            self._off_track.feed(fix, self._overhang.outside_m(fix)),
        ]
        if self._body is not None:
            swept = self._body.feed(step)
            found += [collision.feed(fix, swept) for collision in self._collisions]
        # Beyond the lane the nearest place of the route may run backwards though the car does not.
        if fix.outside_m <= self._margin_m:
            found.append(self._wrong_way.feed(fix, self.way.net_m))
        return [draft for draft in found if draft is not None]

    def so_far(self, t_ns: int) -> list[Draft]:
        """What goes on and is an incident already, the car being unseen until `t_ns`; nothing ends by being asked for."""
        found = [self._lost.close(t_ns), self._stalled.close(), self._off_track.so_far(), self._wrong_way.close()]
        found += [collision.so_far() for collision in self._collisions]
        return [draft for draft in found if draft is not None]

    def close(self, t_ns: int, over: Step | None = None) -> list[Draft]:
        """What goes on while the lap ends at `t_ns`. `over` is the step over its end, if any: a gap or a lift over the end is
        of both laps. What began after `t_ns` belongs to the next one.
        """
        found = [self._lost.close(t_ns if over is None else over.fix.t_ns), self._stalled.close()]
        found += [self._off_track.close(), self._wrong_way.close()]
        found += [collision.close() for collision in self._collisions]
        if over is not None:
            found.append(lifted(over, self._begin))
        return [draft for draft in found if draft is not None and draft.start_t_ns < t_ns]
