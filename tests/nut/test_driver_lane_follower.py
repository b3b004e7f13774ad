"""The lane follower: its view from above, the lane that it finds there, and its drives in the closed loop's world."""

from __future__ import annotations

import dataclasses
import math

import cv2
import numpy as np
import pytest
from driver_bicycle import at, briefing
from hypothesis import given, settings
from hypothesis import strategies as st

from dnb_edge.nut.birds_eye import CELL_M, FAR_M, NEAR_M, SIDE_M, BirdsEye, floor_to_picture
from dnb_edge.nut.lane_follower import KeepAside, LaneFollower
from dnb_edge.sim.circuit import LANE_WIDTH_M, demo_circuit
from dnb_edge.sim.control import DriverFailed, Sight
from dnb_edge.sim.front_camera import FrontCamera, FrontMount, front_floor
from dnb_edge.sim.light import LightChange
from dnb_edge.sim.task import LoopTask, obstacles_beside
from dnb_edge.sim.world import World

SIZE_PX = (160, 120)
MOUNT = FrontMount()
DEMO = demo_circuit()
EYE = BirdsEye(SIZE_PX, MOUNT)


@pytest.fixture(scope="module")
def camera() -> FrontCamera:
    return FrontCamera(front_floor(DEMO, 3), [], seed=3, size_px=SIZE_PX)


@given(x=st.floats(0.2, 3.0), y=st.floats(-1.0, 1.0))
def test_floor_is_projected_as_a_pinhole_does(x, y):
    """The homography is that of a pinhole with the mount's place, written down another way: by angles."""
    u, v, w = floor_to_picture(SIZE_PX, MOUNT) @ np.array([x, y, 1.0])
    focal = 80.0 / math.tan(0.5 * MOUNT.hfov_rad)
    forward = x - MOUNT.ahead_m
    depth = forward * math.cos(MOUNT.pitch_rad) + MOUNT.height_m * math.sin(MOUNT.pitch_rad)
    assert w == pytest.approx(depth)
    assert u / w == pytest.approx(79.5 - focal * y / depth)
    below = math.atan2(MOUNT.height_m, forward) - MOUNT.pitch_rad
    assert v / w == pytest.approx(59.5 + focal * math.tan(below))


def test_a_mark_on_the_floor_lands_in_its_cell():
    """A spot painted where the homography says the floor's point is turns up at that point of the view from above."""
    for x, y in ((0.3, 0.0), (0.45, 0.12), (0.6, -0.2)):
        u, v, w = floor_to_picture(SIZE_PX, MOUNT) @ np.array([x, y, 1.0])
        picture = np.zeros((120, 160, 3), np.uint8)
        cv2.circle(picture, (round(u / w * 16), round(v / w * 16)), 24, (255, 255, 255), -1, cv2.LINE_AA, 4)
        view = EYE.view(picture)[..., 0]
        row, column = np.unravel_index(int(np.argmax(cv2.GaussianBlur(view, (0, 0), 2.0))), view.shape)
        assert FAR_M - (row + 0.5) * CELL_M == pytest.approx(x, abs=0.03)
        assert SIDE_M - (column + 0.5) * CELL_M == pytest.approx(y, abs=0.02)


@pytest.mark.parametrize("gain", [1.0, 0.45, 0.25])
@pytest.mark.parametrize(("offset_m", "turned_rad"), [(0.0, 0.0), (0.05, 0.0), (-0.05, 0.0), (0.0, 0.2), (0.0, -0.2)])
def test_middle_of_a_straight_lane_is_found(camera, gain, offset_m, turned_rad):
    """Wherever the car stands on a straight and in any light, the lane's middle is found within 1.5 cm."""
    state = at(DEMO, 0.35, offset_m=offset_m, turned_rad=turned_rad)
    lane = EYE.lane(camera.picture(7, state, gain))
    middle = EYE.middle(lane, centre_m=(0.0, 0.0), distance_m=0.32, towards_rad=0.0, half_width_m=0.5 * LANE_WIDTH_M)
    assert middle is not None
    x, y = middle.at_m
    across = math.sin(turned_rad) * x + math.cos(turned_rad) * y
    assert across + offset_m == pytest.approx(0.0, abs=0.015)
    assert math.hypot(x, y) == pytest.approx(0.32)


