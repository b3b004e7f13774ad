"""What every detector does, whatever is behind it: `detect.protocol.Detector`."""

import math
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from roof_markers import Roof, marker_print
from ultralytics_graph import write_red_finder

from dnb_edge.detect.centre import CentreDetector
from dnb_edge.detect.markers import MarkerDetector, MarkerSettings
from dnb_edge.detect.onnx import load_builtin_model, open_model
from dnb_edge.detect.protocol import Detector
from dnb_edge.detect.ultralytics import UltralyticsDetector, UltralyticsSettings
from dnb_edge.values import FrameDetections, SearchWindow

WIDTH, HEIGHT = 640, 360
FRAMES = 24


def _centre(folder: Path) -> Detector:
    return CentreDetector(load_builtin_model())


def _ultralytics(folder: Path) -> Detector:
    path = folder / "red.onnx"
    if not path.exists():
        write_red_finder(path)
    return UltralyticsDetector(open_model(path), UltralyticsSettings(iou=0.05, min_confidence=0.1))


def _markers(folder: Path) -> Detector:
    return MarkerDetector(MarkerSettings())


DETECTORS: dict[str, Callable[[Path], Detector]] = {"centre": _centre, "ultralytics": _ultralytics, "markers": _markers}


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("models")


@pytest.fixture(scope="module", params=DETECTORS)
def kind(request) -> str:
    """The detector under test."""
    return request.param


@pytest.fixture(scope="module")
def make(kind, folder) -> Callable[[], Detector]:
    """Makes a new detector of the kind under test."""
    return lambda: DETECTORS[kind](folder)


def _floor() -> np.ndarray:
    rng = np.random.default_rng(11)
    picture = np.full((HEIGHT, WIDTH, 3), (150, 155, 160), np.uint8)
    cv2.ellipse(picture, (320, 180), (220, 110), 0, 0, 360, (70, 70, 72), 60)
    return np.clip(picture + rng.normal(0, 2, picture.shape), 0, 255).astype(np.uint8)


def _place(frame: int) -> tuple[float, float]:
    angle = 0.06 * frame
    return 320 + 220 * math.cos(angle), 180 + 110 * math.sin(angle)


def _frame(number: int, *, marked: bool = False) -> np.ndarray:
    """A plain red car of 44 px with black tyres at its place on the track; `marked`, with a marker on a wide roof."""
    out = _floor()
    u, v = _place(number)
    for x in (-13, 13):
        for y in (-11, 11):
            cv2.rectangle(
                out, (round(u + x - 4), round(v + y - 3)), (round(u + x + 4), round(v + y + 3)), (20, 20, 20), -1
            )
    cv2.rectangle(out, (round(u - 22), round(v - 9)), (round(u + 22), round(v + 9)), (40, 40, 200), -1)
    cv2.rectangle(out, (round(u - 11), round(v - 6)), (round(u + 4), round(v + 6)), (40, 30, 30), -1)
    if marked:
        printed = cv2.resize(marker_print(Roof()), (32, 32), interpolation=cv2.INTER_AREA)
        left, top = round(u) - 16, round(v) - 16
        out[top : top + 32, left : left + 32] = printed[:, :, None]
    return cv2.GaussianBlur(out, (0, 0), 0.7).astype(np.uint8)


def _drive(detector: Detector, *, marked: bool) -> list[FrameDetections]:
    """A drive in which the core follows the car from the fourth frame on."""
    out: list[FrameDetections] = []
    for number in range(FRAMES):
        window = SearchWindow(target_id=1, camera_px=_place(number), length_px=44.0)
        windows = (window,) if number >= 4 else ()
        out.append(
            detector.detect(
                _frame(number, marked=marked), sequence=number + 10, t_ns=number * 33_000_000, windows=windows
            )
        )
    return out


@pytest.fixture(scope="module")
def driven(make, kind) -> list[FrameDetections]:
    return _drive(make(), marked=kind == "markers")


def test_the_car_is_found(driven):
    """From the third frame on some detection lies on the car."""
    for number, seen in enumerate(driven[2:], start=2):
        assert min((math.dist(one.camera_px, _place(number)) for one in seen.detections), default=math.inf) < 12.0, (
            number
        )


def test_the_same_frames_give_the_same_answers(make, kind, driven):
    """State lives in the object alone: a second one repeats the first to the last bit."""
    assert _drive(make(), marked=kind == "markers") == driven


def test_answers_carry_the_frames_number_and_stamp(driven):
    """An answer belongs to its frame."""
    assert [(seen.sequence, seen.t_ns) for seen in driven] == [(n + 10, n * 33_000_000) for n in range(FRAMES)]


def test_without_windows_the_whole_picture_is_looked_at(driven):
    """`full_frame` is true wherever no window was given."""
    assert all(seen.full_frame for seen in driven[:4])


def test_answers_are_well_formed_and_inside_the_picture(driven):
    """Plain floats; positive sigmas and lengths; confidences in 0..1; headings in -pi..pi; points in the picture."""
    for seen in driven:
        for one in seen.detections:
            assert type(one.camera_px[0]) is type(one.confidence) is type(one.sigma_px) is type(one.length_px) is float
            assert one.sigma_px > 0
            assert one.length_px > 0
            assert 0 <= one.confidence <= 1
            assert one.heading_rad is None or -math.pi <= one.heading_rad <= math.pi
            assert -0.5 <= one.camera_px[0] <= WIDTH - 0.5
            assert -0.5 <= one.camera_px[1] <= HEIGHT - 0.5


def test_the_strongest_comes_first(driven):
    """Among what moves, and among what does not, confidence falls."""
    for seen in driven:
        for moving in (True, False):
            confidences = [one.confidence for one in seen.detections if one.moving is moving]
            assert confidences == sorted(confidences, reverse=True)


@pytest.mark.parametrize("level", [0, 128, 255])
def test_an_empty_picture_has_no_cars(make, level):
    """Black, grey and overexposed pictures give no detection, with a window or without."""
    detector = make()
    picture = np.full((HEIGHT, WIDTH, 3), level, np.uint8)
    window = SearchWindow(target_id=1, camera_px=(320.0, 180.0), length_px=44.0)
    for number in range(4):
        for windows in ((), (window,)):
            assert detector.detect(picture, sequence=number, t_ns=number, windows=windows).detections == ()


def test_the_frame_is_left_as_it_was(make):
    """A detector does not write into the picture, which the recorder uses too."""
    picture = _frame(0)
    before = picture.copy()
    make().detect(picture, sequence=0, t_ns=0, windows=())
    assert np.array_equal(picture, before)
