"""The route that laps were driven on."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnb_edge.errors import InputError
from dnb_edge.track.driven import DrivenPath, driven_route, gate_of, laps_between, thinned
from dnb_edge.track.line import DirectedLine

START = DirectedLine(name="start", start_m=(0.6, 0.0), end_m=(1.4, 0.0))


def bean(turns):
    """Places (n, 2) on a bean-shaped circuit about 6.7 m long, at `turns` (n,) of a round, from (1, 0) anticlockwise."""
    angle = 2 * np.pi * np.asarray(turns)
    radius = 1.0 + 0.15 * np.sin(2 * angle) + 0.06 * np.sin(3 * angle)
    return np.column_stack((radius * np.cos(angle), radius * np.sin(angle)))


def eight(turns):
    """Places on a figure eight, which crosses itself at (0, 0)."""
    angle = 2 * np.pi * np.asarray(turns)
    return np.column_stack((np.cos(angle), np.sin(2 * angle) / 1.5))


def drive(shape, rounds, *, offsets=(0.0,), noise_m=0.0, seed=1, first=-0.1, per_round=400):
    """A drive of so many rounds and a bit before and after, each round further out by its offset."""
    turns = np.arange(first, rounds - first, 1 / per_round)
    points = shape(turns)
    ahead = np.gradient(points, axis=0)
    left = np.column_stack((-ahead[:, 1], ahead[:, 0])) / np.hypot(*ahead.T)[:, None]
    which = np.clip(np.floor(turns), 0, rounds - 1)
    at = np.interp(turns, np.arange(rounds) + 0.5, np.resize(offsets, rounds)) if rounds > 1 else offsets[0] + 0 * which
    random = np.random.default_rng(seed)
    return points + at[:, None] * left + random.normal(0, noise_m, points.shape)


def named(laps):
    return [DrivenPath(name=f"lap {k}", points_m=lap) for k, lap in enumerate(laps, start=1)]


def apart_m(points, shape):
    """How far each point (n, 2) lies from the shape."""
    line = shape(np.linspace(0, 1, 6000))
    return np.array([np.hypot(*(line - point).T).min() for point in points])


def whole(points):
    return float(np.hypot(*(np.roll(points, -1, axis=0) - points).T).sum())


@pytest.mark.parametrize("rounds", [1, 2, 3, 7])
def test_laps_are_cut_at_the_start_line(rounds):
    """A lap goes from a forward crossing to the next; what lies before the first and after the last is none."""
    laps = laps_between(drive(bean, rounds), START)
    assert len(laps) == rounds
    for lap in laps:
        assert lap[0][1] == pytest.approx(0.0, abs=1e-9)
        assert lap[-1][1] == pytest.approx(0.0, abs=1e-9)
        assert whole(lap) == pytest.approx(whole(bean(np.arange(0, 1, 1e-4))), rel=1e-3)


def test_a_car_that_trembles_on_the_line_makes_no_laps():
    """To and fro over the line, without a way between, is one crossing."""
    path = drive(bean, 2)
    at = int(np.argmin(np.hypot(*(path[30:200] - (1.0, 0.0)).T))) + 30
    trembling = np.vstack(
        (path[:at], np.repeat(path[at : at + 1], 40, axis=0) + [[0, 0.01], [0, -0.01]] * 20, path[at:])
    )
    assert len(laps_between(trembling, START)) == 2


@pytest.mark.parametrize("shape", [bean, eight])
def test_rounds_are_told_apart_without_a_start_line(shape):
    """The gate is where the path comes by most often in one direction, though it crosses itself elsewhere."""
    path = drive(shape, 3, noise_m=0.004)
    gate = gate_of(path)
    laps = laps_between(path, gate, straight=True)
    assert len(laps) == 3
    for lap in laps:
        assert whole(thinned(lap, 0.02)) == pytest.approx(whole(shape(np.arange(0, 1, 1e-4))), rel=0.03)


def test_a_path_that_never_comes_back_has_no_gate():
    """Half a round, a straight line, a car that stands and no path at all."""
    assert gate_of(bean(np.arange(0, 0.5, 0.002))) is None
    assert gate_of(np.column_stack((np.linspace(0, 3, 200), np.zeros(200)))) is None
    assert gate_of(np.random.default_rng(1).normal(0, 0.004, (500, 2))) is None
    assert gate_of(np.empty((0, 2))) is None


@pytest.mark.parametrize("shape", [bean, eight])
@pytest.mark.parametrize("rounds", [1, 2, 3, 6])
def test_the_median_path_is_the_shape(shape, rounds):
    """From noisy laps the route comes out within 4 mm on average, of the right length, evenly spaced and in their direction."""
    path = drive(shape, rounds, noise_m=0.008)
    start = START if shape is bean else gate_of(path) or START
    laps = laps_between(path, start, straight=True)
    if not laps:  # one round and a bit of an eight, whose best gate is near its ends
        laps = [path[40:440]]
    found = driven_route(named(laps), lane_width_m=0.3, source="x")
    assert apart_m(found.points_m, shape).mean() < 0.004
    assert whole(found.points_m) == pytest.approx(whole(shape(np.arange(0, 1, 1e-4))), rel=0.01)
    steps = np.hypot(*(np.roll(found.points_m, -1, axis=0) - found.points_m).T)
    assert steps.max() < 1.02 * steps.min()
    assert np.hypot(*(found.points_m[0] - laps[0][0])) < 0.03
    ahead = laps[0][20] - laps[0][0]
    assert (found.points_m[10] - found.points_m[0]) @ ahead > 0
    assert (found.half_left_m == 0.15).all()
    assert len(found.kept) == len(laps)
    assert found.left_out == ()


def test_it_is_the_median_and_not_the_mean():
    """One lap of five that runs 12 cm wide all round moves the route by next to nothing."""
    laps = [laps_between(drive(bean, 1, offsets=(offset,), seed=k), START)[0]
            for k, offset in enumerate((0.0, 0.004, -0.004, 0.002, 0.12))]  # fmt: skip
    found = driven_route(named(laps), lane_width_m=None, source="x")
    assert apart_m(found.points_m, bean).mean() < 0.004
    assert found.spread_m == pytest.approx(0.026, abs=0.006)
    assert (found.half_left_m > 0.2).all()


def test_a_lap_that_went_elsewhere_is_left_out_by_name():
    """A short cut and a lap beside the others are named with what is wrong with them."""
    laps = [laps_between(drive(bean, 1, seed=k, noise_m=0.004), START)[0] for k in range(5)]
    laps[1] = np.vstack((laps[1][:100], laps[1][300:]))
    laps[3] = laps_between(drive(bean, 1, offsets=(0.4,)), DirectedLine(name="s", start_m=(0.2, 0), end_m=(1.4, 0)))[0]
    found = driven_route(named(laps), lane_width_m=None, source="x")
    assert found.kept == ("lap 1", "lap 3", "lap 5")
    assert [text[:5] for text in found.left_out] == ["lap 2", "lap 4"]
    assert "m long, the usual lap" in found.left_out[0]
    assert apart_m(found.points_m, bean).mean() < 0.004


def test_a_lap_of_the_right_length_in_the_wrong_place_is_left_out():
    """A lap as long as the others and beside them all the way is told by its distance."""
    laps = [laps_between(drive(bean, 1, seed=k, noise_m=0.004), START)[0] for k in range(4)]
    laps[2] = laps[2] + (0.4, 0.0)
    found = driven_route(named(laps), lane_width_m=None, source="x")
    assert found.kept == ("lap 1", "lap 2", "lap 4")
    assert "lap 3 lies 0.2" in found.left_out[0]
    assert "from the others on average" in found.left_out[0]


def test_another_branch_through_the_line_counts_only_if_it_goes_straight_over_it():
    """At the crossing of an eight a line across one branch is crossed by the other, too, at a slant."""
    path = drive(eight, 3)
    ahead = path[541] - path[539]
    at = path[540] + 0.0
    left = np.array([-ahead[1], ahead[0]]) / np.hypot(*ahead)
    line = DirectedLine(name="s", start_m=tuple(at + 0.25 * left), end_m=tuple(at - 0.25 * left))
    assert np.hypot(*at) < 0.05
    assert len(laps_between(path, line)) > len(laps_between(path, line, straight=True)) >= 2


def test_laps_that_do_not_agree_are_refused_by_name():
    """Two laps on different ways do not say which is the track."""
    laps = [laps_between(drive(bean, 1), START)[0], laps_between(drive(bean, 1), START)[0] * 0.7]
    with pytest.raises(InputError, match=r"run\.mcap: the laps do not agree \(lap 1 .* m off, lap 2 .* m off\)"):
        driven_route(named(laps), lane_width_m=None, source="run.mcap")
    with pytest.raises(InputError, match="no complete lap"):
        driven_route([], lane_width_m=None, source="run.mcap")


@settings(max_examples=15, deadline=None)
@given(turn=st.floats(-3.1, 3.1), dx=st.floats(-5, 5), dy=st.floats(-5, 5))
def test_a_moved_drive_has_the_moved_route(turn, dx, dy):
    """Nothing depends on where the track lies or how it is turned."""
    laps = laps_between(drive(bean, 3, noise_m=0.003), START)
    rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    found = driven_route(named(laps), lane_width_m=None, source="x")
    moved = driven_route(named([lap @ rotation + (dx, dy) for lap in laps]), lane_width_m=None, source="x")
    assert np.abs(moved.points_m - (found.points_m @ rotation + (dx, dy))).max() < 1e-3


def test_standing_still_adds_no_way():
    """A car that is left standing while it is pushed round by hand makes the same route."""
    path = drive(bean, 3, noise_m=0.003)
    random = np.random.default_rng(2)
    rest = path[700] + random.normal(0, 0.004, (900, 2))
    paused = np.vstack((path[:700], rest, path[700:]))
    laps = named([thinned(lap, 0.01) for lap in laps_between(paused, START)])
    found = driven_route(laps, lane_width_m=None, source="x")
    assert len(found.kept) == 3
    assert apart_m(found.points_m, bean).mean() < 0.004
