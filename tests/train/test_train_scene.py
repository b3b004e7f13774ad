"""Drawn scenes: the same for a seed, and labelled exactly."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnb_edge.errors import InputError
from dnb_edge.train.camera import overhead_view
from dnb_edge.train.cars import any_car
from dnb_edge.train.clutter import any_mover, any_static
from dnb_edge.train.render import Light, blank, body_of, draw, flatten, visible_share
from dnb_edge.train.scene import LABEL_FIELDS, SCENE_PX, PlacedCar, exposed, label_of, make_sample, place_car
from dnb_edge.train.shards import SHARD_SAMPLES, asset_photos
from dnb_edge.train.solids import box
from dnb_edge.train.stage import random_camera, random_stage

LIGHT = Light(direction=np.array([0.0, 0.0, 1.0]), ambient=0.6, shadow_strength=0.4, shadow_blur_px=1.0)


def _view(pitch_deg: float = 50.0, roll: float = 0.0, radial: tuple[float, float] = (0.0, 0.0)):
    return overhead_view(
        width_px=SCENE_PX,
        height_px=SCENE_PX,
        camera_height_m=2.0,
        pitch_rad=math.radians(pitch_deg),
        field_of_view_rad=math.radians(40.0),
        roll_rad=roll,
        radial=radial,
    )


def test_a_seed_and_a_number_give_the_same_sample_for_ever():
    """Two runs with the same generator are equal to the byte; another number is another scene."""
    one, again, other = (make_sample(np.random.default_rng([7, number])) for number in (3, 3, 4))
    assert np.array_equal(one.image, again.image)
    assert np.array_equal(one.background, again.background)
    assert np.array_equal(one.labels, again.labels)
    assert not np.array_equal(one.image, other.image)


@pytest.mark.parametrize("number", range(12))
def test_samples_are_well_formed(number):
    """Pictures are uint8 of the stated size; labels are finite, inside or near the picture, with unit headings."""
    sample = make_sample(np.random.default_rng([21, number]))
    assert sample.image.shape == sample.background.shape == (SCENE_PX, SCENE_PX, 3)
    assert sample.image.dtype == sample.background.dtype == np.uint8
    assert sample.labels.shape[1] == LABEL_FIELDS
    assert np.isfinite(sample.labels).all()
    assert np.all(np.abs(np.hypot(sample.labels[:, 3], sample.labels[:, 4]) - 1) < 1e-3)
    assert np.all(sample.labels[:, 2] > 0)


@given(
    u=st.floats(10, 180), v=st.floats(10, 180), pitch=st.floats(30, 90), roll=st.floats(-3, 3), k1=st.floats(-0.3, 0.1)
)
def test_a_floor_point_projects_back_to_its_pixel(u, v, pitch, roll, k1):
    """The floor point seen at a pixel projects to that pixel, through a distorting lens too: what labels rest on."""
    view = _view(pitch, roll, (k1, 0.02))
    point = view.floor_point((u, v))
    assert point[2] == 0.0
    assert tuple(view.project(point[None])[0]) == pytest.approx((u, v), abs=1e-3)


@given(u=st.floats(5, 185), v=st.floats(5, 185), scale=st.floats(0.3, 3))
def test_a_crop_shows_the_same_floor_scaled(u, v, scale):
    """A floor point of the whole picture lies in a crop where scale and shift put it."""
    view = _view(60.0, 0.1, (-0.2, 0.0))
    crop = view.cropped(centre_px=(100.0, 80.0), scale=scale, size_px=(64, 48))
    wanted = ((u - 100.0) * scale + 31.5, (v - 80.0) * scale + 23.5)
    assert tuple(crop.project(view.floor_point((u, v))[None])[0]) == pytest.approx(wanted, abs=1e-2)


def test_the_floor_map_is_the_floor_point_of_each_pixel():
    """The interpolated map agrees with the exact point to a third of a pixel's size on the floor."""
    view = _view(45.0, 0.2, (-0.2, 0.03))
    floor = view.floor_map()
    assert floor.shape == (SCENE_PX, SCENE_PX, 2)
    for u, v in ((0, 0), (191, 191), (50, 120), (101, 7)):
        seen = np.array([[*floor[v, u].astype(float), 0.0]])
        assert tuple(view.project(seen)[0]) == pytest.approx((u, v), abs=0.35)


