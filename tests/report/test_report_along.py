"""Laps along the route: which are drawn, where they were when, and what their pictures show."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.report.along import (
    best_laps,
    drawn_laps,
    lane_edges_m,
    lap_start_m,
    laps_along,
    path_trace,
    sector_ends_m,
)
from dnb_edge.report.along_plots import along_picture, lap_deltas
from dnb_edge.report.lap_style import LAP_COLOURS
from dnb_edge.report.plots import farthest_off, off_picture
from dnb_edge.report.run import RunResult
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.line import line_across
from dnb_edge.track.model import FINISH_LINE, START_LINE, Track
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import Lap


def lap(number: int, time_s: float, *, car: int = 1, valid: bool = True, penalty_s: float = 0.0) -> Lap:
    return Lap(
        number=number,
        start_t_ns=0,
        end_t_ns=round(time_s * 1e9),
        start_s=0.0,
        time_s=time_s,
        sigma_s=0.001,
        valid=valid,
        reasons=() if valid else ("why",),
        similarity_percent=None,
        observed_fraction=1.0,
        car=car,
        penalty_s=penalty_s,
        official_time_s=time_s + penalty_s,
    )


def straight(*, finish_m: float = 4.5) -> Track:
    """A straight open route of 5 m, 0.2 m to its left and 0.3 m to its right edge; a lap goes from 0.5 m to `finish_m`."""
    points = np.column_stack((np.linspace(0.0, 5.0, 51), np.ones(51)))
    route = Centreline(points_m=points, half_left_m=np.full(51, 0.2), half_right_m=np.full(51, 0.3), closed=False)
    return Track(
        name="straight",
        scale=TwinScale(metres_per_px=0.005, height_px=400),
        centreline=route,
        start_line=line_across(route, 0.5, name=START_LINE),
        finish_line=line_across(route, finish_m, name=FINISH_LINE),
        sector_lines=(line_across(route, 1.5, name="<a>"), line_across(route, 3.5, name="<b>")),
    )


def pixels(png: bytes) -> np.ndarray:
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    return image


DRAWN = [
    ("none", [], ()),
    ("all", [lap(1, 9.0), lap(2, 8.0)], (0, 1)),
    ("the best and the last", [lap(1, 9.0), lap(2, 7.0), *(lap(n, 8.0) for n in range(3, 9))], (1, 6, 7)),
    ("an invalid one is not the best", [lap(1, 1.0, valid=False), *(lap(n, 8.0) for n in range(2, 9))], (1, 6, 7)),
    ("nor one with a penalty", [lap(1, 7.0, penalty_s=3.0), *(lap(n, 8.0) for n in range(2, 9))], (1, 6, 7)),
    ("each car's best", [lap(1, 7.0), lap(1, 7.5, car=2), *(lap(n, 8.0) for n in range(2, 9))], (0, 1, 8)),
    ("no valid lap", [lap(n, 8.0, valid=False) for n in range(1, 9)], (5, 6, 7)),
]


@pytest.mark.parametrize(("laps", "drawn"), [case[1:] for case in DRAWN], ids=[case[0] for case in DRAWN])
def test_the_best_and_the_last_laps_are_drawn(laps: list[Lap], drawn: tuple[int, ...]) -> None:
    """Of more laps than can be told apart: the best valid one of each car, by official time, and the last ones."""
    assert drawn_laps(laps, 3) == drawn


@given(laps=st.lists(st.tuples(st.integers(1, 8), st.floats(1, 99), st.booleans())), most=st.integers(1, 20))
def test_no_more_laps_than_fit_and_none_twice(laps: list[tuple[int, float, bool]], most: int) -> None:
    """Always as many as fit, each once, in order, whatever the cars did."""
    every = [lap(i, time_s, car=car, valid=valid) for i, (car, time_s, valid) in enumerate(laps, start=1)]
    drawn = drawn_laps(every, most)
    assert len(drawn) == min(most, len(every))
    assert list(drawn) == sorted(set(drawn))
    assert len(best_laps(every)) > most or set(best_laps(every).values()) <= set(drawn)


def test_a_trace_of_an_open_route_by_hand() -> None:
    """From the start line at 0.5 m to the finish line at 4.5 m: the way counts from the start, d_m is to the left."""
    path = np.array([[0.5, 1.0], [1.5, 1.1], [2.5, 0.8], [4.5, 1.0]])
    t_ns = np.array([10, 11, 13, 16], dtype=np.int64) * 1_000_000_000
    run = replace(lap(1, 6.0), start_t_ns=int(t_ns[0]), end_t_ns=int(t_ns[-1]))
    trace = path_trace(path, t_ns, run, straight())
    assert trace is not None
    assert trace.length_m == pytest.approx(4.0)
    np.testing.assert_allclose(trace.way_m, [0, 1, 2, 4], atol=1e-12)
    np.testing.assert_allclose(trace.d_m, [0, 0.1, -0.2, 0], atol=1e-12)
    np.testing.assert_allclose(trace.t_s, [0, 1, 3, 6])


def test_nothing_before_the_end_lies_beyond_the_line() -> None:
    """A place that was seen a little beyond the finish line before the crossing's instant ends on it."""
    path = np.array([[0.5, 1.0], [4.51, 1.0], [4.5, 1.0]])
    t_ns = np.array([0, 5, 6], dtype=np.int64) * 1_000_000_000
    trace = path_trace(path, t_ns, lap(1, 6.0), straight())
    assert trace is not None
    assert (trace.way_m[1] < 4.0, trace.way_m[2]) == (True, 4.0)


