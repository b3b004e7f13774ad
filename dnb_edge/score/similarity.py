"""The paper's path similarity of one lap: resample, compare with the route, normalise by a fixed baseline.

Knows a driven path and a route in track metres; knows nothing of stamps, targets or files. The scale (clamp and baseline)
comes from the settings and never from the path that is being scored, so a wilder path cannot buy itself a larger scale.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from dnb_edge.score.distance import dtw_distance, frechet_distance
from dnb_edge.track.centreline import Centreline
from dnb_edge.values import Points, Score


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

    def __post_init__(self) -> None:
        if self.points < 2:
            raise ValueError(f"score.points: {self.points} is too few, at least 2 are needed")
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
) -> Score:
    """Scores the driven path `path_m`, (n, 2) track metres in driving order, from where a lap starts to where it ends.

    `lap_route_m`, (m, 2) track metres, is the lap's stretch of the route; None for once round it, from start line to start
    line. Raises `ValueError` where the path has fewer than two points or no length.
    """
    route = closed_route(centreline) if lap_route_m is None else lap_route_m
    driven, wanted = resample(path_m, settings.points), resample(route, settings.points)
    dtw_mean_m = dtw_distance(driven, wanted, settings.clamp_m) / settings.points
    frechet_m = frechet_distance(driven, wanted, settings.clamp_m)
    distance_m = dtw_mean_m if settings.metric is Metric.DTW else frechet_m
    lateral_m = np.abs(centreline.locate_path(driven)[1])
    return Score(
        lap=lap,
        metric=settings.metric.value,
        similarity_percent=similarity_percent(distance_m, settings.baseline_m),
        dtw_mean_m=dtw_mean_m,
        frechet_m=frechet_m,
        clamp_m=settings.clamp_m,
        baseline_m=settings.baseline_m,
        completion_time_s=completion_time_s,
        lateral_mean_m=float(lateral_m.mean()),
        lateral_max_m=float(lateral_m.max()),
        path_length_m=polyline_length_m(path_m),
        route_length_m=polyline_length_m(route),
    )


def polyline_length_m(points: Points) -> float:
    """Length of the polyline `points`, (n, 2) in metres."""
    return float(np.hypot(*np.diff(points, axis=0).T).sum())
