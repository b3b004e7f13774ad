"""One lap along the route: lateral error, speed, and where time is lost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from demo_laps import Camera, demo_drive, demo_laps, demo_track
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from dnb_edge.score.profile import (
    LapTrace,
    delta_profile,
    excursion,
    first_arrivals_s,
    lap_trace,
    lateral_profile,
    speed_profile,
    speeds_mps,
    stretch_ends,
)
from dnb_edge.score.similarity import ScoreSettings, score_lap


def trace_of(t_s: np.ndarray, way_m: np.ndarray, d_m: np.ndarray | None = None) -> LapTrace:
    """A trace on a straight along x."""
    side = np.zeros(len(t_s)) if d_m is None else d_m
    return LapTrace(length_m=float(way_m[-1]), t_s=t_s, way_m=way_m, d_m=side, track_m=np.column_stack([way_m, side]))


def steady(speed_mps: float, *, length_m: float = 4.0, fps: float = 30.0) -> LapTrace:
    t_s = np.append(np.arange(0.0, length_m / speed_mps - 1e-9, 1 / fps), length_m / speed_mps)
    return trace_of(t_s, speed_mps * t_s)


@given(
    hnp.arrays(np.float64, st.integers(2, 40), elements=st.floats(-1.0, 1.0)),
    hnp.arrays(np.float64, st.integers(1, 10), elements=st.floats(0.0, 1.0)),
)
def test_the_first_arrival_is_the_first_instant_of_the_straight_line_at_the_place(
    steps: np.ndarray, shares: np.ndarray
) -> None:
    """Against a search piece by piece, for any way there and back; and no farther place is reached earlier."""
    way_m = np.concatenate(([0.0], np.cumsum(steps)))
    t_s = np.arange(len(way_m), dtype=np.float64)
    at_m = np.sort(shares) * way_m.max()
    arrivals = first_arrivals_s(t_s, way_m, at_m)
    for place, arrival in zip(at_m.tolist(), arrivals.tolist(), strict=True):
        i = next(i for i in range(1, len(way_m)) if max(way_m[: i + 1]) >= place)
        if way_m[i] > way_m[i - 1]:
            slow = i - 1 + min(max((place - way_m[i - 1]) / (way_m[i] - way_m[i - 1]), 0.0), 1.0)
            assert arrival == pytest.approx(slow, abs=1e-9)
    assert (np.diff(arrivals) >= 0).all()


@given(st.floats(0.2, 3.0), st.floats(0.4, 2.5))
def test_a_constant_slower_pace_loses_time_evenly(speed_mps: float, factor: float) -> None:
    """The delta grows in proportion to the way, to the difference of the two laps' times; against itself it is nothing."""
    lap, best = steady(speed_mps / factor), steady(speed_mps)
    profile = delta_profile(lap, best)
    assert profile.delta_s == pytest.approx((factor - 1) * profile.way_m / speed_mps, abs=1e-9)
    assert profile.delta_s[-1] == pytest.approx(lap.time_s - best.time_s, abs=1e-12)
    assert profile.lost_s.sum() == pytest.approx(lap.time_s - best.time_s, abs=1e-12)
    assert not delta_profile(lap, lap).delta_s.any()


def test_time_is_lost_where_the_car_stood() -> None:
    """A second's stop at 2 m is lost there and nowhere else."""
    t_s = np.append(np.arange(0.0, 5.0, 1 / 30), 5.0)
    stopped = trace_of(t_s, np.interp(t_s, [0.0, 2.0, 3.0, 5.0], [0.0, 2.0, 2.0, 4.0]))
    profile = delta_profile(stopped, steady(1.0), bin_m=0.1)
    lost = profile.lost_s
    at_stop = (profile.way_m[1:] > 1.95) & (profile.way_m[:-1] < 2.05)
    assert lost[at_stop].sum() == pytest.approx(1.0, abs=1e-9)
    assert np.abs(lost[~at_stop]).max() < 1e-9


@given(st.integers(1, 60))
def test_standing_still_somewhere_weighs_nothing(frames: int) -> None:
    """A car that is 50 mm off on one tenth of the way, however long it stands there, has the same lateral figures."""
    way_m = np.linspace(0.0, 10.0, 1001)
    d_m = np.where((way_m > 4.0) & (way_m < 5.0), 0.05, -0.01)
    longer = np.insert(way_m, 450, np.full(frames, way_m[450]))
    stood = np.insert(d_m, 450, np.full(frames, d_m[450]))
    before, after = excursion(way_m, d_m, s_m=way_m), excursion(longer, stood, s_m=longer)
    assert after.mean_m == pytest.approx(before.mean_m, abs=1e-12)
    assert after.bias_m == pytest.approx(before.bias_m, abs=1e-12)
    assert after.p95_m == pytest.approx(before.p95_m, abs=1e-12)
    assert before.mean_m == pytest.approx(0.1 * 0.05 + 0.9 * 0.01, abs=1e-4)
    assert before.bias_m == pytest.approx(0.1 * 0.05 - 0.9 * 0.01, abs=1e-4)
    assert (before.p95_m, before.greatest_m) == (0.05, 0.05)
    assert 4.0 < before.greatest_s_m < 5.0


