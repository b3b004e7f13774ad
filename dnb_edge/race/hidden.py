"""A line that the car passed while nobody saw it: by its way along the route, and what can be fitted at all.

Where a car is hidden in a bend, the straight way between its last place before and its first one behind leads past the line's
ends, or both lie on one side of the line; its way along the route tells. Knows fixes, one line and its place on the route;
knows nothing of laps, nor of how crossings are confirmed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import median
from typing import Self

import numpy as np

from dnb_edge.race.fix import FASTER, SPARE_M, Fix
from dnb_edge.race.instant import Samples
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.line import DirectedLine
from dnb_edge.track.model import crossings_of
from dnb_edge.values import Direction, PointM

LEAST_SIGMA_M = 0.001
"""No fix is trusted further than this, metres."""

_SIGMAS = 6.0
_LOOK_M = 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class RouteSamples:
    """A hidden passage as the fit wants it: `across_m` is the distance along the route."""

    samples: Samples
    near_s: float
    """The instant by even speed, on the samples' clock."""
    speed_mps: float
    """Mean speed along the route in the gap."""
    along_m: float
    """Where on the line, metres from its start."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LinePlace:
    """Where a line lies on the route."""

    route: Centreline
    line: DirectedLine
    s_m: float

    @classmethod
    def of(cls, route: Centreline, line: DirectedLine) -> Self | None:
        """None where the route does not cross the line exactly once."""
        found = crossings_of(route, line)
        return cls(route=route, line=line, s_m=found[0][0]) if len(found) == 1 else None

    def passed(self, before: Fix, after: Fix, *, margin_m: float = 0.0) -> Direction | None:
        """In which direction the line's place on the route lies between two fixes, at least `margin_m` from either."""
        step_m = after.progress_m - before.progress_m
        ahead_m = self._ahead_m(before.s_m, step_m)
        if not margin_m < ahead_m < abs(step_m) - margin_m:
            return None
        return Direction.FORWARD if step_m > 0 else Direction.REVERSE

    def samples(self, fixes: Sequence[Fix], before: Fix, after: Fix, direction: Direction) -> RouteSamples | None:
        """What the fit needs of a passage hidden between `before` and `after`, both among `fixes`; seconds count from `before`.

        None where the car did not pass the line in that direction, or cannot have driven that far.
        """
        route, sense = self.route, 1.0 if direction is Direction.FORWARD else -1.0
        split = next(k for k, fix in enumerate(fixes) if fix is after)
        places = [*self._places(fixes[:split]), *self._places(fixes[split:])]
        t_s = np.array([(fix.seen_t_ns - before.seen_t_ns) * 1e-9 for fix in fixes])
        before_m, after_m = places[split - 1][0], places[split][0]
        step_m = self._nearest_round(after_m - before_m, after.progress_m - before.progress_m)
        at_m = -sense * self._ahead_m(before_m, sense)
        offsets = [at_m + route.step_m(before_m, s_m) for s_m, _ in places[:split]]
        offsets += [at_m + step_m + route.step_m(after_m, s_m) for s_m, _ in places[split:]]
        gap_s = float(t_s[split])
        if not sense * offsets[split - 1] < 0.0 < sense * offsets[split]:
            return None
        speeds = [_rate(t_s[part], offsets[part]) for part in (slice(None, split), slice(split, None))]
        if abs(step_m) > FASTER * max(before.fastest_mps, *speeds) * gap_s + SPARE_M:
            return None
        share = offsets[split - 1] / (offsets[split - 1] - offsets[split])
        d_m = places[split - 1][1] + share * (places[split][1] - places[split - 1][1])
        skew_m, along_m = self._beside(d_m)
        return RouteSamples(
            samples=Samples(
                t_s=t_s,
                across_m=np.array(offsets) - skew_m,
                along_m=np.full(len(fixes), along_m),
                variance_m2=np.array(
                    [
                        variance_along(route.direction_at(s_m), fix.covariance_m2)
                        for fix, (s_m, _) in zip(fixes, places, strict=True)
                    ]
                ),
                stamp_sigma_s=np.array([fix.stamp_sigma_s for fix in fixes]),
            ),
            near_s=share * gap_s,
            speed_mps=abs(step_m) / gap_s,
            along_m=along_m,
        )

    def _ahead_m(self, s_m: float, sense: float) -> float:
        """The way from `s_m` on to the line in a sense; negative where an open route's line lies the other way."""
        way_m = math.copysign(1.0, sense) * (self.s_m - s_m)
        return way_m % self.route.length_m if self.route.closed else way_m

    def _nearest_round(self, step_m: float, progress_m: float) -> float:
        """`step_m`, of which whole rounds are not known, with those that bring it next to `progress_m`."""
        if not self.route.closed:
            return step_m
        return step_m + self.route.length_m * round((progress_m - step_m) / self.route.length_m)

    def _places(self, fixes: Sequence[Fix]) -> list[tuple[float, float]]:
        """(s_m, d_m) of each observation. The latest one is on the right branch of the route, if any is: it leads."""
        places, hint_m, last = list[tuple[float, float]](), fixes[-1].s_m, fixes[-1].observed_m
        for fix in reversed(fixes):
            window_m = _LOOK_M + 2 * math.dist(last, fix.observed_m)
            place = self.route.locate_near(fix.observed_m, s_hint_m=hint_m, window_m=window_m)
            places.append(place)
            hint_m, last = place[0], fix.observed_m
        return places[::-1]

    def _beside(self, d_m: float) -> tuple[float, float]:
        """(how much further along the route the line is crossed `d_m` to the centreline's left, the place along the line)."""
        line = self.line
        (x0, y0), (x1, y1) = line.start_m, line.end_m
        line_x, line_y = (x1 - x0) / line.length_m, (y1 - y0) / line.length_m
        ahead_x, ahead_y = self.route.direction_at(self.s_m)
        x, y = self.route.point_at(self.s_m)
        leftward = line_y * ahead_x - line_x * ahead_y
        middle_m = (x - x0) * line_x + (y - y0) * line_y
        if abs(leftward) < 0.2:
            return 0.0, middle_m
        return d_m * (line_x * ahead_x + line_y * ahead_y) / leftward, middle_m + d_m / leftward


