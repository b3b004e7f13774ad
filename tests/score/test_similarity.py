"""From distance to percent, and the scoring of whole laps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.score.similarity import (
    Metric,
    ScoreSettings,
    closed_route,
    polyline_length_m,
    resample,
    score_lap,
    similarity_percent,
)
from dnb_edge.track.centreline import Centreline


def ring(radius_m: float = 1.0, points: int = 300) -> Centreline:
    angles = np.linspace(0, 2 * np.pi, points, endpoint=False)
    half = np.full(points, 0.15)
    circle = np.column_stack([np.cos(angles), np.sin(angles)]) * radius_m
    return Centreline(points_m=circle, half_left_m=half, half_right_m=half)


@pytest.mark.parametrize(
    ("distance_m", "baseline_m", "percent"),
    [(0.0, 0.5, 100.0), (0.25, 0.5, 50.0), (0.5, 0.5, 0.0), (3.0, 0.5, 0.0), (0.0211, 0.5, 95.78)],
)
def test_similarity_follows_the_papers_formula(distance_m: float, baseline_m: float, percent: float) -> None:
    """S = min(100, 100 max(0, 1 - d / B)), case by case."""
    assert similarity_percent(distance_m, baseline_m) == pytest.approx(percent, abs=1e-12)


@pytest.mark.parametrize("metric", list(Metric))
def test_a_lap_that_follows_the_route_exactly_scores_exactly_a_hundred(metric: Metric) -> None:
    """The route itself, driven as a lap, is worth 100 % to the last bit."""
    route = ring()
    score = score_lap(closed_route(route), route, ScoreSettings(metric=metric), lap=1, completion_time_s=5.0)
    assert score.similarity_percent == 100.0
    assert score.dtw_mean_m == score.frechet_m == 0.0


@given(st.floats(0.01, 0.14))
def test_a_constant_offset_scores_by_its_size(offset_m: float) -> None:
    """A lap that runs `offset_m` beside the route all round is that far away by both metrics."""
    wide = closed_route(ring(1.0 + offset_m))
    score = score_lap(wide, ring(), ScoreSettings(), lap=1, completion_time_s=5.0)
    assert score.dtw_mean_m == pytest.approx(offset_m, rel=0.02)
    assert score.frechet_m == pytest.approx(offset_m, rel=0.02)
    assert score.lateral_mean_m == pytest.approx(offset_m, abs=1e-3)


def test_the_scale_never_comes_from_the_path_that_is_scored() -> None:
    """A wilder path scores lower, never higher, under the same settings."""
    angles = np.linspace(0, 2 * np.pi, 400)
    scores = []
    for wobble_m in (0.0, 0.05, 0.1, 0.2):
        radius = 1.0 + wobble_m * np.sin(9 * angles)
        path = np.column_stack([radius * np.cos(angles), radius * np.sin(angles)])
        scores.append(score_lap(path, ring(), ScoreSettings(), lap=1, completion_time_s=5).similarity_percent)
    assert scores == sorted(scores, reverse=True)
    assert scores[0] > 99.9 > scores[1]


def test_the_clamp_bounds_what_one_excursion_costs() -> None:
    """With a clamp a single far excursion costs no more than the clamp at each of its points."""
    path = closed_route(ring()).copy()
    path[100:110] *= 5.0
    free = score_lap(path, ring(), ScoreSettings(), lap=1, completion_time_s=5)
    clamped = score_lap(path, ring(), ScoreSettings(clamp_m=0.2), lap=1, completion_time_s=5)
    assert clamped.frechet_m == 0.2
    assert clamped.similarity_percent > free.similarity_percent


@given(st.integers(2, 500))
def test_resampling_keeps_the_ends_and_the_length(count: int) -> None:
    """Resampled points are as many as asked, start and end alike, and do not lengthen the path."""
    path = closed_route(ring())
    points = resample(path, count)
    assert len(points) == count
    assert points[0] == pytest.approx(path[0])
    assert points[-1] == pytest.approx(path[-1])
    assert polyline_length_m(points) <= polyline_length_m(path) + 1e-9


@pytest.mark.parametrize("bad", [{"points": 1}, {"baseline_m": 0.0}, {"baseline_m": float("inf")}, {"clamp_m": -1.0}])
def test_settings_that_make_no_sense_are_refused(bad: dict[str, float]) -> None:
    """Each impossible setting is named in the error."""
    with pytest.raises(ValueError, match=next(iter(bad))):
        ScoreSettings(**bad)  # type: ignore[arg-type]


def test_over_a_crossing_the_distance_is_that_to_the_branch_that_is_driven() -> None:
    """On an eight, 0.12 m beside its middle all along, no point counts as nearer for the other branch's sake."""
    t = np.arange(600) * (2 * np.pi / 600) + np.pi / 4
    half = np.full(600, 0.15)
    points = np.column_stack([2.0 * np.sin(t), 1.2 * np.sin(2 * t)])
    eight = Centreline(points_m=points, half_left_m=half, half_right_m=half)
    path = np.array([eight.point_at(s, 0.12) for s in np.linspace(0.0, eight.length_m, 1500)])
    score = score_lap(path, eight, ScoreSettings(), lap=1, completion_time_s=5.0)
    assert score.lateral_mean_m == pytest.approx(0.12, abs=2e-4)


def test_an_open_lap_is_compared_with_its_own_stretch_of_the_route() -> None:
    """From line to line of a straight it scores 100 %, and its route is as long as that stretch."""
    x = np.linspace(0.0, 4.0, 300)
    route = Centreline(
        points_m=np.column_stack([x, np.zeros(300)]), half_left_m=np.full(300, 0.1), half_right_m=np.full(300, 0.1),
        closed=False,
    )  # fmt: skip
    stretch = np.column_stack([np.linspace(0.5, 3.5, 50), np.zeros(50)])
    score = score_lap(stretch, route, ScoreSettings(), lap=1, completion_time_s=5.0, lap_route_m=stretch)
    assert score.similarity_percent == 100.0
    assert score.route_length_m == pytest.approx(3.0)
