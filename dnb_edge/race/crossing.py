"""The instant at which the car crosses a directed line, finer than a frame and with its uncertainty.

Confirm late, stamp early: a crossing counts once the car is `hysteresis_m` beyond the line, so that a car that jitters on
the line makes none; its instant comes from a least-squares fit of the signed distance over the stamped observations
round the line, so the wait never moves the time. Knows metres and stamps; knows nothing of laps.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dnb_edge.race.fix import Fix
from dnb_edge.track.line import DirectedLine
from dnb_edge.values import Crossing, Direction, PointM


@dataclass(frozen=True, slots=True, kw_only=True)
class CrossingSettings:
    """How crossings are found."""

    hysteresis_m: float = 0.05
    """Distance beyond the line at which a crossing counts, metres."""
    fit_half_s: float = 0.15
    """Observations within this time of the line take part in the fit, seconds."""
    gap_s: float = 0.2
    """Time without an observation round the line above which the crossing is marked as estimated, seconds."""
    stamp_sigma_s: float = 0.0
    """One standard deviation of the source's stamps, seconds."""

    def __post_init__(self) -> None:
        if not self.hysteresis_m > 0 or not self.fit_half_s > 0 or not self.gap_s > 0:
            raise ValueError("crossing: hysteresis_m, fit_half_s and gap_s must be positive")


@dataclass(slots=True, kw_only=True)
class _Passage:
    """The way through the line between two neighbouring fixes, with the fixes round it as far as the fit reaches."""

    before: Fix
    after: Fix
    direction: Direction
    reach_ns: float
    """How far before `before` and after `after` the fit reaches."""
    fixes: list[Fix]


