"""The instant at which the car crosses a directed line, finer than a frame and with its uncertainty.

Confirm late, stamp early. A *passage* is the way between two neighbouring fixes on which the signed distance changes its sign.
The running sum of the signed distance falls as long as the car is before the line and rises as long as it is behind it; noise
round zero moves it by little. Where it turns, and then goes more than `TURN_SIGMAS` sigmas of a fix the other way, the passage
at the turn is *settled*: there the car changed sides (E. S. Page's cumulative sum, Biometrika 41, 1954). A settled passage that
another one, settled later, leads back through is undone; one not undone is a crossing once the car has been `hysteresis_m`
beyond the line. So a car may stand or jitter on the line for hours: which passage counts, and when it was, does not depend on
the hysteresis, and only the passage and the fixes round it are kept. The instant is `instant`'s fit to those.

Knows metres and stamps; knows nothing of laps.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from dnb_edge.race.fix import Fix
from dnb_edge.race.hidden import LinePlace, driven_together, variance_along
from dnb_edge.race.instant import Belief, Instant, Samples, find_instant
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.line import DirectedLine
from dnb_edge.values import Crossing, Direction, PointM

TURN_SIGMAS = 10.0
"""How far the running sum must come back for a passage to count as settled, in sigmas of one fix. A car that stands three
fifths of a sigma beside the line seems to change sides once in exp(2 * 0.6 * 10) = 160,000 frames (random walk with drift)."""

GAP_JERK = 3.0
"""What a car may do while nobody sees it, however smoothly it was seen to drive: q / v^2 of `instant`, 1/s^3. At 1 m/s its
acceleration wanders by 1.2 m/s^2 in half a second, and a gap of that length at the line adds 8.5 ms to sigma."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CrossingSettings:
    """How crossings are found."""

    hysteresis_m: float = 0.05
    """Distance beyond the line at which a crossing counts, metres. It never moves a crossing's time."""
    fit_half_s: float = 0.375
    """Half the time whose observations take part in the fit, seconds. Two thirds of it lie before the line: what is as sure as
    a fit of equal halves is told a third sooner."""
    gap_s: float = 0.2
    """Time without an observation round the line above which the crossing is marked as estimated, seconds."""
    stamp_sigma_s: float = 0.0
    """One standard deviation of what all stamps round one crossing are off by together, seconds; how each scatters by itself
    is known from its source."""
    lasting_sigma_m: float = 0.0
    """One standard deviation of the part of an observation's error that lasts as long as a crossing and is another at the next
    one, metres: the fit cannot see it, and no number of frames averages it out."""
    lasting_share: float = 0.07
    """The same as a share of an observation's own sigma, so that it goes by the pixels of the camera: both parts count. Of the
    shipped detector on rendered frames 0.06 +- 0.02 was found, from how far laps are off beyond what the fit says."""

    def __post_init__(self) -> None:
        if not self.hysteresis_m > 0 or not self.fit_half_s > 0 or not self.gap_s > 0:
            raise ValueError("crossing: hysteresis_m, fit_half_s and gap_s must be positive")
        if self.stamp_sigma_s < 0 or self.lasting_sigma_m < 0 or self.lasting_share < 0:
            raise ValueError("crossing: stamp_sigma_s, lasting_sigma_m and lasting_share must not be negative")

    def reach_s(self, step_s: float) -> tuple[float, float]:
        """How far before and behind two fixes round the line, `step_s` apart, others take part in the fit, seconds.

        At slow rates farther, so that the fit still has a curve to see.
        """
        before_s, behind_s = 4 / 3 * self.fit_half_s, 2 / 3 * self.fit_half_s
        return min(max(before_s, 2.5 * step_s), 2 * before_s), min(max(behind_s, 2.5 * step_s), 2 * behind_s)


@dataclass(slots=True, kw_only=True)
class _Passage:
    """The way from one side of the line to the other between two neighbouring fixes, with the fixes round it.

    Of a car that is first seen there, both are its first fix: it has not crossed the line.
    """

    before: Fix
    after: Fix
    direction: Direction
    until_ns: int
    """Stamp up to which later fixes take part in the fit."""
    fixes: list[Fix]
    by_route: bool = False
    """Whether only the way along the route tells of it."""


