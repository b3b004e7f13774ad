"""One lap along the route: how far to the side, how fast, and where time is lost against another lap.

Knows when a car was where along a lap's stretch of the route; knows nothing of pictures, rules or percent. A place of the
route counts where the car first came to it, so that neither jitter nor driving back counts a stretch twice, and standing
still counts no more than driving fast: figures are over the way along the route, not over frames.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dnb_edge.race.laps import DrivenLap
from dnb_edge.track.model import Track
from dnb_edge.values import Points, path_points

Floats: TypeAlias = NDArray[np.float64]

BIN_M = 0.02
"""Length of the stretches into which a lap is cut, metres, as far as they fit in evenly."""

UNSEEN_S = 0.25
"""A stretch that the car drove between two fixes so far apart was not seen, seconds."""

SPEED_S = 0.25
"""A speed is the slope over so long before and after, seconds."""

_LINE_M = 0.3
"""How far from its line a crossing is looked for along the route, metres."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LapTrace:
    """When the car was where in one lap, from the crossing that began it to the crossing that ended it."""

    length_m: float
    """The lap's length along the route."""
    t_s: Floats
    """(n,), n >= 2, seconds since the lap's start, rising; 0 first."""
    way_m: Floats
    """(n,), progress along the route since the lap's start, metres; 0 first, `length_m` last, in between it may fall."""
    d_m: Floats
    """(n,), metres to the left of the centreline."""
    track_m: Points
    """(n, 2), track m."""

    def __post_init__(self) -> None:
        if len(self.t_s) < 2 or not (np.diff(self.t_s) > 0).all():
            raise ValueError("a lap's trace needs at least two instants, in their order")

    @property
    def time_s(self) -> float:
        """The lap's time."""
        return float(self.t_s[-1])

    def arrivals_s(self, way_m: Floats) -> Floats:
        """When the car first came to the places `way_m` (k,) along the lap, (k,), seconds since its start; linear between
        fixes. Before the lap it is its start, beyond it its end.
        """
        return first_arrivals_s(self.t_s, self.way_m, way_m)

    def place_m(self, t_s: Floats) -> Points:
        """Where the car was at (k,) instants, seconds since the lap's start: (k, 2), track m, linear between fixes."""
        return np.column_stack([np.interp(t_s, self.t_s, self.track_m[:, axis]) for axis in (0, 1)])


def lap_trace(driven: DrivenLap, track: Track) -> LapTrace:
    """The trace of a complete lap: its fixes (filtered places) between its two crossings."""
    route = track.centreline
    start_m, length_m = track.lap_m()
    fixes = [fix for fix in driven.fixes if driven.lap.start_t_ns < fix.t_ns < driven.lap.end_t_ns]
    t_ns = np.array([driven.lap.start_t_ns, *(fix.t_ns for fix in fixes), driven.lap.end_t_ns], dtype=np.int64)
    before_m = route.step_m(start_m, fixes[0].s_m) - fixes[0].progress_m if fixes else 0.0
    way_m = np.array([0.0, *(before_m + fix.progress_m for fix in fixes), length_m])
    # The lap ended with its crossing: nothing before it lies beyond the line, whatever the filter made of it.
    way_m[:-1] = np.minimum(way_m[:-1], np.nextafter(length_m, 0.0))
    first_m, last_m = driven.path_m[0], driven.path_m[-1]
    _, first_d_m = route.locate_near(first_m, s_hint_m=start_m, window_m=_LINE_M)
    _, last_d_m = route.locate_near(last_m, s_hint_m=start_m + length_m, window_m=_LINE_M)
    return LapTrace(
        length_m=length_m,
        t_s=(t_ns - t_ns[0]) * 1e-9,
        way_m=way_m,
        d_m=np.array([first_d_m, *(fix.d_m for fix in fixes), last_d_m]),
        track_m=path_points([first_m, *(fix.track_m for fix in fixes), last_m]),
    )


