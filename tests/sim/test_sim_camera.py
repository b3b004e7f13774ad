"""The pinhole camera: its projection and the homography that it must agree with."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.sim.camera import mast_camera
from dnb_edge.sim.rig import demo_camera, floor_to_camera_px


@pytest.mark.parametrize(
    ("point", "pixel"),
    [
        ((0.0, 0.0, 0.0), (49.5, 49.5)),
        ((1.0, 0.0, 0.0), (74.5, 49.5)),
        ((0.0, 1.0, 0.0), (49.5, 24.5)),
        ((0.0, 1.0, 1.0), (49.5, -0.5)),
    ],
)
def test_looking_straight_down(point, pixel):
    """From 2 m up, 100 px and 90 degrees wide, a metre on the floor is 25 px: x goes right, y up, and height magnifies."""
    camera = mast_camera(position_m=(0.0, 0.0, 2.0), pitch_deg=90.0, hfov_deg=90.0, size_px=(100, 100))
    assert np.allclose(camera.project(np.array([point]))[0], pixel, atol=1e-9)


def test_pitch_yaw_and_roll_turn_the_right_way():
    """What lies on the axis stays in the centre; turning right moves the world left; rolling clockwise turns it back."""
    ahead = np.array([[0.0, 2.0 / math.tan(math.radians(60.0)), 0.0]])
    straight = mast_camera(position_m=(0.0, 0.0, 2.0), pitch_deg=60.0)
    centre = np.array([639.5, 359.5])
    assert np.allclose(straight.project(ahead)[0], centre)
    turned = mast_camera(position_m=(0.0, 0.0, 2.0), pitch_deg=60.0, yaw_deg=5.0)
    assert turned.project(ahead)[0, 0] < centre[0] - 10
    rolled = mast_camera(position_m=(0.0, 0.0, 2.0), pitch_deg=60.0, roll_deg=10.0)
    right = rolled.project(ahead + np.array([0.3, 0.0, 0.0]))[0]
    assert right[1] < centre[1] - 5


@given(st.floats(-0.2, 3.2), st.floats(0.0, 2.0))
def test_homography_is_the_projection_of_the_floor(x, y):
    """Both ways from floor to picture give the same pixel."""
    camera = demo_camera()
    u, v, w = camera.floor_homography() @ [x, y, 1.0]
    assert np.allclose(floor_to_camera_px(camera, np.array([[x, y]]))[0], (u / w, v / w), atol=1e-8)


def test_points_behind_the_camera_are_refused():
    """There is no pixel for what lies behind."""
    with pytest.raises(ValueError, match="behind"):
        demo_camera().project(np.array([[1.5, -5.0, 3.0]]))


def test_the_axes_stay_a_right_handed_frame():
    """However the camera is turned, its three axes are at right angles and nothing is mirrored."""
    turned = mast_camera(position_m=(0.0, 0.0, 2.0), pitch_deg=55.0, yaw_deg=20.0, roll_deg=-15.0).rotation
    assert np.allclose(turned @ turned.T, np.eye(3))
    assert np.linalg.det(turned) == pytest.approx(1.0)
