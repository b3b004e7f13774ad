"""Pure pursuit: its line, its tracking with delay, how it turns round and how it backs away."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
from driver_bicycle import PERIOD_S, at, briefing, ride, stepped
from hypothesis import given, settings
from hypothesis import strategies as st

from dnb_edge.nut.driving_line import STEP_M, Pace, driving_line
from dnb_edge.nut.foresight import foreseen
from dnb_edge.nut.pursuit import PurePursuit
from dnb_edge.nut.recovery import BackAway, TurnRound
from dnb_edge.sim.car import WIDTH_M
from dnb_edge.sim.circuit import Circuit, demo_circuit
from dnb_edge.sim.control import Control, DriverFailed, Obstacle, Sight
from dnb_edge.sim.places import figure_eight, hairpin, table_oval

PACE = Pace(top_mps=1.3, lowest_mps=0.45, lateral_mps2=1.8, change_mps2=1.4, least_radius_m=0.18, clearance_m=0.03)
DEMO = demo_circuit()


def obstacle(circuit: Circuit, s_m: float, offset_m: float, radius_m: float = 0.03) -> Obstacle:
    return Obstacle(track_m=at(circuit, s_m, offset_m=offset_m).track_m, radius_m=radius_m)


@settings(max_examples=15, deadline=None)
@given(
    places=st.lists(st.tuples(st.floats(0.0, 7.3), st.floats(-0.12, 0.12)), max_size=3, unique_by=lambda one: one[0]),
    radius_m=st.floats(0.01, 0.05),
)
def test_line_keeps_the_cars_width_from_obstacles(places, radius_m):
    """A line passes every obstacle that is alone on its stretch with room for the car, and is a closed, even one."""
    alone = [
        one for one in places
        if all(abs(math.remainder(one[0] - other[0], 7.4)) > 0.9 for other in places if other is not one)
    ]  # fmt: skip
    line = driving_line(DEMO, [obstacle(DEMO, s, d, radius_m) for s, d in alone], PACE)
    for s, d in alone:
        gaps = np.linalg.norm(line.points_m - np.asarray(at(DEMO, s, offset_m=d).track_m), axis=1) - radius_m
        assert gaps.min() > 0.5 * WIDTH_M + 0.015
    steps = np.linalg.norm(np.roll(line.points_m, -1, axis=0) - line.points_m, axis=1)
    assert steps.min() > 0.3 * STEP_M
    assert steps.max() < 2.0 * STEP_M


def test_line_without_obstacles_is_the_centreline_at_an_allowed_pace():
    """Nothing in the way: no offset; the speed keeps to the limits to the side and along the line, round the seam too."""
    line = driving_line(DEMO, [], PACE)
    assert not line.offset_m.any()
    speed = line.speed_mps
    change = np.abs(np.roll(speed, -1) ** 2 - speed**2) / (2.0 * STEP_M)
    assert change.max() <= PACE.change_mps2 * 1.05
    bend = np.abs(DEMO.centreline.curvature(np.arange(len(speed)) * DEMO.centreline.length_m / len(speed)))
    assert (speed**2 * bend)[speed > PACE.lowest_mps].max() < PACE.lateral_mps2 * 1.2
    assert speed.min() >= PACE.lowest_mps
    assert speed.max() == PACE.top_mps


def test_each_branch_of_a_crossing_passes_an_obstacle_for_itself():
    """Where a figure of eight crosses itself both branches get round the same obstacle."""
    circuit = figure_eight()
    one = Obstacle(track_m=(1.5, 1.03), radius_m=0.02)
    line = driving_line(circuit, [one], PACE)
    gaps = np.linalg.norm(line.points_m - np.asarray(one.track_m), axis=1)
    near = np.flatnonzero(gaps < 0.25)
    assert (np.diff(near) > 20).any()
    assert gaps.min() > 0.02 + 0.5 * WIDTH_M
    sides = [np.sign(line.offset_m[near[part]].sum()) for part in (near < near.mean(), near > near.mean())]
    assert sorted(sides) == [-1.0, 1.0]


def test_between_two_things_abreast_it_goes_through_the_middle():
    """Where both sides are limited more than the clearance allows, the line takes the middle between them."""
    line = driving_line(DEMO, [obstacle(DEMO, 1.0, 0.13), obstacle(DEMO, 1.0, -0.13)], PACE)
    index = line.nearest(at(DEMO, 1.0).track_m)
    assert abs(line.offset_m[index]) < 0.005


@pytest.mark.parametrize("circuit", [DEMO, table_oval(), hairpin()], ids=lambda one: one.name)
@pytest.mark.parametrize("delay_s", [0.0, 0.06, 0.2])
def test_stays_in_its_lane_with_any_delay(circuit, delay_s):
    """The car's ground point never leaves the lane and goes on, with 0 to 0.2 s between picture and control."""
    ridden = ride(PurePursuit(), circuit, briefing(circuit, delay_s=delay_s), at(circuit, 0.1), 18.0)
    assert ridden.worst_m < 0.5 * circuit.lane_width_m
    assert np.mean(np.abs(ridden.offsets_m)) < 0.02
    assert ridden.travelled_m > 11.0


