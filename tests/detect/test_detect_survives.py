"""What happens to cameras and rooms, on rendered frames: bumps, light, parking, dark and frozen pictures, large sources."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import pytest

from dnb_edge.detect.centre import CentreDetector
from dnb_edge.detect.onnx import load_builtin_model
from dnb_edge.sim.rig import Rig
from dnb_edge.values import Detection, SearchWindow

FRAMES = 75
EVENT = 30
"""Frame in which something happens."""


@dataclass(frozen=True)
class Drive:
    """Frames of the rig's car and where it truly is in each, camera px."""

    frames: list[np.ndarray]
    places: list[tuple[float, float]]


@pytest.fixture(scope="module")
def drive() -> Drive:
    rig = Rig(seed=1, laps=1, size_px=(960, 540))
    frames = [rig.frame(i).bgr for i in range(FRAMES)]
    return Drive([f for f in frames if f is not None], [rig.frame_truth(i).camera_px for i in range(FRAMES)])


@dataclass(frozen=True)
class Run:
    chosen: list[Detection | None]
    """The followed car's detection in each frame."""
    others: list[list[Detection]]
    """What was surely found elsewhere."""


def _follow(drive: Drive, *, detector: CentreDetector | None = None) -> Run:
    """Follow the first moving find by constant velocity, as the core does in earnest."""
    detector = detector or CentreDetector(load_builtin_model())
    last: list[Detection] = []
    run = Run([], [])
    for number, (frame, place) in enumerate(zip(drive.frames, drive.places, strict=True)):
        windows: tuple[SearchWindow, ...] = ()
        if last:
            u, v = (2 * now - then for now, then in zip(last[-1].camera_px, last[0].camera_px, strict=True))
            windows = (SearchWindow(target_id=1, camera_px=(u, v), length_px=last[-1].length_px),)
        found = detector.detect(frame, sequence=number, t_ns=number, windows=windows).detections
        near = [one for one in found if windows and math.dist(one.camera_px, windows[0].camera_px) < one.length_px]
        moving = [one for one in found if one.moving and one.confidence > 0.3]
        chosen = max(near if windows else moving, key=lambda one: one.confidence, default=None)
        last = [] if chosen is None else [*last[-1:], chosen]
        run.chosen.append(chosen)
        run.others.append([one for one in found if one.confidence > 0.3 and math.dist(one.camera_px, place) > 50])
    return run


def _assert_followed(run: Run, drive: Drive, *, since: int = 3, within_px: float = 14.0) -> None:
    for number in range(since, len(drive.frames)):
        chosen = run.chosen[number]
        assert chosen is not None, number
        assert math.dist(chosen.camera_px, drive.places[number]) < within_px, number


def _shifted(frame: np.ndarray, by: tuple[int, int]) -> np.ndarray:
    matrix = np.array([[1.0, 0.0, by[0]], [0.0, 1.0, by[1]]])
    return cv2.warpAffine(frame, matrix, frame.shape[1::-1], borderMode=cv2.BORDER_REPLICATE).astype(np.uint8)


