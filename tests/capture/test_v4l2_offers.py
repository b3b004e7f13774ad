"""Format, size and rate by what the camera offers: which is taken, and what is said where none serves."""

from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.capture.settings import CaptureSettings
from dnb_edge.capture.source import open_source
from dnb_edge.capture.v4l2_offers import Offer, Rates, Size, choose
from dnb_edge.errors import InputError

CAMERA = Path("/dev/video0")
WEBCAM = {
    "MJPG": [((1280, 720), [30, 15]), ((640, 360), [30, Fraction(25, 2)])],
    "YUYV": [((1280, 720), [10, 5]), ((640, 360), [30]), ((320, 180), [60])],
}
RANGED = {"YUYV": [((16, 16), (1920, 1080), (16, 2), (1, 60))]}


def size(width, height, *fps):
    return Size(least_px=(width, height), most_px=(width, height), rates=Rates(listed=tuple(map(Fraction, fps))))


def asked(camera, width, height, fps, pixel_format=None):
    settings = CaptureSettings(width_px=width, height_px=height, fps=fps, pixel_format=pixel_format)
    source = open_source(f"v4l2:{camera.path}", settings)
    source.close()
    return source.info


@pytest.mark.parametrize(
    ("wanted", "granted"),
    [
        ((1280, 720, 30), ("MJPG", 30.0)),
        ((1280, 720, 29.97), ("MJPG", 29.97)),
        ((640, 360, 12.5), ("MJPG", 12.5)),
        ((1280, 720, 10), ("YUYV", 10.0)),
        ((320, 180, 60), ("YUYV", 60.0)),
        ((640, 360, 30, "YUYV"), ("YUYV", 30.0)),
    ],
    ids=str,
)
def test_mjpeg_comes_first_as_far_as_it_serves(play_camera, wanted, granted):
    """USB 2 carries HD only as MJPEG; where only YUYV has the size at the rate, that is taken; a format asked for wins."""
    info = asked(play_camera(sizes=WEBCAM), *wanted)
    assert (info.pixel_format, info.nominal_fps) == (granted[0], pytest.approx(granted[1]))


@pytest.mark.parametrize("wanted", [(1920, 1080, 60), (16, 16, 1), (656, 482, 25.0)], ids=str)
def test_ranges_of_sizes_and_rates_are_understood(play_camera, wanted):
    """Drivers such as v4l2loopback's offer all between two sizes and two rates."""
    info = asked(play_camera(formats=("YUYV",), sizes=RANGED), *wanted)
    assert (info.width_px, info.height_px, info.nominal_fps) == wanted


@pytest.mark.parametrize(
    ("sizes", "wanted", "words"),
    [
        (WEBCAM, (1280, 720, 60), r"\.fps: the camera has no 1280x720 at 60 fps; it has MJPG 1280x720 at 30, 15 fps; 6"),
        (WEBCAM, (1920, 1080, 30), r"\.width_px, capture\.height_px: the camera has no 1920x1080; it has MJPG .* YUYV 12"),
        (WEBCAM, (1280, 720, 30, "YUYV"), r"capture\.fps: .* it has YUYV 1280x720 at 10, 5 fps"),
        (WEBCAM, (640, 360, 14), "12.5 fps"),
        (RANGED, (17, 16, 30), "no 17x16; it has YUYV 16x16 to 1920x1080 at 1 to 60 fps"),
        (RANGED, (16, 16, 61), "no 16x16 at 61 fps"),
        (WEBCAM, (640, 360, 30, "YU12"), r"capture\.pixel_format: 'YU12' cannot be decoded here"),
    ],
    ids=str,
)  # fmt: skip
def test_what_the_camera_lacks_is_told_with_what_it_has(play_camera, sizes, wanted, words):
    """One line names the key to change and every size and rate that would do."""
    camera = play_camera(formats=tuple(sizes), sizes=sizes)
    with pytest.raises(InputError, match=words) as caught:
        asked(camera, *wanted)
    assert str(caught.value).startswith(f"{camera.path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("offered", "wanted", "chosen"),
    [
        (["YUYV", "MJPG"], None, "MJPG"),
        (["YUYV"], None, "YUYV"),
        (["JPEG", "YUYV"], None, "JPEG"),
        (["YUYV", "MJPG"], "YUYV", "YUYV"),
    ],
)
def test_a_driver_that_tells_no_sizes_is_taken_at_its_word(offered, wanted, chosen):
    """Without sizes and rates to choose by, MJPEG comes first; what the driver then grants is checked."""
    offers = [Offer(pixel_format=one) for one in offered]
    assert choose(CAMERA, offers, width_px=9, height_px=9, fps=9.0, asked=wanted) == chosen


@pytest.mark.parametrize(("offered", "wanted"), [(["H264"], None), ([], None), (["YUYV"], "MJPG"), (["RGB3"], "RGB3")])
def test_formats_that_nobody_can_decode_are_refused(offered, wanted):
    """A camera without a usable format is bad input, named with what it offers."""
    offers = [Offer(pixel_format=one) for one in offered]
    with pytest.raises(InputError, match=r"/dev/video0: capture\.pixel_format"):
        choose(CAMERA, offers, width_px=9, height_px=9, fps=9.0, asked=wanted)


def test_long_lists_are_cut_short():
    """A camera with very many sizes still gives one line that can be read."""
    offers = [Offer(pixel_format="MJPG", sizes=tuple(size(16 * k, 16, 30) for k in range(1, 40)))]
    with pytest.raises(InputError, match=r"it has MJPG 624x16 at 30 fps; .*; 27 more") as caught:
        choose(CAMERA, offers, width_px=9, height_px=9, fps=9.0)
    assert len(str(caught.value)) < 500
    many = [Offer(pixel_format=f"A{k:03}") for k in range(40)]
    with pytest.raises(InputError, match=r"offers A000, .*, A011 and 28 more, and MJPG or") as caught:
        choose(CAMERA, many, width_px=9, height_px=9, fps=9.0)
    assert len(str(caught.value)) < 250


@given(
    st.lists(st.tuples(st.integers(1, 3), st.integers(1, 3), st.sampled_from([5, 15, 30])), max_size=6),
    st.lists(st.tuples(st.integers(1, 3), st.integers(1, 3), st.sampled_from([5, 15, 30])), max_size=6),
    st.tuples(st.integers(1, 3), st.integers(1, 3), st.sampled_from([5, 15, 30])),
)
def test_a_format_is_taken_if_and_only_if_it_serves(jpeg, raw, wanted):
    """Whatever is offered: the choice has the size at the rate, MJPEG before YUYV, and is refused only where neither has."""
    lists = [(name, set(sizes)) for name, sizes in (("MJPG", jpeg), ("YUYV", raw)) if sizes]
    offers = [Offer(pixel_format=name, sizes=tuple(size(*one) for one in sorted(sizes))) for name, sizes in lists]
    serving = [name for name, sizes in lists if wanted in sizes]
    width, height, fps = wanted
    if serving:
        assert choose(CAMERA, offers, width_px=width, height_px=height, fps=fps) == serving[0]
    else:
        with pytest.raises(InputError):
            choose(CAMERA, offers, width_px=width, height_px=height, fps=fps)
