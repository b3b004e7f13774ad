"""What must not change a score: frame rate, lost frames, the points' number, the frame of reference, the direction's name."""

from __future__ import annotations

import numpy as np
import pytest
from demo_laps import Camera, demo_drive, demo_laps, demo_track
from hypothesis import given, settings
from hypothesis import strategies as st

from dnb_edge.score.similarity import Metric, ScoreSettings, closed_route, score_lap
from dnb_edge.track.centreline import Centreline
from dnb_edge.values import Points, Score

VARIANTS = [{}, {"directed": True}, {"symmetric": True}, {"directed": True, "symmetric": True}, {"clamp_m": 0.05}]
SIMILARITY_POINTS = 0.5
"""Percentage points within which frame rate and lost frames may move a score."""


def scored(path_m: Points, route: Centreline, rules: ScoreSettings) -> Score:
    return score_lap(path_m, route, rules, lap=1, completion_time_s=5.0)


def demo_path(seed: int, camera: Camera) -> Points:
    return np.array(next(demo_laps(demo_drive(seed), camera)).path_m)


def moved(route: Centreline, by_m: np.ndarray) -> Centreline:
    return Centreline(points_m=route.points_m + by_m, half_left_m=route.half_left_m, half_right_m=route.half_right_m)


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("metric", list(Metric))
def test_the_route_itself_is_worth_exactly_a_hundred(metric: Metric, variant: dict[str, bool]) -> None:
    """The demo track's route, driven as a lap, scores 100 % to the last bit in every variant, and has no lateral error."""
    route = demo_track().centreline
    rules = ScoreSettings(metric=metric, **variant)
    score = scored(closed_route(route), route, rules)
    assert score.similarity_percent == 100.0
    assert score.lateral_max_m < 1e-9


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("noise_m", [0.0, 0.004])
@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5])
def test_frame_rate_and_lost_frames_do_not_move_the_similarity(
    seed: int, noise_m: float, variant: dict[str, bool]
) -> None:
    """The same drive at 15, 30 and 60 frames a second, all frames or nine in ten, is worth the same within half a point."""
    rules = ScoreSettings(**variant)  # type: ignore[arg-type]
    percents = [
        scored(
            demo_path(seed, Camera(fps=fps, noise_m=noise_m, drops=drops, seed=seed)), demo_track().centreline, rules
        ).similarity_percent
        for fps in (15.0, 30.0, 60.0)
        for drops in (0.0, 0.1)
    ]
    assert max(percents) - min(percents) <= SIMILARITY_POINTS
    assert min(percents) > 90


@given(st.floats(0.0, 1.0), st.integers(1, 5))
@settings(max_examples=20, deadline=None)
def test_the_frames_phase_does_not_move_the_similarity(phase: float, seed: int) -> None:
    """Whenever the first frame falls, the lap is worth the same within a twentieth of a point at 30 frames a second."""
    route, rules = demo_track().centreline, ScoreSettings()
    percent = scored(demo_path(seed, Camera(phase=phase)), route, rules).similarity_percent
    assert percent == pytest.approx(scored(demo_path(seed, Camera()), route, rules).similarity_percent, abs=0.05)


@given(st.lists(st.tuples(st.integers(0, 150), st.floats(0.01, 0.99)), max_size=60))
@settings(max_examples=25, deadline=None)
def test_points_on_the_way_between_two_others_change_nothing(extra: list[tuple[int, float]]) -> None:
    """A path with more points on its own straight pieces has the same score to a billionth."""
    path = demo_path(1, Camera())
    at = np.sort(np.concatenate([np.arange(len(path)), [i + share for i, share in extra]]).astype(np.float64))
    longer = np.column_stack([np.interp(at, np.arange(len(path)), path[:, axis]) for axis in (0, 1)])
    route, rules = demo_track().centreline, ScoreSettings(directed=True)
    before, after = scored(path, route, rules), scored(longer, route, rules)
    for figure in ("similarity_percent", "frechet_m", "lateral_mean_m", "lateral_p95_m", "lateral_bias_m"):
        assert getattr(after, figure) == pytest.approx(getattr(before, figure), abs=1e-7)