@pytest.mark.parametrize("ends", [(0, 5), (1, 6), (2, 2)], ids=["ends early", "begins late", "one place"])
def test_a_path_that_is_no_whole_lap_has_no_trace(ends: tuple[int, int]) -> None:
    """A judge's lap between instants at which no line was crossed cannot be compared along the route."""
    t_ns = np.unique(np.array(ends, dtype=np.int64)) * 1_000_000_000
    path = np.array([[0.5, 1.0], [4.5, 1.0]])[: len(t_ns)]
    assert path_trace(path, t_ns, lap(1, 6.0), straight()) is None


def test_a_long_gap_does_not_turn_the_lap_round(result: Callable[..., RunResult]) -> None:
    """Unseen for three quarters of the lap, the car is where it was seen afterwards, not a round behind."""
    run = result(lap_times_s=(9.0,))
    (t_ns,), (path,) = run.stamps_ns, run.paths_m
    share = (t_ns - t_ns[0]) / (t_ns[-1] - t_ns[0])
    keep = (share < 0.1) | (share > 0.85)
    (one,) = laps_along(replace(run, stamps_ns=(t_ns[keep],), paths_m=(path[keep],)))
    assert one.trace is not None
    np.testing.assert_allclose(one.trace.way_m / run.track.centreline.length_m, share[keep], atol=0.02)


def test_a_closed_route_is_gone_round_once(result: Callable[..., RunResult]) -> None:
    """The way grows from 0 to the route's length though s_m begins anew at the start line."""
    run = result()
    for one in laps_along(run):
        assert one.trace is not None
        assert one.trace.way_m[-1] == pytest.approx(run.track.centreline.length_m)
        assert (np.diff(one.trace.way_m) > 0).all()
        assert np.abs(one.trace.d_m).max() == pytest.approx(0.03 * (one.index + 1), rel=0.02)


def test_a_lap_behind_the_best_one_by_hand(result: Callable[..., RunResult]) -> None:
    """Lap 2 is the best; each other lap's delta begins at 0 and ends with the difference of both times."""
    deltas = {one.along.lap.number: one.profile for one in lap_deltas(laps_along(result()))}
    assert [float(deltas[number].delta_s[0]) for number in (1, 2, 3)] == [0, 0, 0]
    last = [float(deltas[number].delta_s[-1]) for number in (1, 2, 3)]
    assert last == pytest.approx([12.4831 - 12.1022, 0, 13.0105 - 12.1022])


def test_each_car_is_compared_with_its_own_best(result: Callable[..., RunResult]) -> None:
    """The only lap of a car has nothing to be compared with but itself."""
    run = result()
    laps = (run.laps[0], run.laps[1], replace(run.laps[2], car=2))
    deltas = {one.along.lap.number: one.profile for one in lap_deltas(laps_along(replace(run, laps=laps)))}
    assert float(deltas[3].delta_s[-1]) == 0


def test_one_lap_has_nothing_to_be_behind(result: Callable[..., RunResult]) -> None:
    """No third panel for a single lap, nor where no lap is valid."""
    assert lap_deltas(laps_along(result(lap_times_s=(9.0,)))) == ()
    assert lap_deltas(laps_along(result(valid=(False, False, False)))) == ()


def test_where_the_lines_lie_along_a_lap() -> None:
    """Sectors end at their lines and at the lap's end; the lane's right edge is negative."""
    track = straight()
    assert lap_start_m(track) == pytest.approx(0.5)
    assert sector_ends_m(track) == pytest.approx((1.0, 3.0, 4.0))
    left_m, right_m = lane_edges_m(track, np.array([0.0, 4.0]))
    np.testing.assert_allclose(left_m, 0.2)
    np.testing.assert_allclose(right_m, -0.3)


