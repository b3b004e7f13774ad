"""Where the camera stands, told from the floor's homography, against simulated cameras whose place is known."""

import math
from dataclasses import replace

import numpy as np
import pytest

from dnb_edge.errors import InputError
from dnb_edge.sim.camera import PinholeCamera, mast_camera
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import Points
from dnb_edge.view.ground import GroundMap
from dnb_edge.view.homography import fit_ground_map
from dnb_edge.view.keypoints import KeypointPairs
from dnb_edge.view.pose import find_pose, likely_pose, with_camera

SCALE = TwinScale(metres_per_px=0.002, height_px=1200)
HEIGHTS_M = (1.5, 2.15, 3.0, 4.0)
PITCHES_DEG = (30.0, 45.0, 60.0, 75.0)


def camera(height_m: float, pitch_deg: float, *, size_px: tuple[int, int] = (1280, 720)) -> PinholeCamera:
    """A camera that looks, askew, at a spot at about (1.5, 1) m on the floor."""
    back_m = height_m / math.tan(math.radians(pitch_deg)) if pitch_deg < 90.0 else 0.0
    return mast_camera(
        position_m=(1.5, 1.0 - back_m, height_m),
        pitch_deg=pitch_deg,
        yaw_deg=4.0 if pitch_deg < 90.0 else 0.0,
        roll_deg=-2.0,
        size_px=size_px,
    )


def floor_seen(height_m: float) -> Points:
    """A 4 x 3 grid on the floor about (1.5, 1) m, well inside the picture, track m."""
    half = 0.28 * height_m
    across, along = np.meshgrid(np.linspace(-half, half, 4), np.linspace(-0.6 * half, 0.6 * half, 3))
    return np.column_stack((across.ravel() + 1.5, along.ravel() + 1.0))


def ground(seen_by: PinholeCamera, *, noise_px: float = 0.0, seed: int = 0) -> GroundMap:
    """The ground map of keypoints clicked with a spread of `noise_px`."""
    floor = floor_seen(float(seen_by.position_m[2]))
    pixels = seen_by.project(np.column_stack((floor, np.zeros(len(floor)))))
    clicked = pixels + np.random.default_rng(seed).normal(0.0, 1.0, pixels.shape) * noise_px
    pairs = KeypointPairs.from_arrays(clicked, SCALE.to_twin_px(floor), source="clicked")
    return fit_ground_map(pairs, SCALE, width_px=seen_by.width_px, height_px=seen_by.height_px)


def seen_at(seen_by: PinholeCamera, track_m: tuple[float, float], height_m: float) -> tuple[float, float]:
    (pixel,) = seen_by.project(np.array([[*track_m, height_m]])).tolist()
    return pixel[0], pixel[1]


@pytest.mark.parametrize("pitch_deg", PITCHES_DEG)
@pytest.mark.parametrize("height_m", HEIGHTS_M)
def test_the_camera_is_found_where_it_stands(height_m: float, pitch_deg: float) -> None:
    """From the floor's homography alone: place and height within 1 %, and a roof 80-150 mm up is placed within 5 mm."""
    truth = camera(height_m, pitch_deg)
    pose = find_pose(ground(truth))
    assert pose.position_m[2] == pytest.approx(height_m, rel=0.01)
    assert math.dist(pose.position_m, truth.position_m) < 0.01 * height_m
    assert pose.focal_px == pytest.approx(truth.matrix[0, 0], rel=0.01)
    assert pose.pitch_deg == pytest.approx(pitch_deg, abs=0.5)
    known = with_camera(ground(truth))
    for roof_m in (0.08, 0.15):
        for track_m in ((1.5, 1.0), (1.2, 1.1), (1.75, 0.9)):
            below_m = known.point_below_m(seen_at(truth, track_m, roof_m), roof_m)
            assert below_m is not None
            assert math.dist(below_m, track_m) < 0.005


@pytest.mark.parametrize("pitch_deg", [*PITCHES_DEG, 90.0])
@pytest.mark.parametrize("height_m", HEIGHTS_M)
def test_a_measured_height_is_enough_from_straight_above(height_m: float, pitch_deg: float) -> None:
    """With the height measured 1 % wrong, a roof is placed within 5 mm at every pitch, straight down included."""
    truth = camera(height_m, pitch_deg)
    known = with_camera(ground(truth), height_m=1.01 * height_m)
    assert known.camera_m is not None
    assert known.camera_m[2] == pytest.approx(height_m, rel=0.011)
    for roof_m in (0.08, 0.15):
        below_m = known.point_below_m(seen_at(truth, (1.75, 0.9), roof_m), roof_m)
        assert below_m is not None
        assert math.dist(below_m, (1.75, 0.9)) < 0.005


@pytest.mark.parametrize(("width", "height"), [(1920, 1080), (640, 360)])
def test_frames_of_another_size_keep_the_camera_where_it_is(width: int, height: int) -> None:
    """The map at another size of frame places the same roof at the same point."""
    truth = camera(2.15, 60.0)
    scaled = with_camera(ground(truth)).scaled_to(width, height)
    u, v = seen_at(truth, (1.75, 0.9), 0.1)
    below_m = scaled.point_below_m((u * width / 1280, v * height / 720), 0.1)
    assert below_m == pytest.approx((1.75, 0.9), abs=1e-4)


