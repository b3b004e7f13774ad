"""The route that laps were driven on: the median path of them all.

Knows paths on the track plane, in the order in which they were driven. Knows no camera, no time and no picture. A lap that does
not go where the others go is left out by name, never in silence.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.track.line import DirectedLine
from dnb_edge.values import Points

Floats = NDArray[np.float64]

HALF_CAR_M = 0.1
"""Half the width of a car, metres: what it covers to either side of its path, where nobody tells the lane's width."""

_STEP_M = 0.01
_LEAST_POINTS, _MOST_POINTS = 200, 1500
_ROUNDS = 5
_REACH = 0.06
"""A lap's point belongs to the route's place of the same share of the lap, or to one so much of the lap before or behind it."""
_SMOOTH_M = 0.25
"""Waves of this length across the path are halved by the smoothing, shorter ones vanish: a car turns no faster."""
_ODD_LENGTH = 0.12
"""A lap whose length differs by more than this share from the usual one went elsewhere."""
_ODD_PLACE_M = 0.15
"""A lap is odd where it lies further from the median path than this, on average, and than `_ODD_TIMES` the usual lap."""
_ODD_TIMES = 4.0
_AWAY_M = 0.3
"""A car that goes to and fro over a line, and no further from it than this, crosses it once."""
_BASE_M = 0.08
_ALONG = 0.8
"""Cosine of the angle up to which a path counts as going the same way."""
_WORST_SPREAD_M = 0.12
"""Laps that lie further apart than this on average do not say where the route is."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DrivenPath:
    """One lap as it was driven, from the start line to the start line."""

    name: str
    points_m: Points
    """Shape (n, 2), track m, in the order of driving."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DrivenRoute:
    """The median path of laps; closed, in the direction of driving, from where the laps begin."""

    points_m: Points
    """Shape (n, 2), track m, evenly spaced; the last joins the first, which is not repeated."""
    half_left_m: Floats
    half_right_m: Floats
    """Shape (n,), metres from the path to the lane's edges."""
    kept: tuple[str, ...]
    """Names of the laps that it is the median of."""
    left_out: tuple[str, ...]
    """What was left out and why, a sentence each."""
    spread_m: float
    """How far the kept laps lie from the median path, the mean over all of them, metres; 0 for one."""


def driven_route(laps: Sequence[DrivenPath], *, lane_width_m: float | None, source: str) -> DrivenRoute:
    """The median path of `laps`, with a lane `lane_width_m` wide, or as wide as the laps and a car on them.

    Raises `InputError` where there is no lap, or the laps lie too far apart; `source` names in it where they come from.
    """
    if not laps:
        raise InputError(f"{source}: no complete lap: drive round at least twice past the same place, in one direction")
    kept, left_out = _of_like_length(list(laps))
    route, apart = _median_path(kept)
    odd = _odd(kept, apart)
    if odd:
        left_out += [f"{kept[k].name} lies {apart_m:.2f} m from the others on average" for k, apart_m in odd]
        kept = [lap for k, lap in enumerate(kept) if k not in dict(odd)]
        route, apart = _median_path(kept)
    spread_m = float(np.mean(np.abs(apart))) if len(kept) > 1 else 0.0
    if 2 * len(kept) <= len(laps) or spread_m > _WORST_SPREAD_M:
        raise InputError(
            f"{source}: the laps do not agree ({', '.join(_distances(laps, route))}): drive the same way round each time, or "
            "leave out the laps that differ"
        )
    widest_m = float(np.percentile(np.abs(apart), 99)) if len(kept) > 1 else 0.0
    half_m = widest_m + HALF_CAR_M if lane_width_m is None else lane_width_m / 2
    half = np.full(len(route), half_m)
    return DrivenRoute(
        points_m=route,
        half_left_m=half,
        half_right_m=half.copy(),
        kept=tuple(lap.name for lap in kept),
        left_out=tuple(left_out),
        spread_m=spread_m,
    )


def laps_between(path_m: Points, line: DirectedLine, *, straight: bool = False) -> list[Points]:
    """The stretches (n, 2) of the path (m, 2), track m, from each forward crossing of the line to the next, ends included.

    With `straight` only crossings within about 37 degrees of the line's forward direction count: another branch of a route
    that crosses itself may pass through a line, such as that of `gate_of`.
    """
    at = _forward_crossings(path_m, line, least_straight=_ALONG if straight else 0.0)
    laps = []
    for (i, first), (j, last) in pairwise(at):
        laps.append(np.vstack((first, path_m[i + 1 : j + 1], last)))
    return laps