def first_arrivals_s(t_s: Floats, way_m: Floats, at_m: Floats) -> Floats:
    """When a car that was at `way_m` (n,) at the instants `t_s` (n,) first came to the places `at_m` (k,): (k,), linear
    between its neighbours. Before all of them it is the first instant, beyond them the last.
    """
    farthest = np.maximum.accumulate(way_m)
    after = np.clip(np.searchsorted(farthest, at_m, side="left"), 1, len(way_m) - 1)
    # Where the farthest place grows, the car itself is there: it came from the fix before, wherever that was.
    before = after - 1
    step_m = way_m[after] - way_m[before]
    share = np.divide(at_m - way_m[before], step_m, out=np.ones_like(step_m), where=step_m > 0)
    share = np.clip(share, 0.0, 1.0)
    return np.asarray(t_s[before] + share * (t_s[after] - t_s[before]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Excursion:
    """How far from the centreline a path was, over the way along the route."""

    mean_m: float
    """Mean distance from the centreline."""
    p95_m: float
    """95th percentile of that distance."""
    bias_m: float
    """Mean of d_m: positive where the path kept to the left."""
    greatest_m: float
    """The greatest distance, of all points."""
    greatest_s_m: float
    """Where along the route that was, s_m."""


def excursion(way_m: Floats, d_m: Floats, *, s_m: Floats) -> Excursion:
    """Lateral figures of a path with the progress `way_m` (n,), n >= 1, and the distances `d_m` (n,) to the left at `s_m` (n,).

    Means and percentile weigh each point by the way along the route that it stands for when the path first comes there,
    trapezoid fashion; a path that goes back more than forth is taken from its end. Only the greatest is of all points.
    """
    weights = _way_weights(way_m if way_m[-1] >= way_m[0] else -way_m)
    apart_m = np.abs(d_m)
    order = np.argsort(apart_m, kind="stable")
    share = (np.cumsum(weights[order]) - 0.5 * weights[order]) / weights.sum()
    worst = int(np.argmax(apart_m))
    return Excursion(
        mean_m=float(np.average(apart_m, weights=weights)),
        p95_m=float(np.interp(0.95, share, apart_m[order])),
        bias_m=float(np.average(d_m, weights=weights)),
        greatest_m=float(apart_m[worst]),
        greatest_s_m=float(s_m[worst]),
    )


def _way_weights(way_m: Floats) -> Floats:
    """(n,) half of the way gained to either side of each point; points that gain nothing get nothing."""
    new = _gaining(way_m)
    steps = np.diff(way_m[new])
    weights = np.zeros(len(way_m))
    if len(steps) == 0:
        return np.ones(len(way_m))
    weights[new[:-1]] += 0.5 * steps
    weights[new[1:]] += 0.5 * steps
    return weights


def _gaining(way_m: Floats) -> NDArray[np.intp]:
    """The points, in order, that are farther along than all before them."""
    farthest = np.maximum.accumulate(way_m)
    (later,) = np.nonzero(np.diff(farthest) > 0)
    return np.concatenate(([0], later + 1))


def speeds_mps(trace: LapTrace) -> Floats:
    """(n,) speed along the route at each instant of the trace, metres per second, negative backwards.

    It is the slope of a straight line through the progress of the fixes within `SPEED_S`, weighed by how near in time they are,
    and again with less weight for those that lie off (W. Cleveland, "Robust locally weighted regression", 1979, one step).
    """
    t_s, way_m = trace.t_s, trace.way_m
    n = len(t_s)
    reach = int(np.clip(np.ceil(SPEED_S / np.median(np.diff(t_s))), 2, min(60, n)))
    at = np.arange(n)[:, None] + np.arange(-reach, reach + 1)
    inside = (at >= 0) & (at < n)
    at = np.clip(at, 0, n - 1)
    t, y = t_s[at] - t_s[:, None], way_m[at] - way_m[:, None]
    # Over a gap the window opens as far as the next fix to either side.
    wide = np.maximum(SPEED_S, 1.5 * np.where(inside, np.abs(t), 0.0)[:, reach - 1 : reach + 2].max(axis=1))[:, None]
    near = np.where(inside, np.clip(1.0 - (np.abs(t) / wide) ** 3, 0.0, None) ** 3, 0.0)
    slope, offset = _lines(t, y, near)
    scale = 6.0 * max(float(np.median(np.abs(offset))), 1e-6)
    trust = np.clip(1.0 - (offset / scale) ** 2, 0.02, None) ** 2
    slope, _ = _lines(t, y, near * trust[at])
    return slope


def _lines(t: Floats, y: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """(slope, value at t = 0), each (n,), of the weighted least-squares line through each row of points, (n, k)."""
    total = weights.sum(axis=1)
    t_mean, y_mean = (weights * t).sum(axis=1) / total, (weights * y).sum(axis=1) / total
    from_mean = t - t_mean[:, None]
    slope = (weights * from_mean * y).sum(axis=1) / (weights * from_mean**2).sum(axis=1)
    return slope, y_mean - slope * t_mean


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LateralProfile:
    """How far to the side the car was, stretch by stretch of a lap."""

    way_m: Floats
    """(k,), the middle of each stretch, metres along the route since the lap's start."""
    mean_m: Floats
    """(k,), mean d_m over the stretch, as the car first came through."""
    greatest_m: Floats
    """(k,), the d_m, of all fixes and stretch ends, that is farthest from the centreline."""
    seen: NDArray[np.bool_]
    """(k,), False where the car was not seen for longer than `UNSEEN_S`, and the figures are a straight line."""


def lateral_profile(trace: LapTrace, *, bin_m: float = BIN_M) -> LateralProfile:
    """The lap's lateral profile in stretches of about `bin_m`, metres; linear between fixes."""
    edges = stretch_ends(trace.length_m, bin_m=bin_m)
    new = _gaining(trace.way_m)
    knots = np.unique(np.concatenate([edges, trace.way_m[new].clip(0.0, trace.length_m)]))
    d_m = np.interp(knots, trace.way_m[new], trace.d_m[new])
    integral = np.concatenate(([0.0], np.cumsum(0.5 * (d_m[1:] + d_m[:-1]) * np.diff(knots))))
    at_ends = np.searchsorted(knots, edges)
    middles = 0.5 * (edges[1:] + edges[:-1])
    return LateralProfile(
        way_m=middles,
        mean_m=np.diff(integral[at_ends]) / np.diff(edges),
        greatest_m=_greatest(trace, edges, d_m[at_ends]),
        seen=_seen(trace, middles),
    )


def _greatest(trace: LapTrace, edges: Floats, edges_d_m: Floats) -> Floats:
    """(k,), in each of the k stretches between `edges`, both ends included, the d_m that is farthest from 0."""
    inside = (trace.way_m >= edges[0]) & (trace.way_m <= edges[-1])
    stretches = np.arange(len(edges) - 1)
    of_fix = np.clip(np.searchsorted(edges, trace.way_m[inside], side="right") - 1, 0, stretches[-1])
    stretch = np.concatenate([of_fix, stretches, stretches])
    d_m = np.concatenate([trace.d_m[inside], edges_d_m[:-1], edges_d_m[1:]])
    order = np.lexsort((np.abs(d_m), stretch))
    last = np.searchsorted(stretch[order], stretches, side="right") - 1
    return np.asarray(d_m[order][last])


def _seen(trace: LapTrace, at_m: Floats) -> NDArray[np.bool_]:
    """(k,) whether the car was seen on its first way to the places `at_m` (k,)."""
    after = np.searchsorted(np.maximum.accumulate(trace.way_m), at_m, side="left")
    after = np.clip(after, 1, len(trace.t_s) - 1)
    return np.asarray(trace.t_s[after] - trace.t_s[after - 1] <= UNSEEN_S)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SpeedProfile:
    """How fast the car was along the route, stretch by stretch of a lap."""

    way_m: Floats
    """(k,), the middle of each stretch, metres along the route since the lap's start."""
    speed_mps: Floats
    """(k,), speed along the route as the car first came there, metres per second."""
    seen: NDArray[np.bool_]
    """(k,), as in `LateralProfile`."""


def speed_profile(trace: LapTrace, *, bin_m: float = BIN_M) -> SpeedProfile:
    """The lap's speed profile in stretches of about `bin_m`, metres; see `speeds_mps`."""
    edges = stretch_ends(trace.length_m, bin_m=bin_m)
    middles = 0.5 * (edges[1:] + edges[:-1])
    return SpeedProfile(
        way_m=middles,
        speed_mps=np.interp(trace.arrivals_s(middles), trace.t_s, speeds_mps(trace)),
        seen=_seen(trace, middles),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DeltaProfile:
    """Where a lap lost time against another one, or won it."""

    way_m: Floats
    """(k + 1,), the stretches' ends, metres along the route since the lap's start; 0 first."""
    delta_s: Floats
    """(k + 1,), time behind (positive) or ahead of the other lap at the same place; 0 first, the laps' difference last."""

    @property
    def lost_s(self) -> Floats:
        """(k,), time lost (positive) or won on each stretch."""
        return np.diff(self.delta_s)


def delta_profile(trace: LapTrace, other: LapTrace, *, bin_m: float = BIN_M) -> DeltaProfile:
    """The time that the lap `trace` lost against `other`, of the same track, in stretches of about `bin_m`, metres."""
    edges = stretch_ends(trace.length_m, bin_m=bin_m)
    return DeltaProfile(way_m=edges, delta_s=trace.arrivals_s(edges) - other.arrivals_s(edges))


def stretch_ends(length_m: float, *, bin_m: float = BIN_M) -> Floats:
    """The ends of the equal stretches of about `bin_m` into which a lap of `length_m` is cut, from 0 to `length_m`."""
    return np.linspace(0.0, length_m, max(1, round(length_m / bin_m)) + 1)
