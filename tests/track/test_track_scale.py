"""Twin pixels and metres."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.errors import InputError
from dnb_edge.track.scale import TwinScale


def test_up_on_the_twin_is_up_in_metres():
    """x grows to the right and y to the top; the twin's bottom edge is y = 0."""
    scale = TwinScale(metres_per_px=0.5, height_px=100)
    assert scale.to_track_m(np.array([[0, 100], [10, 100], [0, 0]])).tolist() == [[0, 0], [5, 0], [0, 50]]


@given(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4), st.floats(1e-4, 10))
def test_there_and_back(u, v, metres_per_px):
    """Both directions undo each other."""
    scale = TwinScale(metres_per_px=metres_per_px, height_px=2540)
    assert scale.to_twin_px(scale.to_track_m(np.array([[u, v]])))[0] == pytest.approx((u, v), abs=1e-8)


@given(angle=st.floats(0, 7), length_px=st.floats(1.1, 3000), length_m=st.floats(0.01, 100))
def test_one_measured_length_sets_the_scale(angle, length_px, length_m):
    """Whatever the line's direction, its two ends come out at the measured distance."""
    ends = ((50.0, 60.0), (50 + length_px * math.cos(angle), 60 + length_px * math.sin(angle)))
    scale = TwinScale.from_measured_length(from_px=ends[0], to_px=ends[1], length_m=length_m, height_px=400)
    a, b = scale.to_track_m(np.array(ends))
    assert math.dist(a, b) == pytest.approx(length_m)


@pytest.mark.parametrize(
    ("to_px", "length_m", "pattern"),
    [
        ((50.0, 60.0), 1.0, "same twin pixel"),
        ((math.nan, 60.0), 1.0, "same twin pixel"),
        ((90.0, 60.0), 0.0, "positive number of metres"),
        ((90.0, 60.0), math.inf, "positive number of metres"),
    ],
)
def test_no_length_gives_no_scale(to_px, length_m, pattern):
    """Two ends that are one, or a length that is none, is an error."""
    with pytest.raises(InputError, match=pattern):
        TwinScale.from_measured_length(from_px=(50.0, 60.0), to_px=to_px, length_m=length_m, height_px=400)


@pytest.mark.parametrize("changes", [{"metres_per_px": 0.0}, {"metres_per_px": -1.0}, {"height_px": math.nan}])
def test_a_scale_is_positive(changes):
    """Zero, negative and missing numbers are refused by name."""
    with pytest.raises(InputError, match=next(iter(changes))):
        TwinScale(**{"metres_per_px": 0.01, "height_px": 10.0, **changes})