def test_a_closed_routes_sectors(oval: Track) -> None:
    """Counted from the start line, though that may be found on either side of the route's seam."""
    length_m = oval.centreline.length_m
    lines = tuple(line_across(oval.centreline, at_m, name=f"s{at_m}") for at_m in (2.0, 5.0))
    assert sector_ends_m(replace(oval, sector_lines=lines)) == pytest.approx((2.0, 5.0, length_m))
    finish = line_across(oval.centreline, 6.0, name=FINISH_LINE)
    assert sector_ends_m(replace(oval, sector_lines=lines, finish_line=finish)) == pytest.approx((2.0, 5.0, 6.0))
    assert lap_start_m(replace(oval, finish_line=finish)) == pytest.approx(0.0, abs=1e-9)


def test_every_lap_is_in_the_panels(result: Callable[..., RunResult]) -> None:
    """Each lap's colour is in the picture; a picture of two panels is lower than one of three."""
    picture, single = along_picture(result()), along_picture(result(lap_times_s=(9.0,)))
    assert picture is not None
    assert single is not None
    image = pixels(picture)
    for code in LAP_COLOURS[:3]:
        rgb = [int(code[i : i + 2], 16) for i in (1, 3, 5)]
        assert (np.abs(image.astype(int) - rgb[::-1]) < 12).all(axis=2).sum() > 300
    assert pixels(single).shape[0] < image.shape[0]


def test_a_stretch_that_was_not_seen_is_a_gap(result: Callable[..., RunResult]) -> None:
    """Without the fixes of a quarter of the lap there is less of its line, and the pictures still stand."""
    run = result(lap_times_s=(9.0,))
    (t_ns,), (path,) = run.stamps_ns, run.paths_m
    keep = (np.arange(len(t_ns)) < 100) | (np.arange(len(t_ns)) > 170)
    gappy = replace(run, stamps_ns=(t_ns[keep],), paths_m=(path[keep],))
    blue = [int(LAP_COLOURS[0][i : i + 2], 16) for i in (5, 3, 1)]
    drawn = []
    for one in (run, gappy):
        picture = along_picture(one)
        assert picture is not None
        mask = (np.abs(pixels(picture).astype(int) - blue) < 12).all(axis=2)
        drawn.append([half.sum() for half in np.array_split(mask, 2)])
        assert off_picture(one) is not None
    assert drawn[1][0] < 0.9 * drawn[0][0], "speed"
    assert drawn[1][1] < 0.9 * drawn[0][1], "lateral error"


def test_a_lap_of_which_nothing_was_seen(result: Callable[..., RunResult]) -> None:
    """Two crossings and nothing between them make panels without a line, not an error."""
    run = result(lap_times_s=(9.0,))
    (t_ns,), (path,) = run.stamps_ns, run.paths_m
    blind = replace(run, stamps_ns=(t_ns[[0, -1]],), paths_m=(path[[0, -1]],))
    assert along_picture(blind) is not None
    assert off_picture(blind) is not None


def test_without_laps_or_stamps_there_is_nothing_to_draw(result: Callable[..., RunResult]) -> None:
    """No lap, or paths without stamps: no picture, instead of an empty one."""
    for run in (result(lap_times_s=()), replace(result(), stamps_ns=())):
        assert along_picture(run) is None
        assert off_picture(run) is None
        assert farthest_off(run) is None


def test_the_worst_lap_is_the_one_that_was_farthest_off(result: Callable[..., RunResult]) -> None:
    """Each lap of the made-up run drifts farther than the one before."""
    worst = farthest_off(result())
    assert worst is not None
    assert worst.lap.number == 3


def test_a_car_that_was_carried_away_leaves_the_others_readable(result: Callable[..., RunResult]) -> None:
    """A place far off the lane is clipped at the lateral panel's edge, and marked there."""
    run = result()
    path = run.paths_m[0].copy()
    path[120:124] += (0.0, 8.0)
    assert along_picture(replace(run, paths_m=(path, *run.paths_m[1:]))) is not None


def test_an_open_route_with_a_finish_line_and_sectors_is_drawn() -> None:
    """All of it: lines, sectors, panels; the same bytes for the same result."""
    track = straight()
    t_ns = np.arange(0, 6_000_000_001, 50_000_000, dtype=np.int64)
    path = np.column_stack((np.linspace(0.5, 4.5, len(t_ns)), 1.0 + 0.1 * np.sin(t_ns * 1e-9)))
    run = RunResult(entry="a", source_uri="sim:", track=track, laps=(lap(1, 6.0),), paths_m=(path,), stamps_ns=(t_ns,))
    for picture in (along_picture, off_picture):
        first = picture(run)
        assert first is not None
        assert first == picture(run)
