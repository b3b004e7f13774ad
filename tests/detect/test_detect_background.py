"""The background learns the floor, forgets ghosts, and never learns a followed car."""

from collections.abc import Sequence

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


def _background(first: np.ndarray, *, scale: float = 1.0, **changes: int) -> Background:
    """A background that looks at the whole picture in each frame."""
    return Background(first, scale=scale, settings=BackgroundSettings(bands=1, **changes))


def _update(background: Background, picture: np.ndarray, *, frozen: Sequence[Disc] = ()) -> np.ndarray:
    rows = background.rows()
    moved = background.compare(picture[rows], rows)
    background.learn(picture[rows], rows, frozen=frozen)
    return moved


@settings(max_examples=25, deadline=None)
@given(
    path=st.lists(st.tuples(st.integers(20, 140), st.integers(20, 70)), min_size=1, max_size=6),
    pause=st.integers(1, 40),
    scale=st.sampled_from([0.25, 0.5, 1.0]),
)
def test_a_followed_car_is_never_learnt(path, pause, scale):
    """However long a followed car stands anywhere, no pixel of it enters the background."""
    background = _background(_floor(), scale=scale)
    for centre in path:
        disc = Disc(centre_px=((centre[0] + 0.5) / scale - 0.5, (centre[1] + 0.5) / scale - 0.5), radius_px=12 / scale)
        for _ in range(pause):
            _update(background, _with_car(_floor(), centre), frozen=[disc])
            assert difference(background.picture, _floor()).max() == 0


def test_a_standing_car_that_is_lost_for_a_moment_is_not_learnt():
    """A car that was frozen and is not for `hold_looks` looks, as when its target was lost, stays out of the background."""
    background = _background(_floor(), hold_looks=8, stable_looks=4)
    car = _with_car(_floor(), (60, 40))
    disc = Disc(centre_px=(60.0, 40.0), radius_px=12.0)
    for _ in range(10):
        for _ in range(5):
            _update(background, car, frozen=[disc])
        for _ in range(9):
            _update(background, car)
    assert difference(background.picture, _floor()).max() == 0
    for _ in range(6):
        _update(background, car)
    assert difference(background.picture, _floor()).max() > 20, "and it is learnt once nobody follows it"


def test_a_car_that_drives_through_unfollowed_is_not_learnt():
    """A pixel that shows something for fewer looks than `stable_looks` keeps the floor."""
    background = _background(_floor(), stable_looks=4)
    for step in range(12):
        _update(background, _with_car(_floor(), (15 + 10 * step, 40)))
    assert difference(background.picture, _floor()).max() == 0


def test_the_ghost_of_the_first_frame_goes():
    """A car in the very first frame is in the background at first and gone some looks after it drove off."""
    background = _background(_with_car(_floor(), (40, 40)), stable_looks=4)
    assert difference(background.picture, _floor()).max() > 50
    for _ in range(14):
        _update(background, _floor())
    assert difference(background.picture, _floor()).max() <= 2


@pytest.mark.parametrize("level", [100, 118, 135, 180, 250])
def test_a_change_of_light_is_learnt(level):
    """After the light has changed the difference is small again within a few looks, and the background settled."""
    background = _background(_floor(120))
    for _ in range(14):
        _update(background, _floor(level))
    assert difference(background.picture, _floor(level)).max() <= 2
    assert background.settled


def test_a_light_switched_on_unsettles_until_it_is_learnt():
    """From the look that sees it the background is unsettled, learns every band in each frame, and soon is settled again."""
    background = Background(_floor(100), scale=1.0)
    bright, unsettled = _floor(180), 0
    for number in range(60):
        rows = background.rows()
        background.compare(bright[rows], rows)
        background.learn(bright[rows], rows)
        unsettled += not background.settled
        if number > 20:
            assert background.settled
    assert 3 <= unsettled <= 8
    assert difference(background.picture, bright).max() <= 2


def test_a_car_alone_does_not_unsettle():
    """Something that moves in one place, even a large thing, leaves the background settled."""
    background = _background(_floor())
    for step in range(0, 100, 10):
        _update(background, _with_car(_floor(), (20 + step, 40)))
        assert background.settled
    person = _floor()
    person[:, 50:100] = 30
    _update(background, person)
    assert background.settled


def test_the_followed_car_stays_out_while_the_light_is_learnt():
    """Catching up with a new light stops at the frozen discs, in which the old background stays."""
    background = _background(_floor(100))
    bright = _with_car(_floor(180), (60, 40))
    for _ in range(20):
        _update(background, bright, frozen=[Disc(centre_px=(60.0, 40.0), radius_px=12.0)])
    assert background.settled
    assert difference(background.picture, bright)[40, 60] > 50
    assert difference(background.picture, bright)[10, 10] <= 2


def test_a_bump_of_the_camera_is_learnt():
    """The edges that a bump leaves in the difference are gone within some looks."""
    texture = np.random.default_rng(0).integers(0, 255, (*SIZE, 3), dtype=np.uint8)
    moved = np.roll(texture, 2, axis=1)
    background = _background(texture)
    for _ in range(16):
        _update(background, moved)
    assert difference(background.picture, moved).max() <= 2


def test_bands_cover_the_picture_in_turn():
    """One band of rows a frame, all of them in turn, whatever the picture's height."""
    for height in (3, 90, 135, 360):
        background = Background(np.zeros((height, 64, 3), np.uint8), scale=1.0)
        seen = np.zeros(height, int)
        for _ in range(3 * len(range(0, height, background.rows().stop))):
            rows = background.rows()
            seen[rows] += 1
            background.learn(np.zeros((rows.stop - rows.start, 64, 3), np.uint8), rows)
        assert set(seen.tolist()) == {3}


def test_moved_cells_tell_where():
    """A thing that has moved shows in its own cells of four px, and nowhere else."""
    background = _background(_floor())
    picture = _floor()
    picture[40:48, 80:88] = 250
    _update(background, picture)
    moved = background.moved_cells > 20
    assert moved.sum() == 4
    assert moved[10:12, 20:22].all()
