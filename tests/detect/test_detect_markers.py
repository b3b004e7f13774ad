"""Roof markers read on rendered frames: who it is, where the car's ground point is, and where its nose points."""

import math
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
import pytest
from roof_markers import Roof, above_px, camera_over, developed, floor_picture, ground_of, put_car

from dnb_edge.detect.codes import DICTIONARIES, CodeBook
from dnb_edge.detect.markers import MarkerDetector, MarkerSettings, corner_sigma_px
from dnb_edge.sim.camera import PinholeCamera
from dnb_edge.values import BgrImage, Detection, SearchWindow

CAMERA = camera_over(2.15, 60.0)
FLOOR = floor_picture(CAMERA)
GROUND = ground_of(CAMERA)
CAR_LENGTH_M = 0.235


def picture_of(
    *cars: tuple[tuple[float, float], float, Roof | None],
    camera: PinholeCamera = CAMERA,
    floor: BgrImage = FLOOR,
    blur_px: float = 0.0,
    seed: int = 1,
) -> BgrImage:
    """The floor with cars at (track m, heading, roof)."""
    picture = floor.copy()
    for track_m, heading_rad, roof in cars:
        put_car(picture, camera, track_m=track_m, heading_rad=heading_rad, roof=roof, blur_px=blur_px)
    return developed(picture, seed)


def look(
    image: BgrImage, settings: MarkerSettings | None = None, windows: Sequence[SearchWindow] = ()
) -> tuple[Detection, ...]:
    detector = MarkerDetector(settings or MarkerSettings(marker_height_m=Roof().height_m))
    return detector.detect(image, sequence=3, t_ns=7, windows=windows).detections


def window(track_m: tuple[float, float], camera: PinholeCamera = CAMERA) -> SearchWindow:
    """Where the core expects the car: its ground point, a little off."""
    u, v = above_px(camera, track_m, 0.0)
    length_px = CAR_LENGTH_M * float(camera.matrix[0, 0] / camera.distance_m(np.array([[*track_m, 0.1]]))[0])
    return SearchWindow(target_id=1, camera_px=(u + 6.0, v - 5.0), length_px=length_px)


def heading_px(camera: PinholeCamera, track_m: tuple[float, float], heading_rad: float, height_m: float) -> float:
    """Direction of travel as the picture shows it, as a detection's `heading_rad`."""
    ahead = (track_m[0] + 0.02 * math.cos(heading_rad), track_m[1] + 0.02 * math.sin(heading_rad))
    (u, v), (u_ahead, v_ahead) = above_px(camera, track_m, height_m), above_px(camera, ahead, height_m)
    return math.atan2(v - v_ahead, u_ahead - u)


def turned_by(one_rad: float, other_rad: float) -> float:
    return abs((one_rad - other_rad + math.pi) % (2 * math.pi) - math.pi)


@pytest.mark.parametrize("windowed", [False, True], ids=["whole frame", "window"])
@pytest.mark.parametrize("heading_deg", [0.0, 75.0, 160.0, -110.0])
@pytest.mark.parametrize(
    "roof",
    [
        Roof(),
        Roof(dictionary="APRILTAG_36h11", marker_id=3),
        Roof(height_m=0.15, ahead_m=0.06, marker_id=21),
        Roof(ahead_m=-0.05, marker_id=2, dictionary="5X5_100"),
    ],
    ids=["ArUco", "AprilTag", "ahead and high", "behind"],
)
def test_the_cars_ground_point_number_and_heading(roof: Roof, heading_deg: float, windowed: bool) -> None:
    """Each car is found by its number; its ground point is right within 2 mm at 2.15 m, its heading within 2 degrees."""
    track_m, heading_rad = (1.72, 0.86), math.radians(heading_deg)
    image = picture_of((track_m, heading_rad, roof))
    settings = MarkerSettings(
        dictionary=roof.dictionary, marker_height_m=roof.height_m, marker_ahead_m=roof.ahead_m, ids=(roof.marker_id,)
    )
    (found,) = look(image, settings, [window(track_m)] if windowed else [])
    assert (found.marker_id, found.height_m) == (roof.marker_id, roof.height_m)
    assert math.dist(found.camera_px, above_px(CAMERA, track_m, roof.height_m)) < 4 * found.sigma_px
    below_m = GROUND.point_below_m(found.camera_px, found.height_m)
    assert below_m is not None
    assert math.dist(below_m, track_m) < 0.002
    assert found.heading_rad is not None
    assert turned_by(found.heading_rad, heading_px(CAMERA, track_m, heading_rad, roof.height_m)) < math.radians(2)
    assert found.confidence > 0.7
    assert found.length_px == pytest.approx(window(track_m).length_px, rel=0.12)


