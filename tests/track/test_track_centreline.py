"""The (s, d) frame: where along the route and how far to its left."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.errors import InputError
from dnb_edge.track.centreline import Centreline

SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])


def square(left=0.3, right=0.2):
    """A 2 m square, driven anticlockwise from the origin."""
    return Centreline(points_m=SQUARE, half_left_m=np.full(4, left), half_right_m=np.full(4, right))


def round_route(n=400, radius=1.5):
    a = np.arange(n) * (2 * math.pi / n)
    points = np.column_stack((radius * np.cos(a), radius * np.sin(a)))
    return Centreline(points_m=points, half_left_m=np.full(n, 0.2), half_right_m=np.full(n, 0.2))


@pytest.mark.parametrize(
    ("point", "s_m", "d_m"),
    [
        ((1.0, 0.1), 1.0, 0.1),
        ((1.0, -0.1), 1.0, -0.1),
        ((1.9, 1.0), 3.0, 0.1),
        ((2.5, 1.0), 3.0, -0.5),
        ((0.1, 0.5), 7.5, 0.1),
        ((2.3, -0.4), 2.0, -0.5),
        ((-0.3, -0.4), 0.0, -0.5),
        ((1.0, 0.0), 1.0, 0.0),
    ],
)
def test_locate_on_a_square(point, s_m, d_m):
    """Points beside the sides, on them, and beyond the corners project where a ruler would put them."""
    s, d = square().locate(np.array([point]))
    assert s[0] == pytest.approx(s_m, abs=1e-12)
    assert d[0] == pytest.approx(d_m, abs=1e-12)


@given(s=st.floats(-20, 20), d=st.floats(-0.5, 0.5))
def test_point_at_and_locate_are_inverse(s, d):
    """A point laid out at (s, d) is found there again, round the route."""
    route = round_route()
    found_s, found_d = route.locate(np.array([route.point_at(s, d)]))
    apart = (found_s[0] - s + route.length_m / 2) % route.length_m - route.length_m / 2
    # Between two segments a point beside the line belongs to either: the polyline's own corner is the tolerance.
    assert abs(apart) < 0.5 * route.length_m / 400
    assert found_d[0] == pytest.approx(d, abs=1e-4)
    assert 0 <= found_s[0] < route.length_m


@given(st.integers(0, 2**32 - 1))
def test_many_points_locate_as_each_alone(seed):
    """However many points are asked for at once, the answers are those of one by one."""
    points = np.random.default_rng(seed).uniform(-2, 2, (5, 2))
    route = round_route(40)
    s, d = route.locate(points)
    for k in range(5):
        alone = route.locate(points[k : k + 1])
        assert (s[k], d[k]) == (alone[0][0], alone[1][0])


def test_more_points_than_a_block_and_none():
    """Blocks join without a seam, and no points give no answers."""
    route = round_route(40)
    points = np.tile([[1.0, 0.5], [0.2, -1.0]], (700, 1))
    s, d = route.locate(points)
    assert s.shape == d.shape == (1400,)
    assert np.unique(s).size == np.unique(d).size == 2
    assert [a.shape for a in route.locate(np.empty((0, 2)))] == [(0,), (0,)]


def hairpin():
    """Two straights 0.2 m apart, joined at both ends."""
    x = np.linspace(0, 4, 81)
    out = np.column_stack((x, np.zeros(81)))
    back = np.column_stack((x[::-1], np.full(81, 0.2)))
    n = 162
    return Centreline(points_m=np.vstack((out, back)), half_left_m=np.full(n, 0.08), half_right_m=np.full(n, 0.08))


def test_locate_near_stays_on_the_branch_that_the_hint_names():
    """Where two branches come near each other, the hint decides, and not the few millimetres between them."""
    route = hairpin()
    point = (2.0, 0.11)
    s, _d = route.locate(np.array([point]))
    assert s[0] > 4
    near_s, near_d = route.locate_near(point, s_hint_m=1.9, window_m=0.5)
    assert near_s == pytest.approx(2.0)
    assert near_d == pytest.approx(0.11)
    assert route.locate_near(point, s_hint_m=6.3, window_m=0.5)[0] == pytest.approx(s[0])


@pytest.mark.parametrize("hint", [0.1, 8.3, -0.1, 0.1 - 8.4 * 3])
def test_locate_near_looks_across_the_start(hint):
    """The window wraps round s = 0, whichever lap the hint is counted in."""
    route = hairpin()
    before, after = route.point_at(-0.1), route.point_at(0.1)
    assert route.locate_near(before, s_hint_m=hint, window_m=0.4)[0] == pytest.approx(route.length_m - 0.1)
    assert route.locate_near(after, s_hint_m=hint, window_m=0.4)[0] == pytest.approx(0.1)


@given(x=st.floats(-3, 3), y=st.floats(-3, 3), hint=st.floats(0, 10))
def test_a_window_as_long_as_the_route_is_the_whole_route(x, y, hint):
    """`locate_near` with an endless window is `locate`."""
    route = round_route(60)
    s, d = route.locate(np.array([[x, y]]))
    assert route.locate_near((x, y), s_hint_m=hint, window_m=1e9) == (s[0], d[0])


def test_directions_and_widths():
    """Tangents point along travel; widths go linearly from point to point and tell inside from outside."""
    route = square()
    assert route.direction_at(0.5) == (1.0, 0.0)
    assert route.direction_at(-0.5) == (0.0, -1.0)
    assert route.direction_at(8.5) == (1.0, 0.0)
    assert route.outside_by_m(1.0, 0.35) == pytest.approx(0.05)
    assert route.outside_by_m(1.0, -0.35) == pytest.approx(0.15)
    assert route.outside_by_m(1.0, -0.1) == pytest.approx(-0.1)
    widening = Centreline(points_m=SQUARE, half_left_m=np.array([0.1, 0.3, 0.1, 0.1]), half_right_m=np.full(4, 0.2))
    assert widening.half_widths_at(1.0) == pytest.approx((0.2, 0.2))
    assert np.allclose(route.points_at(np.array([0.0, 3.0, 9.0])), [[0, 0], [2, 1], [1, 0]])


def test_reversed_swaps_the_sides():
    """Driven the other way a point keeps its place and changes side."""
    route = square()
    s, d = route.reversed().locate(np.array([[1.0, 0.1]]))
    assert s[0] == pytest.approx(7.0)
    assert d[0] == pytest.approx(-0.1)
    assert route.reversed().half_widths_at(1.0) == (0.2, 0.3)
    assert route.reversed().reversed() == route


@given(st.lists(st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6)), min_size=3, max_size=8, unique=True))
def test_the_stored_form_is_exact(points):
    """Through JSON text and back not one bit changes."""
    n = len(points)
    try:
        route = Centreline(points_m=np.array(points), half_left_m=np.full(n, 0.1), half_right_m=np.full(n, 1 / 3))
    except InputError:
        return  # neighbours so near that their distance is nothing
    again = Centreline.from_dict(json.loads(json.dumps(route.to_dict())))
    assert again == route
    assert hash(again) == hash(route)
    assert again.s_m.tobytes() == route.s_m.tobytes()


@pytest.mark.parametrize(
    ("points", "left", "pattern"),
    [
        (SQUARE[:2], np.full(2, 0.1), "at least three"),
        (np.full((4, 2), np.nan), np.full(4, 0.1), "finite"),
        (SQUARE[[0, 1, 1, 2]], np.full(4, 0.1), "point 1 is repeated"),
        (SQUARE, np.full(3, 0.1), "half_left_m must hold one positive number"),
        (SQUARE, np.zeros(4), "half_left_m must hold one positive number"),
    ],
)
def test_what_makes_no_centreline_is_refused(points, left, pattern):
    """Numbers that make no closed line are an error at construction."""
    with pytest.raises(InputError, match=pattern):
        Centreline(points_m=points, half_left_m=left, half_right_m=np.full(len(points), 0.1))


def test_nobody_can_change_it():
    """The arrays are read-only and are the centreline's own."""
    points = SQUARE.copy()
    route = Centreline(points_m=points, half_left_m=np.ones(4), half_right_m=np.ones(4))
    points[0] = 9
    assert route.points_m[0, 0] == 0
    with pytest.raises(ValueError, match="read-only"):
        route.points_m[0] = 1


