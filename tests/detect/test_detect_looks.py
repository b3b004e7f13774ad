"""Windows, tiles and the whole frame: what of a frame the network sees, and the way back to frame px."""

from itertools import pairwise

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.detect.looks import halved, halvings, look_pixels, tile_looks, whole_look, whole_pixels, window_look


@pytest.mark.parametrize(("length", "side"), [(36.0, 160), (72.0, 320), (18.0, 80), (9.0, 40)])
def test_a_window_scales_the_car_to_the_wanted_length(length, side):
    """The window's side follows from the expected length, whatever the frame's size."""
    look = window_look((300.0, 200.0), length, window_px=160, window_length_px=36.0)
    assert (look.width_px, look.height_px, look.out_width_px) == (side, side, 160)


@given(u=st.floats(-20, 1300), v=st.floats(-20, 740), length=st.floats(8, 150))
def test_the_middle_of_a_window_is_the_expected_point(u, v, length):
    """A window's centre maps back to the place it was made for, to within its rounding."""
    look = window_look((u, v), length, window_px=160, window_length_px=36.0)
    back = look.to_frame(79.5, 79.5)
    assert back == pytest.approx((u, v), abs=1.01)


@pytest.mark.parametrize("step", [1, 2, 4, 8])
@given(u=st.floats(-20, 1300), v=st.floats(-20, 740), length=st.floats(8, 150))
def test_windows_keep_to_the_backgrounds_grid(step, u, v, length):
    """A window's edges are whole background px, and its centre is no farther off than that costs."""
    look = window_look((u, v), length, window_px=128, window_length_px=44.0, step_px=step)
    assert all(edge % step == 0 for edge in (look.left_px, look.top_px, look.width_px, look.height_px))
    assert look.to_frame(63.5, 63.5) == pytest.approx((u, v), abs=0.5 * step + 0.01)


@pytest.mark.parametrize("size", [(1280, 720), (1920, 1080), (3840, 2160), (640, 480), (800, 1280)])
def test_tiles_cover_the_frame_and_stay_inside_it(size):
    """Every pixel of the frame lies in a tile, no tile sticks out, and neighbours overlap by what was asked."""
    tiles = tile_looks(*size, working_width_px=1280, tile_px=(320, 256), overlap_px=32, step_px=2)
    covered = np.zeros((size[1], size[0]), dtype=bool)
    for tile in tiles:
        assert tile.left_px >= 0
        assert tile.top_px >= 0
        assert tile.left_px + tile.width_px <= size[0]
        assert tile.top_px + tile.height_px <= size[1]
        covered[tile.top_px : tile.top_px + tile.height_px, tile.left_px : tile.left_px + tile.width_px] = True
    assert covered.all()
    lefts = sorted({(tile.left_px, tile.left_px + tile.width_px) for tile in tiles})
    assert all(right - left >= 32 * tiles[0].width_px / 320 - 2 for (_, right), (left, _) in pairwise(lefts))


def test_a_small_frame_is_one_tile():
    """A frame no larger than a tile is seen whole in one pass."""
    (tile,) = tile_looks(320, 240, working_width_px=1280, tile_px=(320, 256))
    assert (tile.width_px, tile.height_px) == (320, 240)


@pytest.mark.parametrize(("width", "times"), [(320, 0), (640, 0), (799, 0), (800, 1), (1280, 1), (1920, 2), (3840, 3)])
def test_frames_are_halved_to_a_like_size(width, times):
    """Whatever the camera's size, the background is 400 to 799 px wide where the frame is."""
    assert halvings(width, 400) == times


def test_halving_takes_the_mean_of_four():
    """Each pixel of a halved picture is the mean of its four, and an odd row or column falls away."""
    picture = np.random.default_rng(2).integers(0, 256, (7, 9, 3), dtype=np.uint8)
    means = picture[:6, :8].reshape(3, 2, 4, 2, 3).astype(float).mean(axis=(1, 3))
    assert np.abs(halved(picture, 1) - means).max() <= 0.5


@pytest.mark.parametrize("centre", [(200.0, 150.0), (5.0, 5.0), (398.0, 299.0), (333.3, 77.7)])
@pytest.mark.parametrize("length", [14.0, 36.0, 80.0])
def test_what_moved_appears_in_the_right_place_of_the_difference(centre, length):
    """A disc that is in the frame and not in the reduced background appears at its own place in the window's fourth channel."""
    frame = np.full((300, 400, 3), 90, np.uint8)
    background = halved(frame, 1)
    cv2.circle(frame, (round(centre[0]), round(centre[1])), max(3, round(length / 4)), (230, 230, 230), -1)
    look = window_look(centre, length, window_px=160, window_length_px=36.0, step_px=2)
    moved = look_pixels(frame, background, look, 0.5)[:, :, 3].astype(float)
    rows, columns = np.mgrid[0:160, 0:160]
    inside = (rows > 2) & (columns > 2)
    weight = moved * inside
    assert moved.max() > 100
    if centre in {(200.0, 150.0), (333.3, 77.7)}:
        middle = look.to_frame(
            float((columns * weight).sum() / weight.sum()), float((rows * weight).sum() / weight.sum())
        )
        assert middle == pytest.approx((round(centre[0]), round(centre[1])), abs=0.6)


def test_fine_texture_that_the_background_cannot_resolve_is_no_motion():
    """A still picture of single-pixel stripes differs from its own reduced background by nothing, in every window."""
    frame = np.zeros((300, 400, 3), np.uint8)
    frame[:, ::2] = 255
    background = halved(frame, 1)
    look = window_look((200.0, 150.0), 20.0, window_px=160, window_length_px=36.0, step_px=2)
    assert look_pixels(frame, background, look, 0.5)[:, :, 3].max() <= 1


def test_a_window_off_the_frame_is_black_and_does_not_fail():
    """A prediction far outside the picture gives an empty window, not an error."""
    frame = np.full((100, 100, 3), 200, np.uint8)
    look = window_look((900.0, -500.0), 30.0, window_px=160, window_length_px=36.0)
    assert look_pixels(frame, frame, look, 1.0).max() == 0


def test_no_background_and_a_change_everywhere_give_no_difference():
    """The difference is zero where there is no background, and where more than the given share of the window has moved."""
    frame = np.full((100, 100, 3), 200, np.uint8)
    look = window_look((50.0, 50.0), 30.0, window_px=128, window_length_px=44.0)
    assert look_pixels(frame, None, look, 1.0)[:, :, 3].max() == 0
    assert look_pixels(frame, frame // 2, look, 1.0)[:, :, 3].min() == 100
    assert look_pixels(frame, frame // 2, look, 1.0, most_moved=0.6)[:, :, 3].max() == 0


def test_sides_are_padded_to_multiples_of_sixteen():
    """The network takes multiples of 16 only: 448x252 is padded to 448x256."""
    reduced = np.zeros((360, 640, 3), np.uint8)
    moved = np.zeros((360, 640), np.uint8)
    assert whole_pixels(reduced, moved, whole_look(1280, 720, 448)).shape == (256, 448, 4)
