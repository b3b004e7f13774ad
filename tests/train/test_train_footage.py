"""Held-out footage: the same for a seed, with the truth where the car is drawn, and figures that notice a wrong answer."""

import itertools
import math

import numpy as np
import pytest

from dnb_edge.train.footage import FRAME_PX, Conditions, film

CONDITIONS = Conditions(camera_height_m=2.15, movers=0.0)


@pytest.fixture(scope="module", params=[3])
def clip(request):
    """Three frames of a clip."""
    return list(film(request.param, frames=3, conditions=CONDITIONS))


def test_a_seed_films_the_same_clip_for_ever(clip, request):
    """A second filming is equal to the byte, truth included."""
    seed = request.node.callspec.params["clip"]
    again = next(iter(film(seed, frames=1, conditions=CONDITIONS)))
    assert np.array_equal(clip[0].image, again.image)
    assert clip[0].ground_px == again.ground_px


def test_frames_are_whole_and_their_truth_lies_in_them(clip):
    """Frames are 1280x720; the ground point lies inside and is the floor point that the camera sees there."""
    for frame in clip:
        assert frame.image.shape == (FRAME_PX[1], FRAME_PX[0], 3)
        assert 0 <= frame.ground_px[0] < FRAME_PX[0]
        assert 0 <= frame.ground_px[1] < FRAME_PX[1]
        assert tuple(frame.view.floor_point(frame.ground_px)[:2]) == pytest.approx(frame.ground_m, abs=1e-4)
        assert frame.view.eye_m[2] == 2.15


def test_the_car_drives_ahead_and_only_there_the_picture_changes(clip):
    """From frame to frame the ground point moves along the heading, and what changes in the picture is round the car."""
    for before, after in itertools.pairwise(clip):
        du, dv = (after.ground_px[i] - before.ground_px[i] for i in (0, 1))
        assert math.hypot(du, dv) > 0.3
        assert abs(math.remainder(math.atan2(-dv, du) - before.heading_rad, 2 * math.pi)) < 0.5
        changed = np.abs(after.image.astype(int) - before.image.astype(int)).max(axis=2)
        rows, columns = np.mgrid[0 : FRAME_PX[1], 0 : FRAME_PX[0]]
        near = np.hypot(columns - after.ground_px[0], rows - after.ground_px[1]) < 1.5 * after.length_px
        assert changed[near].mean() > 1.2 * changed[~near].mean()
