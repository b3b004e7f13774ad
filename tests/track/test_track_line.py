"""Directed lines: which side, which way, where along the way."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_track_centreline import round_route, square

from dnb_edge.errors import InputError
from dnb_edge.track.line import DirectedLine, line_across
from dnb_edge.track.scale import TwinScale

UP = DirectedLine(name="start", start_m=(0.0, -1.0), end_m=(0.0, 1.0))
COORDINATE = st.floats(-5, 5)
POINT = st.tuples(COORDINATE, COORDINATE)


@pytest.mark.parametrize(
    ("a", "b", "fraction"),
    [
        ((1, 0), (-1, 0), 0.5),
        ((-1, 0), (1, 0), 0.5),
        ((3, 0.5), (-1, 0.5), 0.75),
        ((1, 0), (0, 0), 1.0),
        ((0, 0), (-1, 0), None),
        ((0, 0), (1, 0), 0.0),
        ((1, 0), (0.5, 0), None),
        ((1, 2), (-1, 2), None),
        ((1, 0), (-1, 4), None),
        ((1, 1), (-1, 1), 0.5),
        ((0, -0.5), (0, 0.5), None),
    ],
)
def test_crossings_of_an_upright_line(a, b, fraction):
    """Through, beside, up to, from, along and past the ends of a line from (0, -1) to (0, 1)."""
    assert UP.intersects_segment(a, b) == (None if fraction is None else pytest.approx(fraction))


def test_forward_is_to_the_left():
    """The paper's start line is crossed forward by cars that move to the left of the twin, as its truth file says."""
    scale = TwinScale(metres_per_px=0.002, height_px=2540)
    (x0, y0), (x1, y1) = scale.to_track_m(np.array([[1885.4, 263.7], [1832.6, -31.7]])).tolist()
    line = DirectedLine(name="start", start_m=(x0, y0), end_m=(x1, y1))
    before, after = scale.to_track_m(np.array([[1900.0, 110.0], [1820.0, 120.0]]))
    assert line.signed_distance(tuple(before)) < 0 < line.signed_distance(tuple(after))
    assert line.forward == pytest.approx((-0.984, -0.176), abs=1e-3)


@given(st.lists(POINT, min_size=2, max_size=12))
def test_a_path_crosses_the_endless_line_once_for_every_change_of_side(points):
    """However a path is cut into segments, points on the line included, forward and reverse crossings alternate."""
    line = DirectedLine(name="long", start_m=(0.0, -1e6), end_m=(0.0, 1e6))
    found = [
        line.signed_distance(b) >= 0 for a, b in itertools.pairwise(points) if line.intersects_segment(a, b) is not None
    ]
    assert all(x != y for x, y in itertools.pairwise(found))
    sides = [line.signed_distance(points[0]) >= 0, line.signed_distance(points[-1]) >= 0]
    assert len(found) % 2 == (sides[0] != sides[1])


@given(POINT, POINT)
def test_the_fraction_lies_on_the_line(a, b):
    """The point at the fraction is on the line, between its ends."""
    fraction = UP.intersects_segment(a, b)
    if fraction is not None:
        assert 0 <= fraction <= 1
        x, y = (p + fraction * (q - p) for p, q in zip(a, b, strict=True))
        assert x == pytest.approx(0, abs=1e-9)
        assert abs(y) <= 1 + 1e-9


@given(st.floats(0, 30))
def test_a_line_across_is_crossed_forward_along_the_route(s_m):
    """It stands square to the route, spans the lane and a margin, and the route crosses it forward, at s."""
    route = round_route()
    line = line_across(route, s_m, name="sector 1", margin_m=0.05)
    assert line.length_m == pytest.approx(0.5, abs=1e-3)
    x, y = route.direction_at(s_m)
    assert line.forward == pytest.approx((x, y))
    before, after = route.point_at(s_m - 0.05), route.point_at(s_m + 0.05)
    assert line.intersects_segment(before, after) == pytest.approx(0.5, abs=0.05)
    assert line.signed_distance(after) > 0


def test_a_line_across_takes_each_sides_own_width():
    """An off-centre lane gets an off-centre line."""
    line = line_across(square(left=0.3, right=0.2), 1.0, name="x")
    assert line.start_m == pytest.approx((1.0, 0.3))
    assert line.end_m == pytest.approx((1.0, -0.2))


@pytest.mark.parametrize("end", [(0.0, 0.0), (math.nan, 1.0), (math.inf, 0.0)])
def test_a_line_needs_two_ends(end):
    """A point, or no number, is no line; the error names the line."""
    with pytest.raises(InputError, match="line 'start'"):
        DirectedLine(name="start", start_m=(0.0, 0.0), end_m=end)
