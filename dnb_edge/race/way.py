"""How much of a lap's route the car really drove: the stretches that it went along, without those that it left out.

Knows fixes and the route's length. Progress counts steps along the route; a car that goes across the infield, or is carried,
gets on by more than it drove. Such a gain is a short cut and is not driven, so that it makes no lap.
"""

from __future__ import annotations

import math

from dnb_edge.race.fix import LOST_S, Fix
from dnb_edge.race.incidents import Draft, Step
from dnb_edge.race.rules import LapRules
from dnb_edge.values import IncidentKind

GAP_S = 0.2
"""Over a longer step the car may have driven any way that its speed allows, seconds."""

CHORD_M = 0.02
"""The car's way is measured by chords of this length, metres, so that the scatter of one that stands adds nothing."""

CELLS = 256
"""A lap's route is ticked off in so many stretches: what is driven twice counts once."""


class Way:
    """The way in one lap. Within the lane the inside of a bend is nobody's short cut: only what is gained from leaving
    the lane to being back on it, or from one fix to the next, is counted.
    """

    def __init__(
        self, rules: LapRules, *, progress_m: float, lap_m: float, start_s_m: float, loop_m: float | None
    ) -> None:
        """`progress_m` is the car's progress at the lap's start, which lies at `start_s_m`; `lap_m` a lap's length along the
        route; `loop_m` the length of a closed route, None where it is open.
        """
        self._short_cut_m = rules.short_cut_m
        self._margin_m = rules.off_lane_margin_m
        self._lap_m = lap_m
        self._start_s_m = start_s_m
        self._loop_m = loop_m
        self._cells = bytearray(CELLS)
        self._start_m = progress_m
        self._now_m = progress_m
        self._jumped_m = 0.0
        self._way_m = 0.0
        self._anchor: Fix | None = None
        self._base: Fix | None = None
        self._base_way_m = 0.0
        self._unsure = False

    @property
    def driven_m(self) -> float:
        """Metres of the lap's route that the car has driven along; what it drove more than once counts once."""
        ongoing_m = 0.0
        if self._base is not None:
            ongoing_m = min(self._now_m - self._base.progress_m, self._way_m - self._base_way_m)
        return min(sum(self._cells) * self._lap_m / CELLS + max(ongoing_m, 0.0), self._lap_m)

    @property
    def net_m(self) -> float:
        """Metres along the route since the lap's start, jumps left out: it falls only while the car drives against the route,
        and grows beyond a lap where a crossing was missed."""
        return self._now_m - self._start_m - self._jumped_m

    def feed(self, step: Step) -> Draft | None:
        """Takes the next step; returns the short cut that ended with it."""
        fix, base = step.fix, self._base
        self._measure(step)
        before_m, self._now_m = self._now_m, fix.progress_m
        if base is None or step.lifted:
            ahead_m = fix.progress_m - before_m
            if step.lifted:
                self._jumped_m += ahead_m
            elif ahead_m <= step.can_m + self._short_cut_m:
                self._tick_off(fix, ahead_m)
            self._rest_on(fix)
            return None
        if step.dt_s > GAP_S and fix.progress_m < before_m:
            # Nobody saw it drive back.
            self._jumped_m += fix.progress_m - before_m
            self._rest_on(fix)
            return None
        if fix.outside_m > self._margin_m:
            return None
        draft = self._back_on(base, fix)
        self._rest_on(fix)
        return draft

    def _measure(self, step: Step) -> None:
        fix, anchor = step.fix, self._anchor
        if anchor is None or step.dt_s > GAP_S:
            self._way_m += max(step.moved_m, step.can_m)
            self._anchor = fix
            self._unsure = self._unsure or step.dt_s > LOST_S
            return
        chord_m = math.dist(anchor.track_m, fix.track_m)
        if chord_m >= CHORD_M:
            self._way_m += chord_m
            self._anchor = fix

    def _rest_on(self, fix: Fix) -> None:
        self._base, self._base_way_m, self._unsure = fix, self._way_m, False

    def _tick_off(self, fix: Fix, ahead_m: float, left_out_m: float = 0.0) -> None:
        """Ticks off the `ahead_m` before `fix`, without the last `left_out_m` of them."""
        place_m = fix.s_m - self._start_s_m
        if self._loop_m is not None:
            place_m %= self._loop_m
        cell_m = self._lap_m / CELLS
        first, last = math.floor((place_m - ahead_m) / cell_m), math.floor((place_m - left_out_m) / cell_m)
        for cell in range(max(first, 0), min(last, CELLS - 1) + 1):
            self._cells[cell] = 1

    def _back_on(self, base: Fix, fix: Fix) -> Draft | None:
        """Takes what the car went from `base`, in the lane, to `fix`, in the lane again; returns it if it is a short cut."""
        ahead_m = fix.progress_m - base.progress_m
        drove_m = self._way_m - self._base_way_m
        if abs(ahead_m) - drove_m <= self._short_cut_m:
            if ahead_m >= 0:
                self._tick_off(fix, ahead_m)
            return None
        if ahead_m >= 0:
            self._jumped_m += ahead_m - drove_m
        else:
            place_m = base.progress_m - self._start_m - self._jumped_m + ahead_m
            self._jumped_m += ahead_m
            # Back beyond the lap's start is ahead, the shorter way round.
            if self._loop_m is None or place_m > -self._short_cut_m:
                return None
            ahead_m += self._loop_m
        gain_m = ahead_m - drove_m
        # What it did drive is worth as much of what it left out.
        self._tick_off(fix, ahead_m, gain_m)
        if self._unsure or gain_m <= self._short_cut_m:
            return None
        return Draft(
            kind=IncidentKind.SHORT_CUT,
            start_t_ns=base.t_ns,
            start_s=base.t_s,
            end_t_ns=fix.t_ns,
            worst=fix,
            greatest_m=gain_m,
            text=f"the car took a short cut: it got {ahead_m:.2f} m further along the route and drove {drove_m:.2f} m",
        )