@pytest.mark.parametrize(
    ("height_m", "pitch_deg", "size_px", "blur_px"),
    [
        (3.0, 60.0, (1280, 720), 0.0),
        (2.15, 35.0, (1280, 720), 0.0),
        (2.15, 60.0, (1280, 720), 5.0),
        (4.0, 60.0, (1920, 1080), 3.0),
        (2.15, 90.0, (1920, 1080), 8.0),
    ],
    ids=["far", "steep", "blurred", "far and blurred", "strongly blurred from above"],
)
def test_small_steep_and_blurred_markers_are_read_in_windows(
    height_m: float, pitch_deg: float, size_px: tuple[int, int], blur_px: float
) -> None:
    """Round its prediction nearly every marker of a moving car is read, and placed within 4 mm."""
    camera = camera_over(height_m, pitch_deg, size_px=size_px)
    floor, ground = floor_picture(camera), ground_of(camera)
    errors_m = []
    for k in range(5):
        track_m, heading_rad = (1.3 + 0.08 * k, 0.9 + 0.05 * k), 1.3 * k
        image = picture_of((track_m, heading_rad, Roof()), camera=camera, floor=floor, blur_px=blur_px, seed=k)
        for found in look(image, windows=[window(track_m, camera)]):
            below_m = ground.point_below_m(found.camera_px, found.height_m)
            assert found.marker_id == 7
            assert below_m is not None
            errors_m.append(math.dist(below_m, track_m))
    assert len(errors_m) >= 4
    assert max(errors_m) < 0.004


def test_blur_costs_confidence_and_widens_the_sigma() -> None:
    """A smeared marker is less sure, in confidence and in place; a sharp one is not believed to a tenth of a pixel."""
    sharp, smeared = (
        look(picture_of(((1.5, 1.0), 0.3, Roof()), blur_px=blur_px), windows=[window((1.5, 1.0))])[0]
        for blur_px in (0.0, 6.0)
    )
    assert sharp.confidence > 0.97 > smeared.confidence
    assert smeared.sigma_px > sharp.sigma_px >= 0.5


def test_two_cars_are_told_apart() -> None:
    """Two cars side by side are two detections, each with its own number at its own place."""
    cars = {4: (1.4, 1.0), 9: (1.4, 1.2)}
    image = picture_of(*((at, 0.2, Roof(marker_id=number)) for number, at in cars.items()))
    for windows in ([], [window(at) for at in cars.values()]):
        found = {one.marker_id: one for one in look(image, windows=windows)}
        assert set(found) == set(cars)
        for number, at in cars.items():
            below_m = GROUND.point_below_m(found[number].camera_px, found[number].height_m)
            assert below_m is not None
            assert math.dist(below_m, at) < 0.002


def test_only_the_numbers_asked_for_are_cars() -> None:
    """A marker on the wall or on a rival's car is left alone where `ids` names others."""
    image = picture_of(((1.4, 1.0), 0.2, Roof(marker_id=4)), ((1.8, 1.0), 0.2, Roof(marker_id=9)))
    found = look(image, MarkerSettings(ids=(9, 11)), [])
    assert [one.marker_id for one in found] == [9]


@pytest.mark.parametrize("blur_px", [0.0, 6.0])
def test_without_a_marker_there_is_nothing(blur_px: float) -> None:
    """A bare car, a floor and the edges of its parts are no marker, in windows neither."""
    for k in range(4):
        image = picture_of(((1.5, 1.0), 0.9 * k, None), blur_px=blur_px, seed=k)
        assert look(image) == ()
        assert look(image, windows=[window((1.5, 1.0))]) == ()