def _lit(frame: np.ndarray, gain: float) -> np.ndarray:
    return np.clip(frame.astype(np.float32) * gain, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("by", [(2, 0), (0, -2), (3, -2), (5, 4)])
def test_a_bumped_camera_is_survived(drive, by):
    """After a bump of 2 to 6 px the car is followed on, and soon nothing else counts as moving."""
    bumped = Drive(
        [f if n < EVENT else _shifted(f, by) for n, f in enumerate(drive.frames)],
        [p if n < EVENT else (p[0] + by[0], p[1] + by[1]) for n, p in enumerate(drive.places)],
    )
    run = _follow(bumped)
    _assert_followed(run, bumped)
    assert not [one for some in run.others[EVENT + 15 :] for one in some if one.moving]


@pytest.mark.parametrize("gain", [0.5, 1.3, 1.6])
def test_a_light_switched_is_survived(drive, gain):
    """When the light changes at once the car is followed on, and nothing else counts as moving."""
    lit = Drive([f if n < EVENT else _lit(f, gain) for n, f in enumerate(drive.frames)], drive.places)
    run = _follow(lit)
    _assert_followed(run, lit)
    assert not [one for some in run.others[EVENT:] for one in some if one.moving]


def test_a_car_parked_from_the_start_leaves_no_ghost(drive):
    """A car that stood in the first frames is found moving within three frames of its start; its place looks empty then."""
    start = drive.places[0]
    parked = Drive([drive.frames[0]] * EVENT + drive.frames[:45], [start] * EVENT + drive.places[:45])
    run = _follow(parked)
    assert not any(run.chosen[:EVENT])
    _assert_followed(run, parked, since=EVENT + 3)
    assert not [one for some in run.others[EVENT + 6 :] for one in some if math.dist(one.camera_px, start) < 30]


def test_a_followed_car_stands_still_for_long_and_is_never_absorbed(drive):
    """A followed car that stands for minutes, with its window jittering, differs from the background to the end."""
    detector = CentreDetector(load_builtin_model())
    for number in range(EVENT):
        window = SearchWindow(target_id=1, camera_px=drive.places[number], length_px=85.0)
        detector.detect(drive.frames[number], sequence=number, t_ns=number, windows=(window,))
    rng = np.random.default_rng(4)
    place, frame = drive.places[EVENT - 1], drive.frames[EVENT - 1]
    for number in range(EVENT, EVENT + 900):
        u, v = rng.normal(place, 8.0).tolist()
        window = SearchWindow(target_id=1, camera_px=(u, v), length_px=85.0 * float(rng.uniform(0.8, 1.2)))
        found = detector.detect(frame, sequence=number, t_ns=number, windows=(window,)).detections
        best = max(found, key=lambda one: one.confidence)
        assert math.dist(best.camera_px, place) < 14.0, number
        assert best.moving, number


def _noise(level: float) -> np.ndarray:
    return np.clip(np.random.default_rng(1).normal(level, 5, (540, 960, 3)), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(
    "picture",
    [
        lambda _: np.zeros((540, 960, 3), np.uint8),
        lambda _: np.full((540, 960, 3), 255, np.uint8),
        lambda _: _noise(4.0),
        lambda frame: _lit(frame, 12.0),
    ],
    ids=["black", "white", "dark", "overexposed"],
)
@pytest.mark.parametrize("before", [0, 12])
def test_an_empty_picture_holds_no_car(drive, picture: Callable[[np.ndarray], np.ndarray], before):
    """A black, white, dark or overexposed picture gives no moving find, at once or after good pictures; a few dark specks left
    of an overexposed scene may look like something that stands, black and white ones hold nothing at all."""
    detector = CentreDetector(load_builtin_model())
    for number in range(before):
        detector.detect(drive.frames[number], sequence=number, t_ns=number, windows=())
    empty = picture(drive.frames[0])
    for number in range(before, before + 12):
        found = detector.detect(empty, sequence=number, t_ns=number, windows=()).detections
        assert not [one for one in found if one.moving or one.confidence > (0.7 if np.ptp(empty) > 100 else 0.4)]


def test_nothing_moves_in_a_frozen_picture(drive):
    """The same picture again and again holds nothing that moves."""
    detector = CentreDetector(load_builtin_model())
    for number in range(15):
        found = detector.detect(drive.frames[0], sequence=number, t_ns=number, windows=()).detections
        assert not [one for one in found if one.moving]


@pytest.mark.parametrize("size", [(1920, 1080), (3840, 2160)])
def test_large_sources_are_followed_at_native_sharpness(size):
    """In 1080p and 4K a car is found, and followed to within the same share of its length as in a small one."""
    rig = Rig(seed=2, laps=1, size_px=size)
    frames = [rig.frame(i).bgr for i in range(7)]
    drive = Drive([f for f in frames if f is not None], [rig.frame_truth(i).camera_px for i in range(7)])
    run = _follow(drive)
    _assert_followed(run, drive, since=3, within_px=14.0 * size[0] / 960)


def test_the_colour_of_the_cars_middle_is_told(drive):
    """The followed car's colour is its own, not the floor's, and steady from frame to frame."""
    run = _follow(Drive(drive.frames[:20], drive.places[:20]))
    colours = np.array([one.colour_bgr for one in run.chosen[3:] if one is not None])
    floor = np.array([cv2.mean(drive.frames[0])[:3]])
    assert len(colours) == 17
    assert np.abs(colours - np.median(colours, axis=0)).max() < 30
    assert np.abs(colours - floor).max(axis=1).min() > 15


def test_a_wrong_shape_is_a_programmers_mistake():
    """A grey picture is refused with its shape."""
    with pytest.raises(ValueError, match=r"shape \(20, 30\): needs \(height, width, 3\)"):
        CentreDetector(load_builtin_model()).detect(np.zeros((20, 30), np.uint8), sequence=0, t_ns=0, windows=())
