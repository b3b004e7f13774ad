"""The paper's path similarity of one lap: resample, compare with the route, normalise by a fixed baseline.

Knows a driven path and a route in track metres; knows nothing of stamps, targets or files. The scale (clamp and baseline)
comes from the settings and never from the path that is being scored, so a wilder path cannot buy itself a larger scale.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from dnb_edge.score.distance import Headings, Programme, distances
from dnb_edge.score.profile import Excursion, LapTrace, excursion, speeds_mps
from dnb_edge.track.centreline import Centreline
from dnb_edge.values import Points, Score

HEADING_ARM_M = 0.05
"""A path's direction at a point is that from so far before to so far behind it along the path: over a car's length, so that
neither the points' noise nor the frame rate tells in it, metres."""


MOST_POINTS = 10_000
"""Time and memory go with the square of `score.points`, and 500 tell millimetres: more than this would only stop the race."""


class Metric(StrEnum):
    """Which distance the similarity is made of."""

    DTW = "dtw"
    FRECHET = "frechet"


@dataclass(frozen=True, slots=True, kw_only=True)
class ScoreSettings:
    """How a lap's path becomes a percentage."""

    metric: Metric = Metric.DTW
    """Which distance the percentage is made of: `dtw` or `frechet`."""
    points: int = 500
    """Number of points to which lap and route are resampled by arc length; at least 2."""
    clamp_m: float | None = None
    """Bound on each point-to-point distance (delta in the paper), metres; None for no bound."""
    baseline_m: float = 0.5
    """The distance that scores 0 % (B in the paper), metres. With DTW it is compared with the mean distance per point."""
    directed: bool = False
    """Whether the direction counts: to each point-to-point distance, after the clamp, `baseline_m` * (1 - cos(theta)) / 2 is
    added, theta being the angle between the path and the route. Driven against the route all along scores 0 %."""
    symmetric: bool = False
    """Whether DTW takes step pattern symmetric2, normalised by the points of both (Sakoe and Chiba, 1978), instead of
    symmetric1 by those of the route. The Frechet distance is symmetric by itself."""

    def __post_init__(self) -> None:
        if self.points < 2:
            raise ValueError(f"score.points: {self.points} is too few, at least 2 are needed")
        if self.points > MOST_POINTS:
            raise ValueError(f"score.points: {self.points} is too many, at most {MOST_POINTS}")
        if not (self.baseline_m > 0 and math.isfinite(self.baseline_m)):
            raise ValueError(f"score.baseline_m: {self.baseline_m} must be a positive length")
        if self.clamp_m is not None and not self.clamp_m > 0:
            raise ValueError(f"score.clamp_m: {self.clamp_m} must be positive")


def similarity_percent(distance_m: float, baseline_m: float) -> float:
    """S = min(100, 100 max(0, 1 - d / B)), equation 1 of the DriveNetBench paper."""
    return min(100.0, 100.0 * max(0.0, 1.0 - distance_m / baseline_m))


def resample(points: Points, count: int) -> Points:
    """`count` points evenly spaced by arc length along the polyline `points`, (n, 2); first and last are kept.

    Raises `ValueError` where the polyline has no length.
    """
    steps = np.hypot(*np.diff(points, axis=0).T)
    arc = np.concatenate([[0.0], np.cumsum(steps)])
    if not arc[-1] > 0:
        raise ValueError("a path without length cannot be resampled")
    at = np.linspace(0.0, arc[-1], count)
    return np.column_stack([np.interp(at, arc, points[:, 0]), np.interp(at, arc, points[:, 1])])


def directions(points: Points) -> Points:
    """(n, 2) unit vectors of travel at `points` (n, 2) that `resample` made, n >= 2, over `HEADING_ARM_M` to either side, or
    what there is of it at the ends; (0, 0) where the path is back where it was.
    """
    spacing_m = polyline_length_m(points) / (len(points) - 1)
    arm = max(1, round(HEADING_ARM_M / spacing_m))
    at = np.arange(len(points))
    chords = points[np.minimum(at + arm, len(points) - 1)] - points[np.maximum(at - arm, 0)]
    lengths = np.hypot(chords[:, 0], chords[:, 1])[:, None]
    units: Points = np.divide(chords, lengths, out=np.zeros_like(chords), where=lengths > 0)
    return units