@given(st.floats(-50, 50), st.floats(-50, 50))
@settings(max_examples=15, deadline=None)
def test_moving_path_and_route_together_changes_nothing(x_m: float, y_m: float) -> None:
    """The track plane's origin may lie anywhere."""
    path, route, by_m = demo_path(2, Camera(noise_m=0.004)), demo_track().centreline, np.array([x_m, y_m])
    before = scored(path, route, ScoreSettings())
    after = scored(path + by_m, moved(route, by_m), ScoreSettings())
    for figure in ("similarity_percent", "frechet_m", "lateral_mean_m", "lateral_p95_m", "lateral_bias_m"):
        assert getattr(after, figure) == pytest.approx(getattr(before, figure), abs=1e-9)


@pytest.mark.parametrize("variant", VARIANTS)
def test_reversing_path_and_route_together_changes_nothing_but_the_side(variant: dict[str, bool]) -> None:
    """A track that is driven the other way round is the same track; what was left is right. Symmetric2 counts the first pair of
    points once and the last one, as a rule, twice (as dtw-python does), so that it may differ by a hundredth of a point."""
    rules = ScoreSettings(**variant)  # type: ignore[arg-type]
    path, route = demo_path(3, Camera(noise_m=0.004)), demo_track().centreline
    before, after = scored(path, route, rules), scored(path[::-1], route.reversed(), rules)
    tolerance = 0.01 if rules.symmetric else 1e-9
    assert after.similarity_percent == pytest.approx(before.similarity_percent, abs=tolerance)
    for figure in ("frechet_m", "lateral_mean_m", "lateral_p95_m", "lateral_max_m"):
        assert getattr(after, figure) == pytest.approx(getattr(before, figure), abs=1e-9)
    assert after.lateral_bias_m == pytest.approx(-before.lateral_bias_m, abs=1e-9)  # type: ignore[operator]
    assert after.lateral_max_s_m == pytest.approx(route.length_m - before.lateral_max_s_m, abs=1e-6)  # type: ignore[operator]


@given(st.integers(0, 739))
@settings(max_examples=15, deadline=None)
def test_where_a_closed_lap_starts_does_not_move_the_similarity(first: int) -> None:
    """A closed path beside the route, started anywhere together with it, is worth the same within a fifth of a point."""
    route = demo_track().centreline
    s_m = np.arange(2000) * (route.length_m / 2000)
    side_m = 0.03 * np.sin(2 * np.pi * 3 * s_m / route.length_m)
    path = np.array([route.point_at(float(s), float(d)) for s, d in zip(s_m, side_m, strict=True)])
    at = round(first / 740 * 2000)
    turned = Centreline(
        points_m=np.roll(route.points_m, -first, axis=0), half_left_m=route.half_left_m, half_right_m=route.half_right_m
    )
    before = scored(np.vstack([path, path[:1]]), route, ScoreSettings()).similarity_percent
    rolled = np.roll(path, -at, axis=0)
    after = scored(np.vstack([rolled, rolled[:1]]), turned, ScoreSettings()).similarity_percent
    assert after == pytest.approx(before, abs=0.2)


@pytest.mark.parametrize("metric", list(Metric))
def test_the_same_points_backwards_are_worth_less_where_direction_counts(metric: Metric) -> None:
    """On a straight that is driven to and fro and ends where it should, only the directed form tells the way back."""
    x = np.linspace(0.0, 4.0, 300)
    half = np.full(300, 0.2)
    route = Centreline(points_m=np.column_stack([x, np.zeros(300)]), half_left_m=half, half_right_m=half, closed=False)
    stretch = np.column_stack([np.linspace(0.5, 3.5, 100), np.zeros(100)])
    plain, directed = (
        ScoreSettings(metric=metric, clamp_m=0.1),
        ScoreSettings(metric=metric, clamp_m=0.1, directed=True),
    )
    worth = {
        (name, way): score_lap(path, route, rules, lap=1, completion_time_s=1.0, lap_route_m=stretch).similarity_percent
        for name, rules in (("plain", plain), ("directed", directed))
        for way, path in (("forth", stretch), ("back", stretch[::-1]))
    }
    assert worth["plain", "forth"] == worth["directed", "forth"] == 100.0
    assert worth["plain", "back"] >= 80.0
    assert worth["directed", "back"] == 0.0