def test_keypoints_clicked_half_a_pixel_wrong_still_place_a_roof() -> None:
    """With a spread of 0.5 px in every click, 19 of 20 calibrations place a roof 120 mm up within 5 mm of where it is."""
    truth = camera(2.15, 50.0)
    errors = []
    for seed in range(60):
        known = with_camera(ground(truth, noise_px=0.5, seed=seed))
        below_m = known.point_below_m(seen_at(truth, (1.75, 0.9), 0.12), 0.12)
        assert below_m is not None
        errors.append(math.dist(below_m, (1.75, 0.9)))
    assert np.quantile(errors, 0.95) < 0.005


def test_on_the_floor_nothing_changes() -> None:
    """At height 0 the point is the homography's own, to the bit, whether the camera's place is known or not."""
    plain = ground(camera(2.15, 60.0))
    for known in (plain, with_camera(plain)):
        assert known.point_below_m((700.0, 400.0), 0.0) == plain.point_to_track_m((700.0, 400.0))
        assert known.share_at(0.0) == 1.0


def test_a_step_on_the_roof_is_shorter_than_on_the_floor_behind_it() -> None:
    """The share of a step is that of a real one at the roof's height."""
    truth = camera(2.0, 60.0)
    known = with_camera(ground(truth))
    pixels = np.array([seen_at(truth, point, 0.2) for point in ((1.5, 1.0), (1.6, 1.0))])
    one, other = known.to_track_m(pixels).tolist()
    assert math.dist(one, other) * known.share_at(0.2) == pytest.approx(0.1, abs=1e-6)


def test_beyond_the_horizon_there_is_nothing_below() -> None:
    """A pixel at the sky has no floor point, whatever the height."""
    known = with_camera(ground(camera(1.5, 30.0)))
    assert known.point_below_m((640.0, -400.0), 0.1) is None


STEEP = ground(camera(2.15, 90.0))
USUAL = ground(camera(2.15, 60.0))


@pytest.mark.parametrize(
    ("seen", "height_m", "tallest_m", "named"),
    [
        (STEEP, None, 0.1, "camera_height_m"),
        (ground(camera(2.15, 84.0)), None, 0.1, "84 degrees down"),
        (USUAL, 0.0, 0.1, "camera_height_m"),
        (USUAL, math.nan, 0.1, "camera_height_m"),
        (USUAL, 4.0, 0.1, "not 4 m"),
        (USUAL, None, 2.5, "2.5 m high"),
    ],
    ids=["straight down", "nearly straight down", "height 0", "no number", "far too high", "roof above the camera"],
)
def test_what_does_not_tell_the_height_says_so(
    seen: GroundMap, height_m: float | None, tallest_m: float, named: str
) -> None:
    """One line that names the key to set, never a camera somewhere."""
    with pytest.raises(InputError, match=named):
        with_camera(seen, height_m=height_m, tallest_m=tallest_m)


def test_a_mirrored_twin_is_refused() -> None:
    """A floor seen from below means that the twin or the picture is mirrored."""
    truth = camera(2.15, 60.0)
    floor = floor_seen(2.15)
    mirrored = SCALE.to_twin_px(floor) * (-1.0, 1.0) + (2000.0, 0.0)
    pixels = truth.project(np.column_stack((floor, np.zeros(len(floor)))))
    pairs = KeypointPairs.from_arrays(pixels, mirrored, source="clicked")
    with pytest.raises(InputError, match="mirrored"):
        find_pose(fit_ground_map(pairs, SCALE, width_px=1280, height_px=720))


def test_without_the_cameras_place_a_roof_is_refused() -> None:
    """A height that cannot be accounted for is a fault of the program, never taken for the floor."""
    with pytest.raises(ValueError, match="not known"):
        USUAL.point_below_m((700.0, 400.0), 0.1)
    with pytest.raises(ValueError, match="not below the camera"):
        with_camera(USUAL).share_at(2.5)


def test_the_cameras_place_survives_its_stored_form() -> None:
    """Written and read back the map is equal; one written before there was a camera in it reads as without."""
    known = with_camera(USUAL)
    assert GroundMap.from_dict(known.to_dict()) == known
    stored = known.to_dict()
    del stored["camera_m"]
    assert GroundMap.from_dict(stored) == replace(known, camera_m=None)


def test_a_wrong_height_does_not_cost_what_the_keypoints_tell() -> None:
    """With a height that contradicts the keypoints the likely pose is the keypoints' own, not that of a usual lens."""
    seen = ground(camera(2.15, 45.0))
    with pytest.raises(InputError, match="measure again"):
        find_pose(seen, height_m=1.0)
    assert likely_pose(seen, height_m=1.0) == find_pose(seen)
    steep = ground(camera(2.15, 90.0))
    assert likely_pose(steep, height_m=0.01) is not None