def test_the_p95_is_that_of_the_way() -> None:
    """Of a deviation that grows evenly along the way it is the one at 95 %, however uneven the points are."""
    random = np.random.default_rng(1)
    way_m = np.sort(np.concatenate([random.uniform(0.0, 1.0, 200), random.uniform(0.0, 0.1, 2000), [0.0, 1.0]]))
    found = excursion(way_m, 0.2 * way_m, s_m=way_m)
    assert found.p95_m == pytest.approx(0.19, abs=1e-3)
    assert found.mean_m == pytest.approx(0.1, abs=1e-6)


def test_a_path_backwards_has_the_figures_of_the_same_path_forth() -> None:
    """A lap the wrong way round is as far to the side as it is, and weighs its places all the same."""
    way_m = np.array([0.0, 1.0, 1.5, 4.0])
    d_m = np.array([0.01, -0.02, 0.03, 0.04])
    forth, back = excursion(way_m, d_m, s_m=way_m), excursion(way_m[::-1] - 4.0, d_m[::-1], s_m=way_m[::-1])
    for figure in ("mean_m", "p95_m", "bias_m", "greatest_m", "greatest_s_m"):
        assert getattr(back, figure) == pytest.approx(getattr(forth, figure), abs=1e-12)
    assert forth.mean_m != pytest.approx(np.abs(d_m).mean(), abs=1e-3)


def test_a_path_that_goes_nowhere_has_plain_means() -> None:
    """Without way along the route all points count alike."""
    found = excursion(np.zeros(3), np.array([0.01, 0.02, 0.06]), s_m=np.zeros(3))
    assert found.mean_m == pytest.approx(0.03)
    assert found.greatest_m == 0.06


def test_the_lateral_profile_is_the_line_between_fixes_stretch_by_stretch() -> None:
    """Means are exact for straight pieces; the farthest d_m of a stretch is its sign and all; what was not seen says so."""
    t_s = np.array([0.0, 0.1, 0.2, 0.3, 1.0, 1.1])
    trace = trace_of(t_s, np.array([0.0, 0.1, 0.2, 0.3, 0.7, 0.8]), np.array([0.0, 0.1, -0.12, 0.0, 0.0, 0.04]))
    profile = lateral_profile(trace, bin_m=0.1)
    assert profile.way_m == pytest.approx(np.arange(8) * 0.1 + 0.05)
    assert profile.mean_m == pytest.approx([0.05, -0.01, -0.06, 0.0, 0.0, 0.0, 0.0, 0.02])
    assert profile.greatest_m == pytest.approx([0.1, -0.12, -0.12, 0.0, 0.0, 0.0, 0.0, 0.04])
    assert profile.seen.tolist() == [True] * 3 + [False] * 4 + [True]


def test_the_lateral_profile_takes_a_place_as_it_was_first_passed() -> None:
    """Backing up and passing again does not change a stretch's mean; only its farthest point is of all passes."""
    way_m = np.array([0.0, 0.2, 0.4, 0.3, 0.2, 0.4, 0.6])
    d_m = np.array([0.0, 0.0, 0.0, -0.5, -0.5, 0.0, 0.0])
    profile = lateral_profile(trace_of(np.arange(7.0) * 0.1, way_m, d_m), bin_m=0.1)
    assert profile.mean_m == pytest.approx(np.zeros(6), abs=1e-12)
    assert profile.greatest_m.min() == -0.5


@given(st.floats(0.1, 4.0), st.sampled_from([10.0, 15.0, 30.0, 60.0]))
@settings(deadline=None)
def test_a_constant_speed_is_found_exactly(speed_mps: float, fps: float) -> None:
    """Everywhere in the lap, its ends included, at any frame rate."""
    trace = steady(speed_mps, fps=fps)
    assert speeds_mps(trace) == pytest.approx(speed_mps, rel=1e-6)
    assert speed_profile(trace).speed_mps == pytest.approx(speed_mps, rel=1e-6)