class LineWatch:
    """Watches one line. Feed it every fix in order, and `tick` in frames without one; it returns confirmed crossings.

    A passage through the line is noted at once, with the fixes round it; it becomes a crossing once the car is beyond the
    hysteresis on that side, however long it takes its time about it.
    """

    def __init__(self, line: DirectedLine, settings: CrossingSettings) -> None:
        self._line = line
        self._settings = settings
        self._recent: deque[Fix] = deque()
        self._side: Direction | None = None
        self._passage: _Passage | None = None
        self._pending: _Passage | None = None

    def feed(self, fix: Fix) -> list[Crossing]:
        """Takes the next fix; returns the crossings that became certain with it."""
        done = self.tick(fix.t_ns)
        for passage in (self._passage, self._pending):
            if passage is not None and fix.t_ns - passage.after.t_ns <= passage.reach_ns:
                passage.fixes.append(fix)
        self._note(fix)
        distance_m = self._line.signed_distance(fix.observed_m)
        side = Direction.FORWARD if distance_m > 0 else Direction.REVERSE
        if self._side is None:
            # A car that is first seen just before the line still has to cross it.
            self._side = side
        if abs(distance_m) >= self._settings.hysteresis_m:
            passage, self._passage = self._passage, None
            if side is not self._side and passage is not None and passage.direction is side:
                done += self.finish()
                self._pending = passage
            self._side = side
        return done

    def tick(self, t_ns: int) -> list[Crossing]:
        """Says that time has come to `t_ns`; returns the crossing whose fit waits for nothing more."""
        pending = self._pending
        waits = pending is not None and t_ns - pending.after.t_ns <= pending.reach_ns
        return [] if waits else self.finish()

    def finish(self) -> list[Crossing]:
        """Returns the pending crossing from the observations there are: no more will come."""
        if self._pending is None:
            return []
        pending, self._pending = self._pending, None
        return [self._crossing(pending)]

    def _note(self, fix: Fix) -> None:
        """Notes whether the way to `fix` leads through the line, and keeps what a later passage's fit can need."""
        if self._recent:
            before = self._recent[-1]
            if self._line.intersects_segment(before.observed_m, fix.observed_m) is not None:
                forward = self._line.signed_distance(fix.observed_m) >= 0
                reach_ns = self._reach_ns(fix.t_ns - before.t_ns)
                self._passage = _Passage(
                    before=before,
                    after=fix,
                    direction=Direction.FORWARD if forward else Direction.REVERSE,
                    reach_ns=reach_ns,
                    fixes=[*(one for one in self._recent if one.t_ns >= before.t_ns - reach_ns), fix],
                )
        self._recent.append(fix)
        while len(self._recent) > 1 and self._recent[0].t_ns < fix.t_ns - 2 * self._settings.fit_half_s * 1e9:
            self._recent.popleft()

    def _reach_ns(self, step_ns: int) -> float:
        """Reach of the fit before and after the line: at slow frame rates longer, so that it still has a curve to see."""
        half_ns = self._settings.fit_half_s * 1e9
        return min(max(half_ns, 2.5 * step_ns), 2 * half_ns)

    def _crossing(self, passage: _Passage) -> Crossing:
        before, after = passage.before, passage.after
        gap_s = (after.t_ns - before.t_ns) * 1e-9
        t_ns, sigma_s = self._instant(before, after, passage.fixes)
        share = (t_ns - before.t_ns) / (after.t_ns - before.t_ns)
        estimated = gap_s > self._settings.gap_s
        spread_s = gap_s / math.sqrt(12.0) if estimated else 0.0
        return Crossing(
            t_ns=t_ns,
            t_s=before.t_s + (t_ns - before.t_ns) * 1e-9,
            line=self._line.name,
            direction=passage.direction,
            sigma_s=math.hypot(sigma_s, spread_s, self._settings.stamp_sigma_s),
            track_m=_between(before.observed_m, after.observed_m, share),
            target_id=after.target_id,
            estimated=estimated,
        )

    def _instant(self, before: Fix, after: Fix, fixes: Sequence[Fix]) -> tuple[int, float]:
        """(t_ns, sigma_s) of the zero of the signed distance, by a weighted polynomial fit round the line."""
        t0 = before.t_ns
        t = np.array([(fix.t_ns - t0) * 1e-9 for fix in fixes])
        h = np.array([self._line.signed_distance(fix.observed_m) for fix in fixes])
        sigma_m = np.sqrt([_variance_along(self._line.forward, fix.covariance_m2) for fix in fixes])
        degree = 2 if len(fixes) >= 5 else 1
        bracket_s = (after.t_ns - t0) * 1e-9
        middle_s = bracket_s / 2
        design = np.vander(t - middle_s, degree + 1, increasing=True) / sigma_m[:, None]
        solution, residual, _, _ = np.linalg.lstsq(design, h / sigma_m, rcond=None)
        spare = len(fixes) - degree - 1
        # Where the observations scatter more than they say, believe the scatter.
        scale = max(1.0, float(residual[0]) / spare) if spare > 0 and residual.size else 1.0
        covariance = np.linalg.inv(design.T @ design) * scale
        root = _root(solution, bracket_s) + middle_s
        basis = np.power(root - middle_s, np.arange(degree + 1))
        speed = float(np.dot(solution[1:] * np.arange(1, degree + 1), basis[:-1]))
        sigma_s = math.sqrt(float(basis @ covariance @ basis)) / abs(speed) if speed else bracket_s
        return t0 + round(root * 1e9), min(sigma_s, max(bracket_s, self._settings.fit_half_s))


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


def _root(coefficients: np.ndarray, bracket_s: float) -> float:
    """The zero of the polynomial nearest to the middle of the bracket, time counted from there; half the bracket's length
    beyond either end is allowed, since the fit may disagree with single observations. Linear where the parabola fails.
    """
    a, b = float(coefficients[0]), float(coefficients[1])
    linear = -a / b if b else 0.0
    root = linear
    if len(coefficients) == 3 and coefficients[2]:
        c = float(coefficients[2])
        inside = b * b - 4 * a * c
        if inside >= 0:
            # The root that tends to the linear one as c tends to zero, without cancellation.
            q = -(b + math.copysign(math.sqrt(inside), b)) / 2
            root = a / q if q else linear
    limit = bracket_s
    return min(max(root, -limit), limit)


def _variance_along(direction: tuple[float, float], covariance_m2: tuple[float, float, float]) -> float:
    x, y = direction
    xx, xy, yy = covariance_m2
    return max(x * x * xx + 2 * x * y * xy + y * y * yy, 1e-12)


def _between(a: PointM, b: PointM, share: float) -> PointM:
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
