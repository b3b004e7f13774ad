"""The lane in a photograph of the simulated room."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from dnb_edge.errors import InputError
from dnb_edge.sim.circuit import TWIN_SCALE, demo_circuit
from dnb_edge.sim.renderer import Renderer
from dnb_edge.sim.rig import demo_camera
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.lane_shade import LaneShade
from dnb_edge.view.ground import GroundMap
from dnb_edge.view.lens import Lens, LensModel
from dnb_edge.view.photograph import UnclearLane, floor_in, median_picture, route_in, twin_of


@pytest.fixture(scope="module")
def room():
    """The empty room as the simulated camera sees it, and the camera's exact map."""
    circuit, camera = demo_circuit(), demo_camera()
    to_twin = np.array(
        [[1, 0, 0], [0, -1, TWIN_SCALE.height_px * TWIN_SCALE.metres_per_px], [0, 0, TWIN_SCALE.metres_per_px]]
    )
    h = to_twin @ np.linalg.inv(camera.floor_homography())
    h *= np.sign((h @ [640, 719, 1])[2])
    ground = GroundMap(camera_to_twin=tuple(h.ravel().tolist()), scale=TWIN_SCALE, width_px=1280, height_px=720)
    return Renderer(circuit, camera, 1).picture(0, None), ground


def bent(picture, ground):
    """The picture as a webcam's lens would show it, and the map that knows the lens."""
    focal = float(demo_camera().matrix[0, 0])
    lens = Lens(
        model=LensModel.PINHOLE, fx_px=focal, fy_px=focal, cx_px=639.5, cy_px=359.5, width_px=1280, height_px=720,
        distortion=(-0.25, 0.07, 0.001, -0.0005, 0.0),
    )  # fmt: skip
    v, u = np.mgrid[0:720, 0:1280].astype(float)
    ideal = lens.to_ideal_px(np.column_stack((u.ravel(), v.ravel()))).astype(np.float32).reshape(720, 1280, 2)
    return cv2.remap(picture, ideal, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT), replace(ground, lens=lens)


def worse(picture):
    """Half of the light gone on one side, noise, and hard JPEG."""
    u = np.mgrid[0:720, 0:1280][1]
    dim = picture * (1 - 0.6 * u / 1280)[..., None] + np.random.default_rng(1).normal(0, 8, picture.shape)
    data = cv2.imencode(".jpg", np.clip(dim, 0, 255).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 30])[1]
    return cv2.imdecode(data, cv2.IMREAD_COLOR)


def mean_off_m(route, ground):
    line = demo_circuit().centreline
    at = np.arange(2000) * line.length_m / 2000
    truth = Centreline(points_m=line.at(at), half_left_m=np.full(2000, 0.13), half_right_m=np.full(2000, 0.13))
    _, d_m = truth.locate(ground.scale.to_track_m(route.points_px))
    return float(np.abs(d_m).mean())


@pytest.mark.parametrize(
    ("kind", "shade"), [("bent, dim and noisy", LaneShade.DARK), ("bent", LaneShade.BETWEEN_LINES)]
)
def test_the_route_is_right_through_a_lens_and_in_bad_light(room, kind, shade):
    """Within 5 mm of the true centreline on average, and the lane of the right width."""
    picture, ground = bent(*room)
    picture = worse(picture) if "dim" in kind else picture
    route = route_in(floor_in(picture, ground), ground, shade, source="x")
    assert mean_off_m(route, ground) < 0.005
    width_m = float(np.median(route.half_left_px + route.half_right_px)) * ground.scale.metres_per_px
    assert width_m == pytest.approx(0.26, abs=0.015)
    assert np.median(route.half_left_px) == pytest.approx(np.median(route.half_right_px), rel=0.04)


def test_the_twin_lies_as_the_map_says(room):
    """A twin px of the made twin shows what the camera shows at the px that the map gives it."""
    picture, ground = room
    twin = twin_of(picture, ground, right_px=1200.0)
    assert twin.shape == (TWIN_SCALE.height_px, 1200, 3)
    random = np.random.default_rng(4)
    places = random.uniform((300, 200), (900, 600), (200, 2)).round()
    camera_px = ground.to_camera_px(ground.scale.to_track_m(places)).round().astype(int)
    seen = picture[camera_px[:, 1], camera_px[:, 0]].astype(int)
    shown = twin[places[:, 1].astype(int), places[:, 0].astype(int)].astype(int)
    assert np.median(np.abs(seen - shown)) < 6


def test_a_lane_that_leaves_the_picture_is_told(room):
    """The error says where, and has a picture of what was taken for lane."""
    picture, ground = room
    with pytest.raises(
        UnclearLane, match=r"px of the picture from above.*the lane leaves the picture near \("
    ) as caught:
        route_in(floor_in(picture, ground, area_m=(1.0, 0.0, 3.0, 2.0)), ground, LaneShade.DARK, source="x")
    assert isinstance(caught.value, InputError)
    assert caught.value.picture.ndim == 3


def test_the_median_forgets_what_moves():
    """Of three pictures with a blot each, and of one; of none there is none."""
    still = np.random.default_rng(2).integers(0, 255, (40, 50, 3)).astype(np.uint8)
    pictures = []
    for k in range(3):
        picture = still.copy()
        picture[10 * k : 10 * k + 8, 5:40] = 0
        pictures.append(picture)
    assert np.array_equal(median_picture(pictures), still)
    assert np.array_equal(median_picture(pictures[:1]), pictures[0])
    with pytest.raises(ValueError, match="no picture"):
        median_picture([])


def test_lengths_are_those_of_the_twin_and_not_of_the_view_from_above(room):
    """Sought over so much floor that its px are twice the twin's, the lane is 0.13 m wide to either side all the same."""
    picture, ground = room
    floor = floor_in(picture, ground, area_m=(-4.0, -4.0, 8.0, 8.0))
    assert floor.metres_per_px == pytest.approx(2 * TWIN_SCALE.metres_per_px)
    route = route_in(floor, ground, LaneShade.DARK, source="x")
    for half_px in (route.half_left_px, route.half_right_px):
        assert np.median(half_px) * TWIN_SCALE.metres_per_px == pytest.approx(0.13, abs=0.01)
    assert mean_off_m(route, ground) < 0.006
