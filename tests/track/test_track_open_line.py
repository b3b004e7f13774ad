"""Open centrelines, routes that cross themselves, and curvature."""

import json
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.errors import InputError
from dnb_edge.track.centreline import Centreline


def line_of(points, *, closed=False, half=0.15):
    n = len(points)
    return Centreline(
        points_m=np.asarray(points, float), half_left_m=np.full(n, half), half_right_m=np.full(n, half), closed=closed
    )


CORNER = line_of([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]])
"""Two metres east, one north."""


def bow(n=300):
    """A gentle S, open."""
    x = np.linspace(0.0, 4.0, n)
    return line_of(np.column_stack((x, 0.4 * np.sin(x * 1.2))))


def eight(n=600, size=2.0):
    """A figure eight about the origin, whose branches cross there."""
    t = np.arange(n) * (2 * math.pi / n)
    return line_of(np.column_stack((size * np.sin(t), 0.6 * size * np.sin(2 * t))), closed=True)


@pytest.mark.parametrize(
    ("point", "s_m", "d_m"),
    [
        ((1.0, 0.1), 1.0, 0.1),
        ((1.9, 0.5), 2.5, 0.1),
        ((-0.3, 0.4), 0.0, 0.5),
        ((-0.3, -0.4), 0.0, -0.5),
        ((2.0, 1.5), 3.0, 0.5),
        ((2.3, 1.4), 3.0, -0.5),
        ((0.0, 0.0), 0.0, 0.0),
        ((2.0, 1.0), 3.0, 0.0),
    ],
)
def test_beyond_an_end_the_end_is_nearest(point, s_m, d_m):
    """An open route has no way from its last point to its first: there, the nearest place is an end."""
    (s,), (d,) = CORNER.locate(np.array([point]))
    assert (s, abs(d)) == pytest.approx((s_m, abs(d_m)))
    assert d_m == 0 or math.copysign(1, d) == math.copysign(1, d_m) or point == (2.0, 1.5)
    assert CORNER.length_m == 3.0


@pytest.mark.parametrize(
    ("s_m", "d_m", "point"),
    [(-0.5, 0.0, (-0.5, 0.0)), (-0.5, 0.2, (-0.5, 0.2)), (3.5, 0.0, (2.0, 1.5)), (3.5, 0.2, (1.8, 1.5))],
)
def test_an_open_route_goes_straight_on_beyond_its_ends(s_m, d_m, point):
    """Points are laid out along the ends' directions; widths, direction and curvature are the ends' own."""
    assert CORNER.point_at(s_m, d_m) == pytest.approx(point)
    assert CORNER.points_at(np.array([s_m]))[0] == pytest.approx(CORNER.point_at(s_m))
    assert CORNER.direction_at(s_m) == pytest.approx((1.0, 0.0) if s_m < 0 else (0.0, 1.0))
    wedge = Centreline(
        points_m=CORNER.points_m, half_left_m=np.array([0.1, 0.2, 0.3]), half_right_m=np.full(3, 0.4), closed=False
    )
    assert wedge.half_widths_at(s_m) == pytest.approx((0.1 if s_m < 0 else 0.3, 0.4))
    assert wedge.curvature_at(s_m) == pytest.approx(wedge.curvature_at(1.0))


@given(share=st.floats(0, 1), d=st.floats(-0.3, 0.3), closed=st.booleans())
def test_point_at_and_locate_are_inverse(share, d, closed):
    """A point laid out at (s, d) is found there again, on open routes and on closed ones that do not cross themselves."""
    ring = np.column_stack([f(np.arange(400) * 2 * math.pi / 400) for f in (np.cos, np.sin)])
    route = line_of(ring, closed=True) if closed else bow()
    s = share * route.length_m
    (found_s,), (found_d,) = route.locate(np.array([route.point_at(s, d)]))
    assert abs(route.step_m(s, found_s)) < 0.01
    assert found_d == pytest.approx(d, abs=2e-3)
    near_s, near_d = route.locate_near(route.point_at(s, d), s_hint_m=s, window_m=0.2)
    assert (near_s, near_d) == pytest.approx((found_s, found_d))


def test_steps_are_plain_on_an_open_route_and_the_shorter_way_round_on_a_closed_one():
    """From the last tenth to the first is nearly the whole length back, or a little on."""
    assert bow().step_m(3.9, 0.1) == pytest.approx(-3.8)
    ring = eight()
    assert ring.step_m(ring.length_m - 0.1, 0.1) == pytest.approx(0.2)


