"""Floors and lanes: in range, the same for a seed, and lanes touch only what lies near them."""

import math

import numpy as np
import pytest

from dnb_edge.train.camera import overhead_view
from dnb_edge.train.floor_textures import _KINDS, TEXTURE_PX
from dnb_edge.train.floors import laid_texture, light_patches, paint_lanes, photo_crop, procedural_texture, track_walls
from dnb_edge.train.lanes import Lane, _Painter, any_lane


def _view(pitch_deg: float = 60.0, radial=(0.0, 0.0)):
    return overhead_view(
        width_px=160,
        height_px=112,
        camera_height_m=2.0,
        pitch_rad=math.radians(pitch_deg),
        field_of_view_rad=1.0,
        radial=radial,
    )


@pytest.mark.parametrize("kind", [kind for kind, _ in _KINDS], ids=lambda kind: kind.__name__)
def test_a_texture_is_finite_and_in_range_and_repeats_by_seed(kind):
    """Each kind of floor makes (512, 512, 3) floats that are colours, give or take noise, the same for a seed."""
    one, again = (kind(np.random.default_rng(4)) for _ in range(2))
    assert one.shape == (TEXTURE_PX, TEXTURE_PX, 3)
    assert one.dtype == np.float32
    assert np.array_equal(one, again)
    assert one.min() > -60
    assert one.max() < 450


def test_any_texture_is_clipped_to_colours():
    """What scenes take is within 0..255."""
    for seed in range(8):
        made = procedural_texture(np.random.default_rng(seed))
        assert made.min() >= 0
        assert made.max() <= 255


@pytest.mark.parametrize("pitch_deg", [5.0, 25.0, 60.0, 90.0])
def test_a_floor_fills_a_picture_that_is_not_square_even_above_the_horizon(pitch_deg):
    """The texture, lanes, light and walls work for wide pictures, bent lenses and views that see the horizon."""
    view = _view(pitch_deg, (-0.1, 0.01))
    for seed in range(6):
        rng = np.random.default_rng(seed)
        picture = laid_texture(procedural_texture(rng), view, rng)
        assert picture.shape == (112, 160, 3)
        paint_lanes(picture, view, 0.3, rng)
        assert np.isfinite(picture).all()
        gain = light_patches(view, rng)
        assert gain.shape == (112, 160, 1)
        assert 0.1 < gain.min() <= gain.max() < 7
        walls = track_walls(view, 0.3, rng)
        assert walls
        assert min(solid.vertices_m[:, 2].min() for solid in walls) > -1e-9


def test_a_checked_texture_is_laid_in_its_place():
    """A texture that is white in one half shows as a straight edge in a picture from straight above."""
    texture = np.zeros((TEXTURE_PX, TEXTURE_PX, 3), dtype=np.float32)
    texture[:, 256:] = 255.0
    picture = laid_texture(texture, _view(90.0), np.random.default_rng(1))
    assert 0 < (picture > 127).mean() <= 1
    assert ((picture > 5) & (picture < 250)).mean() < 0.1


def test_a_strip_changes_only_pixels_near_it():
    """Pixels farther from the strip than its half width and a pixel's breadth keep their values; those inside change."""
    view = _view(60.0, (-0.1, 0.0))
    x = np.linspace(-1.0, 1.0, 100)
    ahead = view.floor_point((80.0, 56.0))[1]
    lane = Lane(path_m=np.column_stack([x, np.full(100, ahead)]), left=np.tile([0.0, 1.0], (100, 1)), width_m=0.3)
    picture = np.full((112, 160, 3), 100.0, dtype=np.float32)
    _Painter(picture, view, lane).strip(0.0, 0.2, (200.0, 10.0, 10.0))
    floor = view.floor_map()
    off = np.abs(floor[:, :, 1] - ahead)
    inside = np.abs(floor[:, :, 0]) < 0.9
    assert np.all(picture[(off > 0.13)] == 100.0)
    assert np.all(picture[(off < 0.07) & inside][:, 0] > 150.0)


def test_lanes_repeat_by_seed_and_pass_through_the_picture():
    """The same seed paints the same; a lane's middle is seen in the picture."""
    view, pictures = _view(), []
    for _ in range(2):
        picture = np.full((112, 160, 3), 100.0, dtype=np.float32)
        paint_lanes(picture, view, 0.3, np.random.default_rng(11))
        pictures.append(picture)
    assert np.array_equal(*pictures)
    assert (pictures[0] != 100.0).any()
    for seed in range(10):
        lane = any_lane(view, 0.3, np.random.default_rng(seed))
        seen = view.project(np.column_stack([lane.path_m, np.zeros(len(lane.path_m))]))
        assert ((seen > 0) & (seen < (160, 112))).all(axis=1).any()


def test_a_photo_crop_is_square_and_in_range():
    """A crop of a photograph keeps its values in 0..255."""
    photo = np.random.default_rng(0).integers(0, 256, (90, 140, 3), dtype=np.uint8)
    made = photo_crop([photo], 64, np.random.default_rng(1))
    assert made.shape == (64, 64, 3)
    assert 0 <= made.min() <= made.max() <= 255
