"""The simulated drive: continuous, lawful, and exact about when it crosses the line."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnb_edge.sim.circuit import demo_circuit
from dnb_edge.sim.driver import drive

CIRCUIT = demo_circuit()
DRIVE = drive(CIRCUIT, laps=3, seed=1)


def left_of_start(point) -> float:
    start, end = np.asarray(CIRCUIT.start_line_m)
    along, offset = end - start, np.asarray(point) - start
    return float(along[0] * offset[1] - along[1] * offset[0]) / float(np.linalg.norm(along))


@settings(deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 4))
def test_crossings_lie_on_the_line(seed, laps):
    """There is one crossing more than laps; at each the ground point is on the line to a nanometre, before it to its right
    and after it to its left."""
    driven = drive(CIRCUIT, laps=laps, seed=seed)
    assert len(driven.crossings_s) == laps + 1
    for t in driven.crossings_s:
        before, at, after = (left_of_start(driven.pose(t + dt).track_m) for dt in (-0.02, 0.0, 0.02))
        assert before < 0.0 < after
        assert abs(at) < 1e-9
    assert driven.crossings_s[0] > 0.3
    assert driven.duration_s > driven.crossings_s[-1] + 0.3


def test_no_crossing_is_missed():
    """Sampled densely, the drive changes sides of the line, inside the lane, exactly at the crossings."""
    t = np.arange(0.0, DRIVE.duration_s, 0.001)
    start, end = np.asarray(CIRCUIT.start_line_m)
    along = end - start
    offset = DRIVE.points(t) - start
    side = along[0] * offset[:, 1] - along[1] * offset[:, 0]
    fraction = offset @ along / (along @ along)
    changes = np.flatnonzero((side[:-1] < 0) != (side[1:] < 0))
    on_line = [i for i in changes if 0.0 <= fraction[i] <= 1.0]
    assert np.allclose(t[on_line], DRIVE.crossings_s, atol=0.001)


def test_the_car_moves_as_a_car():
    """It never jumps or stops, keeps well inside the lane, slows in bends, and heads where it moves."""
    t = np.arange(0.0, DRIVE.duration_s, 0.01)
    poses = [DRIVE.pose(float(x)) for x in t]
    speed = np.array([pose.speed_mps for pose in poses])
    points = np.array([pose.track_m for pose in poses])
    assert 0.4 < speed.min() < 0.9
    assert 1.1 < speed.max() < 1.7
    assert np.abs(np.diff(speed)).max() < 0.1
    line = CIRCUIT.centreline
    dense = line.at(np.arange(0.0, line.length_m, 0.005))
    off = np.array([np.linalg.norm(dense - p, axis=1).min() for p in points])
    assert 0.005 < off.max() < 0.04
    heading = np.unwrap([pose.heading_rad for pose in poses])
    moved = np.diff(points, axis=0)
    along = np.unwrap(np.arctan2(moved[:, 1], moved[:, 0]))
    turn = along - 0.5 * (heading[:-1] + heading[1:])
    assert np.abs(turn - 2 * np.pi * np.round(turn / (2 * np.pi))).max() < 0.02


def test_laps_differ_and_the_seed_decides():
    """Each lap has a pace of its own, the same seed gives the same drive, another seed another one."""
    laps = np.diff(DRIVE.crossings_s)
    assert np.ptp(laps) > 0.1
    assert drive(CIRCUIT, laps=3, seed=1).crossings_s == DRIVE.crossings_s
    assert drive(CIRCUIT, laps=3, seed=2).crossings_s != DRIVE.crossings_s


def test_a_drive_needs_a_lap():
    """No laps is no drive."""
    with pytest.raises(ValueError, match="laps"):
        drive(CIRCUIT, laps=0, seed=1)