def test_one_wild_fix_does_not_make_a_speed() -> None:
    """A single fix 0.3 m off in a noisy lap changes the speed there by less than a tenth; a stop is a speed of nothing."""
    random = np.random.default_rng(2)
    t_s = np.append(np.arange(0.0, 6.0, 1 / 30), 6.0)
    way_m = np.interp(t_s, [0.0, 2.0, 4.0, 6.0], [0.0, 2.0, 2.0, 4.0])
    way_m[1:-1] += random.normal(0.0, 0.003, len(t_s) - 2)
    way_m[30] += 0.3
    speeds = speeds_mps(trace_of(t_s, way_m))
    assert speeds[10:50] == pytest.approx(1.0, abs=0.1)
    assert speeds[75:105] == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_demo_drives_speed_and_side_are_found_again(seed: int) -> None:
    """Against the drive itself, at 30 fps with 4 mm of noise: speed within 0.12 m/s all along, side within 12 mm, and the
    time at each place within a frame's share of the noise."""
    driven = demo_drive(seed)
    lap = next(demo_laps(driven, Camera(noise_m=0.004)))
    trace = lap_trace(lap, demo_track())
    start_s = driven.crossings_s[0]
    speeds = speed_profile(trace)
    true_t = np.interp(speeds.way_m, driven.table_s_m, driven.table_t_s)
    true_mps = np.gradient(driven.table_s_m, driven.table_t_s)
    assert speeds.speed_mps == pytest.approx(np.interp(true_t, driven.table_t_s, true_mps), abs=0.12)
    assert trace.arrivals_s(speeds.way_m) == pytest.approx(true_t - start_s, abs=0.03)
    side = lateral_profile(trace)
    assert side.mean_m == pytest.approx(driven.wander.offset_m(side.way_m), abs=0.015)
    assert side.seen.all()


def test_a_trace_begins_and_ends_with_its_crossings() -> None:
    """Instants, ways and places of both ends are the crossings' own."""
    lap = next(demo_laps(demo_drive(1), Camera()))
    trace = lap_trace(lap, demo_track())
    assert trace.time_s == pytest.approx(lap.lap.time_s, abs=1e-9)
    assert (trace.way_m[0], trace.way_m[-1]) == (0.0, demo_track().centreline.length_m)
    assert tuple(trace.track_m[0]) == lap.path_m[0]
    assert tuple(trace.track_m[-1]) == lap.path_m[-1]
    assert trace.d_m[0] == pytest.approx(demo_drive(1).wander.offset_m(np.array([0.0]))[0], abs=1e-3)
    assert len(trace.t_s) == len(lap.fixes) + 2


def test_a_lap_ends_with_its_crossing_wherever_the_filter_had_the_car_before() -> None:
    """A filtered place beyond the line before the crossing does not end the lap early: the delta at its end is the times'."""
    lap = next(demo_laps(demo_drive(1), Camera()))
    last = replace(lap.fixes[-1], progress_m=lap.fixes[-1].progress_m + 0.2)
    trace = lap_trace(replace(lap, fixes=(*lap.fixes[:-1], last)), demo_track())
    assert trace.arrivals_s(np.array([trace.length_m])) == pytest.approx([lap.lap.time_s], abs=1e-6)


def test_a_score_tells_the_laps_speeds_where_it_is_told_its_times() -> None:
    """Mean is length by time, greatest that of the profile; without a trace there are none."""
    lap = next(demo_laps(demo_drive(1), Camera()))
    track = demo_track()
    trace = lap_trace(lap, track)
    path = np.array(lap.path_m)
    score = score_lap(path, track.centreline, ScoreSettings(), lap=1, completion_time_s=trace.time_s, trace=trace)
    assert score.speed_mean_mps == pytest.approx(track.centreline.length_m / lap.lap.time_s)
    assert score.speed_max_mps == pytest.approx(1.466, abs=0.02)
    bare = score_lap(path, track.centreline, ScoreSettings(), lap=1, completion_time_s=trace.time_s)
    assert (bare.speed_mean_mps, bare.speed_max_mps) == (None, None)


@given(st.floats(0.01, 100.0))
def test_stretches_are_even_and_about_two_centimetres(length_m: float) -> None:
    """From 0 to the lap's length, in equal parts."""
    ends = stretch_ends(length_m)
    assert (ends[0], ends[-1]) == (0.0, length_m)
    assert np.diff(ends) == pytest.approx(length_m / (len(ends) - 1))
    assert length_m < 0.04 or 0.015 < ends[1] < 0.03


def test_a_trace_must_go_on_in_time() -> None:
    """Two fixes of one instant, or one fix alone, are no trace."""
    with pytest.raises(ValueError, match="in their order"):
        trace_of(np.zeros(2), np.array([0.0, 1.0]))
