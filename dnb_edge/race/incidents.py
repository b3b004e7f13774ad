"""What can happen to a car in a lap, watched fix by fix: each kind a small state machine that tells when it ends.

Knows fixes, the lap's start and the limits of `LapRules`; knows neither lines nor what an incident costs. Here are those that
need no more than where the car is: lost, lifted, stalled, wrong way. `off_track.py` and `way.py` have the others.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from dnb_edge.race.fix import Fix
from dnb_edge.race.rules import LapRules
from dnb_edge.values import Crossing, Incident, IncidentKind

STILL_M = 0.05
"""A car that stays within this distance of a place stands there, metres: more than the scatter of one that is parked."""

_STEPS = 3
"""So many steps in a row must be as fast for the car to be that fast: a hand, or a false detection, makes one or two."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Draft:
    """An incident before it has its number and its lap."""

    kind: IncidentKind
    start_t_ns: int
    start_s: float
    end_t_ns: int
    worst: Fix | Crossing
    """Where the car was when it was at its worst: seen, or at the line at which nobody saw it."""
    text: str
    greatest_m: float | None = None

    def told(self, *, number: int, car: int, lap: int | None) -> Incident:
        """The incident, numbered `number`, of the car's lap `lap`."""
        seen = self.worst if isinstance(self.worst, Fix) else None
        return Incident(
            number=number,
            kind=self.kind,
            car=car,
            target_id=self.worst.target_id,
            lap=lap,
            start_t_ns=self.start_t_ns,
            end_t_ns=self.end_t_ns,
            start_s=self.start_s,
            lasted_s=(self.end_t_ns - self.start_t_ns) * 1e-9,
            greatest_m=self.greatest_m,
            worst_t_ns=self.worst.t_ns,
            track_m=self.worst.track_m,
            camera_px=None if seen is None else seen.camera_px,
            s_m=None if seen is None else seen.s_m,
            text=self.text,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """The way from the fix before to this one."""

    fix: Fix
    before: Fix | None
    dt_s: float
    moved_m: float
    """Straight from one to the other."""
    can_m: float
    """As far as the car drives in that time at the greatest speed at which it was seen."""
    rest: Fix
    """The fix since which the car stands; this one, where it moves."""
    lifted: bool
    """Whether it is further away than it can have driven."""


class Pace:
    """Makes steps of fixes and remembers how fast the car drives. It belongs to the car, not to a lap."""

    def __init__(self, lifted_m: float) -> None:
        self._lifted_m = lifted_m
        self._speeds_mps: deque[float] = deque(maxlen=_STEPS)
        self._fastest_mps = 0.0
        self._rest: Fix | None = None
        self.last: Fix | None = None
        """The latest fix."""

    def step(self, fix: Fix) -> Step:
        """The step to the next fix."""
        if self._rest is None or math.dist(self._rest.track_m, fix.track_m) > STILL_M:
            self._rest = fix
        step = self.peek(fix)
        self.last = fix
        if step.dt_s > 0.0:
            self._speeds_mps.append(step.moved_m / step.dt_s)
            if len(self._speeds_mps) == _STEPS:
                self._fastest_mps = max(self._fastest_mps, min(self._speeds_mps))
        return step

    def peek(self, fix: Fix) -> Step:
        """The same, without taking it."""
        before, rest = self.last, self._rest or fix
        if before is None or fix.t_ns <= before.t_ns:
            return Step(fix=fix, before=before, dt_s=0.0, moved_m=0.0, can_m=0.0, rest=rest, lifted=False)
        dt_s = (fix.t_ns - before.t_ns) * 1e-9
        moved_m = math.dist(before.track_m, fix.track_m)
        can_m = self._fastest_mps * dt_s
        is_far = moved_m - can_m > self._lifted_m
        return Step(fix=fix, before=before, dt_s=dt_s, moved_m=moved_m, can_m=can_m, rest=rest, lifted=is_far)

    def can_m(self, a: Fix, b: Fix) -> float:
        """How far the car drives from one fix to a later one at the greatest speed at which it was seen."""
        return self._fastest_mps * (b.t_ns - a.t_ns) * 1e-9

    def back_to(self, fix: Fix | None) -> None:
        """Forgets all fixes after `fix`: they will come again."""
        self.last = fix


class Lost:
    """Tells that the car was unseen for longer than `max_gap_s`, once it is seen again or the lap is over."""

    def __init__(self, rules: LapRules, begin: Crossing, seen_t_ns: int) -> None:
        """`seen_t_ns`: the car is known to have been seen then, at or after the lap's beginning."""
        self._limit_s = rules.max_gap_s
        self._last: Fix | Crossing = begin
        self._zero_ns = begin.t_ns - round(begin.t_s * 1e9)
        self._seen_t_ns = seen_t_ns

    def feed(self, fix: Fix) -> Draft | None:
        """Takes the next fix."""
        draft = self.close(fix.t_ns)
        self._last, self._seen_t_ns = fix, fix.t_ns
        return draft

    def close(self, t_ns: int) -> Draft | None:
        """The gap up to `t_ns`, when the car was seen again or nobody looks any more, if it is too long."""
        gap_s = (t_ns - self._seen_t_ns) * 1e-9
        if gap_s <= self._limit_s:
            return None
        return Draft(
            kind=IncidentKind.LOST,
            start_t_ns=self._seen_t_ns,
            start_s=(self._seen_t_ns - self._zero_ns) * 1e-9,
            end_t_ns=t_ns,
            worst=self._last,
            text=f"the car was not seen for {gap_s:.1f} s (limit {self._limit_s:.1f} s)",
        )


def lifted(step: Step, begin: Crossing) -> Draft | None:
    """Tells a step of the lap that began at `begin`, or over its end, that the car cannot have driven."""
    before = step.before
    if not step.lifted or before is None:
        return None
    return Draft(
        kind=IncidentKind.LIFTED,
        start_t_ns=max(before.t_ns, begin.t_ns),
        start_s=max(before.t_s, begin.t_s),
        end_t_ns=step.fix.t_ns,
        worst=step.fix,
        greatest_m=step.moved_m,
        text=f"the car was lifted: after {step.dt_s:.2f} s it was {step.moved_m:.2f} m away, where it cannot have driven",
    )


class Stalled:
    """Tells that the car stood for longer than `stalled_s`, once it has driven on or the lap is over."""

    def __init__(self, rules: LapRules, begin: Crossing) -> None:
        self._limit_ns = rules.stalled_s * 1e9
        self._begin = begin
        self._rest: Fix | None = None
        self._last_t_ns = 0

    def feed(self, step: Step) -> Draft | None:
        """Takes the next step."""
        draft = None if self._rest is None or step.rest is self._rest else self.close()
        self._rest, self._last_t_ns = step.rest, step.fix.t_ns
        return draft

    def close(self) -> Draft | None:
        """The stand up to the last fix, if it was too long; of one that began before the lap, the part within it."""
        rest = self._rest
        if rest is None:
            return None
        start_t_ns = max(rest.t_ns, self._begin.t_ns)
        if self._last_t_ns - start_t_ns < self._limit_ns:
            return None
        return Draft(
            kind=IncidentKind.STALLED,
            start_t_ns=start_t_ns,
            start_s=max(rest.t_s, self._begin.t_s),
            end_t_ns=self._last_t_ns,
            worst=rest,
            text=f"the car stood for {(self._last_t_ns - start_t_ns) * 1e-9:.1f} s",
        )


class WrongWay:
    """Tells that the car went back along the route by more than `wrong_way_m`, once it goes forward again."""

    def __init__(self, rules: LapRules) -> None:
        self._limit_m = rules.wrong_way_m
        self._furthest: tuple[float, Fix] | None = None
        self._back: tuple[float, Fix] | None = None

    def feed(self, fix: Fix, driven_m: float) -> Draft | None:
        """Takes the next fix, and how far the car has driven along the route in the lap."""
        if self._furthest is None or (self._back is None and driven_m >= self._furthest[0]):
            self._furthest = driven_m, fix
            return None
        if self._back is None:
            if self._furthest[0] - driven_m > self._limit_m:
                self._back = driven_m, fix
            return None
        if driven_m < self._back[0]:
            self._back = driven_m, fix
        elif driven_m - self._back[0] > self._limit_m:
            draft = self.close()
            self._furthest, self._back = (driven_m, fix), None
            return draft
        return None

    def close(self) -> Draft | None:
        """The way back so far, if it was too long."""
        if self._furthest is None or self._back is None:
            return None
        (furthest_m, begin), (back_m, end) = self._furthest, self._back
        return Draft(
            kind=IncidentKind.WRONG_WAY,
            start_t_ns=begin.t_ns,
            start_s=begin.t_s,
            end_t_ns=end.t_ns,
            worst=end,
            greatest_m=furthest_m - back_m,
            text=f"the car drove {furthest_m - back_m:.2f} m against the route",
        )
