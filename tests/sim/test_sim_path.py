"""The closed path and the circuit made of it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.sim.circuit import demo_circuit
from dnb_edge.sim.path import closed_path

CIRCUIT = demo_circuit()
LINE = CIRCUIT.centreline


def test_a_ring_of_knots_is_nearly_a_circle():
    """Length, curvature and normals of a spline through points on a circle are the circle's, driven counter-clockwise."""
    angles = np.arange(24) * 2.0 * math.pi / 24
    path = closed_path([(2.0 * math.cos(a), 2.0 * math.sin(a)) for a in angles])
    s = np.linspace(0.0, path.length_m, 50)
    assert path.length_m == pytest.approx(4.0 * math.pi, rel=1e-5)
    assert np.allclose(path.curvature(s), 0.5, rtol=0.02)
    assert np.allclose(path.normal(s), -path.at(s) / 2.0, atol=1e-3)


@given(st.floats(-50.0, 50.0))
def test_the_path_closes_and_runs_at_unit_speed(s_m):
    """A whole length further is the same point, and a millimetre of arc length is a millimetre of way."""
    here = np.array([s_m])
    assert np.allclose(LINE.at(here), LINE.at(here + LINE.length_m), atol=1e-7)
    moved = LINE.at(here + 0.001) - LINE.at(here)
    assert np.linalg.norm(moved) == pytest.approx(0.001, rel=2e-3)
    assert np.allclose(moved / 0.001, LINE.tangent(here), atol=0.01)


def test_the_lane_fits_the_track():
    """No bend is tighter than the lane's half width, and the lane with its tape stays inside the 3 m x 2 m of the twin."""
    s = np.linspace(0.0, LINE.length_m, 4000)
    assert 1.0 / np.abs(LINE.curvature(s)).max() > 0.5 * CIRCUIT.lane_width_m + 0.05
    margin = 0.5 * CIRCUIT.lane_width_m + 0.03
    points = LINE.at(s)
    assert points.min() > margin
    assert points[:, 0].max() < 3.0 - margin
    assert points[:, 1].max() < 2.0 - margin


def test_the_start_line_is_crossed_forward():
    """Driving goes to the left of the directed start line, and the line spans the whole lane."""
    start, end = np.asarray(CIRCUIT.start_line_m)
    ahead = LINE.tangent(np.array([CIRCUIT.start_s_m]))[0]
    along = end - start
    assert along[0] * ahead[1] - along[1] * ahead[0] > 0.0
    assert np.linalg.norm(along) > CIRCUIT.lane_width_m


@pytest.mark.parametrize("knots", [[(0.0, 0.0), (1.0, 0.0)], [(0.0, 0.0), (1.0, 0.0), (1.0, 0.0), (0.0, 1.0)]])
def test_paths_need_distinct_knots(knots):
    """Too few knots, or a knot twice, make no path."""
    with pytest.raises(ValueError, match="knots"):
        closed_path(knots)