@given(u=st.floats(10, 180), v=st.floats(10, 180), pitch=st.floats(30, 89), roll=st.floats(-3, 3))
def test_the_lean_points_away_from_the_camera_by_the_cosine_of_the_ray(u, v, pitch, roll):
    """Through a plain lens the lean's length is the cosine of the angle between ray and floor; upright cameras see up as up."""
    view = _view(pitch, roll)
    lean = view.lean(np.array([[u, v]]))[0]
    foot = view.floor_point((u, v)) - view.eye_m
    flat = math.hypot(foot[0], foot[1])
    assert math.hypot(*lean) == pytest.approx(flat / math.hypot(flat, foot[2]), abs=0.25)
    if abs(roll) < 0.2 and pitch < 60:
        assert lean[1] < 0


def test_straight_below_the_camera_nothing_leans():
    """At the foot of the camera's plumb line the lean is zero."""
    assert np.abs(_view(90.0).lean(np.array([[95.5, 95.5]]))).max() < 1e-3


def test_a_sample_tells_its_lean():
    """The plane kept with a sample gives the lean of its camera all over the picture, within a few hundredths."""
    sample = make_sample(np.random.default_rng([7, 3]))
    assert sample.lean.shape == (2, 3)
    rng = np.random.default_rng([7, 3])
    length_m = float(np.exp(rng.uniform(math.log(0.09), math.log(0.55))))
    view = random_stage(rng, car_length_m=length_m, size_px=SCENE_PX).view
    points = np.array([[20.0, 30.0], [170.0, 40.0], [100.0, 150.0]])
    assert np.column_stack([points, np.ones(3)]) @ sample.lean.T == pytest.approx(view.lean(points), abs=0.12)


@pytest.mark.parametrize("seed", range(20))
def test_stages_show_a_car_of_the_wanted_size(seed):
    """Whatever camera is drawn, it looks down from 0.7 to 4 m, and a car at the sample's middle is about 5 to 90 px long."""
    rng = np.random.default_rng(seed)
    camera = random_camera(rng)
    assert 0.7 <= camera.eye_m[2] <= 4.0
    assert camera.rotation[2, 2] < -0.25  # the optical axis goes down
    stage = random_stage(rng, car_length_m=0.3, size_px=SCENE_PX)
    middle = stage.view.floor_point(((SCENE_PX - 1) / 2, (SCENE_PX - 1) / 2))
    assert 5.0 < 0.3 * stage.view.px_per_m(middle) < 95.0


@pytest.mark.parametrize("pitch", [35.0, 50.0, 90.0])
@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
def test_the_label_is_the_projected_middle_of_the_footprint(pitch, yaw):
    """A car placed at a pixel is labelled with that pixel, wherever it looks and however steep the view."""
    view = _view(pitch)
    body = body_of(any_car(np.random.default_rng(5), 0.3))
    placed = place_car(view, body, (101.25, 130.5), yaw, np.random.default_rng(0), 0.3)
    assert tuple(label_of(placed, view)[:2]) == pytest.approx((101.25, 130.5), abs=1e-3)


def _drawn(solids, view):
    canvas = blank(view)
    assert draw(canvas, body_of(solids), view, LIGHT)
    return flatten([canvas], view)


def test_the_drawn_body_stands_on_its_label():
    """A flat plate's drawn pixels have their centre of mass at the label, and no more of them than its area."""
    view = _view(90.0)
    at = view.floor_point((90.3, 110.7))
    _, alpha = _drawn([box((float(at[0]), float(at[1]), 0.0005), (0.3, 0.2, 0.001), (200.0, 200.0, 200.0))], view)
    rows, columns = np.mgrid[0:SCENE_PX, 0:SCENE_PX]
    mass = float(alpha.sum())
    middle = (float((columns * alpha).sum()) / mass, float((rows * alpha).sum()) / mass)
    assert middle == pytest.approx((90.3, 110.7), abs=0.2)
    assert mass == pytest.approx(0.3 * 0.2 * view.px_per_m(at) ** 2, rel=0.06)


