"""Drawn scenes: the same for a seed, and labelled exactly."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnb_edge.errors import InputError
from dnb_edge.train.camera import look_at_floor
from dnb_edge.train.cars import any_car
from dnb_edge.train.clutter import any_mover, any_static
from dnb_edge.train.render import Light, draw
from dnb_edge.train.scene import LABEL_FIELDS, SCENE_PX, make_sample, place_car
from dnb_edge.train.shards import SHARD_SAMPLES, asset_photos
from dnb_edge.train.solids import box

LIGHT = Light(direction=np.array([0.0, 0.0, 1.0]), ambient=0.6, shadow_strength=0.4, shadow_blur_px=1.0)


def _view(elevation_deg: float = 50.0, roll: float = 0.0, px_per_m: float = 120.0):
    return look_at_floor(
        size_px=SCENE_PX,
        elevation_rad=math.radians(elevation_deg),
        distance_m=4.0,
        px_per_m=px_per_m,
        roll_rad=roll,
        shear=np.eye(2),
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


@given(u=st.floats(30, 190), v=st.floats(30, 190), elevation=st.floats(20, 85), roll=st.floats(-3, 3))
def test_a_floor_point_projects_back_to_its_pixel(u, v, elevation, roll):
    """The floor point seen at a pixel projects to that pixel: what labels rest on."""
    view = _view(elevation, roll)
    point = view.floor_point((u, v))
    assert point[2] == 0.0
    assert tuple(view.project(point[None])[0]) == pytest.approx((u, v), abs=1e-6)


@pytest.mark.parametrize("elevation", [25.0, 50.0, 85.0])
@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
def test_the_label_is_the_projected_middle_of_the_footprint(elevation, yaw):
    """A car placed at a pixel is labelled with that pixel, wherever it looks and however steep the view."""
    view = _view(elevation)
    car = any_car(np.random.default_rng(5), 0.3)
    placed = place_car(view, LIGHT, car, (101.25, 130.5), yaw, np.random.default_rng(0))
    assert placed is not None
    assert placed.label is not None
    assert tuple(placed.label[:2]) == pytest.approx((101.25, 130.5), abs=1e-3)


def test_the_drawn_body_stands_on_its_label():
    """A flat plate's drawn pixels have their centre of mass at the label: no inflation, no half pixel lost."""
    view = _view(89.9)
    plate = [box((0.0, 0.0, 0.0005), (0.3, 0.2, 0.001), (200.0, 200.0, 200.0))]
    place = view.floor_point((100.3, 120.7))
    solids = [box((float(place[0]), float(place[1]), 0.0005), (0.3, 0.2, 0.001), (200.0, 200.0, 200.0))]
    assert len(plate) == len(solids)
    sprite = draw(solids, view, LIGHT, np.random.default_rng(0))
    assert sprite is not None
    rows, columns = np.mgrid[0 : sprite.alpha.shape[0], 0 : sprite.alpha.shape[1]]
    mass = float(sprite.alpha.sum())
    middle = (
        float((columns * sprite.alpha).sum()) / mass + sprite.x_px,
        float((rows * sprite.alpha).sum()) / mass + sprite.y_px,
    )
    assert middle == pytest.approx((100.3, 120.7), abs=0.15)
    assert mass == pytest.approx(0.3 * 0.2 * 120.0**2, rel=0.06)


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
