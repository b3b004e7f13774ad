"""One car's running lap, told a few times a second: similarity so far, time against the best lap, and the best lap's ghost.

Knows fixes, the instants at which laps begin and end, and the track; knows no clock and no other car. It is told of a lap's
beginning a little late, as crossings are confirmed late, and takes the fixes since then from those that it was told of before.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dnb_edge.race.fix import Fix
from dnb_edge.race.laps import DrivenLap
from dnb_edge.score.distance import Programme
from dnb_edge.score.prefix import PrefixTable
from dnb_edge.score.profile import LapTrace, lap_trace
from dnb_edge.score.similarity import (
    HEADING_ARM_M,
    Metric,
    ScoreSettings,
    directions,
    polyline_length_m,
    resample,
    similarity_percent,
)
from dnb_edge.track.model import Track
from dnb_edge.values import Crossing, Lap, PointM, Points, Running

PERIOD_S = 0.2
"""Time between two tellings, seconds of stamps."""

LIVE_POINTS = 500
"""The route has at most so many points for the running similarity: more cost time and change it little."""

LEAST_SHARE = 0.05
"""Of less than this share of a lap there is no similarity: a centimetre at the start would count too much."""

NEAR_M = 0.1
"""The route's driven stretch ends where it fits best, so far at most from the car's place, metres."""

SPEED_S = 0.3
"""The speed is that over the last so many seconds."""

_RECENT = 600
"""Fixes kept for a lap of which the beginning is told late."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BestLap:
    """A car's best valid lap so far."""

    number: int
    official_s: float
    """Its time with penalties: what it is the best by."""
    trace: LapTrace


class LiveLap:
    """Takes one car's fixes, its laps' beginnings and its finished laps, and tells its running lap."""

    def __init__(self, track: Track, score: ScoreSettings | None, *, car: int = 1, period_s: float = PERIOD_S) -> None:
        """`score` is None where laps are not scored."""
        self._track = track
        self._start_m, self._length_m = track.lap_m()
        self._likeness = None if score is None else _Likeness(track.lap_route_m(), score)
        self._car = car
        self._period_ns = round(period_s * 1e9)
        self._recent: deque[Fix] = deque(maxlen=_RECENT)
        self._lap: _OpenLap | None = None
        self._best: BestLap | None = None
        self._told_t_ns: int | None = None

    @property
    def best(self) -> BestLap | None:
        """The best valid lap so far."""
        return self._best

    def fix(self, fix: Fix) -> Running | None:
        """Takes the car's next fix, in the order of stamps; returns what is to be told, once in a period while a lap runs."""
        self._recent.append(fix)
        if self._lap is None or fix.t_ns <= self._lap.start_t_ns:
            return None
        self._drive(self._lap, fix)
        if self._told_t_ns is not None and fix.t_ns - self._told_t_ns < self._period_ns:
            return None
        self._told_t_ns = fix.t_ns
        return self._running(self._lap, fix)

    def started(self, crossing: Crossing, *, lap: int) -> None:
        """Says that `crossing` began lap number `lap`; what lap was running is over."""
        self._lap = _OpenLap(number=lap, start_t_ns=crossing.t_ns)
        if self._likeness is not None:
            self._likeness.begin(crossing.track_m)
        for fix in self._recent:
            if fix.t_ns > crossing.t_ns:
                self._drive(self._lap, fix)

    def stopped(self) -> None:
        """Says that no lap runs any more: the car has arrived, or its race is over."""
        self._lap = None

    def finished(self, driven: DrivenLap, lap: Lap | None = None) -> None:
        """Takes a complete lap; `lap` is its last word on validity and penalties, where `driven.lap` is not.

        The best is the valid lap of the least official time. Does not end the running lap: `started` and `stopped` do.
        """
        lap = driven.lap if lap is None else lap
        official_s = lap.time_s if lap.official_time_s is None else lap.official_time_s
        if lap.valid and (self._best is None or official_s < self._best.official_s):
            self._best = BestLap(number=lap.number, official_s=official_s, trace=lap_trace(driven, self._track))

    def _drive(self, lap: _OpenLap, fix: Fix) -> None:
        if lap.before_m is None:
            lap.before_m = self._track.centreline.step_m(self._start_m, fix.s_m) - fix.progress_m
        way_m = lap.before_m + fix.progress_m
        if way_m >= self._length_m:
            # The lap is over, though its end is not told yet: what it was worth stays as it is.
            return
        lap.farthest_m = max(lap.farthest_m, way_m)
        lap.driven_s = lap.elapsed_s(fix)
        if self._likeness is not None:
            self._likeness.drive(fix.observed_m)

    def _running(self, lap: _OpenLap, fix: Fix) -> Running:
        elapsed_s = lap.elapsed_s(fix)
        delta_s: float | None = None
        ghost_m: PointM | None = None
        if self._best is not None and lap.driven_s is not None:
            (then_s,) = self._best.trace.arrivals_s(np.array([lap.farthest_m])).tolist()
            delta_s = lap.driven_s - then_s
        if self._best is not None and elapsed_s <= self._best.trace.time_s:
            ((x, y),) = self._best.trace.place_m(np.array([elapsed_s])).tolist()
            ghost_m = (x, y)
        share = min(lap.farthest_m / self._length_m, 1.0)
        return Running(
            t_ns=fix.t_ns,
            t_s=fix.t_s,
            car=self._car,
            target_id=fix.target_id,
            lap=lap.number,
            elapsed_s=elapsed_s,
            track_m=fix.track_m,
            s_m=fix.s_m,
            d_m=fix.d_m,
            speed_mps=speed_mps(self._recent),
            similarity_percent=None if self._likeness is None else self._likeness.percent(share),
            delta_s=delta_s,
            ghost_m=ghost_m,
        )