def gate_of(path_m: Points, *, half_width_m: float = 0.25) -> DirectedLine | None:
    """A line across the path that it crosses most often in one direction: where rounds can be told apart without a start line.

    Of places as good, the one where the path is straightest. None where the path comes by no place twice.
    """
    path = thinned(path_m, _STEP_M * 2)
    if len(path) < 20:
        return None
    best: tuple[int, float] | None = None
    gate: DirectedLine | None = None
    ahead = 5
    for k in range(ahead, len(path) - ahead, ahead):
        before, at, after = path[k - ahead], path[k], path[k + ahead]
        way = after - before
        length = float(np.hypot(*way))
        if length < _STEP_M:
            continue
        left = np.array([-way[1], way[0]]) / length
        start, end = at + half_width_m * left, at - half_width_m * left
        line = DirectedLine(
            name="gate", start_m=(float(start[0]), float(start[1])), end_m=(float(end[0]), float(end[1]))
        )
        crossings = len(_forward_crossings(path, line, least_straight=_ALONG))
        turned = float(np.hypot(*(before + after - 2 * at))) / length
        if crossings >= 2 and (best is None or (crossings, -turned) > best):
            best, gate = (crossings, -turned), line
    return gate


def thinned(path_m: Points, step_m: float) -> Points:
    """The path (n, 2) without the points that are nearer than `step_m` to the one kept before: a car that stands still adds
    no way.
    """
    path = np.asarray(path_m, dtype=np.float64).reshape(-1, 2)
    kept = [0] if len(path) else []
    for k in range(1, len(path)):
        if np.hypot(*(path[k] - path[kept[-1]])) >= step_m:
            kept.append(k)
    return path[kept]


def _forward_crossings(path_m: Points, line: DirectedLine, *, least_straight: float = 0.0) -> list[tuple[int, Points]]:
    """(index of the point before, the point on the line (2,)) of each forward crossing.

    A car that has not been `_AWAY_M` away since has not left the line. `least_straight` is the cosine of the greatest
    angle to the line's forward direction.
    """
    path = np.asarray(path_m, dtype=np.float64).reshape(-1, 2)
    start, end = np.array(line.start_m), np.array(line.end_m)
    across = (end - start) / line.length_m
    side = across[0] * (path[:, 1] - start[1]) - across[1] * (path[:, 0] - start[0])
    found: list[tuple[int, Points]] = []
    for i in np.flatnonzero((side[:-1] < 0) & (side[1:] >= 0)).tolist():
        step = path[i + 1] - path[i]
        point = path[i] + side[i] / (side[i] - side[i + 1]) * step
        if not 0.0 <= float((point - start) @ across) <= line.length_m:
            continue
        way = _way(path, i, point)
        if float(across[0] * way[1] - across[1] * way[0]) < least_straight * float(np.hypot(*way)):
            continue
        if not found or _farthest_m(path[found[-1][0] : i + 1], found[-1][1]) > _AWAY_M:
            found.append((i, point))
    return found


def _way(path: Points, i: int, at: Points) -> Points:
    """The way (2,) that the path goes at `at`, behind its point `i`: from `_BASE_M` before to as far behind, so that the
    noise of single points does not turn it.
    """
    far = np.hypot(*(path - at).T) >= _BASE_M
    before, after = np.flatnonzero(far[: i + 1]), np.flatnonzero(far[i + 1 :])
    first = path[before[-1]] if len(before) else path[0]
    last = path[i + 1 + after[0]] if len(after) else path[-1]
    return np.asarray(last - first)


def _farthest_m(path: Points, from_m: Points) -> float:
    return float(np.hypot(*(path - from_m).T).max())


def _of_like_length(laps: list[DrivenPath]) -> tuple[list[DrivenPath], list[str]]:
    lengths = np.array([_length_m(lap.points_m) for lap in laps])
    usual = float(np.median(lengths))
    kept, left_out = [], []
    for lap, length in zip(laps, lengths.tolist(), strict=True):
        if abs(length - usual) <= _ODD_LENGTH * usual:
            kept.append(lap)
        else:
            left_out.append(f"{lap.name} is {length:.2f} m long, the usual lap {usual:.2f} m")
    return (kept, left_out) if kept else (laps, [])


def _length_m(points_m: Points) -> float:
    """Length of the way from the first point to the last and back to the first, in steps that jitter does not lengthen."""
    path = thinned(points_m, 2 * _STEP_M)
    return float(np.hypot(*np.diff(np.vstack((path, path[:1])), axis=0).T).sum())


