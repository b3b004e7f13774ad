"""The lane by its shade, in drawn pictures and in uneven light."""

import cv2
import numpy as np
import pytest
from twin_pictures import canvas, circle, open_eight, painted, ring, rounded, stroke, two_rings, winding

from dnb_edge.errors import InputError
from dnb_edge.track.lane_shade import LaneShade
from dnb_edge.track.light import even_light
from dnb_edge.track.loop import SeveralLoops
from dnb_edge.track.route import find_route
from dnb_edge.track.twin import colour_at, colour_of, lane_mask

DARK, LIGHT, AUTO, BETWEEN = LaneShade.DARK, LaneShade.LIGHT, LaneShade.AUTO, LaneShade.BETWEEN_LINES


def shaded(mask, lane, floor):
    """A picture of a floor with a lane, both of one colour, blurred at the edges as pictures are."""
    image = np.full((*mask.shape, 3), floor, dtype=np.float64)
    image[mask] = lane
    return np.asarray(cv2.GaussianBlur(image, (0, 0), 0.6), dtype=np.uint8)


def lit(image, kind):
    """The picture in another light, or from a worse camera."""
    height, width = image.shape[:2]
    v, u = np.mgrid[0:height, 0:width]
    x, y = u / width - 0.5, v / height - 0.5
    random = np.random.default_rng(3)
    match kind:
        case "plain":
            return image
        case "window":
            factor = 1.0 - 0.65 * u / width
        case "vignette":
            factor = 1.0 - 1.2 * (x**2 + y**2)
        case "lamp":
            factor = 0.45 + 0.55 * np.exp(-((x - 0.2) ** 2 + (y + 0.2) ** 2) / 0.15)
        case "noise":
            return np.asarray(np.clip(image + random.normal(0, 9, image.shape), 0, 255), dtype=np.uint8)
        case "dim":
            factor = np.full((height, width), 0.3)
        case "jpeg":
            return cv2.imdecode(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 25])[1], cv2.IMREAD_COLOR)
    return np.asarray(np.clip(image * factor[..., None], 0, 255), dtype=np.uint8)


def found(image, shade, gap=4.0):
    return lane_mask(image, shade, source="x", close_gap_px=gap)


def overlap(one, other):
    return np.count_nonzero(one & other) / np.count_nonzero(one | other)


GREY, BLACK, VIOLET, PALE = (
    ((60, 57, 56), (156, 164, 166)),
    ((0, 0, 0), (255, 255, 255)),
    ((120, 60, 150), (215, 225, 230)),
    ((120, 120, 120), (190, 190, 190)),
)
WHITE, YELLOW = ((235, 238, 240), (60, 62, 70)), ((90, 230, 240), (90, 100, 90))


@pytest.mark.parametrize(
    ("kind", "colours"),
    [
        ("plain", BLACK),
        ("window", GREY),
        ("window", PALE),
        ("vignette", VIOLET),
        ("lamp", GREY),
        ("lamp", PALE),
        ("noise", PALE),
        ("dim", GREY),
        ("dim", BLACK),
        ("jpeg", VIOLET),
    ],
)
def test_a_dark_lane_is_found_in_any_light(kind, colours):
    """Whatever the light, a lane darker than its floor is found to within 4 % of its area.

    By `auto`, which also looks for it as `dark` does and takes that.
    """
    mask = ring()
    assert overlap(found(lit(shaded(mask, *colours), kind), AUTO), mask) > 0.96


@pytest.mark.parametrize(
    ("kind", "colours"),
    [("plain", WHITE), ("window", YELLOW), ("vignette", WHITE), ("lamp", YELLOW), ("noise", YELLOW)],
)
def test_a_light_lane_is_found_in_any_light(kind, colours):
    """The same for a lane lighter than its floor."""
    mask = ring()
    assert overlap(found(lit(shaded(mask, *colours), kind), AUTO), mask) > 0.96


@pytest.mark.parametrize(("shade", "colours"), [(DARK, GREY), (LIGHT, YELLOW)])
def test_a_shade_that_is_said_is_the_one_that_auto_finds(shade, colours):
    """To the last px."""
    image = lit(shaded(ring(), *colours), "window")
    assert np.array_equal(found(image, shade), found(image, AUTO))


