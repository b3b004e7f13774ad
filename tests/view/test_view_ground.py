"""Camera px to the track plane and back, on every frame."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from keypoint_samples import HEIGHT, SCALE, TWIN, WIDTH, ground, seen

from dnb_edge.errors import InputError
from dnb_edge.view.ground import GroundMap

GROUND = ground()
TWIN_POINT = st.tuples(st.floats(-300, 1300), st.floats(-1500, 1300))
HORIZON_V = 359.5 - 900 * np.tan(np.radians(40))


@given(TWIN_POINT)
def test_the_floor_is_found_where_it_is(twin_px):
    """Any floor point comes back from the pixel at which the camera sees it."""
    truth = SCALE.to_track_m(np.array([twin_px]))[0]
    (pixel,) = seen(np.array([twin_px])).tolist()
    assert GROUND.point_to_track_m(tuple(pixel)) == pytest.approx(tuple(truth), abs=1e-5)
    assert GROUND.point_to_camera_px(tuple(truth)) == pytest.approx(pixel, abs=1e-3)


@given(st.lists(TWIN_POINT, min_size=1, max_size=6))
def test_many_points_map_as_each_alone(points):
    """Arrays and single points are one map, both ways."""
    pixels = seen(np.array(points))
    on_track = GROUND.to_track_m(pixels)
    for pixel, metres in zip(pixels.tolist(), on_track.tolist(), strict=True):
        assert GROUND.point_to_track_m(tuple(pixel)) == pytest.approx(metres, abs=1e-9)
    assert GROUND.to_camera_px(on_track) == pytest.approx(pixels, abs=1e-6)


@given(TWIN_POINT)
def test_the_jacobian_is_the_maps_derivative(twin_px):
    """A small step in the picture moves the floor point as the Jacobian says."""
    (u, v) = seen(np.array([twin_px]))[0]
    step = 1e-3
    measured = np.empty((2, 2))
    for k, (du, dv) in enumerate(((step, 0), (0, step))):
        ahead = np.array(GROUND.point_to_track_m((u + du, v + dv)))
        behind = np.array(GROUND.point_to_track_m((u - du, v - dv)))
        measured[:, k] = (ahead - behind) / (2 * step)
    assert GROUND.jacobian((u, v)) == pytest.approx(measured, rel=1e-3, abs=1e-8)


@given(TWIN_POINT)
def test_a_pixel_is_seen_where_the_map_says_and_moves_as_it_says(twin_px):
    """Place and slopes in one are the point and the Jacobian by themselves, to the last bit."""
    (pixel,) = seen(np.array([twin_px])).tolist()
    place, slopes = GROUND.seen(tuple(pixel))
    assert place == GROUND.point_to_track_m(tuple(pixel))
    assert np.reshape(slopes, (2, 2)).tolist() == GROUND.jacobian(tuple(pixel)).tolist()


def test_beyond_the_horizon_there_is_no_floor():
    """At and above the horizon a pixel has no floor point, and says so rather than mirror one from behind."""
    above, below = (600.0, HORIZON_V - 1), (600.0, HORIZON_V + 1)
    assert GROUND.point_to_track_m(above) is None
    assert GROUND.seen(above) is None
    assert GROUND.point_to_track_m(below) is not None
    assert GROUND.sees_ground(np.array([above, below])).tolist() == [False, True]
    with pytest.raises(ValueError, match="beyond the horizon: point 0 of 2"):
        GROUND.to_track_m(np.array([above, below]))
    with pytest.raises(ValueError, match="beyond the horizon"):
        GROUND.jacobian(above)


def test_behind_the_camera_nothing_is_seen():
    """A floor point behind the camera has no pixel."""
    behind = tuple(SCALE.to_track_m(np.array([[500.0, 9000.0]]))[0].tolist())
    assert GROUND.point_to_camera_px(behind) is None
    with pytest.raises(ValueError, match="behind the camera"):
        GROUND.to_camera_px(np.array([behind]))


@pytest.mark.parametrize(("width", "height"), [(640, 360), (1920, 1080), (3840, 2160), (854, 480), (1280, 720)])
def test_frames_of_another_size(width, height):
    """The same aspect in another size maps the same floor, pixel positions scaled plainly."""
    scaled = GROUND.scaled_to(width, height)
    assert (scaled.width_px, scaled.height_px) == (width, height)
    pixels = seen(TWIN)
    resized = pixels * (width / WIDTH, height / HEIGHT)
    assert scaled.to_track_m(resized) == pytest.approx(GROUND.to_track_m(pixels), abs=1e-9)
    assert scaled.scaled_to(WIDTH, HEIGHT).to_track_m(pixels) == pytest.approx(GROUND.to_track_m(pixels), abs=1e-9)


@pytest.mark.parametrize(("width", "height"), [(1280, 1024), (720, 1280), (640, 480), (640, 362), (0, 0)])
def test_frames_of_another_aspect_are_refused(width, height):
    """Nobody knows where a picture of another shape was cropped: both sizes are named."""
    with pytest.raises(
        InputError, match=rf"frames are {width}x{height}, the view was calibrated on pictures of 1280x720: "
    ):
        GROUND.scaled_to(width, height)


def test_the_stored_form_is_exact():
    """Through JSON text and back not one bit changes."""
    again = GroundMap.from_dict(json.loads(json.dumps(GROUND.to_dict())))
    assert again == GROUND
    assert hash(again) == hash(GROUND)


def test_a_damaged_stored_form_is_refused():
    """A member that is gone or of another kind is an input error."""
    whole = GROUND.to_dict()
    for damaged in ({**whole, "camera_to_twin": [1, 2]}, {k: v for k, v in whole.items() if k != "scale"}):
        with pytest.raises(InputError, match="calibrate again"):
            GroundMap.from_dict(damaged)


@pytest.mark.parametrize(
    ("matrix", "size"),
    [((0.0,) * 9, (1280, 720)), ((float("nan"),) * 9, (1280, 720)), ((1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0), (0, 720))],
)
def test_what_is_no_map_is_refused(matrix, size):
    """A matrix without inverse, or no picture, is an error at construction."""
    with pytest.raises(InputError, match="ground map"):
        GroundMap(camera_to_twin=matrix, scale=SCALE, width_px=size[0], height_px=size[1])