@dataclass(slots=True, kw_only=True, eq=False)
class _OpenLap:
    """What is known of the running lap; changes with each fix."""

    number: int
    start_t_ns: int
    before_m: float | None = None
    """To be added to a fix's progress for its way since the lap's start; None before the first fix."""
    farthest_m: float = 0.0
    """The farthest place that the car came to, metres along the route since the lap's start."""
    driven_s: float | None = None
    """Time from the lap's start to its latest fix before the end; None before the first fix."""

    def elapsed_s(self, fix: Fix) -> float:
        return (fix.t_ns - self.start_t_ns) * 1e-9


class _Likeness:
    """The similarity of the lap so far: the path's points, as far apart as the route's, against the route's beginning."""

    def __init__(self, lap_route_m: Points, settings: ScoreSettings) -> None:
        self._settings = settings
        self._route = resample(lap_route_m, min(settings.points, LIVE_POINTS))
        self._spacing_m = polyline_length_m(self._route) / (len(self._route) - 1)
        self._directions = directions(self._route) if settings.directed else None
        # With directions, a point waits for the path so far behind it.
        self._arm = max(1, round(HEADING_ARM_M / self._spacing_m)) if settings.directed else 0
        warping = Programme.DTW_SYMMETRIC if settings.symmetric else Programme.DTW
        self._programme = warping if settings.metric is Metric.DTW else Programme.FRECHET
        self._table = PrefixTable(self._route, self._programme, settings.clamp_m)
        self._points: list[PointM] = []
        self._since_m = 0.0
        self._at: PointM | None = None

    def begin(self, point_m: PointM) -> None:
        """A new lap begins at `point_m`, track m."""
        self._table = PrefixTable(self._route, self._programme, self._settings.clamp_m)
        self._points = [point_m]
        self._at, self._since_m = point_m, 0.0

    def drive(self, to_m: PointM) -> None:
        """The path goes on straight to `to_m`, track m."""
        assert self._at is not None, "a lap begins before it is driven"
        from_m, self._at = self._at, to_m
        way_m = math.dist(from_m, to_m)
        next_m = self._spacing_m - self._since_m
        while next_m <= way_m:
            share = next_m / way_m
            self._points.append((from_m[0] + share * (to_m[0] - from_m[0]), from_m[1] + share * (to_m[1] - from_m[1])))
            next_m += self._spacing_m
        self._since_m = way_m - next_m + self._spacing_m

    def percent(self, share: float) -> float | None:
        """Similarity of the path so far to the first `share`, 0..1, of the route; None where that is too little."""
        if share < LEAST_SHARE:
            return None
        self._compare()
        if self._table.points == 0:
            return None
        # The filter's place and the end of what is compared are a little apart.
        middle = share * (len(self._route) - 1)
        around = NEAR_M / self._spacing_m
        first, last = max(0, math.floor(middle - around)), min(len(self._route) - 1, math.ceil(middle + around))
        distances_m = self._table.to(first, last)
        covered = np.arange(first, last + 1) + 1.0
        if self._programme is Programme.DTW_SYMMETRIC:
            distances_m /= self._table.points + covered
        elif self._programme is Programme.DTW:
            # The whole lap is scored by as many points as the route has: so is its part, however long its path is.
            distances_m /= np.maximum(self._table.points, covered)
        return similarity_percent(float(distances_m.min()), self._settings.baseline_m)

    def _compare(self) -> None:
        """Takes the points that do not wait any more."""
        first, ready = self._table.points, len(self._points) - self._arm
        if ready <= first:
            return
        extra = None
        if self._directions is not None:
            at = np.arange(first, ready)
            points = np.array(self._points)
            chords = points[at + self._arm] - points[np.maximum(at - self._arm, 0)]
            lengths = np.hypot(chords[:, 0], chords[:, 1])[:, None]
            units = np.divide(chords, lengths, out=np.zeros_like(chords), where=lengths > 0)
            turned = (units[:, None, :] - self._directions) ** 2
            extra = 0.25 * self._settings.baseline_m * turned.sum(axis=2)
        self._table.extend(np.array(self._points[first:ready]), extra)


def speed_mps(fixes: Sequence[Fix]) -> float:
    """Speed along the route, either way, metres per second: the slope of the progress over the last `SPEED_S` of `fixes`,
    in the order of stamps, by least squares; 0 for a single fix.
    """
    last = fixes[-1]
    near: list[tuple[float, float]] = []
    for fix in reversed(fixes):
        if (last.t_ns - fix.t_ns) * 1e-9 > SPEED_S and len(near) > 1:
            break
        near.append(((fix.t_ns - last.t_ns) * 1e-9, fix.progress_m - last.progress_m))
    t_mean = math.fsum(t for t, _ in near) / len(near)
    spread = math.fsum((t - t_mean) ** 2 for t, _ in near)
    return abs(math.fsum((t - t_mean) * way for t, way in near) / spread) if spread > 0 else 0.0
