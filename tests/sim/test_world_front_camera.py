"""The vehicle's own camera: things lie in its pictures where a pinhole at that place would see them."""

import math

import cv2
import numpy as np
import pytest

from dnb_edge.sim.circuit import demo_circuit
from dnb_edge.sim.control import Obstacle, VehicleState
from dnb_edge.sim.front_camera import FrontCamera, FrontMount, front_floor
from dnb_edge.sim.light import LightChange, light_of

CIRCUIT = demo_circuit()
MOUNT = FrontMount()
WIDTH_PX, HEIGHT_PX = 160, 120
FOCAL_PX = 0.5 * WIDTH_PX / math.tan(0.5 * MOUNT.hfov_rad)


@pytest.fixture(scope="module")
def floor():
    """The demo track's floor; drawing it takes half a second."""
    return front_floor(CIRCUIT, 3)


def on_the_lane(before_start_m, aside_m=0.0):
    """A vehicle on the straight so far before the start line, along the lane."""
    s = np.array([CIRCUIT.start_s_m - before_start_m])
    line = CIRCUIT.centreline
    at, ahead = (line.at(s) + aside_m * line.normal(s))[0], line.tangent(s)[0]
    heading = math.atan2(ahead[1], ahead[0])
    return VehicleState(track_m=(float(at[0]), float(at[1])), heading_rad=heading, speed_mps=0.0, steering_rad=0.0)


def seen_at(state, x, y, z=0.0):
    """(u, v) px at which a pinhole on the vehicle sees a point of the world; written anew from the mount's angles."""
    dx, dy = x - state.track_m[0], y - state.track_m[1]
    ahead = dx * math.cos(state.heading_rad) + dy * math.sin(state.heading_rad) - MOUNT.ahead_m
    left = dy * math.cos(state.heading_rad) - dx * math.sin(state.heading_rad)
    below = math.atan2(MOUNT.height_m - z, ahead)
    away = math.hypot(ahead, MOUNT.height_m - z)
    depth = away * math.cos(below - MOUNT.pitch_rad)
    v = FOCAL_PX * math.tan(below - MOUNT.pitch_rad) + 0.5 * (HEIGHT_PX - 1)
    return 0.5 * (WIDTH_PX - 1) - FOCAL_PX * left / depth, v


@pytest.mark.parametrize("before_m", [0.30, 0.45, 0.7])
def test_the_start_line_lies_where_a_pinhole_sees_it(floor, before_m):
    """The white tape across the lane shows in the row that height, pitch and distance give, to within a px."""
    state = on_the_lane(before_m)
    picture = FrontCamera(floor, (), seed=3).picture(0, state)
    (x, y), (end_x, end_y) = CIRCUIT.start_line_m
    u, v = seen_at(state, 0.5 * (x + end_x), 0.5 * (y + end_y))
    column = picture[:, round(u) - 1 : round(u) + 2].mean(axis=(1, 2))
    rows = np.arange(round(v) - 6, round(v) + 7)
    white = np.clip(column[rows] - 120.0, 0.0, None)
    assert white.sum() > 0.0
    assert float((rows * white).sum() / white.sum()) == pytest.approx(v, abs=1.0)


def test_the_lanes_borders_lie_left_and_right(floor):
    """A car left of the middle sees the left border nearer the picture's edge's middle: the map is not mirrored."""
    picture = FrontCamera(floor, (), seed=3).picture(0, on_the_lane(0.6, aside_m=0.05)).mean(axis=2)
    row = picture[70]
    bright = np.flatnonzero(row > 150.0)
    left, right = bright[bright < 80].max(), bright[bright >= 80].min()
    assert 79.5 - left < right - 79.5


