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

KEPT_FIXES = 1000
"""Fixes kept of a car that stands on the line."""


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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Pending:
    """A crossing that has happened and whose fit still waits for observations."""

    before: Fix
    after: Fix
    direction: Direction


class LineWatch:
    """Watches one line. Feed it every fix in order, and `tick` in frames without one; it returns confirmed crossings."""

    def __init__(self, line: DirectedLine, settings: CrossingSettings) -> None:
        self._line = line
        self._settings = settings
        self._recent: deque[Fix] = deque(maxlen=KEPT_FIXES)
        self._side: Direction | None = None
        self._pending: _Pending | None = None

    def feed(self, fix: Fix) -> list[Crossing]:
        """Takes the next fix; returns the crossings that became certain with it."""
        done = self.tick(fix.t_ns)
        self._recent.append(fix)
        distance_m = self._line.signed_distance(fix.observed_m)
        if abs(distance_m) >= self._settings.hysteresis_m:
            side = Direction.FORWARD if distance_m > 0 else Direction.REVERSE
            if self._side not in (None, side):
                bracket = self._bracket()
                if bracket is not None:
                    done += self.finish()
                    self._pending = _Pending(before=bracket[0], after=bracket[1], direction=side)
            self._side = side
            self._forget(fix.t_ns)
        return done

    def tick(self, t_ns: int) -> list[Crossing]:
        """Says that time has come to `t_ns`; returns the crossing whose fit waits for nothing more."""
        pending = self._pending
        waits = pending is not None and t_ns - pending.after.t_ns <= self._fit_half_ns(pending)
        return [] if waits else self.finish()

    def finish(self) -> list[Crossing]:
        """Returns the pending crossing from the observations there are: no more will come."""
        if self._pending is None:
            return []
        pending, self._pending = self._pending, None
        return [self._crossing(pending)]

    def _bracket(self) -> tuple[Fix, Fix] | None:
        """The latest two neighbouring fixes between which the way leads through the line."""
        recent = list(self._recent)
        for i in range(len(recent) - 1, 0, -1):
            if self._line.intersects_segment(recent[i - 1].observed_m, recent[i].observed_m) is not None:
                return recent[i - 1], recent[i]
        return None

    def _forget(self, t_ns: int) -> None:
        """Drops what no fit and no bracket can need: all but a few of the fit's stretches before now."""
        keep_ns = 10 * self._settings.fit_half_s * 1e9
        while len(self._recent) > 1 and self._recent[0].t_ns < t_ns - keep_ns:
            self._recent.popleft()

    def _crossing(self, pending: _Pending) -> Crossing:
        before, after = pending.before, pending.after
        half_ns = self._fit_half_ns(pending)
        fixes = [
            fix
            for fix in self._recent
            if before.t_ns - half_ns <= fix.t_ns <= after.t_ns + half_ns or fix in (before, after)
        ]
        gap_s = (after.t_ns - before.t_ns) * 1e-9
        t_ns, sigma_s = self._instant(before, after, fixes)
        share = (t_ns - before.t_ns) / (after.t_ns - before.t_ns)
        estimated = gap_s > self._settings.gap_s
        spread_s = gap_s / math.sqrt(12.0) if estimated else 0.0
        return Crossing(
            t_ns=t_ns,
            t_s=before.t_s + (t_ns - before.t_ns) * 1e-9,
            line=self._line.name,
            direction=pending.direction,
            sigma_s=math.hypot(sigma_s, spread_s, self._settings.stamp_sigma_s),
            track_m=_between(before.observed_m, after.observed_m, share),
            target_id=after.target_id,
            estimated=estimated,
        )

    def _fit_half_ns(self, pending: _Pending) -> float:
        """Reach of the fit before and after the line: at slow frame rates longer, so that it still has a curve to see."""
        step_ns = pending.after.t_ns - pending.before.t_ns
        half_ns = self._settings.fit_half_s * 1e9
        return min(max(half_ns, 2.5 * step_ns), 2 * half_ns)

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


def _root(coefficients: np.ndarray, bracket_s: float) -> float:
    """The zero of the polynomial nearest to the middle of the bracket, time counted from there; the bracket's own length
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
    limit = 1.5 * bracket_s
    return min(max(root, -limit), limit)


def _variance_along(direction: tuple[float, float], covariance_m2: tuple[float, float, float]) -> float:
    x, y = direction
    xx, xy, yy = covariance_m2
    return max(x * x * xx + 2 * x * y * xy + y * y * yy, 1e-12)


def _between(a: PointM, b: PointM, share: float) -> PointM:
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
