"""The running lap: its similarity, its time against the best lap, and that lap's ghost."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from demo_laps import Camera, crossing, demo_drive, demo_laps, demo_track, fixes_at, lap_of, seen
from hypothesis import given, settings
from hypothesis import strategies as st

from dnb_edge.race.fix import Fix
from dnb_edge.race.laps import DrivenLap
from dnb_edge.score.live import LiveLap
from dnb_edge.score.similarity import Metric, ScoreSettings, score_lap
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.line import DirectedLine
from dnb_edge.track.model import FINISH_LINE, START_LINE, Track
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import Crossing, Running

EACH_FIX_S = 1e-9
"""A period so short that every fix is told."""


def straight(*, length_m: float = 4.0) -> Track:
    """An open route along x from 0 to `length_m`, with a lap from 0.5 m to 0.5 m before its end."""
    x = np.linspace(0.0, length_m, 300)
    half = np.full(300, 0.2)
    route = Centreline(points_m=np.column_stack([x, np.zeros(300)]), half_left_m=half, half_right_m=half, closed=False)
    end_m = length_m - 0.5
    return Track(
        name="straight",
        scale=TwinScale(metres_per_px=0.01, height_px=100),
        centreline=route,
        start_line=DirectedLine(name=START_LINE, start_m=(0.5, 0.3), end_m=(0.5, -0.3)),
        finish_line=DirectedLine(name=FINISH_LINE, start_m=(end_m, 0.3), end_m=(end_m, -0.3)),
    )


def straight_lap(
    speed_mps: float, *, from_s: float = 0.0, fps: float = 30.0, side_m: float = 0.0, number: int = 1
) -> tuple[list[Fix], DrivenLap, Crossing]:
    """All fixes of a drive along the straight at one speed, the lap in it, and the crossing that began it."""
    t_s = from_s + np.arange(0.0, 4.0 / speed_mps, 1 / fps) + 0.3 / fps
    points = np.column_stack([(t_s - from_s) * speed_mps, np.full(len(t_s), side_m)])
    fixes = fixes_at(t_s, points, straight())
    start = crossing(from_s + 0.5 / speed_mps, (0.5, side_m))
    end = crossing(from_s + 3.5 / speed_mps, (3.5, side_m), FINISH_LINE)
    return fixes, lap_of(fixes, start, end, number=number), start


def told(live: LiveLap, fixes: list[Fix], start: Crossing, *, lap: int, late_s: float = 0.1) -> list[Running]:
    """What is told of one lap, of which the beginning is told `late_s` after it."""
    rows: list[Running | None] = []
    known = False
    for fix in fixes:
        rows.append(live.fix(fix))
        if not known and fix.t_s >= start.t_s + late_s:
            live.started(start, lap=lap)
            known = True
    live.stopped()
    return [row for row in rows if row is not None]


@given(st.floats(0.3, 3.0), st.floats(0.5, 2.0), st.sampled_from([15.0, 30.0, 60.0]))
@settings(max_examples=25, deadline=None)
def test_at_a_constant_slower_pace_the_delta_grows_with_the_way(speed_mps: float, factor: float, fps: float) -> None:
    """After the way w at v / factor against w at v the car is (factor - 1) * w / v behind, or ahead; on an open route."""
    live = LiveLap(straight(), None, period_s=EACH_FIX_S)
    fixes, best, start = straight_lap(speed_mps, fps=fps)
    told(live, fixes, start, lap=1)
    live.finished(best)
    fixes, _, start = straight_lap(speed_mps / factor, from_s=100.0, fps=fps)
    rows = [row for row in told(live, fixes, start, lap=2) if row.s_m < 3.5]
    assert len(rows) > 2
    for row in rows:
        assert row.delta_s == pytest.approx((factor - 1) * (row.s_m - 0.5) / speed_mps, abs=1e-6)
        assert row.elapsed_s == pytest.approx((row.s_m - 0.5) / (speed_mps / factor), abs=1e-6)
        assert row.speed_mps == pytest.approx(speed_mps / factor, rel=1e-6)


@given(st.floats(0.3, 3.0), st.floats(0.5, 2.0))
@settings(max_examples=25, deadline=None)
def test_the_ghost_is_where_the_best_lap_was_after_the_same_time(speed_mps: float, factor: float) -> None:
    """On the straight: half a metre and v * t along, to the best lap's own side; no ghost after that lap's end."""
    live = LiveLap(straight(), None, period_s=EACH_FIX_S)
    fixes, best, start = straight_lap(speed_mps, side_m=0.07)
    told(live, fixes, start, lap=1)
    live.finished(best)
    fixes, _, start = straight_lap(speed_mps / factor, from_s=100.0)
    for row in told(live, fixes, start, lap=2):
        if row.elapsed_s > best.lap.time_s:
            assert row.ghost_m is None
        else:
            assert row.ghost_m == pytest.approx((0.5 + speed_mps * row.elapsed_s, 0.07), abs=1e-6)


@pytest.mark.parametrize("camera", [Camera(), Camera(fps=15), Camera(fps=60, noise_m=0.004)])
def test_the_best_lap_driven_again_is_neither_ahead_nor_behind(camera: Camera) -> None:
    """The same frames again, a hundred seconds later: delta 0 and the ghost under the car, all round the demo track."""
    live = LiveLap(demo_track(), None, period_s=EACH_FIX_S)
    lap = next(demo_laps(demo_drive(1), camera))
    t_s, points = seen(demo_drive(1), camera)
    start = crossing(lap.lap.start_t_ns * 1e-9, lap.path_m[0])
    told(live, fixes_at(t_s, points), start, lap=1)
    live.finished(lap)
    again = crossing(start.t_s + 100.0, start.track_m)
    fixes = [fix for fix in fixes_at(t_s + 100.0, points) if fix.t_ns < lap.lap.end_t_ns + 100 * 10**9]
    rows = [row for row in told(live, fixes, again, lap=2) if row.elapsed_s > 0.1]
    assert len(rows) > 50
    for row in rows:
        assert row.delta_s is not None
        assert row.ghost_m is not None
        # Where noise set the car back, the place that counts is the farthest, where it was up to a frame or two before.
        assert -1e-6 < row.delta_s < (1e-6 if camera.noise_m == 0 else 2.5 / camera.fps)
        assert math.dist(row.ghost_m, row.track_m) < 1e-6


def test_the_same_lap_between_other_frames_has_a_delta_of_a_fraction_of_a_frame() -> None:
    """The same drive seen by frames at another phase: the delta is what a straight line between frames is wrong by."""
    best = next(demo_laps(demo_drive(1), Camera(phase=0.0)))
    live = LiveLap(demo_track(), None, period_s=EACH_FIX_S)
    live.finished(best)
    fixes = fixes_at(*seen(demo_drive(1), Camera(phase=0.5)))
    start = crossing(best.lap.start_t_ns * 1e-9, best.path_m[0])
    deltas = [row.delta_s for row in told(live, fixes, start, lap=1) if row.elapsed_s > 0.1]
    inside = [abs(delta) for delta in deltas[: int(best.lap.time_s * 30) - 5] if delta is not None]
    assert len(inside) > 150
    assert max(inside) < 0.1 / 30


def test_standing_and_driving_back_lose_time_and_nothing_else() -> None:
    """A car that stands for a second and backs up for another is as far behind as it took to be back where it was."""
    live = LiveLap(straight(), None, period_s=EACH_FIX_S)
    _, best, _ = straight_lap(1.0)
    live.finished(best)
    t_s = np.arange(0.0, 7.0, 1 / 30)
    x = np.interp(t_s, [0.0, 2.0, 3.0, 4.0, 5.0, 6.5], [0.0, 2.0, 2.0, 1.5, 2.0, 3.5])
    jitter = np.random.default_rng(1).normal(0.0, 0.002, len(t_s))
    fixes = fixes_at(t_s, np.column_stack([x + jitter, np.zeros(len(t_s))]), straight())
    rows = told(live, fixes, crossing(0.5, (0.5, 0.0)), lap=1)
    by_time = {round(row.t_s, 2): row.delta_s for row in rows}
    assert by_time[1.5] == pytest.approx(0.0, abs=0.02)
    assert by_time[3.0] == pytest.approx(1.0, abs=0.02)
    assert by_time[4.0] == pytest.approx(2.0, abs=0.02)
    assert by_time[6.0] == pytest.approx(3.0, abs=0.02)


@pytest.mark.parametrize("metric", list(Metric))
@pytest.mark.parametrize("variant", [{}, {"directed": True}, {"symmetric": True}, {"clamp_m": 0.03}])
@pytest.mark.parametrize("camera", [Camera(noise_m=0.004), Camera(fps=60), Camera(fps=15, noise_m=0.004, drops=0.1)])
def test_at_a_laps_end_the_running_similarity_is_the_laps_score(
    metric: Metric, variant: dict[str, float], camera: Camera
) -> None:
    """Within one percentage point, by both metrics and all variants, at any frame rate."""
    rules = ScoreSettings(metric=metric, **variant)  # type: ignore[arg-type]
    track = demo_track()
    for seed in (1, 2):
        lap = next(demo_laps(demo_drive(seed), camera))
        live = LiveLap(track, rules, period_s=EACH_FIX_S)
        start = crossing(lap.lap.start_t_ns * 1e-9, lap.path_m[0])
        rows = told(live, fixes_at(*seen(demo_drive(seed), camera)), start, lap=1)
        last = next(row for row in reversed(rows) if row.elapsed_s < lap.lap.time_s)
        score = score_lap(np.array(lap.path_m), track.centreline, rules, lap=1, completion_time_s=1.0)
        assert last.similarity_percent == pytest.approx(score.similarity_percent, abs=1.0)


def test_how_late_a_laps_beginning_is_told_changes_nothing() -> None:
    """A crossing may be confirmed a tenth of a second or two seconds after its instant: what is told then is the same."""
    lap = next(demo_laps(demo_drive(1), Camera(noise_m=0.004)))
    start = crossing(lap.lap.start_t_ns * 1e-9, lap.path_m[0])
    fixes = fixes_at(*seen(demo_drive(1), Camera(noise_m=0.004)))

    def rows(late_s: float) -> dict[int, Running]:
        live = LiveLap(demo_track(), ScoreSettings(), period_s=EACH_FIX_S)
        live.finished(lap)
        return {
            row.t_ns: row for row in told(live, fixes, start, lap=1, late_s=late_s) if row.elapsed_s < lap.lap.time_s
        }

    soon, late = rows(0.1), rows(2.0)
    assert 100 < len(late) < len(soon)
    for t_ns, row in late.items():
        assert row.similarity_percent == pytest.approx(soon[t_ns].similarity_percent, abs=1e-9)
        assert replace(row, similarity_percent=None) == replace(soon[t_ns], similarity_percent=None)


def test_a_restless_path_does_not_lower_the_running_similarity_by_its_length() -> None:
    """A slow car seen with much noise has a path half as long again as the route: told as it is scored, within two points of a
    scale ten times as fine as usual."""
    track, random = straight(), np.random.default_rng(3)
    t_s = np.arange(0.0, 4.0 / 0.3, 1 / 60)
    points = np.column_stack([0.3 * t_s, np.zeros(len(t_s))]) + random.normal(0.0, 0.005, (len(t_s), 2))
    fixes = fixes_at(t_s, points, track)
    start, end = crossing(0.5 / 0.3, (0.5, 0.0)), crossing(3.5 / 0.3, (3.5, 0.0), FINISH_LINE)
    lap = lap_of(fixes, start, end)
    for rules in (ScoreSettings(baseline_m=0.05), ScoreSettings(baseline_m=0.05, symmetric=True)):
        score = score_lap(
            np.array(lap.path_m), track.centreline, rules, lap=1, completion_time_s=1.0, lap_route_m=track.lap_route_m()
        )
        assert score.path_length_m > 1.5 * score.route_length_m
        rows = told(LiveLap(track, rules, period_s=EACH_FIX_S), fixes, start, lap=1)
        last = next(row for row in reversed(rows) if row.t_s < end.t_s)
        assert last.similarity_percent == pytest.approx(score.similarity_percent, abs=2.0)


def test_of_too_short_a_way_there_is_no_similarity() -> None:
    """In the first twentieth of a lap it is not told, then it is; without a score it never is."""
    fixes, _, start = straight_lap(1.0)
    rows = told(LiveLap(straight(), ScoreSettings(), period_s=EACH_FIX_S), fixes, start, lap=1)
    for row in rows:
        assert (row.similarity_percent is None) == (row.s_m - 0.5 < 0.05 * 3.0)
    rows = told(LiveLap(straight(), None, period_s=EACH_FIX_S), fixes, start, lap=1)
    assert {row.similarity_percent for row in rows} == {None}


def test_it_is_told_five_times_a_second_and_only_in_laps() -> None:
    """Nothing before a lap begins or after it is stopped; in between once every 0.2 s of stamps."""
    live = LiveLap(straight(), None)
    fixes, _, start = straight_lap(0.5, fps=50)
    rows = told(live, fixes, start, lap=7)
    assert np.diff([row.t_s for row in rows]) == pytest.approx(0.2, abs=1e-6)
    assert {row.lap for row in rows} == {7}
    later, _, _ = straight_lap(0.5, from_s=50.0)
    assert [live.fix(fix) for fix in later if fix.t_s > 50.0] == [None] * len(later)


def test_the_best_lap_is_the_valid_one_of_the_least_official_time() -> None:
    """Neither an invalid lap nor one with a penalty displaces a slower clean one."""
    live = LiveLap(straight(), None)
    for number, speed_mps in enumerate((1.0, 2.0, 1.5), start=1):
        _, driven, _ = straight_lap(speed_mps, number=number)
        if number == 2:
            driven = replace(driven, lap=replace(driven.lap, valid=False))
        live.finished(driven)
        assert live.best is not None
        assert live.best.number == (3 if number == 3 else 1)
    _, driven, _ = straight_lap(2.5, number=4)
    live.finished(driven, replace(driven.lap, official_time_s=driven.lap.time_s + 5.0))
    assert live.best is not None
    assert live.best.number == 3


def arc_track() -> Track:
    """A ring of radius 1 m, its start line at a twentieth and a finish line of its own at three quarters of the way."""
    angles = np.linspace(0.0, 2 * np.pi, 600, endpoint=False)
    half = np.full(600, 0.2)
    ring = Centreline(
        points_m=np.column_stack([np.cos(angles), np.sin(angles)]), half_left_m=half, half_right_m=half
    )  # fmt: skip
    ends = {
        name: (1.2 * np.array([math.cos(angle), math.sin(angle)]), 0.8 * np.array([math.cos(angle), math.sin(angle)]))
        for name, angle in ((START_LINE, 0.1 * math.pi), (FINISH_LINE, 1.5 * math.pi))
    }
    lines = {
        name: DirectedLine(name=name, start_m=(float(b[0]), float(b[1])), end_m=(float(a[0]), float(a[1])))
        for name, (a, b) in ends.items()
    }
    return Track(
        name="arc",
        scale=TwinScale(metres_per_px=0.01, height_px=100),
        centreline=ring,
        start_line=lines[START_LINE],
        finish_line=lines[FINISH_LINE],
    )


def test_laps_between_two_lines_of_a_closed_route_are_told_like_others() -> None:
    """On a ring with a finish line of its own: delta and ghost by hand, a similarity of 100, and nothing after the end."""
    track = arc_track()
    live = LiveLap(track, ScoreSettings(directed=True), period_s=EACH_FIX_S)

    def arc(speed: float, from_s: float) -> tuple[list[Fix], Crossing, Crossing]:
        t_s = np.arange(0.0, 1.7 * math.pi / speed, 1 / 30)
        points = np.column_stack([np.cos(speed * t_s), np.sin(speed * t_s)])
        places = [(math.cos(angle), math.sin(angle)) for angle in (0.1 * math.pi, 1.5 * math.pi)]
        start = crossing(from_s + 0.1 * math.pi / speed, places[0])
        end = crossing(from_s + 1.5 * math.pi / speed, places[1], FINISH_LINE)
        return fixes_at(from_s + t_s, points, track), start, end

    fixes, start, end = arc(1.0, 0.0)
    rows = told(live, fixes, start, lap=1)
    assert rows[-1].similarity_percent == pytest.approx(100.0, abs=0.1)
    live.finished(lap_of(fixes, start, end))
    fixes, start, end = arc(0.8, 50.0)
    rows = [row for row in told(live, fixes, start, lap=2) if row.t_s < end.t_s]
    for row in rows:
        turned = 0.8 * row.elapsed_s
        assert row.delta_s == pytest.approx(row.elapsed_s - turned, abs=2e-3)
        if row.elapsed_s < 1.4 * math.pi:
            assert row.ghost_m is not None
            assert (
                math.dist(
                    row.ghost_m, (math.cos(0.1 * math.pi + row.elapsed_s), math.sin(0.1 * math.pi + row.elapsed_s))
                )
                < 1e-3
            )


def test_after_the_line_the_delta_stays_until_the_end_is_told() -> None:
    """Crossings are confirmed late: what the car does meanwhile belongs to no part of the running lap."""
    live = LiveLap(straight(), ScoreSettings(), period_s=EACH_FIX_S)
    _, best, _ = straight_lap(1.0)
    live.finished(best)
    fixes, _, start = straight_lap(0.5, from_s=100.0)
    rows = told(live, fixes, start, lap=2)
    after = [row for row in rows if row.s_m > 3.5]
    last = [row for row in rows if row.s_m < 3.5][-1]
    assert len(after) > 10
    assert {(row.delta_s, row.similarity_percent) for row in after} == {(last.delta_s, last.similarity_percent)}


def test_a_lap_of_which_nothing_was_seen_is_no_hindrance() -> None:
    """A best lap without a single fix between its crossings still has a time at each end, and a ghost on the way between."""
    live = LiveLap(straight(), None, period_s=EACH_FIX_S)
    fixes, best, start = straight_lap(1.0)
    live.finished(replace(best, fixes=()))
    rows = [row for row in told(live, fixes, start, lap=2) if row.s_m < 3.5]
    for row in rows:
        assert row.delta_s == pytest.approx(0.0, abs=1e-6)
        assert row.ghost_m == pytest.approx(row.track_m, abs=1e-6)
