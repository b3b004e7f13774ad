"""The centreline of a route: where along it (s_m) and how far to its left (d_m) a point on the track lies.

Knows points in metres on the track plane and the lane's half-widths at them. Knows no picture, no camera, no car and
no time. (s, d) is the curvilinear frame of road vehicles: s_m grows in the direction of travel, d_m is positive to the
left. A closed route's s_m goes round; an open one's (point to point) ends at 0 and at its length.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.track.curvature import curvature
from dnb_edge.track.nearest import SegmentGrid
from dnb_edge.values import PointM, Points

Floats = NDArray[np.float64]

_BLOCK = 512
"""Points located at a time: bounds the (points x segments) matrices to a few MB."""

_ALONG = 0.5
"""Cosine of the angle (60 degrees) within which a stretch of the route still runs along a direction."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Plain:
    """The same numbers as plain floats, for single places: numpy takes longer to be asked for one than to find it."""

    s_m: list[float]
    points_m: list[list[float]]
    half_left_m: list[float]
    half_right_m: list[float]
    lengths_m: list[float]
    tangents: list[list[float]]
    half_width_limits_m: tuple[float, float]
    """The least and the greatest half-width, of both sides."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Centreline:
    """A polyline in the order of travel; where it is closed the last point joins the first, which is not repeated.

    All arrays are read-only. Two centrelines are equal where their points and half-widths are, bit for bit.
    """

    points_m: Points
    """Shape (n, 2), track m, n >= 3, evenly spaced along the route as far as chords allow."""
    half_left_m: Floats
    """Shape (n,), metres from each point to the lane's left edge, positive."""
    half_right_m: Floats
    """Shape (n,), metres from each point to the lane's right edge, positive."""
    closed: bool = True
    """False for a route from point to point: it ends at its first and its last point."""
    s_m: Floats = field(init=False, repr=False)
    """Shape (n,), arc length of each point along the polyline; s_m[0] is 0."""
    length_m: float = field(init=False)
    """Length of the polyline, with the way from the last point to the first where it is closed."""
    _lengths_m: Floats = field(init=False, repr=False)
    _tangents: Points = field(init=False, repr=False)
    _plain: _Plain = field(init=False, repr=False)
    _grid: SegmentGrid = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Raises `InputError` for shapes that do not fit, repeated neighbours or half-widths that are not positive."""
        points = np.array(self.points_m, dtype=np.float64)
        if points.ndim != 2 or points.shape[1:] != (2,) or len(points) < 3 or not np.isfinite(points).all():
            raise InputError(
                f"centreline: needs at least three finite points (x, y), got an array of shape {points.shape}"
            )
        chords = np.roll(points, -1, axis=0) - points if self.closed else np.diff(points, axis=0)
        lengths = np.hypot(chords[:, 0], chords[:, 1])
        if not (lengths > 0).all():
            raise InputError(f"centreline: point {int(np.argmin(lengths))} is repeated")
        s_m = np.concatenate(([0.0], np.cumsum(lengths)))
        for name in ("half_left_m", "half_right_m"):
            widths = np.array(getattr(self, name), dtype=np.float64)
            if widths.shape != (len(points),) or not (np.isfinite(widths) & (widths > 0)).all():
                raise InputError(f"centreline: {name} must hold one positive number for each of {len(points)} points")
            self._set(name, widths)
        self._set("points_m", points)
        self._set("s_m", s_m[: len(points)].copy())
        self._set("_lengths_m", lengths)
        self._set("_tangents", chords / lengths[:, None])
        object.__setattr__(self, "length_m", float(s_m[-1]))
        plain = {name: getattr(self, f"_{name}").tolist() for name in ("lengths_m", "tangents")}
        plain |= {name: getattr(self, name).tolist() for name in ("s_m", *_STORED)}
        widths_m = np.concatenate((self.half_left_m, self.half_right_m))
        limits_m = (float(widths_m.min()), float(widths_m.max()))
        object.__setattr__(self, "_plain", _Plain(**plain, half_width_limits_m=limits_m))
        grid = SegmentGrid(points[: len(lengths)], self._tangents, lengths, self.s_m[: len(lengths)])
        object.__setattr__(self, "_grid", grid)

    def _set(self, name: str, array: Floats) -> None:
        array.setflags(write=False)
        object.__setattr__(self, name, array)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Centreline):
            return NotImplemented
        return self.closed == other.closed and all(
            np.array_equal(getattr(self, name), getattr(other, name)) for name in _STORED
        )

    def __hash__(self) -> int:
        return hash((self.closed, *(getattr(self, name).tobytes() for name in _STORED)))

    def locate(self, points_m: Points) -> tuple[Floats, Floats]:
        """(s_m, d_m), each (n,), of points (n, 2), track m: the projection on the nearest segment of the whole route.

        s_m is in [0, length_m), or [0, length_m] where the route is open; d_m is the distance to the centreline, positive to
        the left of the direction of travel. Beyond an open route's end, s_m is that end's and d_m the distance to it.
        `locate_point` says the same of a single point, or of those of one path one by one, in less time.
        """
        points = np.asarray(points_m, dtype=np.float64).reshape(-1, 2)
        everywhere = np.arange(len(self._lengths_m))
        blocks = [self._project(points[i : i + _BLOCK], everywhere) for i in range(0, len(points), _BLOCK)]
        if not blocks:
            return np.empty(0), np.empty(0)
        return np.concatenate([s for s, _ in blocks]), np.concatenate([d for _, d in blocks])

    def locate_point(self, point_m: PointM) -> tuple[float, float]:
        """(s_m, d_m) of one point, track m: what `locate` says, to the last bit."""
        found = self._grid.nearest(*point_m)
        if found is None:
            return self._projected(point_m, np.arange(len(self._lengths_m)))
        s_m, d_m = found
        return s_m - self.length_m if self.closed and s_m >= self.length_m else s_m, d_m

    def locate_near(self, point_m: PointM, *, s_hint_m: float, window_m: float) -> tuple[float, float]:
        """(s_m, d_m) of one point, track m, on the stretch of the route within `window_m` of `s_hint_m` along it.

        For routes whose branches come near each other: the hint is where the car was last.
        """
        n = len(self._lengths_m)
        if 2 * window_m >= self.length_m:
            segments = np.arange(n)
        else:
            first, last = self._segment_at(s_hint_m - window_m), self._segment_at(s_hint_m + window_m)
            segments = np.arange(first, last + 1 + (n if last < first else 0)) % n
        return self._projected(point_m, segments)

    def locate_along(self, point_m: PointM, direction: tuple[float, float]) -> tuple[float, float] | None:
        """(s_m, d_m) of one point, track m, on the nearest segment that runs along `direction` (a unit vector), either
        way, to within 60 degrees; None where no segment does. At a crossing it tells the branches apart.
        """
        (segments,) = np.nonzero(np.abs(self._tangents @ np.asarray(direction, dtype=np.float64)) >= _ALONG)
        return self._projected(point_m, segments) if len(segments) else None

    def follow(self, point_m: PointM, *, s_hint_m: float, reach_m: float) -> tuple[float, float]:
        """(s_m, d_m) of one point, track m, of a path that was at `s_hint_m` before and can have gone on by `reach_m`.

        It is the nearest place of the whole route where that is in reach, or where the path has left the stretch in reach
        by more than the lane's width; else, where the route crosses itself or comes near itself, the place in reach.
        """
        s_m, d_m = self.locate_point(point_m)
        if abs(self.step_m(s_hint_m, s_m)) <= reach_m:
            return s_m, d_m
        near_s_m, near_d_m = self.locate_near(point_m, s_hint_m=s_hint_m, window_m=reach_m)
        left_m, right_m = self.half_widths_at(near_s_m)
        is_near = abs(near_d_m) <= 2 * (left_m if near_d_m >= 0 else right_m)
        return (near_s_m, near_d_m) if is_near else (s_m, d_m)

    def locate_path(self, path_m: Points) -> tuple[Floats, Floats]:
        """(s_m, d_m), each (n,), of the points (n, 2), track m, of one path in the order in which it was driven: each as
        `follow` finds it from the one before, so that a crossing does not change the branch.
        """
        path = np.asarray(path_m, dtype=np.float64).reshape(-1, 2)
        together = self._grid.nearest_of(path) if len(path) else None
        if together is not None and self._goes_on(path, together[0]):
            s_m, d_m = together
            s_m[(s_m >= self.length_m) & self.closed] -= self.length_m
            return s_m, d_m
        points: list[PointM] = [(x, y) for x, y in path.tolist()]
        places = [self.locate_point(point_m) for point_m in points[:1]]
        for before_m, point_m in pairwise(points):
            s_hint_m = places[-1][0]
            reach_m = 2 * math.dist(before_m, point_m) + sum(self.half_widths_at(s_hint_m))
            places.append(self.follow(point_m, s_hint_m=s_hint_m, reach_m=reach_m))
        s_m, d_m = np.array(places, dtype=np.float64).reshape(-1, 2).T
        return s_m, d_m

    def _goes_on(self, path_m: Points, s_m: Floats) -> bool:
        """Whether from each point of a path (n, 2) to the next its nearest place on the route, at `s_m` (n,), surely lies in
        reach, as `locate_path` reckons it where the lane is narrowest: then each nearest place is the right one.
        """
        steps_m = np.diff(s_m)
        if self.closed:
            steps_m = (steps_m + self.length_m / 2) % self.length_m - self.length_m / 2
        reach_m = 2 * np.hypot(*np.diff(path_m, axis=0).T) + 2 * self._plain.half_width_limits_m[0]
        return bool((np.abs(steps_m) <= (1 - 1e-9) * reach_m).all())

    def step_m(self, from_s_m: float, to_s_m: float) -> float:
        """The way along the route from one place on it to another, metres; the shorter way round where it is closed."""
        difference_m = to_s_m - from_s_m
        if not self.closed:
            return difference_m
        return (difference_m + self.length_m / 2) % self.length_m - self.length_m / 2

    def direction_at(self, s_m: float) -> tuple[float, float]:
        """Unit vector of travel, track plane, at `s_m`: any real number, taken round the route, or the end's beyond an end."""
        x, y = self._plain.tangents[self._segment_at(s_m)]
        return x, y

    def point_at(self, s_m: float, d_m: float = 0.0) -> PointM:
        """The point, track m, at `s_m` (any real number), `d_m` to the centreline's left. A closed route is taken round, an
        open one goes straight on beyond its ends.
        """
        i, along = self._on_segment(s_m)
        plain = self._plain
        (x, y), (tx, ty) = plain.points_m[i], plain.tangents[i]
        return x + along * tx - d_m * ty, y + along * ty + d_m * tx

    def points_at(self, s_m: Floats) -> Points:
        """The points (n, 2), track m, of the centreline at the arc lengths `s_m` (n,), each taken as by `point_at`."""
        s = np.asarray(s_m, dtype=np.float64).reshape(-1)
        s = np.mod(s, self.length_m) if self.closed else s
        i = np.clip(np.searchsorted(self.s_m, s, side="right") - 1, 0, len(self._lengths_m) - 1)
        points: Points = self.points_m[i] + (s - self.s_m[i])[:, None] * self._tangents[i]
        return points

    def half_widths_at(self, s_m: float) -> tuple[float, float]:
        """(left, right) metres from the centreline to the lane's edges at `s_m`, linear between the points; beyond an open
        route's end they are that end's.
        """
        i, j, share = self._between(s_m)
        left_m, right_m = self._plain.half_left_m, self._plain.half_right_m
        return left_m[i] + share * (left_m[j] - left_m[i]), right_m[i] + share * (right_m[j] - right_m[i])

    @property
    def curvature_1pm(self) -> Floats:
        """Shape (n,), curvature at each point, 1/m, positive to the left, over about a quarter of the lane's width to either
        side.
        """
        half_m = float(np.median((self.half_left_m + self.half_right_m) / 2))
        return curvature(self.points_m, closed=self.closed, arm=half_m / 2)

    @property
    def min_radius_m(self) -> float | None:
        """Radius of the tightest bend, metres; None where the route is straight to within a micrometre in a metre."""
        sharpest = float(np.abs(self.curvature_1pm).max())
        return 1.0 / sharpest if sharpest > 1e-6 else None

    def curvature_at(self, s_m: float) -> float:
        """Curvature at `s_m`, 1/m, positive to the left, linear between the points; the end's beyond an open route's end."""
        i, j, share = self._between(s_m)
        each = self.curvature_1pm
        return float(each[i] + share * (each[j] - each[i]))

    def outside_by_m(self, s_m: float, d_m: float) -> float:
        """Metres by which a point at (s_m, d_m) lies beyond the lane's edge; negative inside the lane."""
        left, right = self.half_widths_at(s_m)
        return d_m - left if d_m >= 0 else -d_m - right

    def is_within(self, point_m: PointM, margin_m: float) -> bool:
        """Whether a point, track m, lies beyond the lane's edge by at most `margin_m`."""
        bounds_m = self._grid.distance_bounds(*point_m)
        if bounds_m is not None:
            narrowest_m, widest_m = self._plain.half_width_limits_m
            if bounds_m[1] <= narrowest_m + margin_m:
                return True
            if bounds_m[0] > widest_m + margin_m:
                return False
        return self.outside_by_m(*self.locate_point(point_m)) <= margin_m

    def reversed(self) -> Self:
        """The same route driven the other way; a closed one's s_m starts at the same point, an open one's at the other end."""
        order = -np.arange(len(self.points_m)) - (0 if self.closed else 1)
        return type(self)(
            points_m=self.points_m[order],
            half_left_m=self.half_right_m[order],
            half_right_m=self.half_left_m[order],
            closed=self.closed,
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON types; `from_dict` gives back an equal centreline, bit for bit."""
        return {**{name: getattr(self, name).tolist() for name in _STORED}, "closed": self.closed}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Self:
        """The centreline that `to_dict` wrote. Raises `InputError` where the numbers make no centreline.

        What was stored before there were open routes does not say that it is closed, and is.
        """
        try:
            arrays = {name: np.asarray(data[name], dtype=np.float64) for name in _STORED}
            return cls(**arrays, closed=bool(data.get("closed", True)))
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"centreline: {error!r} in its stored form") from error

    def _round(self, s_m: float) -> float:
        if not math.isfinite(s_m):
            raise ValueError(f"s_m must be finite, not {s_m!r}")
        return s_m % self.length_m if self.closed else s_m

    def _segment_at(self, s_m: float) -> int:
        return self._on_segment(s_m)[0]

    def _on_segment(self, s_m: float) -> tuple[int, float]:
        """The segment on which `s_m` lies, and the way from the segment's start, metres."""
        starts_m, s_m = self._plain.s_m, self._round(s_m)
        i = bisect_right(starts_m, s_m) - 1
        # Before an open route's start, beyond its last segment, and where rounding makes a full round of nearly one.
        i = min(max(i, 0), len(self._plain.lengths_m) - 1)
        return i, s_m - starts_m[i]

    def _between(self, s_m: float) -> tuple[int, int, float]:
        """The points before and after `s_m` and the share 0..1 of the way between them."""
        i, along_m = self._on_segment(s_m)
        share = along_m / self._plain.lengths_m[i]
        if self.closed:
            return i, (i + 1) % len(self._plain.s_m), share
        return i, i + 1, min(max(share, 0.0), 1.0)

    def _projected(self, point_m: PointM, segments: NDArray[np.intp]) -> tuple[float, float]:
        s_m, d_m = self._project(np.asarray(point_m, dtype=np.float64).reshape(1, 2), segments)
        return float(s_m[0]), float(d_m[0])

    def _project(self, points: Points, segments: NDArray[np.intp]) -> tuple[Floats, Floats]:
        """Nearest projection of points (m, 2) on the segments (k,), as (s_m, d_m), each (m,)."""
        tangents, lengths = self._tangents[segments], self._lengths_m[segments]
        dx = points[:, 0, None] - self.points_m[segments, 0]
        dy = points[:, 1, None] - self.points_m[segments, 1]
        along = np.clip(dx * tangents[:, 0] + dy * tangents[:, 1], 0.0, lengths)
        apart = (dx - along * tangents[:, 0]) ** 2 + (dy - along * tangents[:, 1]) ** 2
        best = np.argmin(apart, axis=1)
        rows = np.arange(len(points))
        side = tangents[best, 0] * dy[rows, best] - tangents[best, 1] * dx[rows, best]
        s_m = self.s_m[segments[best]] + along[rows, best]
        if self.closed:
            s_m[s_m >= self.length_m] -= self.length_m
        return s_m, np.copysign(np.sqrt(apart[rows, best]), side)


_STORED = ("points_m", "half_left_m", "half_right_m")
