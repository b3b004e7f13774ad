"""Whether a part of the car is beyond the lane's edge, and for how long.

Knows the lane along the route as plain numbers, for speed, and the car's footprint; knows no laps. The footprint is a
rectangle about the ground point, along the way that the fixes have gone.
"""

from __future__ import annotations

import math
from bisect import bisect_right

from dnb_edge.race.fix import HEADING_M, Fix
from dnb_edge.race.incidents import Draft
from dnb_edge.race.rules import Footprint, LapRules
from dnb_edge.track.centreline import Centreline
from dnb_edge.values import IncidentKind, PointM

JOIN_S = 0.2
"""Two excursions that are less than this apart are one, seconds."""

_WHO = {
    Footprint.CENTRE: "the car",
    Footprint.ANY_WHEEL: "a wheel of the car",
    Footprint.ALL_WHEELS: "the car with all wheels",
}


class Lane:
    """Half-widths, direction and curvature along the route."""

    def __init__(self, route: Centreline) -> None:
        self._s_m: list[float] = route.s_m.tolist()
        self._left_m: list[float] = route.half_left_m.tolist()
        self._right_m: list[float] = route.half_right_m.tolist()
        self._curvature: list[float] = route.curvature_1pm.tolist()
        directions = [route.direction_at(s_m) for s_m in self._s_m]
        self._angle = [math.atan2(y, x) for x, y in directions]

    def _index(self, s_m: float) -> int:
        return max(bisect_right(self._s_m, s_m) - 1, 0)

    def angle_at(self, s_m: float) -> float:
        """Direction of travel at `s_m` within the route, atan2(dy, dx)."""
        return self._angle[self._index(s_m)]

    def corners_outside_m(self, s_m: float, d_m: float, turned: float, size_m: tuple[float, float]) -> list[float]:
        """Metres beyond the lane's edge, negative inside, of the four corners of a car of `size_m` (length, width) at
        (s_m, d_m), turned to the left of the route by `turned`. The lane is taken to have one width and one curvature along
        the car: a corner's offset is that to the circle which the route follows there.
        """
        i = self._index(s_m)
        left_m, right_m, curvature = self._left_m[i], self._right_m[i], self._curvature[i]
        cos, sin = math.cos(turned), math.sin(turned)
        outside = []
        for ahead_m in (size_m[0] / 2, -size_m[0] / 2):
            for aside_m in (size_m[1] / 2, -size_m[1] / 2):
                along_m = ahead_m * cos - aside_m * sin
                straight_m = d_m + ahead_m * sin + aside_m * cos
                inner = 1.0 - curvature * straight_m
                # The distance to the circle's centre, less its radius, to second order: exact enough for a car's length.
                offset_m = straight_m - (curvature * along_m**2 / (2.0 * inner) if inner > 0.25 else 0.0)
                outside.append(offset_m - left_m if offset_m >= 0 else -offset_m - right_m)
        return outside


class Overhang:
    """How far beyond the lane's edge the part of the car is that counts, fix by fix."""

    def __init__(self, rules: LapRules, lane: Lane | None) -> None:
        self._part = rules.off_lane
        self._lane = lane
        self._size_m = rules.car_length_m or 0.0, rules.car_width_m or 0.0
        self._turned = None if lane is None else Turned(lane)

    def outside_m(self, fix: Fix) -> float:
        """Takes the next fix; metres beyond the edge, negative inside."""
        if self._part is Footprint.CENTRE or self._lane is None or self._turned is None:
            return fix.outside_m
        corners = self._lane.corners_outside_m(fix.s_m, fix.d_m, self._turned.feed(fix), self._size_m)
        return max(corners) if self._part is Footprint.ANY_WHEEL else min(corners)


class Turned:
    """The car's angle to the route, positive to the left, from its way; until it has gone some, it is along the route or as it
    was."""

    def __init__(self, lane: Lane) -> None:
        self._lane = lane
        self._since: tuple[PointM, float] | None = None
        self._turned = 0.0

    def feed(self, fix: Fix) -> float:
        """Takes the next fix; the angle there."""
        angle = self._lane.angle_at(fix.s_m)
        if self._since is None:
            self._since = fix.track_m, angle
            return self._turned
        (x0, y0), before = self._since
        x, y = fix.track_m[0] - x0, fix.track_m[1] - y0
        if math.hypot(x, y) < HEADING_M:
            return self._turned
        self._since = fix.track_m, angle
        # A chord lies along the route's direction half way between its ends.
        middle = before + _turn(angle - before) / 2
        turned = _turn(math.atan2(y, x) - middle)
        # A rectangle that drives backwards covers the same ground.
        self._turned = turned if abs(turned) <= math.pi / 2 else _turn(turned + math.pi)
        return self._turned


class OffTrack:
    """Tells that the car was off the lane by more than the margin for longer than `off_lane_s`, once it is back on it."""

    def __init__(self, rules: LapRules) -> None:
        self._who = _WHO[rules.off_lane]
        self._margin_m = rules.off_lane_margin_m
        self._limit_ns = rules.off_lane_s * 1e9
        self._first: Fix | None = None
        self._last_t_ns = 0
        self._back = False
        self._worst: tuple[float, Fix] | None = None

    def feed(self, fix: Fix, outside_m: float) -> Draft | None:
        """Takes the next fix, and how far the part of the car that counts is beyond the edge."""
        if self._first is None and outside_m <= self._margin_m:
            return None
        apart = (fix.t_ns - self._last_t_ns) * 1e-9 > JOIN_S
        draft = None
        if outside_m <= self._margin_m:
            self._back = True
            if apart:
                draft = self.close()
            return draft
        if self._back and apart:
            draft = self.close()
        if self._first is None:
            self._first, self._worst = fix, (outside_m, fix)
        elif self._worst is None or outside_m > self._worst[0]:
            self._worst = outside_m, fix
        self._last_t_ns, self._back = fix.t_ns, False
        return draft

    def close(self) -> Draft | None:
        """The excursion so far, if it was too long; it is over."""
        draft = self.so_far()
        self._first, self._worst, self._back = None, None, False
        return draft

    def so_far(self) -> Draft | None:
        """The same, while it may go on."""
        first, worst = self._first, self._worst
        if first is None or worst is None or self._last_t_ns - first.t_ns <= self._limit_ns:
            return None
        lasted_s = (self._last_t_ns - first.t_ns) * 1e-9
        return Draft(
            kind=IncidentKind.OFF_TRACK,
            start_t_ns=first.t_ns,
            start_s=first.t_s,
            end_t_ns=self._last_t_ns,
            worst=worst[1],
            greatest_m=worst[0],
            text=f"{self._who} left the lane for {lasted_s:.1f} s, by up to {worst[0] * 1e3:.0f} mm",
        )


def _turn(angle: float) -> float:
    """The same angle within -pi..pi."""
    return (angle + math.pi) % (2 * math.pi) - math.pi