def test_what_is_nearer_hides_what_is_behind():
    """A high box between camera and car hides the car, and the share that is still seen says so."""
    view = _view(40.0)
    car = body_of([box((0.0, 2.4, 0.05), (0.2, 0.1, 0.1), (0.0, 0.0, 255.0))])
    wall = body_of([box((0.0, 2.2, 0.25), (1.0, 0.02, 0.5), (255.0, 0.0, 0.0))])
    canvas = blank(view)
    draw(canvas, car, view, LIGHT)
    assert visible_share(canvas, car, view) > 0.98
    draw(canvas, wall, view, LIGHT)
    assert visible_share(canvas, car, view) < 0.02


def test_a_moving_car_is_smeared_along_its_way_about_its_label():
    """The instants of an exposure are spread over the way driven in it, their middle being where the label stands."""
    view = _view(90.0)
    body = body_of([box((0.0, 0.0, 0.01), (0.1, 0.1, 0.02), (255.0, 255.0, 255.0))])
    car = PlacedCar(body=body, ground_m=(0.0, 0.0), yaw_rad=0.0, travel_m=0.2, exposure=0.5)
    moments = exposed(car, view, 1e9)
    middles = [float(moment.corners_m[..., 0].mean()) for moment in moments]
    assert len(moments) > 2
    assert np.mean(middles) == pytest.approx(0.0, abs=1e-9)
    assert max(middles) - min(middles) == pytest.approx(0.1 * (1 - 1 / len(moments)), rel=1e-6)


def test_a_rolling_shutter_shows_lower_rows_later():
    """Driving to the right, the lower rows of a car are further to the right than the upper ones, by the way driven."""
    view = _view(90.0)
    body = body_of([box((0.0, 0.0, 0.01), (0.1, 0.3, 0.02), (255.0, 255.0, 255.0))])
    car = PlacedCar(body=body, ground_m=(0.0, 0.0), yaw_rad=0.0, travel_m=0.2, exposure=0.0)
    (moment,) = exposed(car, view, SCENE_PX)
    rows = view.project(moment.corners_m.reshape(-1, 3))[:, 1]
    shift = (moment.corners_m - body.corners_m)[..., 0].ravel()
    assert shift[rows.argmax()] - shift[rows.argmin()] == pytest.approx(0.9 * 0.2 * np.ptp(rows) / SCENE_PX, rel=0.05)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_cars_stand_on_the_floor_about_their_origin(seed):
    """Every car's lowest points are at z = 0 or just above, and its body is roughly centred and about as long as asked."""
    car = any_car(np.random.default_rng(seed), 0.4)
    corners = np.concatenate([solid.vertices_m for solid in car])
    assert np.isfinite(corners).all()
    assert -0.03 < corners[:, 2].min() < 0.05
    assert 0.3 < np.ptp(corners[:, 0]) < 0.65
    assert abs(corners[:, 0].max() + corners[:, 0].min()) < 0.2


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_clutter_is_finite(seed):
    """No thing has a corner that is not a number, whatever is drawn."""
    for thing in (any_static(np.random.default_rng(seed)), any_mover(np.random.default_rng(seed))):
        assert all(np.isfinite(solid.vertices_m).all() for solid in thing)


def test_the_background_lacks_what_moved():
    """On average the picture differs from its background most where the cars are."""
    inside: list[float] = []
    outside: list[float] = []
    for number in range(30):
        sample = make_sample(np.random.default_rng([33, number]))
        apart = cv2.absdiff(sample.image, sample.background).max(axis=2).astype(float)
        for u, v, length, *_ in sample.labels[sample.labels[:, 5] > 0]:
            rows, columns = np.mgrid[0:SCENE_PX, 0:SCENE_PX]
            near = np.hypot(columns - u, rows - v) < length * 0.25
            if near.any():
                inside.append(float(apart[near].mean()))
                outside.append(float(np.median(apart)))
    assert np.median(inside) > 3 * np.median(outside)


def test_assets_without_photographs_are_refused(tmp_path):
    """An assets folder that holds no photograph is an InputError that says what to do; none at all is fine."""
    with pytest.raises(InputError, match="leave --assets out"):
        asset_photos(tmp_path)
    assert asset_photos(None) == ([], [])
    assert SHARD_SAMPLES > 0