def wavy_route(seed, closed):
    """A route that comes near itself, with segments of quite different lengths."""
    random = np.random.default_rng(seed)
    n = int(random.integers(3, 200))
    a = np.sort(random.uniform(0, 2 * math.pi, n))
    points = np.column_stack((np.cos(a), np.sin(2 * a))) * random.uniform(0.01, 100) + random.normal(0, 1e-3, (n, 2))
    return Centreline(points_m=points, half_left_m=np.full(n, 0.2), half_right_m=np.full(n, 0.2), closed=closed)


@given(seed=st.integers(0, 2**32 - 1), closed=st.booleans())
def test_one_point_is_located_as_by_the_whole_search(seed, closed):
    """Among few segments the very same nearest is found, to the last bit: beside the route, on it, on its points, far off."""
    route = wavy_route(seed, closed)
    random = np.random.default_rng(seed)
    extent_m = float(np.ptp(route.points_m, axis=0).max())
    anywhere = random.uniform(-1.5, 1.5, (30, 2)) * extent_m
    laid_out = [route.point_at(s, d) for s, d in random.uniform(0, 1, (40, 2)) * (route.length_m, extent_m / 50)]
    points = np.vstack((anywhere, laid_out, route.points_m, route.points_m.mean(axis=0)))
    s_m, d_m = route.locate(points)
    found = [route.locate_point((x, y)) for x, y in points.tolist()]
    assert found == list(zip(s_m.tolist(), d_m.tolist(), strict=True))
    # Again, now that its cells are known.
    assert [route.locate_point((x, y)) for x, y in points.tolist()] == found


