"""Whether the car hits a thing that stands on the track.

Knows the car's footprint, a rectangle about the ground point along the way that the fixes have gone, and round obstacles on
the track plane; knows no laps and no prices. Between two fixes the car is taken to have gone straight: nothing slips through.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from dnb_edge.race.fix import Fix
from dnb_edge.race.incidents import Draft, Step
from dnb_edge.race.off_track import Lane, Turned
from dnb_edge.race.rules import LapRules
from dnb_edge.values import IncidentKind, PointM

JOIN_S = 0.5
"""Two hits of one obstacle that are less than this apart are one, seconds: a car that pushes springs back a little."""

SWEPT_S = 0.3
"""After a longer gap nobody knows which way the car went, seconds."""

_STEP_M = 0.02
"""Between two footprints that are looked at, metres."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Footprint:
    """A rectangle on the floor."""

    centre_m: PointM
    heading_rad: float
    """Direction of its length on the track plane, atan2(dy, dx)."""
    length_m: float
    width_m: float

    def gap_m(self, point_m: PointM) -> float:
        """From its edge to a point, metres; negative for a point within, by as much as that lies from the nearest side."""
        x, y = point_m[0] - self.centre_m[0], point_m[1] - self.centre_m[1]
        cos, sin = math.cos(self.heading_rad), math.sin(self.heading_rad)
        beyond_x = abs(x * cos + y * sin) - self.length_m / 2
        beyond_y = abs(y * cos - x * sin) - self.width_m / 2
        if beyond_x <= 0 and beyond_y <= 0:
            return max(beyond_x, beyond_y)
        return math.hypot(max(beyond_x, 0.0), max(beyond_y, 0.0))


class Body:
    """Makes footprints of steps."""

    def __init__(self, rules: LapRules, lane: Lane) -> None:
        """The rules tell the car's size. Raises `ValueError` where they do not."""
        if rules.car_length_m is None or rules.car_width_m is None:
            raise ValueError("what a car hits needs its size")
        self._length_m, self._width_m = rules.car_length_m, rules.car_width_m
        self._lane = lane
        self._turned = Turned(lane)

    def feed(self, step: Step) -> tuple[Footprint, ...]:
        """Takes the next step; the footprints from the fix before, which is left out, to this one."""
        fix, before = step.fix, step.before
        heading_rad = self._lane.angle_at(fix.s_m) + self._turned.feed(fix)
        count = 1
        if before is not None and not step.lifted and 0.0 < step.dt_s <= SWEPT_S:
            count = max(1, math.ceil(step.moved_m / _STEP_M))
        from_m = fix.track_m if before is None else before.track_m
        return tuple(self._at(_between(from_m, fix.track_m, k / count), heading_rad) for k in range(1, count + 1))

    def _at(self, centre_m: PointM, heading_rad: float) -> Footprint:
        return Footprint(centre_m=centre_m, heading_rad=heading_rad, length_m=self._length_m, width_m=self._width_m)


class Collision:
    """Tells that the car hit one obstacle, once it has been clear of it for a while or the lap is over."""

    def __init__(self, rules: LapRules, index: int) -> None:
        """`index`: of the obstacle among the rules', from 0."""
        self._obstacle = rules.obstacles[index]
        self._number = index + 1
        self._limit_m = rules.collision_m
        self._first: Fix | None = None
        self._worst: tuple[float, Fix] | None = None
        self._last_t_ns = 0

    def feed(self, fix: Fix, swept: Sequence[Footprint]) -> Draft | None:
        """Takes the next fix, and the car's footprints since the one before."""
        gap_m = min(footprint.gap_m(self._obstacle.at_m) for footprint in swept) - self._obstacle.radius_m
        apart = (fix.t_ns - self._last_t_ns) * 1e-9 > JOIN_S
        if gap_m >= self._limit_m:
            return self.close() if apart else None
        draft = self.close() if apart else None
        self._first = self._first or fix
        if self._worst is None or gap_m < self._worst[0]:
            self._worst = gap_m, fix
        self._last_t_ns = fix.t_ns
        return draft

    def close(self) -> Draft | None:
        """The hit so far, if there is one; it is over."""
        draft = self._draft()
        self._first, self._worst = None, None
        return draft

    def so_far(self) -> Draft | None:
        """The same, while it may go on; one of which there is a single fix so far is waited with: that may be the last."""
        return None if self._first is None or self._first.t_ns == self._last_t_ns else self._draft()

    def _draft(self) -> Draft | None:
        first, worst = self._first, self._worst
        if first is None or worst is None:
            return None
        x, y = self._obstacle.at_m
        return Draft(
            kind=IncidentKind.COLLISION,
            start_t_ns=first.t_ns,
            start_s=first.t_s,
            end_t_ns=self._last_t_ns,
            worst=worst[1],
            text=f"the car hit obstacle {self._number}, which stands at ({x:.2f}, {y:.2f}) m",
        )


def _between(a: PointM, b: PointM, share: float) -> PointM:
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
