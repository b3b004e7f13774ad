"""The lane in the picture, by its colour."""

import colorsys

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from twin_pictures import PINK, painted, ring

from dnb_edge.errors import InputError
from dnb_edge.track.twin import LaneColour, default_close_gap_px, lane_mask, load_twin


def filled(bgr, mask):
    image = np.full((*mask.shape, 3), 255, dtype=np.uint8)
    image[mask] = bgr
    return image


@settings(max_examples=40, deadline=None)
@given(hue=st.integers(0, 359), saturation=st.integers(35, 100), value=st.integers(30, 100))
def test_any_colour_finds_its_lane(hue, saturation, value):
    """Round the whole colour circle, red's two ends included, a lane is found by its HSV as drawing programs give it."""
    red, green, blue = (round(255 * x) for x in colorsys.hsv_to_rgb(hue / 360, saturation / 100, value / 100))
    lane = np.zeros((60, 60), dtype=bool)
    lane[10:50, 10:50] = True
    colour = LaneColour(hue_deg=hue, saturation_percent=saturation, value_percent=value)
    assert np.array_equal(lane_mask(filled((blue, green, red), lane), colour, source="x", close_gap_px=2), lane)


@pytest.mark.parametrize(("seen", "given"), [(5, 355), (355, 5), (0, 360), (359, 1), (180, 190)])
def test_hues_are_near_round_the_circle(seen, given):
    """Five degrees and 355 degrees are ten degrees apart."""
    red, green, blue = (round(255 * x) for x in colorsys.hsv_to_rgb(seen / 360, 0.8, 0.8))
    lane = np.ones((9, 9), dtype=bool)
    colour = LaneColour(hue_deg=given, saturation_percent=80, value_percent=80)
    assert lane_mask(filled((blue, green, red), lane), colour, source="x", close_gap_px=2).all()


@pytest.mark.parametrize(
    ("bgr", "hsv"), [((128, 128, 128), (0, 0, 50)), ((10, 10, 10), (200, 40, 5)), ((70, 64, 66), (90, 5, 27))]
)
def test_grey_and_black_lanes_need_no_hue(bgr, hsv):
    """Tape and asphalt have no hue: whatever hue is given for them, they are found."""
    lane = np.zeros((60, 60), dtype=bool)
    lane[10:50, 10:50] = True
    colour = LaneColour(hue_deg=hsv[0], saturation_percent=hsv[1], value_percent=hsv[2])
    assert np.array_equal(lane_mask(filled(bgr, lane), colour, source="x", close_gap_px=2), lane)


def test_a_missing_colour_names_what_is_there():
    """The error says what was sought, and the picture's most common colours, so that the right one can be copied."""
    green = LaneColour(hue_deg=120, saturation_percent=80, value_percent=60)
    with pytest.raises(InputError) as caught:
        lane_mask(painted(ring()), green, source="twin.png", close_gap_px=2)
    text = str(caught.value)
    assert text.startswith("twin.png: no pixel of the picture within hue 120 +- 20 deg, saturation 80 +- 14 %")
    assert "grey or white saturation 0 % value 100 %" in text
    assert "hue 330 deg saturation 23 % value 84 % (16%)" in text


def test_a_few_stray_pixels_are_no_lane():
    """A dot of the lane's colour does not pass for a lane."""
    dot = np.zeros((400, 400), dtype=bool)
    dot[:5, :5] = True
    with pytest.raises(InputError, match="only 25 pixels"):
        lane_mask(painted(dot), PINK, source="x", close_gap_px=2)


def test_specks_go_and_pinholes_close():
    """Stray pieces and small holes are drawing, large holes are the infield."""
    mask = ring()
    spotted = mask.copy()
    spotted[5:10, 5:10] = True
    spotted[66:74, 196:204] = False
    found = lane_mask(painted(spotted), PINK, source="x", close_gap_px=3)
    assert not found[7, 7]
    assert found[66:74, 196:204].all()
    assert np.count_nonzero(found ^ mask) < 0.002 * mask.sum()
    assert not found[200, 200]


def test_closing_does_not_glue_the_lane_to_the_pictures_edge():
    """A lane a pixel from the edge stays as wide as it is."""
    lane = np.zeros((60, 60), dtype=bool)
    lane[2:20, 2:58] = True
    assert np.array_equal(lane_mask(painted(lane), PINK, source="x", close_gap_px=9), lane)


def test_the_default_gap_follows_the_picture():
    """0.4 % of the longest side, and two pixels at the least."""
    assert default_close_gap_px(np.zeros((2540, 2537, 3), dtype=np.uint8)) == pytest.approx(10.16)
    assert default_close_gap_px(np.zeros((40, 30, 3), dtype=np.uint8)) == 2.0


def test_pictures_that_cannot_be_read(tmp_path):
    """A missing file, an empty one, a directory and a text are each one line with the path."""
    text = tmp_path / "notes.png"
    text.write_text("not a picture")
    empty = tmp_path / "empty.png"
    empty.touch()
    for path, pattern in ((tmp_path / "none.png", "No such file"), (empty, "not an image"), (text, "not an image"),
                          (tmp_path, "Is a directory")):  # fmt: skip
        with pytest.raises(InputError, match=pattern) as caught:
            load_twin(path)
        assert str(caught.value).startswith(str(path))


def test_a_grey_picture_and_one_with_alpha_load_as_colour(tmp_path):
    """Whatever the file holds, the twin is blue-green-red."""
    for channels in (1, 4):
        path = tmp_path / f"{channels}.png"
        cv2.imwrite(str(path), np.full((4, 5, channels), 200, dtype=np.uint8))
        assert load_twin(path).shape == (4, 5, 3)


@pytest.mark.parametrize(
    "changes", [{"hue_deg": 361}, {"saturation_percent": -1}, {"value_percent": 101}, {"hue_tolerance_deg": 0}]
)
def test_colours_out_of_range_are_refused(changes):
    """A number outside its range is named."""
    with pytest.raises(InputError, match=next(iter(changes))):
        LaneColour(**{"hue_deg": 330, "saturation_percent": 20, "value_percent": 80, **changes})