def test_places_equally_far_are_told_apart_as_by_the_whole_search():
    """In the middle of the square all sides are equally near: the first is taken, as always."""
    assert square().locate_point((1.0, 1.0)) == (1.0, 1.0)
    assert [values.tolist() for values in square().locate(np.array([[1.0, 1.0]]))] == [[1.0], [1.0]]


@given(seed=st.integers(0, 2**32 - 1), closed=st.booleans(), stray_m=st.sampled_from([0.01, 0.1, 0.5]))
def test_a_path_is_located_as_point_after_point(seed, closed, stray_m):
    """All at once where that is sure, and else one by one: every place is what `follow` says from the one before."""
    route = wavy_route(seed, closed)
    random = np.random.default_rng(seed)
    along = np.cumsum(random.uniform(0, route.length_m / 30, 40)) + random.uniform(0, route.length_m)
    path = np.array([route.point_at(s, d) for s, d in zip(along, random.normal(0, stray_m, 40), strict=True)])
    s_m, d_m = route.locate_path(path)
    s_before, points = None, [(x, y) for x, y in path.tolist()]
    for i, point in enumerate(points):
        if s_before is None:
            wanted = route.locate_point(point)
        else:
            reach_m = 2 * math.dist(points[i - 1], point) + sum(route.half_widths_at(s_before))
            wanted = route.follow(point, s_hint_m=s_before, reach_m=reach_m)
        assert (s_m[i], d_m[i]) == wanted
        s_before = wanted[0]


def test_a_path_without_points_is_nowhere():
    """No points, no places."""
    s_m, d_m = square().locate_path(np.empty((0, 2)))
    assert s_m.shape == d_m.shape == (0,)


@given(seed=st.integers(0, 2**32 - 1), closed=st.booleans(), margin_m=st.sampled_from([0.0, 0.1, 2.0]))
def test_what_is_within_the_lane_is_what_the_distance_says(seed, closed, margin_m):
    """Bounds decide what is plain, the distance the rest: the answer is always the distance's."""
    route = wavy_route(seed, closed)
    random = np.random.default_rng(seed)
    extent_m = float(np.ptp(route.points_m, axis=0).max())
    spread = random.normal(0, 0.3, 60)
    points = [route.point_at(s, d) for s, d in zip(random.uniform(0, route.length_m, 60), spread, strict=True)]
    points += [(x, y) for x, y in (random.uniform(-2, 2, (20, 2)) * extent_m).tolist()]
    for point in points:
        assert route.is_within(point, margin_m) == (route.outside_by_m(*route.locate_point(point)) <= margin_m)