@pytest.mark.parametrize("offset_m", [-0.09, -0.04, 0.0, 0.06, 0.10])
def test_passes_obstacles_without_touching(offset_m):
    """With obstacles on either side of the lane, straights and bends, no point of the car's middle line comes near them."""
    standing = [obstacle(DEMO, s, offset_m) for s in (1.0, 3.0, 5.2)]
    ridden = ride(PurePursuit(), DEMO, briefing(DEMO, obstacles=standing), at(DEMO, 0.1), 10.0)
    for state, one in itertools.product(ridden.states, standing):
        cos, sin = math.cos(state.heading_rad), math.sin(state.heading_rad)
        x, y = one.track_m[0] - state.track_m[0], one.track_m[1] - state.track_m[1]
        along, aside = cos * x + sin * y, -sin * x + cos * y
        beyond = max(abs(along) - 0.1175, 0.0)
        assert math.hypot(beyond, max(abs(aside) - 0.5 * WIDTH_M, 0.0)) > one.radius_m
    assert ridden.travelled_m > 7.5


@pytest.mark.parametrize("turned_rad", [math.pi, 2.2, -2.2, -3.0])
@pytest.mark.parametrize("s_m", [0.4, 2.5, 4.0])
def test_turns_round_near_its_lane(turned_rad, s_m):
    """Started the wrong way it turns without going far from the lane, and then laps."""
    ridden = ride(PurePursuit(), DEMO, briefing(DEMO), at(DEMO, s_m, turned_rad=turned_rad), 12.0)
    assert ridden.worst_m < 0.25
    assert ridden.travelled_m > 5.0


def test_backs_away_from_a_wall_and_tries_again():
    """A wall across the lane stops the car; it backs away from it and comes again."""
    brief = briefing(DEMO)
    x = at(DEMO, 1.0).track_m[0]
    ridden = ride(PurePursuit(), DEMO, brief, at(DEMO, 0.1), 8.0, wall=lambda state: state.track_m[0] > x)
    speeds = np.array([state.speed_mps for state in ridden.states])
    backwards = speeds < -0.05
    assert np.count_nonzero(np.diff(backwards.astype(int)) == 1) >= 2
    assert backwards.sum() * PERIOD_S < 4.0


def test_backs_out_the_way_it_came():
    """Backwards with the wheels as they were: with them turned the other way the car would swing against what it touches."""
    away, pushing = BackAway(), Control(steering=0.4, throttle=0.5)
    for i in range(8):
        assert away.control(i * 0.1, 0.0) is None
        away.remember(i * 0.1, pushing, 0.0)
    back = away.control(1.0, 0.0)
    assert back is not None
    assert (back.steering, math.copysign(1.0, back.throttle)) == (0.4, -1.0)


def test_backing_away_is_not_taken_for_being_blocked():
    """A car that needs its time to start moving back, or that stands because it wants to, is not blocked."""
    away = BackAway()
    for i in range(60):
        assert away.control(i * 0.1, 0.0) is None
        away.remember(i * 0.1, Control(steering=0.0, throttle=0.0), 0.0)


@pytest.mark.parametrize("error_rad", [-2.5, 2.5])
def test_turns_the_shorter_way(error_rad):
    """Where it must turn right it begins with its wheels to the right, and the other way."""
    wanted = TurnRound().control(0.0, error_rad, 0.0)
    assert wanted is not None
    assert wanted.steering == math.copysign(1.0, error_rad)


def test_turning_ends_and_keeps_its_side():
    """The side is chosen once, though the error goes over half a turn; it ends when the car points along its line."""
    turn = TurnRound()
    first = turn.control(0.0, 3.1, 0.0)
    second = turn.control(0.1, -3.1, 0.0)
    assert first == second
    assert first is not None
    assert first.steering == 1.0
    assert turn.control(0.2, 0.5, 0.0) is None
    assert turn.control(0.3, 1.0, 0.0) is None


@given(steering=st.floats(-1, 1), throttle=st.floats(-1, 1), speed_mps=st.floats(-1, 1.8))
def test_foresight_agrees_with_a_vehicle_of_its_lags(steering, throttle, speed_mps):
    """What it foresees over 0.1 s is a bicycle's way: within 2.5 cm of a vehicle with other lags."""
    brief, control = briefing(DEMO), Control(steering=steering, throttle=throttle)
    state = dataclasses.replace(at(DEMO, 1.0), speed_mps=speed_mps)
    thought = state
    for _ in range(20):
        state = stepped(state, control, brief)
        thought = foreseen(thought, control, brief, 0.005)
    assert math.dist(state.track_m, thought.track_m) < 0.025


@given(
    x=st.floats(-1, 4), y=st.floats(-1, 3), heading=st.floats(-7, 7), speed=st.floats(-2, 3), angle=st.floats(-0.5, 0.5)
)
@settings(max_examples=40, deadline=None)
def test_any_state_has_a_control(x, y, heading, speed, angle):
    """Wherever the car is, on or off the track, there is a control within its bounds (`Control` refuses others)."""
    driver = PurePursuit()
    driver.start(briefing(DEMO))
    state = dataclasses.replace(at(DEMO, 0.0), track_m=(x, y), heading_rad=heading, speed_mps=speed, steering_rad=angle)
    for i in range(3):
        driver.drive(Sight(t_ns=i * 33_000_000, bgr=np.zeros((1, 1, 3), np.uint8), speed_mps=speed, state=state))


def test_fails_in_one_line_without_the_truth():
    """Not started, not told the circuit, not told the state: each is `DriverFailed` that says so."""
    driver = PurePursuit()
    sight = Sight(t_ns=0, bgr=np.zeros((1, 1, 3), np.uint8), speed_mps=0.0)
    with pytest.raises(DriverFailed, match="not started"):
        driver.drive(sight)
    with pytest.raises(DriverFailed, match="circuit"):
        driver.start(briefing(None))
    driver.start(briefing(DEMO))
    with pytest.raises(DriverFailed, match="state"):
        driver.drive(sight)
    driver.close()
    driver.close()
    assert (driver.name, driver.knows_truth) == ("pure-pursuit", True)