def test_things_beside_the_lane_are_not_lane():
    """Black boxes, a sheet of paper and a ring-shaped mug are left out: the lane is the one even band that goes round."""
    mask = rounded_lane()
    image = shaded(mask, (60, 58, 57), (160, 164, 166))
    cv2.rectangle(image, (2, 2), (60, 40), (20, 20, 22), -1)
    cv2.rectangle(image, (180, 190), (230, 220), (245, 245, 245), -1)
    cv2.circle(image, (150, 200), 9, (40, 30, 30), 4)
    assert overlap(found(image, AUTO), mask) > 0.96


def rounded_lane():
    mask = canvas()
    stroke(mask, rounded(60, 70, 340, 320, 60), half=18)
    return mask


@pytest.mark.parametrize(("kind", "across"), [("plain", 0), ("window", 3), ("vignette", 1), ("noise", 1), ("jpeg", 1)])
@pytest.mark.parametrize(("line", "floor"), [((235, 235, 235), (120, 124, 126)), ((30, 30, 30), (190, 192, 196))])
def test_the_lane_between_two_lines(kind, line, floor, across):
    """Two borders of tape, light or dark, make a lane, whatever number of lines lies across it."""
    image, lane = taped(line, floor, across)
    mask = found(lit(image, kind), BETWEEN)
    assert overlap(mask, lane) > 0.93
    route = find_route(mask, source="x")
    middle = rounded(80, 80, 520, 420, 120).astype(np.float32)
    apart = [abs(cv2.pointPolygonTest(middle, (float(u), float(v)), measureDist=True)) for u, v in route.points_px]
    assert np.mean(apart) < 1.0


def taped(line, floor, across, size=(500, 600)):
    """Two lines of 6 px, 60 px apart, with so many lines across, and the lane between their edges."""
    image = np.full((*size, 3), floor, dtype=np.uint8)
    outer, inner = (np.rint(rounded(80 - o, 80 - o, 520 + o, 420 + o, 120 + o)).astype(np.int32) for o in (30, -30))
    lane = np.zeros(size, dtype=np.uint8)
    cv2.fillPoly(lane, [outer], 1)
    cv2.fillPoly(lane, [inner], 0)
    for border in (outer, inner):
        cv2.polylines(lane, [border], isClosed=True, color=0, thickness=6)
    for border in (outer, inner):
        cv2.polylines(image, [border], isClosed=True, color=line, thickness=6, lineType=cv2.LINE_AA)
    for k in range(across):
        cv2.line(image, (200 + 80 * k, 390), (200 + 80 * k, 450), line, 6, cv2.LINE_AA)
    return image, lane > 0


def test_a_darker_picture_has_the_same_lane():
    """Exposure changes nothing but a few px at the edge."""
    image = shaded(ring(), (70, 66, 64), (200, 205, 210))
    lane = found(image, DARK)
    for factor in (0.35, 0.5, 0.83):
        assert overlap(found(np.asarray(image * factor, dtype=np.uint8), DARK), lane) > 0.98


def test_a_turned_picture_has_the_turned_lane():
    """By a quarter and by three quarters of a turn, the lane turns with its picture."""
    image = shaded(rounded_lane(), (70, 66, 64), (200, 205, 210))
    lane = found(image, AUTO)
    for turns in (1, 3):
        turned = np.ascontiguousarray(np.rot90(image, turns))
        assert overlap(found(turned, AUTO), np.rot90(lane, turns)) > 0.995


def test_where_nothing_stands_out_the_message_says_so():
    """A plain floor, and one with mere noise, hold no lane of any shade."""
    plain = np.full((200, 300, 3), 180, dtype=np.uint8)
    noisy = lit(plain, "noise")
    for image in (plain, noisy):
        for shade, text in (
            (DARK, "darker than"),
            (LIGHT, "lighter than"),
            (AUTO, "darker or lighter than"),
            (BETWEEN, "two closed lines"),
        ):
            with pytest.raises(InputError, match=text) as caught:
                found(image, shade)
            assert str(caught.value).startswith("x: ")


