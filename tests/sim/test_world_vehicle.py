"""The vehicle's own physics: arcs, lags, grip, and the edge of its footprint."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.sim.control import VehicleState
from dnb_edge.sim.vehicle import VehicleSettings, halved, reach_m, stepped

CAR = VehicleSettings()
STEP_S = 0.005


def at_rest(**changes):
    """The vehicle in the origin, pointing along x."""
    state = {"track_m": (0.0, 0.0), "heading_rad": 0.0, "speed_mps": 0.0, "steering_rad": 0.0, **changes}
    return VehicleState(**state)


def driven(state, *, steering_rad, speed_mps, seconds, settings=CAR):
    """All states of `seconds` of driving."""
    states = [state]
    for _ in range(round(seconds / STEP_S)):
        arc = stepped(settings, states[-1], steering_rad=steering_rad, speed_mps=speed_mps, step_s=STEP_S)
        states.append(arc.state(STEP_S))
    return states


@given(
    heading=st.floats(-3.0, 3.0),
    speed=st.floats(-2.0, 2.0),
    steering=st.floats(-0.69, 0.69),
    wanted=st.floats(-0.69, 0.69),
    wanted_speed=st.floats(-2.0, 2.0),
    share=st.floats(0.05, 0.95),
)
def test_a_step_is_one_motion(heading, speed, steering, wanted, wanted_speed, share):
    """Wherever a step is looked into, the vehicle is where it would be had it driven the two parts one after the other."""
    start = at_rest(heading_rad=heading, speed_mps=speed, steering_rad=steering)
    arc = stepped(CAR, start, steering_rad=wanted, speed_mps=wanted_speed, step_s=STEP_S)
    assert arc.state(0.0).track_m == pytest.approx(start.track_m, abs=1e-15)
    middle, end = arc.state(share * STEP_S), arc.state(STEP_S)
    # The middle of the rear axle rolls along the heading: from one instant to the next it moves by the speed times the time.
    tiny = 1e-7
    after = arc.state(share * STEP_S + tiny)
    rear = [
        (
            s.track_m[0] - CAR.rear_to_centre_m * math.cos(s.heading_rad),
            s.track_m[1] - CAR.rear_to_centre_m * math.sin(s.heading_rad),
        )
        for s in (middle, after)
    ]
    ahead = (math.cos(middle.heading_rad), math.sin(middle.heading_rad))
    moved = (rear[1][0] - rear[0][0]) * ahead[0] + (rear[1][1] - rear[0][1]) * ahead[1]
    aside = (rear[1][1] - rear[0][1]) * ahead[0] - (rear[1][0] - rear[0][0]) * ahead[1]
    assert moved == pytest.approx(middle.speed_mps * tiny, abs=1e-13)
    assert aside == pytest.approx(0.0, abs=1e-13)
    assert end.speed_mps == pytest.approx(speed + arc.acceleration_mps2 * STEP_S)


def test_full_lock_is_a_circle_about_the_rear_axles_line():
    """Slow at full lock, the ground point runs round a circle whose radius the wheelbase and the lock give."""
    states = driven(at_rest(), steering_rad=CAR.steering_lock_rad, speed_mps=0.3, seconds=12.0)[-800:]
    radius = math.hypot(CAR.wheelbase_m / math.tan(CAR.steering_lock_rad), CAR.rear_to_centre_m)
    xs, ys = [s.track_m[0] for s in states], [s.track_m[1] for s in states]
    centre = (0.5 * (min(xs) + max(xs)), 0.5 * (min(ys) + max(ys)))
    assert all(math.dist(s.track_m, centre) == pytest.approx(radius, rel=2e-3) for s in states)


def test_the_motor_and_the_steering_lag():
    """After one time constant both have done 1 - 1/e of a small change; a large one is held back by the most they can do."""
    small = driven(at_rest(speed_mps=1.0), steering_rad=0.05, speed_mps=1.1, seconds=CAR.motor_lag_s)
    assert small[-1].speed_mps == pytest.approx(1.1 - 0.1 * math.exp(-1.0), abs=1e-6)
    assert small[round(CAR.steering_lag_s / STEP_S)].steering_rad == pytest.approx(
        0.05 * (1.0 - math.exp(-1.0)), abs=1e-6
    )
    large = driven(at_rest(), steering_rad=9.0, speed_mps=9.0, seconds=0.02)
    assert large[-1].speed_mps == pytest.approx(0.02 * CAR.acceleration_mps2)
    assert large[-1].steering_rad == pytest.approx(0.02 * CAR.steering_rate_rps)
    assert (
        max(s.steering_rad for s in driven(large[-1], steering_rad=9.0, speed_mps=0.0, seconds=1.0))
        <= CAR.steering_lock_rad
    )


@pytest.mark.parametrize("speed_mps", [0.5, 1.2, 2.0])
def test_the_tyres_hold_no_more_than_their_grip(speed_mps):
    """At any speed the acceleration to the side stays within the grip: beyond it the car turns less than its wheels ask for."""
    states = driven(at_rest(speed_mps=speed_mps), steering_rad=CAR.steering_lock_rad, speed_mps=speed_mps, seconds=2.0)
    turned = math.remainder(states[-1].heading_rad - states[-2].heading_rad, math.tau) / STEP_S
    asked = speed_mps**2 * math.tan(CAR.steering_lock_rad) / CAR.wheelbase_m
    assert turned * speed_mps == pytest.approx(min(asked, CAR.grip_mps2), rel=1e-6)


@pytest.mark.parametrize(
    ("point_m", "gap_m"),
    [
        ((0.2175, 0.0), 0.1),
        ((-0.1675, 0.05), 0.05),
        ((0.0, 0.1825), 0.1),
        ((0.1175 + 0.03, -0.0825 - 0.04), 0.05),
        ((0.0, 0.0), -0.0825),
    ],
)
@pytest.mark.parametrize("heading_rad", [0.0, 1.1, -2.6])
def test_how_far_a_point_is_from_the_footprint(point_m, gap_m, heading_rad):
    """Ahead, behind, aside, off a corner and inside, whichever way the car points."""
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    x, y = point_m
    turned = (1.0 + x * cos - y * sin, 2.0 + x * sin + y * cos)
    assert reach_m(CAR, at_rest(track_m=(1.0, 2.0), heading_rad=heading_rad), turned) == pytest.approx(gap_m)


def test_the_instant_is_halved_to_the_last_bits():
    """A change within a step is found to far below a microsecond."""
    assert halved(0.005, lambda t: t < 0.00123456789) == pytest.approx(0.00123456789, abs=1e-14)


@pytest.mark.parametrize(
    "wrong", [{"wheelbase_m": 0.0}, {"grip_mps2": math.nan}, {"rear_to_centre_m": 0.5}, {"steering_lock_rad": 1.5}]
)
def test_an_impossible_vehicle_is_refused(wrong):
    """Sizes and limits that no car has."""
    with pytest.raises(ValueError, match="vehicle"):
        VehicleSettings(**wrong)