def driven_together(fixes: Sequence[Fix], after: Fix) -> list[Fix]:
    """The fixes from which the car can have driven to the one before `after`, or to which from `after`: where it was before it
    was lifted says nothing. A single one out of its way is left out.
    """
    split = next(k for k, fix in enumerate(fixes) if fix is after)
    steps = [(a, b) for a, b in pairwise(fixes) if b.t_ns > a.t_ns]
    usual_mps = median([math.dist(a.observed_m, b.observed_m) * 1e9 / (b.t_ns - a.t_ns) for a, b in steps] or [0.0])
    earlier = _reached(fixes[:split][::-1], usual_mps)
    return [*earlier[::-1], *_reached(fixes[split:], usual_mps)]


def can_drive(a: Fix, b: Fix, usual_mps: float) -> bool:
    """Whether a car of the speed `usual_mps` can have driven straight from one fix to another."""
    spread_m = math.sqrt(sum(max(fix.covariance_m2[0], fix.covariance_m2[2]) for fix in (a, b)))
    can_m = 2 * usual_mps * abs(b.t_ns - a.t_ns) * 1e-9 + SPARE_M + _SIGMAS * spread_m
    return math.dist(a.observed_m, b.observed_m) <= can_m


def variance_along(direction: PointM, covariance_m2: tuple[float, float, float]) -> float:
    """Variance along a unit vector, m^2."""
    x, y = direction
    xx, xy, yy = covariance_m2
    return max(x * x * xx + 2 * x * y * xy + y * y * yy, LEAST_SIGMA_M**2)


def _reached(fixes: Sequence[Fix], usual_mps: float) -> list[Fix]:
    """The fixes from the first on, up to a step that the car cannot have driven."""
    kept, left_out = list(fixes[:1]), 0
    for fix in fixes[1:]:
        if can_drive(kept[-1], fix, usual_mps):
            kept.append(fix)
            left_out = 0
        elif left_out:
            break
        else:
            left_out = 1
    return kept


def _rate(t_s: np.ndarray, way_m: Sequence[float]) -> float:
    """Mean speed over some samples, metres per second; 0 of a single one."""
    return abs(way_m[-1] - way_m[0]) / float(t_s[-1] - t_s[0]) if len(way_m) > 1 else 0.0