def _odd(laps: Sequence[DrivenPath], apart: Floats) -> list[tuple[int, float]]:
    """(index, mean distance m) of the laps that lie far from the path on which most of them agree."""
    means = np.mean(np.abs(apart), axis=1)
    limit = max(_ODD_PLACE_M, _ODD_TIMES * float(np.median(means)))
    return [(k, float(means[k])) for k in range(len(laps)) if means[k] > limit] if len(laps) > 2 else []


def _distances(laps: Sequence[DrivenPath], route: Points) -> list[str]:
    """How far each lap lies from the route on average, as text."""
    apart = [float(np.mean(np.abs(_offsets(_even(lap.points_m, len(route)), route)))) for lap in laps]
    return [f"{lap.name} {apart_m:.2f} m off" for lap, apart_m in zip(laps, apart, strict=True)]


def _median_path(laps: Sequence[DrivenPath]) -> tuple[Points, Floats]:
    """The smooth median path (n, 2) of the laps, and how far each lap lies to its left (laps, n), metres.

    First the median of places at equal shares of each lap's length; then, in rounds, the median of the laps' offsets from it.
    """
    length = float(np.median([_length_m(lap.points_m) for lap in laps]))
    count = int(np.clip(round(length / _STEP_M), _LEAST_POINTS, _MOST_POINTS))
    even = [_even(lap.points_m, count) for lap in laps]
    route = _even(_smoothed(np.median(np.stack(even), axis=0)), count)
    apart = np.zeros((len(laps), count))
    for _ in range(_ROUNDS):
        apart = np.stack([_offsets(path, route) for path in even])
        moved = route + np.median(apart, axis=0)[:, None] * _lefts(route)
        route = _even(_smoothed(moved), count)
    return route, np.stack([_offsets(path, route) for path in even])


def _offsets(path: Points, route: Points) -> Floats:
    """How far to the route's left the path lies at each of the route's points (n,), metres.

    Only stretches of a like share of the lap are compared, so that a crossing of the route by itself confuses nothing.
    """
    count = len(route)
    reach = max(2, round(_REACH * count))
    shifts = np.arange(-reach, reach + 1)
    near = route[(np.arange(count)[:, None] + shifts) % count]
    best = np.argmin(((path[:, None, :] - near) ** 2).sum(axis=2), axis=1)
    index = (np.arange(count) + shifts[best]) % count
    step = path - route[index]
    lefts = _lefts(route)[index]
    tangents = np.column_stack((lefts[:, 1], -lefts[:, 0]))
    spacing = float(np.hypot(*(np.roll(route, -1, axis=0) - route).T).mean())
    at = index + (step * tangents).sum(axis=1) / spacing
    order = np.argsort(at % count, kind="stable")
    places, offsets = (at % count)[order], (step * lefts).sum(axis=1)[order]
    return np.asarray(np.interp(np.arange(count), places, offsets, period=count), dtype=np.float64)


def _lefts(points: Points) -> Points:
    """Unit vectors to the left of travel, shape (n, 2)."""
    ahead = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    ahead = ahead / np.maximum(np.hypot(ahead[:, 0], ahead[:, 1]), 1e-12)[:, None]
    return np.column_stack((-ahead[:, 1], ahead[:, 0]))


def _even(points: Points, count: int) -> Points:
    """`count` points at equal arc lengths along the closed polyline, from its first point."""
    ends = np.vstack((points, points[:1]))
    chords = np.hypot(*np.diff(ends, axis=0).T)
    ends = np.vstack((ends[:1], ends[1:][chords > 0]))
    along = np.concatenate(([0.0], np.cumsum(chords[chords > 0])))
    at = np.arange(count) * (along[-1] / count)
    return np.column_stack([np.interp(at, along, ends[:, k]) for k in (0, 1)])


def _smoothed(points: Points) -> Points:
    """The closed even line without its short waves: what a penalty on third differences leaves of each wave.

    P. H. C. Eilers, "A perfect smoother", Analytical Chemistry 75, 2003; on a ring of even points a product of spectra.
    """
    count = len(points)
    length = float(np.hypot(*(np.roll(points, -1, axis=0) - points).T).sum())
    waves = np.fft.rfftfreq(count, d=length / count)
    passed = 1.0 / (1.0 + (waves * _SMOOTH_M) ** 6)
    return np.asarray(np.fft.irfft(np.fft.rfft(points, axis=0) * passed[:, None], n=count, axis=0))