@pytest.mark.parametrize("aside_m", [-0.1, 0.0, 0.12])
def test_an_obstacle_stands_where_a_pinhole_sees_it(floor, aside_m):
    """What differs from the picture without it is centred on the thing's axis, from its foot to its top."""
    state = on_the_lane(0.5)
    cos, sin = math.cos(state.heading_rad), math.sin(state.heading_rad)
    x, y = state.track_m[0] + 0.5 * cos - aside_m * sin, state.track_m[1] + 0.5 * sin + aside_m * cos
    thing = Obstacle(track_m=(x, y), radius_m=0.03, height_m=0.10)
    without, with_it = (FrontCamera(floor, things, seed=3).picture(0, state) for things in ((), (thing,)))
    changed = cv2.absdiff(without, with_it).max(axis=2) > 25
    rows = np.flatnonzero(changed.any(axis=1))
    middle_row = round(seen_at(state, x, y, 0.05)[1])
    columns = np.flatnonzero(changed[middle_row])
    assert columns.mean() == pytest.approx(seen_at(state, x, y, 0.05)[0], abs=1.2)
    assert rows.min() == pytest.approx(seen_at(state, x, y, 0.10)[1], abs=2.5)
    near = (x - 0.03 * cos, y - 0.03 * sin)
    assert rows.max() == pytest.approx(seen_at(state, *near)[1], abs=2.5)


def test_things_beside_and_behind_are_no_trouble(floor):
    """Obstacles that touch the car at its side, stand at its bumper or behind it: whatever is ahead of the lens is drawn."""
    state = on_the_lane(0.5)
    x, y = state.track_m
    cos, sin = math.cos(state.heading_rad), math.sin(state.heading_rad)
    things = [
        Obstacle(track_m=(x + a * cos - b * sin, y + a * sin + b * cos), radius_m=0.03)
        for a, b in ((0.10, 0.115), (0.15, 0.0), (-0.4, 0.0), (0.1, -0.115))
    ]
    assert FrontCamera(floor, things, seed=3).picture(0, state).shape == (HEIGHT_PX, WIDTH_PX, 3)


def test_pictures_are_the_seeds_own_and_cannot_be_changed(floor):
    """The same number and seed give the same noise, others another; and a driver cannot paint over what it is shown."""
    state = on_the_lane(0.5)
    first = FrontCamera(floor, (), seed=3).picture(7, state)
    assert np.array_equal(first, FrontCamera(floor, (), seed=3).picture(7, state))
    assert not np.array_equal(first, FrontCamera(floor, (), seed=3).picture(8, state))
    with pytest.raises(ValueError, match="read-only"):
        first[0, 0] = 0


def test_less_light_is_a_darker_picture(floor):
    """Half the light, half the brightness."""
    camera, state = FrontCamera(floor, (), seed=3), on_the_lane(0.5)
    assert camera.picture(0, state, 0.5).mean() == pytest.approx(0.5 * camera.picture(0, state).mean(), rel=0.02)


@pytest.mark.parametrize("size_px", [(64, 48), (320, 240)])
def test_other_sizes_show_the_same(floor, size_px):
    """A picture of another size is the same view: reduced to one size they agree."""
    state = on_the_lane(0.5)
    small = [
        cv2.resize(
            FrontCamera(floor, (), seed=3, size_px=size).picture(0, state), (32, 24), interpolation=cv2.INTER_AREA
        )
        for size in ((WIDTH_PX, HEIGHT_PX), size_px)
    ]
    assert float(np.abs(small[0].astype(float) - small[1].astype(float)).mean()) < 6.0


def test_light_changes_within_its_bounds():
    """A slow change and a switched lamp stay between full light and what both take away, and both happen."""
    light = light_of(LightChange(depth=0.4, step=0.25), 5)
    gains = np.array([light.gain(t) for t in np.arange(0.0, 60.0, 0.05)])
    assert gains.max() <= 1.0
    assert gains.min() == pytest.approx(0.6 * 0.75, abs=0.01)
    jumps = np.abs(np.diff(gains)) > 0.1
    assert 7 <= jumps.sum() <= 9
    assert {light_of(LightChange(), seed).gain(3.0) for seed in range(3)} == {1.0}
    with pytest.raises(ValueError, match="light"):
        LightChange(depth=1.0)