def test_a_line_with_a_wide_gap_is_no_border():
    """Where the outer line is open the lane runs out of it, and that is said."""
    image, _ = taped((235, 235, 235), (120, 124, 126), 0)
    cv2.rectangle(image, (250, 30), (350, 70), (120, 124, 126), -1)
    cv2.rectangle(image, (40, 200), (60, 300), (120, 124, 126), -1)
    with pytest.raises(InputError, match="two closed lines"):
        found(image, BETWEEN)


def test_unseen_corners_are_neither_lane_nor_floor():
    """What a rectified picture does not show is left out, black as it may be."""
    mask = ring()
    image = shaded(mask, (60, 57, 56), (156, 164, 166))
    seen = np.ones(mask.shape, dtype=bool)
    seen[:60, :90] = False
    image[~seen] = 0
    got = lane_mask(image, DARK, source="x", close_gap_px=4, seen=seen)
    assert not got[~seen].any()
    assert overlap(got & seen, mask & seen) > 0.96


def test_a_colour_from_a_place_on_the_lane_finds_the_lane():
    """People do not know HSV: they know where the lane is."""
    mask = ring()
    image = shaded(mask, (60, 160, 90), (240, 240, 240))
    colour = colour_at(image, (200 + 130, 200), source="x")
    assert overlap(lane_mask(image, colour, source="x", close_gap_px=2), mask) > 0.94
    with pytest.raises(InputError, match=r"x: the place \(400, 3\) px for the lane's colour is outside"):
        colour_at(image, (400, 3), source="x")


@pytest.mark.parametrize(
    ("bgr", "hsv"),
    [
        ((0, 0, 255), (0, 100, 100)),
        ((190, 165, 214), (329.4, 23, 84)),
        ((0, 0, 0), (0, 0, 0)),
        ((255, 255, 255), (0, 0, 100)),
    ],
)
def test_colours_by_blue_green_and_red(bgr, hsv):
    """The same colour as drawing programs would name it."""
    colour = colour_of(*bgr)
    assert (colour.hue_deg, colour.saturation_percent, colour.value_percent) == pytest.approx(hsv, abs=0.7)


def test_even_light_takes_the_light_out_and_keeps_the_colours():
    """Under a window's light a coloured lane has one value again, to a few percent, and the middle of brightness stays."""
    mask = canvas()
    stroke(mask, circle((200, 200), 130))
    image = shaded(mask, (120, 60, 200), (200, 205, 210))
    even = even_light(lit(image, "window"))
    for part in (mask, ~mask):
        values = even[part].max(axis=1)
        assert np.percentile(values, 95) < 1.12 * np.percentile(values, 5)
    assert np.median(even) == pytest.approx(np.median(lit(image, "window")), rel=0.1)
    assert np.array_equal(even_light(image, np.zeros(mask.shape, dtype=bool)), image)


def test_a_large_dark_thing_does_not_pass_for_bad_light():
    """A black carpet over a quarter of an evenly lit floor leaves the floor as it is."""
    image = np.full((300, 400, 3), 180, dtype=np.uint8)
    image[:, :100] = 15
    floor = even_light(image)[:, 110:]
    assert floor.max() <= 1.05 * floor.min()


def gap_in_ring():
    mask = ring()
    mask[185:215, :120] = False
    return mask


def one_in_the_other():
    mask = canvas()
    stroke(mask, circle((200, 200), 150), half=12)
    stroke(mask, circle((200, 200), 80), half=12)
    return mask


@pytest.mark.parametrize("draw", [gap_in_ring, lambda: winding()[0], lambda: open_eight()[0]])
def test_a_faint_rim_about_an_open_lane_is_no_lane(draw):
    """What nobody says is the lane itself, which is not closed, and not the pale line that its own shade leaves round it."""
    mask = draw()
    got = found(painted(mask), AUTO)
    assert overlap(got, mask) > 0.95
    with pytest.raises(InputError, match="lane is not closed: it ends at"):
        find_route(got, source="x")


@pytest.mark.parametrize(("draw", "shade"), [(two_rings, AUTO), (one_in_the_other, DARK)])
def test_two_lanes_on_a_drawing_are_both_lane(draw, shade):
    """Two rings, side by side or of unlike size: neither is left out, so that the user is asked which is meant."""
    mask = draw()
    got = found(painted(mask), shade)
    assert overlap(got, mask) > 0.95
    with pytest.raises(SeveralLoops):
        find_route(got, source="x")
