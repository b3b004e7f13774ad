"""Windows, tiles and the whole frame: what of a frame the network sees, and the way back to frame px."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.detect.looks import look_pixels, reduce_frame, tile_looks, whole_look, whole_pixels, window_look


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


@pytest.mark.parametrize("size", [(1280, 720), (1920, 1080), (3840, 2160), (640, 480), (800, 1280)])
def test_tiles_cover_the_frame_and_stay_inside_it(size):
    """Every pixel of the frame lies in a tile, no tile sticks out, and none is needed where the frame is small."""
    tiles = tile_looks(*size, fine_width_px=1280, tile_px=(448, 384))
    covered = np.zeros((size[1], size[0]), dtype=bool)
    for tile in tiles:
        assert tile.left_px >= 0
        assert tile.top_px >= 0
        assert tile.left_px + tile.width_px <= size[0]
        assert tile.top_px + tile.height_px <= size[1]
        covered[tile.top_px : tile.top_px + tile.height_px, tile.left_px : tile.left_px + tile.width_px] = True
    assert covered.all()


def test_a_small_frame_needs_no_tile():
    """A frame no larger than a tile is seen whole in one pass."""
    assert tile_looks(320, 240, fine_width_px=1280, tile_px=(448, 384)) == []


@pytest.mark.parametrize("centre", [(200.0, 150.0), (5.0, 5.0), (398.0, 299.0), (333.3, 77.7)])
@pytest.mark.parametrize("length", [14.0, 36.0, 80.0])
def test_what_moved_appears_in_the_right_place_of_the_difference(centre, length):
    """A disc that is in the frame and not in the reduced background appears at its own place in the window's fourth channel."""
    frame = np.full((300, 400, 3), 90, np.uint8)
    whole = whole_look(400, 300, 200)
    background = reduce_frame(frame, whole)
    cv2.circle(frame, (round(centre[0]), round(centre[1])), max(3, round(length / 4)), (230, 230, 230), -1)
    look = window_look(centre, length, window_px=160, window_length_px=36.0)
    moved = look_pixels(frame, background, look, whole.scale)[:, :, 3].astype(float)
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
    whole = whole_look(400, 300, 200)
    background = reduce_frame(frame, whole)
    look = window_look((200.0, 150.0), 20.0, window_px=160, window_length_px=36.0)
    assert look_pixels(frame, background, look, whole.scale)[:, :, 3].max() <= 1


def test_a_window_off_the_frame_is_black_and_does_not_fail():
    """A prediction far outside the picture gives an empty window, not an error."""
    frame = np.full((100, 100, 3), 200, np.uint8)
    look = window_look((900.0, -500.0), 30.0, window_px=160, window_length_px=36.0)
    assert look_pixels(frame, frame, look, 1.0).max() == 0


def test_sides_are_padded_to_multiples_of_sixteen():
    """The network takes multiples of 16 only: 640x360 is padded to 640x368."""
    reduced = np.zeros((360, 640, 3), np.uint8)
    assert whole_pixels(reduced, reduced).shape == (368, 640, 4)