def closed_route(centreline: Centreline) -> Points:
    """The route as a polyline (n + 1, 2) in track metres that ends where it starts, at the start line."""
    return np.vstack([centreline.points_m, centreline.points_m[:1]])


def score_lap(
    path_m: Points,
    centreline: Centreline,
    settings: ScoreSettings,
    *,
    lap: int,
    completion_time_s: float,
    lap_route_m: Points | None = None,
    trace: LapTrace | None = None,
) -> Score:
    """Scores the driven path `path_m`, (n, 2) track metres in driving order, from where a lap starts to where it ends.

    `lap_route_m`, (m, 2) track metres, is the lap's stretch of the route; None for once round it, from start line to start
    line. `trace` is when the car was where in the lap; without it the score tells no speeds. Lateral figures are over the way
    along the route, not over frames: see `excursion`. Raises `ValueError` where the path has fewer than two points or no
    length.
    """
    route = closed_route(centreline) if lap_route_m is None else lap_route_m
    driven, wanted = resample(path_m, settings.points), resample(route, settings.points)
    dtw_mean_m, frechet_m = _distances(driven, wanted, settings)
    distance_m = dtw_mean_m if settings.metric is Metric.DTW else frechet_m
    lateral = _lateral(driven, centreline)
    route_length_m = polyline_length_m(route)
    return Score(
        lap=lap,
        metric=settings.metric.value,
        similarity_percent=similarity_percent(distance_m, settings.baseline_m),
        dtw_mean_m=dtw_mean_m,
        frechet_m=frechet_m,
        clamp_m=settings.clamp_m,
        baseline_m=settings.baseline_m,
        completion_time_s=completion_time_s,
        lateral_mean_m=lateral.mean_m,
        lateral_max_m=lateral.greatest_m,
        path_length_m=polyline_length_m(path_m),
        route_length_m=route_length_m,
        lateral_p95_m=lateral.p95_m,
        lateral_max_s_m=lateral.greatest_s_m,
        lateral_bias_m=lateral.bias_m,
        speed_mean_mps=None if trace is None else trace.length_m / trace.time_s,
        speed_max_mps=None if trace is None else float(np.abs(speeds_mps(trace)).max()),
    )


def local_headings(driven: Points, wanted: Points, settings: ScoreSettings) -> Headings | None:
    """What direction costs between the resampled points of path and route; None where it does not count."""
    if not settings.directed:
        return None
    return Headings(path=directions(driven), reference=directions(wanted), cost_m=settings.baseline_m)


def _distances(driven: Points, wanted: Points, settings: ScoreSettings) -> tuple[float, float]:
    """(normalised DTW, Frechet) distance of the resampled paths, metres."""
    warping = Programme.DTW_SYMMETRIC if settings.symmetric else Programme.DTW
    dtw_m, frechet_m = distances(
        driven,
        wanted,
        settings.clamp_m,
        (warping, Programme.FRECHET),
        headings=local_headings(driven, wanted, settings),
    )
    return dtw_m / (2 * settings.points if settings.symmetric else settings.points), frechet_m


def _lateral(driven: Points, centreline: Centreline) -> Excursion:
    """How far from the centreline the points of a path, (n, 2) track m, lie along the way that it made along the route."""
    s_m, d_m = centreline.locate_path(driven)
    steps = np.diff(s_m)
    if centreline.closed:
        steps = (steps + centreline.length_m / 2) % centreline.length_m - centreline.length_m / 2
    way_m: NDArray[np.float64] = np.concatenate(([0.0], np.cumsum(steps)))
    return excursion(way_m, d_m, s_m=s_m)


def polyline_length_m(points: Points) -> float:
    """Length of the polyline `points`, (n, 2) in metres."""
    return float(np.hypot(*np.diff(points, axis=0).T).sum())
