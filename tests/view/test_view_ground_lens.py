"""The ground map of a lens that bends: camera px to the floor and back, its slope, and other sizes of picture."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from dnb_edge.errors import InputError
from dnb_edge.sim.camera import mast_camera
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import Points
from dnb_edge.view.ground import GroundMap
from dnb_edge.view.homography import fit_ground_map
from dnb_edge.view.keypoints import KeypointPairs
from dnb_edge.view.lens import Lens, LensModel
from dnb_edge.view.pose import find_pose

SCALE = TwinScale(metres_per_px=0.002, height_px=1100.0)
CAMERA = mast_camera(position_m=(1.4, -0.3, 2.3), pitch_deg=58.0, yaw_deg=3.0, roll_deg=1.5, hfov_deg=78.0)
WEBCAM = (-0.22, 0.06, 0.0007, -0.0004, -0.004)


def lens_of(distortion: tuple[float, ...] = WEBCAM, model: LensModel = LensModel.PINHOLE) -> Lens:
    k = CAMERA.matrix
    return Lens(
        model=model, fx_px=float(k[0, 0]), fy_px=float(k[1, 1]), cx_px=float(k[0, 2]), cy_px=float(k[1, 2]),
        distortion=distortion, width_px=1280, height_px=720,
    )  # fmt: skip


def photographed(track_m: Points, lens: Lens) -> Points:
    """Where the camera with this lens shows floor points (n, 2)."""
    return lens.to_camera_px(CAMERA.project(np.column_stack((track_m, np.zeros(len(track_m))))))


def grid() -> Points:
    x, y = np.meshgrid(np.linspace(0.3, 2.6, 6), np.linspace(0.4, 2.0, 5))
    return np.column_stack((x.ravel(), y.ravel()))


def fitted(lens: Lens | None, seen_through: Lens) -> GroundMap:
    marks = grid()[::3]
    pairs = KeypointPairs.from_arrays(photographed(marks, seen_through), SCALE.to_twin_px(marks), source="marks")
    return fit_ground_map(pairs, SCALE, width_px=1280, height_px=720, lens=lens)


@pytest.mark.parametrize(
    "lens", [lens_of(), lens_of((-0.03, 0.004, -0.001, 0.0), LensModel.FISHEYE)], ids=["webcam", "fisheye"]
)
def test_a_known_lens_puts_every_point_where_it_is(lens: Lens) -> None:
    """With the lens the map is exact over the floor and back, by array and by point; without it, it is centimetres off."""
    ground, floor = fitted(lens, lens), grid()
    seen = photographed(floor, lens)
    assert np.abs(ground.to_track_m(seen) - floor).max() < 1e-6
    assert np.abs(ground.to_camera_px(floor) - seen).max() < 1e-4
    assert ground.point_to_track_m((float(seen[7, 0]), float(seen[7, 1]))) == pytest.approx(tuple(floor[7]), abs=1e-6)
    assert ground.point_to_camera_px((float(floor[7, 0]), float(floor[7, 1]))) == pytest.approx(
        tuple(seen[7]), abs=1e-4
    )
    blind = fitted(None, lens)
    assert np.linalg.norm(blind.to_track_m(seen) - floor, axis=1).max() > 0.008


def test_the_slope_is_that_of_the_whole_way() -> None:
    """The jacobian holds what a small step in the picture does on the floor, the lens's bend included."""
    ground, at = fitted(lens_of(), lens_of()), np.array([180.0, 560.0])
    steps = np.array([[0.1, 0.0], [-0.1, 0.0], [0.0, 0.1], [0.0, -0.1]])
    right, left, down, up = ground.to_track_m(at + steps)
    by_steps = np.column_stack((right - left, down - up)) / 0.2
    assert ground.jacobian((180.0, 560.0)) == pytest.approx(by_steps, rel=1e-4)
    unbent = replace(ground, lens=None).jacobian((180.0, 560.0))
    assert np.abs(unbent / by_steps - 1.0).max() > 0.01


def test_another_size_of_the_same_mode_shows_the_same_floor() -> None:
    """Half the pixels each way, lens and all, is the same map."""
    full = fitted(lens_of(), lens_of())
    half = full.scaled_to(640, 360)
    assert half.point_to_track_m((90.0, 280.0)) == pytest.approx(full.point_to_track_m((180.0, 560.0)), abs=1e-9)


def test_a_lens_for_another_size_of_picture_is_refused() -> None:
    """A map and its lens must speak of the same pixels."""
    with pytest.raises(InputError, match="640x360"):
        replace(fitted(None, lens_of()), lens=lens_of().scaled_to(640, 360))


def test_what_is_far_outside_the_picture_stays_outside() -> None:
    """A car predicted metres beyond the view is not folded back into it by the lens's formula."""
    ground = fitted(lens_of((-0.3, 0.05, 0.0, 0.0, 0.0)), lens_of((-0.3, 0.05, 0.0, 0.0, 0.0)))
    for x in np.linspace(6.0, 60.0, 60):
        seen = ground.point_to_camera_px((float(x), 1.0))
        assert seen is not None
        assert seen[0] > 1280


def test_a_map_with_its_lens_survives_its_stored_form() -> None:
    """To JSON types and back, bit for bit; one from before lenses were known still loads."""
    ground = fitted(lens_of(), lens_of())
    assert GroundMap.from_dict(ground.to_dict()) == ground
    old = {key: value for key, value in replace(ground, lens=None).to_dict().items() if key != "lens"}
    assert GroundMap.from_dict(old) == replace(ground, lens=None)


def test_a_calibrated_lens_tells_the_pose_from_any_angle() -> None:
    """Straight down, where keypoints alone do not tell the height, and off the picture's middle, where they mislead."""
    steep = mast_camera(position_m=(1.4, 1.1, 2.5), pitch_deg=89.0, hfov_deg=70.0)
    matrix = steep.matrix.copy()
    matrix[0, 2], matrix[1, 2], matrix[1, 1] = 690.0, 330.0, matrix[1, 1] * 1.02
    camera = replace(steep, matrix=matrix)
    lens = replace(
        lens_of((0.0, 0.0, 0.0, 0.0)), fx_px=float(matrix[0, 0]), fy_px=float(matrix[1, 1]), cx_px=690.0, cy_px=330.0
    )
    marks = grid()
    pairs = KeypointPairs.from_arrays(
        camera.project(np.column_stack((marks, np.zeros(len(marks))))), SCALE.to_twin_px(marks), source="marks"
    )
    ground = fit_ground_map(pairs, SCALE, width_px=1280, height_px=720, lens=lens)
    pose = find_pose(ground)
    assert math.dist(pose.position_m, (1.4, 1.1, 2.5)) < 1e-6
    assert pose.pitch_deg == pytest.approx(89.0, abs=1e-4)
    with pytest.raises(InputError, match="camera_height_m"):
        find_pose(replace(ground, lens=None))
    with pytest.raises(InputError, match=r"about 2\.50 m"):
        find_pose(ground, height_m=3.0)