@pytest.mark.parametrize("closed", [False, True])
def test_the_other_way_round_is_the_same_route(closed):
    """Reversed twice it is itself; reversed once, left is right and an open route's ends change places."""
    route = eight() if closed else bow()
    assert route.reversed().reversed() == route
    mirrored = route.reversed()
    assert mirrored.closed is closed
    assert mirrored.length_m == pytest.approx(route.length_m)
    assert mirrored.points_m[0] == pytest.approx(route.points_m[0 if closed else -1])
    order = -np.arange(len(route.points_m)) - (0 if closed else 1)
    assert mirrored.curvature_1pm == pytest.approx(-route.curvature_1pm[order], abs=1e-9)


def test_storage_keeps_whether_it_is_closed_and_old_storage_was():
    """The stored form is exact; one from before there were open routes is a closed one."""
    for route in (bow(), eight()):
        data = json.loads(json.dumps(route.to_dict()))
        assert Centreline.from_dict(data) == route
        del data["closed"]
        assert Centreline.from_dict(data).closed
    assert bow() != line_of(bow().points_m, closed=True)


@pytest.mark.parametrize("shift", [0.0, 0.02, -0.1])
def test_following_over_a_crossing_stays_on_the_branch(shift):
    """Along the eight at a constant distance from its middle, s grows evenly and d stays, over the crossing too."""
    route = eight()
    at = np.arange(0.5, route.length_m + 0.5, 0.02)  # from a place where there is one branch only
    path = np.array([route.point_at(s, shift) for s in at])
    s_m, d_m = route.locate_path(path)
    steps = [route.step_m(a, b) for a, b in pairwise(s_m)]
    assert min(steps) > 0
    assert max(steps) < 0.04
    assert abs(d_m - shift).max() < 5e-3
    # Without the memory of where it was, the nearest branch would do.
    if shift:
        assert abs(route.locate(path)[1] - shift).max() > 0.05 * abs(shift)


def test_a_direction_tells_the_branches_of_a_crossing_apart():
    """At the crossing itself the place is that of the branch that runs along the direction, either way."""
    route = eight()
    half_m = route.length_m / 2
    for s_m in (0.0, half_m):
        x, y = route.direction_at(s_m)
        for sign in (1, -1):
            found = route.locate_along((0.003, 0.001), (sign * x, sign * y))
            assert found is not None
            assert abs(route.step_m(s_m, found[0])) < 0.02
    assert line_of([[0, 0], [1, 0], [2, 0]]).locate_along((1.0, 0.1), (0.0, 1.0)) is None


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("radius", [0.3, 1.0, -2.0])
def test_a_circles_curvature_is_one_over_its_radius(radius, closed):
    """Everywhere, positive where it bends to the left."""
    angles = np.linspace(0, 2 * math.pi, 200, endpoint=False) * (1 if closed else 0.5)
    route = line_of(np.column_stack((abs(radius) * np.cos(angles), radius * np.sin(angles))), closed=closed, half=0.1)
    assert route.curvature_1pm == pytest.approx(1 / radius, rel=1e-3)
    assert route.curvature_at(0.4) == pytest.approx(1 / radius, rel=1e-3)
    assert route.min_radius_m == pytest.approx(abs(radius), rel=1e-3)


def test_a_straight_has_no_curvature():
    """Zero all along, and no radius."""
    route = line_of(np.column_stack((np.linspace(0, 3, 50), np.linspace(1, 2, 50))))
    assert route.curvature_1pm == pytest.approx(0.0, abs=1e-9)
    assert route.min_radius_m is None


def test_a_clothoids_curvature_grows_evenly_with_its_length():
    """Of a line whose heading is s^2 / 2 the curvature at s is s."""
    s = np.linspace(0.0, 2.0, 2001)
    heading = s**2 / 2
    points = np.cumsum(np.column_stack((np.cos(heading), np.sin(heading))) * (s[1] - s[0]), axis=0)
    route = line_of(points[::10], half=0.1)
    for at in np.linspace(0.2, 1.8, 17):
        assert route.curvature_at(at) == pytest.approx(at, abs=0.02)
    jumps = np.diff(route.curvature_1pm)
    assert abs(jumps).max() < 0.02


def test_three_points_are_enough_and_two_are_not():
    """The least that makes a line of either kind, and one line of error for less."""
    for closed in (True, False):
        assert line_of([[0, 0], [1, 0], [1, 1]], closed=closed).min_radius_m == pytest.approx(math.sqrt(0.5))
        with pytest.raises(InputError, match="at least three"):
            line_of([[0, 0], [1, 0]], closed=closed)