class LineWatch:
    """Watches one line for one car. Feed it every fix in order, and `tick` in frames without one; it returns the crossings."""

    def __init__(
        self,
        line: DirectedLine,
        settings: CrossingSettings,
        *,
        map_sigma_m: float = 0.0,
        route: Centreline | None = None,
    ) -> None:
        """`map_sigma_m` is one sigma of the map's place for the line, across it, metres. With `route`, what the car does unseen
        is told by its way along the route.
        """
        self._place = None if route is None else LinePlace.of(route, line)
        self._gap_ns = settings.gap_s * 1e9
        self._line = line
        self._settings = settings
        self._map_sigma_m = map_sigma_m
        ahead_s, behind_s = settings.reach_s(0.0)
        self._oldest_ns, self._behind_ns = round(2e9 * ahead_s), round(1e9 * behind_s)
        # Kept as plain floats: the two distances are wanted in every frame.
        self._x, self._y = line.start_m
        self._across_x, self._across_y = line.forward
        self._recent: deque[Fix] = deque()
        self._belief = Belief()
        self._confirmed = 0.0
        """The side, +1 or -1, on which the car was last known for sure; 0 before the first fix."""
        self._settled = 0.0
        """The side to which the latest settled passage led."""
        self._last_m = 0.0
        """Signed distance of the latest fix."""
        self._turned_m = 0.0
        """How far the running sum has come back from its turn, metres."""
        self._candidate: _Passage | None = None
        """The passage at the turn, while it is not settled."""
        self._waiting: _Passage | None = None
        """The settled passage that nothing has undone and nothing has confirmed."""
        self._due: list[_Passage] = []
        """Confirmed passages whose fit still waits for fixes."""

    def feed(self, fix: Fix) -> list[Crossing]:
        """Takes the next fix; returns the crossings that became certain with it."""
        done = self.tick(fix.t_ns) if self._due else []
        x, y = fix.observed_m
        across_m = self._across_x * (x - self._x) + self._across_y * (y - self._y)
        recent, hidden = self._recent, False
        if recent:
            hidden = self._place is not None and fix.t_ns - recent[-1].t_ns > self._gap_ns
            # Counted from the fix before: it is where a gap that ends now began.
            oldest_ns = recent[-1].t_ns - self._oldest_ns
            while recent[0].t_ns < oldest_ns:
                recent.popleft()
        recent.append(fix)
        self._last_m = across_m
        side = 1.0 if across_m >= 0 else -1.0
        idle = self._candidate is None and self._waiting is None and not self._due
        if idle and side == self._settled and not hidden:
            return done
        self._near(fix, across_m, side)
        if hidden:
            self._hidden(fix)
        return done + self.tick(fix.t_ns)

    def tick(self, t_ns: int) -> list[Crossing]:
        """Says that time has come to `t_ns`; returns the crossings whose fit waits for nothing more."""
        candidate = self._candidate
        if candidate is not None and t_ns > candidate.until_ns and t_ns > self._recent[-1].t_ns + self._behind_ns:
            self._lost()
        if not self._due:
            return []
        ready = [passage for passage in self._due if t_ns > passage.until_ns]
        self._due = [passage for passage in self._due if t_ns <= passage.until_ns]
        return self._crossings(ready)

    def finish(self) -> list[Crossing]:
        """Returns the crossings that still wait, from the observations there are: no more will come."""
        self._lost()
        ready, self._due = self._due, []
        return self._crossings(ready)

    @property
    def unsettled_t_ns(self) -> int | None:
        """No crossing will be told any more whose passage began before this stamp; None where none is on its way at all."""
        passages = [self._candidate, self._waiting, *self._due]
        return min((passage.before.t_ns for passage in passages if passage is not None), default=None)

    def _near(self, fix: Fix, across_m: float, side: float) -> None:
        """Takes a fix that may have to do with a passage."""
        for passage in (self._candidate, self._waiting, *self._due):
            if passage is not None and fix.t_ns <= passage.until_ns:
                passage.fixes.append(fix)
        if self._settled == 0.0:
            # Where noise alone can have it on either side it is before the line, until it proves to have been behind it.
            self._settled = self._confirmed = -1.0 if abs(across_m) < self._settings.hysteresis_m else side
        if self._candidate is None and side != self._settled:
            self._candidate = self._passage(fix)
        if self._candidate is not None:
            self._turned_m -= self._settled * across_m
            if self._turned_m <= 0.0:
                self._candidate, self._turned_m = None, 0.0
            elif self._turned_m > TURN_SIGMAS * math.sqrt(variance_along(self._line.forward, fix.covariance_m2)):
                self._settle()
        self._confirm(across_m)

    def _hidden(self, fix: Fix) -> None:
        """Takes the first fix after a gap: where its sides do not tell that the line was passed in it, the route may."""
        before, place = self._recent[-2], self._place
        direction = None if place is None else place.passed(before, fix, margin_m=self._settings.hysteresis_m)
        known = [self._candidate, self._waiting, *self._due]
        if direction is None or any(
            one is not None and one.after is fix and one.direction is direction for one in known
        ):
            return
        self._due.append(replace(self._passage(fix), direction=direction, by_route=True))

    def _settle(self) -> None:
        """The candidate is where the car changed sides. Where it is back where it came from, a passage is undone."""
        passage, self._candidate, self._turned_m = self._candidate, None, 0.0
        self._settled = -self._settled
        if passage is not None and passage.before is passage.after:
            # It was on this side from the first.
            self._confirmed = self._settled
        self._waiting = None if self._settled == self._confirmed else passage

    def _confirm(self, across_m: float) -> None:
        if self._waiting is not None and across_m * self._settled >= self._settings.hysteresis_m:
            self._confirmed = self._settled
            self._due.append(self._waiting)
            self._waiting = None

    def _lost(self) -> None:
        """The car is seen no more: where it was last seen beyond the hysteresis, its passage is as good as settled."""
        if self._candidate is not None and -self._settled * self._last_m >= self._settings.hysteresis_m:
            self._settle()
            self._confirm(self._last_m)

    def _passage(self, after: Fix) -> _Passage:
        """The passage between the two latest fixes, with all that its fit can need of the fixes so far."""
        before = self._recent[-2] if len(self._recent) > 1 else after
        ahead_s, behind_s = self._settings.reach_s((after.t_ns - before.t_ns) * 1e-9)
        from_ns = before.t_ns - round(ahead_s * 1e9)
        return _Passage(
            before=before,
            after=after,
            direction=Direction.REVERSE if self._settled > 0 else Direction.FORWARD,
            until_ns=after.t_ns + round(behind_s * 1e9),
            fixes=[fix for fix in self._recent if fix.t_ns >= from_ns],
        )

    def _crossings(self, passages: list[_Passage]) -> list[Crossing]:
        return [crossing for passage in passages if (crossing := self._crossing(passage)) is not None]

    def _crossing(self, passage: _Passage) -> Crossing | None:
        """The crossing that a passage is; None where it leads past the line's ends, and not along the route either."""
        before, after = passage.before, passage.after
        passage = replace(passage, fixes=driven_together(passage.fixes, after))
        found = None if passage.by_route else self._by_distance(passage)
        gap_s = bracket_s(before, after)
        if gap_s > self._settings.gap_s and (found is None or gap_s > 2 * self._settings.fit_half_s):
            found = self._by_route(passage) or found
        return None if found is None else self._told(passage, *found)

    def _by_distance(self, passage: _Passage) -> tuple[Instant, float] | None:
        """(instant, seconds between the fixes on either side of it) by the distance from the line; None where the way between
        the two leads past the line's ends.
        """
        before, after = passage.before, passage.after
        bracket = self._straight(before, after)
        if not self._is_within(bracket.along_m, math.dist(before.observed_m, after.observed_m)):
            return None
        found, gap_s = bracket, bracket_s(before, after)
        if gap_s <= 2 * self._settings.fit_half_s:
            fitted = self._fitted(passage, bracket)
            found, gap_s = fitted if fitted is not None else (self._standing(bracket), gap_s)
        return (found, gap_s) if self._is_within(found.along_m, 0.0) else None

    def _by_route(self, passage: _Passage) -> tuple[Instant, float] | None:
        """The same by the way along the route; None where that does not lead over the line."""
        before, after = passage.before, passage.after
        route = None if self._place is None else self._place.samples(passage.fixes, before, after, passage.direction)
        if route is None:
            return None
        gap_s = bracket_s(before, after)
        found = find_instant(route.samples, route.near_s, passage.direction is Direction.FORWARD, self._belief)
        # What the fit learns of a car that nobody sees is no news of one that is seen.
        instant = None if found is None else self._widened(found[0], 0.0, gap_s)
        if instant is None:
            instant = Instant(
                t_s=route.near_s, sigma_s=gap_s / math.sqrt(12.0), speed_mps=route.speed_mps, along_m=route.along_m
            )
        return replace(instant, along_m=min(max(route.along_m, 0.0), self._line.length_m)), gap_s

    def _told(self, passage: _Passage, found: Instant, gap_s: float) -> Crossing:
        before, settings = passage.before, self._settings
        t_ns = before.seen_t_ns + round(found.t_s * 1e9)
        speed_mps = max(found.speed_mps, 1e-6)
        lasting_m = settings.lasting_share * math.sqrt(variance_along(self._line.forward, passage.after.covariance_m2))
        return Crossing(
            t_ns=t_ns,
            t_s=before.t_s + (t_ns - before.t_ns) * 1e-9,
            line=self._line.name,
            direction=passage.direction,
            sigma_s=math.hypot(
                found.sigma_s,
                settings.stamp_sigma_s,
                math.hypot(settings.lasting_sigma_m, lasting_m, self._map_sigma_m) / speed_mps,
            ),
            track_m=_between(self._line.start_m, self._line.end_m, found.along_m / self._line.length_m),
            target_id=passage.after.target_id,
            estimated=gap_s > settings.gap_s,
            speed_mps=found.speed_mps,
            map_sigma_m=self._map_sigma_m,
        )

    def _straight(self, before: Fix, after: Fix) -> Instant:
        """The instant by the straight way between two fixes; between them it is as likely here as there."""
        distances = [self._line.signed_distance(fix.observed_m) for fix in (before, after)]
        share = distances[0] / (distances[0] - distances[1])
        gap_s = bracket_s(before, after)
        return Instant(
            t_s=share * gap_s,
            sigma_s=gap_s / math.sqrt(12.0),
            speed_mps=abs(distances[1] - distances[0]) / gap_s,
            along_m=self._along_m(_between(before.observed_m, after.observed_m, share)),
        )

    def _fitted(self, passage: _Passage, bracket: Instant) -> tuple[Instant, float] | None:
        """(instant, seconds between the fixes on either side of it) by the fit; None where the car stands."""
        start, fixes = passage.before, passage.fixes
        t_s = np.array([(fix.seen_t_ns - start.seen_t_ns) * 1e-9 for fix in fixes])
        samples = Samples(
            t_s=t_s,
            across_m=np.array([self._line.signed_distance(fix.observed_m) for fix in fixes]),
            along_m=np.array([self._along_m(fix.observed_m) for fix in fixes]),
            variance_m2=np.array([variance_along(self._line.forward, fix.covariance_m2) for fix in fixes]),
            stamp_sigma_s=np.array([fix.stamp_sigma_s for fix in fixes]),
        )
        found = find_instant(samples, bracket.t_s, passage.direction is Direction.FORWARD, self._belief)
        if found is None:
            return None
        instant, self._belief = found
        later = min(max(int(np.searchsorted(t_s, instant.t_s)), 1), len(t_s) - 1)
        from_s, until_s = float(t_s[later - 1]), float(t_s[later])
        gap_s = until_s - from_s
        return self._widened(instant, from_s, until_s), gap_s

    def _widened(self, instant: Instant, from_s: float, until_s: float) -> Instant:
        """The instant of a car that nobody saw from one second to another, with what it can have done in that time."""
        gap_s = until_s - from_s
        # The mean of two departures from the parabola, one from either side (see `instant`); 10 um at 30 frames a second.
        unseen_s = math.sqrt(GAP_JERK * (gap_s / 2.0) ** 5 / 40.0)
        instant = replace(instant, sigma_s=math.hypot(instant.sigma_s, unseen_s))
        if gap_s <= self._settings.gap_s:
            return instant
        # That it was crossed in the gap, the fixes on either side say for themselves.
        sigma_s = 1.0 / math.hypot(1.0 / instant.sigma_s, math.sqrt(12.0) / gap_s)
        return replace(instant, t_s=min(max(instant.t_s, from_s), until_s), sigma_s=sigma_s)

    def _standing(self, bracket: Instant) -> Instant:
        """The instant of a car that stood on the line as long as the fit can see: any within it is as likely."""
        return replace(bracket, sigma_s=self._settings.fit_half_s / math.sqrt(3.0))

    def _along_m(self, point_m: PointM) -> float:
        """Place along the line, metres from its start."""
        return (point_m[0] - self._x) * self._across_y - (point_m[1] - self._y) * self._across_x

    def _is_within(self, along_m: float, margin_m: float) -> bool:
        return -margin_m <= along_m <= self._line.length_m + margin_m


def bracket_s(before: Fix, after: Fix) -> float:
    """Seconds from one fix to a later one."""
    return (after.seen_t_ns - before.seen_t_ns) * 1e-9


def lap_sigma_s(start: Crossing, end: Crossing) -> float:
    """One standard deviation of the time from `start` to `end`, seconds.

    The map's error is the same at every crossing of one line, map_sigma_m across it, and moves each instant by map_sigma_m / v:
    between two crossings of that line only the difference of the two remains, and nothing at equal speeds. All else is
    independent, and so is everything between two different lines.
    """
    apart = math.hypot(start.sigma_s, end.sigma_s)
    if start.line != end.line or not start.speed_mps or not end.speed_mps:
        return apart
    first_s, second_s = start.map_sigma_m / start.speed_mps, end.map_sigma_m / end.speed_mps
    if start.direction is not end.direction:
        second_s = -second_s
    return math.sqrt(max(apart**2 - 2 * first_s * second_s, 0.0))


def _between(a: PointM, b: PointM, share: float) -> PointM:
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
