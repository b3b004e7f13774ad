"""The background learns the floor, forgets ghosts, and never learns a followed car."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnb_edge.detect.background import Background, BackgroundSettings, Disc, difference

SIZE = (90, 160)


def _floor(level: int = 120) -> np.ndarray:
    return np.full((*SIZE, 3), level, np.uint8)


def _with_car(picture: np.ndarray, centre: tuple[int, int]) -> np.ndarray:
    out = picture.copy()
    cv2.rectangle(out, (centre[0] - 6, centre[1] - 4), (centre[0] + 6, centre[1] + 4), (20, 20, 230), -1)
    return out


def _background(**changes: int) -> Background:
    return Background(BackgroundSettings(every_frames=1, **changes))


def _learnt(background: Background) -> np.ndarray:
    assert background.picture is not None
    return background.picture


@settings(max_examples=25, deadline=None)
@given(
    path=st.lists(st.tuples(st.integers(20, 140), st.integers(20, 70)), min_size=1, max_size=6),
    pause=st.integers(1, 40),
    scale=st.sampled_from([0.25, 0.5, 1.0]),
)
def test_a_followed_car_is_never_learnt(path, pause, scale):
    """However long a followed car stands anywhere, no pixel of it enters the background."""
    background = _background()
    background.update(_floor(), scale=scale)
    for centre in path:
        disc = Disc(centre_px=((centre[0] + 0.5) / scale - 0.5, (centre[1] + 0.5) / scale - 0.5), radius_px=12 / scale)
        for _ in range(pause):
            background.update(_with_car(_floor(), centre), scale=scale, frozen=[disc])
            assert difference(_learnt(background), _floor()).max() == 0


def test_a_car_that_drives_through_unfollowed_is_not_learnt():
    """A pixel that shows something for fewer looks than `stable_looks` keeps the floor."""
    background = _background(stable_looks=4)
    background.update(_floor(), scale=1.0)
    for step in range(12):
        background.update(_with_car(_floor(), (15 + 10 * step, 40)), scale=1.0)
    assert difference(_learnt(background), _floor()).max() == 0


def test_the_ghost_of_the_first_frame_goes():
    """A car in the very first frame is in the background at first and gone some looks after it drove off."""
    background = _background(stable_looks=4)
    background.update(_with_car(_floor(), (40, 40)), scale=1.0)
    assert difference(_learnt(background), _floor()).max() > 50
    for _ in range(12):
        background.update(_floor(), scale=1.0)
    assert difference(_learnt(background), _floor()).max() <= 2


@pytest.mark.parametrize("level", [100, 118, 135, 180])
def test_a_change_of_light_is_learnt(level):
    """After the light has changed the difference is small again within a few looks."""
    background = _background()
    background.update(_floor(120), scale=1.0)
    for _ in range(14):
        background.update(_floor(level), scale=1.0)
    assert difference(_learnt(background), _floor(level)).max() <= 2


def test_a_bump_of_the_camera_is_learnt():
    """The edges that a bump leaves in the difference are gone within some looks."""
    texture = np.random.default_rng(0).integers(0, 255, (*SIZE, 3), dtype=np.uint8)
    moved = np.roll(texture, 2, axis=1)
    background = _background()
    background.update(texture, scale=1.0)
    for _ in range(16):
        background.update(moved, scale=1.0)
    assert difference(_learnt(background), moved).max() <= 2


def test_a_frame_of_another_size_starts_afresh():
    """A background never mixes frames of two sizes."""
    background = _background()
    background.update(_floor(), scale=1.0)
    background.update(np.zeros((40, 60, 3), np.uint8), scale=1.0)
    assert _learnt(background).shape == (40, 60, 3)


def test_only_every_nth_frame_is_due():
    """The background asks for the first frame and then for every n-th."""
    background = Background(BackgroundSettings(every_frames=3))
    assert [background.is_due() for _ in range(7)] == [True, False, False, True, False, False, True]