def test_a_window_is_where_it_looks_and_a_full_look_comes_by_itself() -> None:
    """With a window elsewhere the car is found only in the periodic full look, sooner where a wanted number is missing."""
    image = picture_of(((1.9, 1.0), 0.4, Roof()))
    elsewhere = [window((1.1, 1.0))]
    for settings, due in (
        (MarkerSettings(full_look_every=4), [3]),
        (MarkerSettings(full_look_every=0), []),
        (MarkerSettings(full_look_every=0, ids=(7, 8), missing_look_every=2), [1, 3, 5]),
        (MarkerSettings(full_look_every=6, ids=(7,), missing_look_every=0), [5]),
    ):
        detector = MarkerDetector(settings)
        looks = [detector.detect(image, sequence=k, t_ns=k, windows=elsewhere) for k in range(6)]
        assert [k for k, one in enumerate(looks) if one.full_frame] == due
        assert all(bool(one.detections) == one.full_frame for one in looks)


def test_the_same_frames_give_the_same_answers() -> None:
    """Two detectors told the same say the same, to the bit; results carry the frame's number and stamp."""
    images = [picture_of(((1.3 + 0.05 * k, 1.0), 0.1, Roof()), seed=k) for k in range(4)]
    answers = []
    for _ in range(2):
        detector = MarkerDetector()
        answers.append([detector.detect(image, sequence=k, t_ns=10 * k, windows=()) for k, image in enumerate(images)])
    assert answers[0] == answers[1]
    assert [(one.sequence, one.t_ns, one.full_frame) for one in answers[0]] == [(k, 10 * k, True) for k in range(4)]


@pytest.mark.parametrize("at_px", [(-500.0, 10.0), (1279.0, 719.0), (640.0, 5000.0), (0.0, 0.0)])
def test_windows_at_and_beyond_the_edge_are_no_fault(at_px: tuple[float, float]) -> None:
    """A target that leaves the picture takes its window with it."""
    leaving = SearchWindow(target_id=1, camera_px=at_px, length_px=3.0)
    assert look(FLOOR, windows=[leaving]) == ()


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"dictionary": "4X4"}, "dictionary"),
        ({"marker_size_m": 0.0}, "marker_size_m"),
        ({"marker_height_m": -0.1}, "marker_height_m"),
        ({"car_length_m": math.nan}, "car_length_m"),
        ({"marker_ahead_m": 0.5}, "marker_ahead_m"),
        ({"ids": (50,)}, "ids: 50"),
        ({"ids": (-1,)}, "ids: -1"),
        ({"full_look_every": -1}, "full_look_every"),
        ({"least_confidence": 1.0}, "least_confidence"),
    ],
    ids=str,
)
def test_settings_that_make_no_sense(given: dict[str, Any], named: str) -> None:
    """Each is refused with its name."""
    with pytest.raises(ValueError, match=named):
        MarkerSettings(**given)


@pytest.mark.parametrize("name", DICTIONARIES)
def test_every_family_reads_its_own_print(name: str) -> None:
    """A code of each family, upright and turned, is read for what it is, its first corner where it was printed."""
    codes = cv2.aruco.getPredefinedDictionary(DICTIONARIES[name].index)
    number = DICTIONARIES[name].codes // 2 + 1
    black = cv2.aruco.generateImageMarker(codes, number, 120)
    page = cv2.copyMakeBorder(black, 40, 40, 40, 40, cv2.BORDER_CONSTANT, value=255)
    book = CodeBook(name, (number,), least_confidence=0.6)
    for quarters in range(4):
        (reading,) = book.read(np.ascontiguousarray(np.rot90(page, -quarters)), closely=quarters % 2 == 1)
        assert reading.number == number
        assert reading.confidence > 0.95
        first = [(40, 40), (160, 40), (160, 160), (40, 160)][quarters]
        # Dark begins half a pixel before the first dark pixel's centre.
        assert math.dist(reading.corners_px[0], (first[0] - 0.5, first[1] - 0.5)) < 0.2


def test_sigma_grows_with_what_is_wrong() -> None:
    """A square that is no parallelogram, a large one and a doubtful one are each worth less."""
    square = np.array([[0.0, 0.0], [30.0, 0.0], [30.0, 30.0], [0.0, 30.0]])
    best = corner_sigma_px(square, 1.0)
    bent = square + np.array([[0.0, 0.0], [0.0, 0.0], [2.0, 1.0], [0.0, 0.0]])
    assert corner_sigma_px(bent, 1.0) > 2 * best
    assert corner_sigma_px(4 * square, 1.0) > 1.5 * best
    assert corner_sigma_px(square, 0.7) > 2 * best