def test_start_line_does_not_part_the_lane(camera):
    """Right before the start line's white tape the lane still goes on beyond it."""
    lane = EYE.lane(camera.picture(1, at(DEMO, DEMO.start_s_m - 0.35)))
    ahead = lane[:, lane.shape[1] // 2]
    assert ahead[: round((FAR_M - 0.45) / CELL_M)].mean() > 0.8
    assert ahead[round((FAR_M - 0.30) / CELL_M) : round((FAR_M - NEAR_M) / CELL_M) - 3].all()


@pytest.mark.parametrize(
    ("left_m", "right_m", "edges", "middle_m"),
    [(0.11, -0.15, 2, -0.02), (0.55, -0.02, 1, 0.11), (-0.02, -0.55, 1, -0.15), (0.55, -0.55, 0, 0.0)],
    ids=["both edges", "right edge", "left edge", "neither"],
)
def test_an_edge_outside_the_picture_is_put_where_the_width_says(left_m, right_m, edges, middle_m):
    """With one edge in sight the middle lies half a lane from it; with both, or neither, halfway."""
    lane = np.zeros(EYE.seen.shape, dtype=np.bool_)
    lane[:, round((SIDE_M - left_m) / CELL_M) : round((SIDE_M - right_m) / CELL_M)] = True
    middle = EYE.middle(lane & EYE.seen, centre_m=(0.0, 0.0), distance_m=0.32, towards_rad=0.0, half_width_m=0.13)
    assert middle is not None
    assert middle.edges == edges
    assert middle.at_m[1] == pytest.approx(middle_m, abs=0.015)


def test_nothing_dark_is_no_lane():
    """A floor without a lane: no lane, no middle; the driver goes on slowly."""
    bright = np.full((120, 160, 3), 160, np.uint8)
    lane = EYE.lane(bright)
    assert not lane.any()
    assert EYE.middle(lane, centre_m=(0.0, 0.0), distance_m=0.3, towards_rad=0.0, half_width_m=0.13) is None
    driver = LaneFollower()
    driver.start(_brief())
    slow = driver.drive(Sight(t_ns=0, bgr=bright, speed_mps=0.25))
    assert slow.steering == 0.0
    assert 0.0 < slow.throttle < 0.2


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), level=st.integers(0, 255), spread=st.integers(0, 255))
def test_any_picture_has_a_control(seed, level, spread):
    """Noise, black, white: there is always a control within its bounds (`Control` refuses others)."""
    random = np.random.default_rng(seed)
    picture = np.clip(level + random.integers(-spread - 1, spread + 1, (120, 160, 3)), 0, 255).astype(np.uint8)
    driver = LaneFollower()
    driver.start(_brief())
    for index in range(3):
        driver.drive(Sight(t_ns=index * 33_000_000, bgr=picture, speed_mps=float(random.uniform(-1, 2))))


@pytest.mark.parametrize(
    "task",
    [
        LoopTask(seed=5, laps=1, delay_s=0.15, light=LightChange(depth=0.6, step=0.3)),
        LoopTask(seed=7, laps=1, place="table"),
    ],
    ids=["delay and light", "table"],
)
def test_laps_on_the_lane(task):
    """A lap of the closed loop's world on the lane all the way: with delay in changing light, on a narrower lane."""
    world, driver = World(task), LaneFollower()
    driver.start(world.brief(driver))
    index = 0
    while world.ended is None:
        world.drive_until(world.front_t_ns(index), driver)
        index += 1
    truth = world.truth()
    assert world.ended == "laps"
    assert truth.off_lane_s == 0.0


def test_finds_its_way_round_obstacles():
    """It does not see them, and gets past them all the same: it backs away and tries one side, then the other."""
    task = LoopTask(seed=2, laps=1, obstacles=obstacles_beside(DEMO, count=3, seed=2))
    world, driver = World(task), LaneFollower()
    driver.start(world.brief(driver))
    index = 0
    while world.ended is None:
        world.drive_until(world.front_t_ns(index), driver)
        index += 1
    assert world.ended == "laps"
    assert len(world.truth().collisions) < 8


def test_keeps_to_one_side_and_then_the_other():
    """Blocked: one side for a metre. Blocked on that side: the other. Blocked again later: the side that worked."""
    aside = KeepAside()
    assert aside.left_m == 0.0
    aside.blocked()
    first = aside.left_m
    aside.moved(0.5)
    aside.blocked()
    assert aside.left_m == -first != 0.0
    aside.moved(1.1)
    assert aside.left_m == 0.0
    aside.blocked()
    assert aside.left_m == -first


def test_fails_in_one_line():
    """Not started, or pictures of another size than it was told: `DriverFailed` that says so."""
    driver = LaneFollower()
    sight = Sight(t_ns=0, bgr=np.zeros((60, 80, 3), np.uint8), speed_mps=0.0)
    with pytest.raises(DriverFailed, match="not started"):
        driver.drive(sight)
    driver.start(_brief())
    with pytest.raises(DriverFailed, match="160x120"):
        driver.drive(sight)
    driver.close()
    driver.close()
    assert (driver.name, driver.knows_truth) == ("lane-follower", False)


def _brief():
    return dataclasses.replace(briefing(None), picture_px=SIZE_PX)
