"""The centre detector on drawn scenes: whole frame, windows, background, determinism."""

import math

import cv2
import numpy as np
import pytest

from dnb_edge.detect.centre import CentreDetector
from dnb_edge.detect.onnx import load_builtin_model
from dnb_edge.values import FrameDetections, SearchWindow

SIZE = (640, 360)


def _draw_car(picture: np.ndarray, centre: tuple[float, float], length: float = 44.0) -> np.ndarray:
    """A plain little car seen from above, heading right: tyres, body, roof."""
    out = picture.copy()
    u, v, half = centre[0], centre[1], length / 2
    for x in (-0.6, 0.6):
        for y in (-0.5, 0.5):
            corner = (round(u + x * half - 0.2 * half), round(v + y * half - 0.1 * half))
            cv2.rectangle(out, corner, (round(corner[0] + 0.4 * half), round(corner[1] + 0.2 * half)), (20, 20, 20), -1)
    body = (round(u - half), round(v - 0.42 * half)), (round(u + half), round(v + 0.42 * half))
    cv2.rectangle(out, *body, (40, 40, 200), -1)
    cv2.rectangle(
        out,
        (round(u - 0.5 * half), round(v - 0.3 * half)),
        (round(u + 0.2 * half), round(v + 0.3 * half)),
        (40, 30, 30),
        -1,
    )
    return cv2.GaussianBlur(out, (0, 0), 0.7).astype(np.uint8)


@pytest.fixture(scope="module")
def floor() -> np.ndarray:
    rng = np.random.default_rng(11)
    picture = np.full((SIZE[1], SIZE[0], 3), (150, 155, 160), np.uint8)
    cv2.ellipse(picture, (320, 180), (220, 110), 0, 0, 360, (70, 70, 72), 60)
    return np.clip(picture + rng.normal(0, 2, picture.shape), 0, 255).astype(np.uint8)


def _place(frame: int) -> tuple[float, float]:
    angle = 0.06 * frame
    return 320 + 220 * math.cos(angle), 180 + 110 * math.sin(angle)


def _drive(floor: np.ndarray, detector: CentreDetector, frames: int) -> list[FrameDetections]:
    out: list[FrameDetections] = []
    windows: tuple[SearchWindow, ...] = ()
    for number in range(frames):
        seen = detector.detect(
            _draw_car(floor, _place(number)), sequence=number, t_ns=number * 33_000_000, windows=windows
        )
        out.append(seen)
        best = next((one for one in seen.detections if one.moving), None)
        windows = (
            () if best is None else (SearchWindow(target_id=1, camera_px=best.camera_px, length_px=best.length_px),)
        )
    return out


@pytest.fixture(scope="module")
def driven(floor) -> list[FrameDetections]:
    return _drive(floor, CentreDetector(load_builtin_model()), 45)


def test_a_drawn_car_is_found_within_a_few_frames_and_followed(driven):
    """From the second frame on the first moving detection lies on the car."""
    for number, seen in enumerate(driven[2:], start=2):
        best = next(one for one in seen.detections if one.moving)
        assert math.dist(best.camera_px, _place(number)) < 12.0, number


def test_results_carry_the_frames_sequence_and_stamp(driven):
    """A result belongs to its frame by sequence and stamp."""
    assert [(seen.sequence, seen.t_ns) for seen in driven] == [(n, n * 33_000_000) for n in range(45)]


def test_the_whole_frame_is_searched_only_until_the_car_is_followed(driven):
    """Without windows the look is a whole one; once the car is followed no frame costs a whole look."""
    whole = [number for number, seen in enumerate(driven) if seen.full_frame]
    assert 0 in whole
    assert max(whole) <= 4


def test_the_same_frames_give_the_same_answers(floor, driven):
    """A second detector gives exactly the same detections for the same frames."""
    assert _drive(floor, CentreDetector(load_builtin_model()), 45) == driven


def test_detections_are_well_formed(driven):
    """Sigmas and lengths are positive and confidences within 0..1, all plain floats."""
    for seen in driven:
        for one in seen.detections:
            assert one.sigma_px > 0
            assert one.length_px > 0
            assert 0 <= one.confidence <= 1
            assert type(one.camera_px[0]) is float


def test_a_followed_car_that_stands_still_stays_moving(floor):
    """The background never takes up a followed car: after a long stop it still differs from the background."""
    detector = CentreDetector(load_builtin_model())
    _drive(floor, detector, 12)
    place = _place(11)
    frame = _draw_car(floor, place)
    window = SearchWindow(target_id=1, camera_px=place, length_px=44.0)
    for number in range(12, 90):
        seen = detector.detect(frame, sequence=number, t_ns=number, windows=(window,))
    best = min(seen.detections, key=lambda one: math.dist(one.camera_px, place))
    assert best.moving
    assert math.dist(best.camera_px, place) < 8.0


def test_a_change_of_light_moves_nothing(floor):
    """When the lamp grows brighter by a quarter nothing counts as moving."""
    detector = CentreDetector(load_builtin_model())
    frame = _draw_car(floor, (300.0, 120.0))
    for number in range(6):
        detector.detect(frame, sequence=number, t_ns=number, windows=())
    brighter = np.clip(frame.astype(np.float32) * 1.25, 0, 255).astype(np.uint8)
    seen = detector.detect(brighter, sequence=6, t_ns=6, windows=())
    assert not any(one.moving for one in seen.detections)


@pytest.mark.parametrize("size", [(320, 240), (1280, 720), (1000, 750)])
def test_any_frame_size_goes(size):
    """Frames smaller than the working size, of odd proportions, and of the usual size are all looked at."""
    detector = CentreDetector(load_builtin_model())
    frame = np.full((size[1], size[0], 3), 128, np.uint8)
    window = SearchWindow(target_id=1, camera_px=(5.0, 5.0), length_px=30.0)
    for number in range(8):
        assert detector.detect(frame, sequence=number, t_ns=number, windows=()).full_frame
    assert detector.detect(frame, sequence=9, t_ns=9, windows=(window,)).full_frame, (
        "an empty window calls for a search"
    )
