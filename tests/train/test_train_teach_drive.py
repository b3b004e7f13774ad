"""A drive that labels itself: drawn pictures with known truth, a car that the shipped model knows or does not know."""

import math

import cv2
import numpy as np
import pytest

from dnb_edge.detect.onnx import load_builtin_model
from dnb_edge.errors import InputError
from dnb_edge.train.teach import check_enough, drive_material, joined, rejecting, write_sheet
from dnb_edge.train.teach_drive import Blob, BlobFinder, Shot, median_floor
from dnb_edge.train.teach_labels import count_cars
from dnb_edge.train.teach_paths import Seen
from dnb_edge.train.teach_points import choose_paths, label_drive, labels_of, mask_point, model_is_right
from dnb_edge.train.teach_sheet import parse_rejected

FPS = 15.0
SIZE = (320, 240)


def _floor(seed=1):
    rng = np.random.default_rng(seed)
    return cv2.resize(rng.integers(90, 150, (30, 40, 3), dtype=np.uint8), SIZE, interpolation=cv2.INTER_CUBIC)


def _at(n):
    """Where the drawn thing is in picture n: on a circle."""
    angle = n / 20
    return 160 + 90 * math.cos(angle), 120 + 70 * math.sin(angle)


def _drive(draw, count=90):
    """A drive of `count` pictures with noise, on each of which `draw(picture, n)` draws."""
    floor = _floor()

    def shots():
        for n in range(count):
            picture = floor.copy()
            draw(picture, n)
            noise = np.random.default_rng(n).normal(0, 2.0, picture.shape)
            yield Shot(number=n, t_s=n / FPS, bgr=np.clip(picture + noise, 0, 255).astype(np.uint8))

    return shots


def _car(picture, n):
    u, v = _at(n)
    cv2.ellipse(picture, ((u, v), (26, 16), 0.0), (30, 30, 200), -1)


def _nothing(picture, n):
    pass


def _lamp(picture, n):
    cv2.circle(picture, (60, 60), 9, (250, 250, 250) if n % 6 < 3 else (20, 20, 20), -1)


@pytest.fixture(scope="module")
def model():
    return load_builtin_model()


@pytest.fixture(scope="module")
def labels(model):
    """A drawn thing that drives in a circle, labelled."""
    return label_drive("circle.mp4", _drive(_car), model)


def test_the_floor_is_the_view_without_the_car():
    """The median over a drive shows the floor everywhere, though the car is in every picture."""
    floor, duration_s = median_floor(_drive(_car), "circle.mp4")
    assert np.abs(floor.astype(int) - _floor()).max() < 12
    assert duration_s == pytest.approx(89 / FPS)


def test_blobs_survive_a_change_of_light_and_a_car_stays_one_blob():
    """With the light a quarter brighter there is one region, where the car is; the bare floor gives none."""
    find = BlobFinder(_floor())
    picture = _floor()
    _car(picture, 7)
    bright = np.clip(picture.astype(float) * 1.25, 0, 255).astype(np.uint8)
    (blob,) = find(bright)
    assert blob.centre_px == pytest.approx(_at(7), abs=2.0)
    assert blob.length_px == pytest.approx(26, abs=5)
    assert find(np.clip(_floor() * 1.25, 0, 255).astype(np.uint8)) == ()
    assert find(np.full_like(picture, 255)) == ()


def test_a_driving_thing_is_labelled_in_nearly_all_pictures(labels):
    """The labels lie on the drawn thing, within a quarter of its length, with its length and its direction of travel."""
    assert len(labels.cars) > 80
    assert labels.paths == 1
    for number, (car,) in labels.cars.items():
        u, v = _at(number)
        assert math.dist(car.ground_px, (u, v)) < 7.0
        assert 18 < car.length_px < 40
        nu, nv = _at(number + 1)
        assert car.heading_rad is not None
        off = car.heading_rad - math.atan2(-(nv - v), nu - u)
        assert abs(math.remainder(off, 2 * math.pi)) < 0.4


@pytest.mark.parametrize("draw", [_nothing, _lamp], ids=["nothing", "a lamp that blinks"])
def test_footage_in_which_no_car_moves_says_so(model, draw):
    """A bare floor with noise, and a lamp that blinks on the spot: one line that names the drive and what to do."""
    with pytest.raises(InputError, match=r"still\.mp4: nothing moves.*: (drive|record)"):
        label_drive("still.mp4", _drive(draw), model)


def test_what_moves_beside_the_lane_is_no_car(model):
    """The same drive with a lane elsewhere: nothing moves on the lane."""
    with pytest.raises(InputError, match="nothing moves as a car does on the lane"):
        label_drive("circle.mp4", _drive(_car), model, lane=lambda w, h: np.zeros((h, w), bool))


def test_too_short_a_drive_is_refused(model):
    """Five pictures cannot tell the floor from a car."""
    with pytest.raises(InputError, match=r"short\.mp4: only 5 pictures"):
        label_drive("short.mp4", _drive(_car, 5), model)


def test_the_last_fifth_is_held_out(labels):
    """Pictures to learn from end before those to compare on begin; both carry the floor as background."""
    material = drive_material(labels, _drive(_car))
    last = max(one.number for one in material.learn)
    first = min(one.number for one in material.held_out)
    assert last < first
    assert last / 89 == pytest.approx(0.8, abs=0.03)
    assert all(one.background is labels.floor for one in material.learn)
    assert material.drives[0].first <= first
    assert set(material.drives[0].cars) == {one.number for one in material.held_out}
    check_enough(material)


def test_little_memory_thins_the_pictures(labels):
    """Room for 60 pictures: 45 to learn from and 15 or a few more to compare on, spread over the drive."""
    material = drive_material(labels, _drive(_car), most_bytes=60 * labels.floor.nbytes)
    assert len(material.learn) + len(material.held_out) <= 60
    assert count_cars(material.held_out) >= 15


def test_rejecting_all_leaves_too_few(labels, tmp_path):
    """Once everything on the sheet is rejected there is nothing left to teach from, and one line says so."""
    material = drive_material(labels, _drive(_car))
    shown = write_sheet(material, tmp_path / "sheet.png")
    sheet = cv2.imread(str(tmp_path / "sheet.png"))
    assert sheet is not None
    everything = parse_rejected("A", [*material.learn, *material.held_out], shown)
    emptied = rejecting(joined([material]), shown, everything)
    assert all(not car.sure for cars in emptied.drives[0].cars.values() for car in cars)
    with pytest.raises(InputError, match=r"circle\.mp4: 0 labelled cars are too few"):
        check_enough(emptied)


def _seen(n, model_px, box=(100.0, 100.0, 130.0, 120.0)):
    moved = (box[0] + 3 * n, box[1], box[2] + 3 * n, box[3])
    at = None if model_px is None else (model_px[0] + 3 * n, model_px[1])
    return Seen(number=n, t_s=n / FPS, blob=Blob(box_px=moved, area_px=400.0), model_px=at, model_length_px=28.0)


@pytest.mark.parametrize(
    ("model_px", "right"),
    [((115.0, 113.0), True), ((115.0, 103.0), False), ((129.0, 113.0), False), ((115.0, 119.9), False), (None, False)],
    ids=["on the foot", "too high", "at the side", "below", "unknown"],
)
def test_the_model_is_believed_where_the_mask_lets_a_footprint_be(model_px, right):
    """The model's point is the label's where it lies in the middle and low in the region; else the mask decides."""
    path = [_seen(n, model_px) for n in range(30)]
    assert model_is_right(path) is right
    labels, by_model = labels_of(path, 0)
    assert by_model is right
    expected = model_px if right else mask_point(path[0].blob)
    label = labels[15]
    assert label.ground_px == pytest.approx((expected[0] + 45, expected[1]), abs=0.2)


def test_one_wild_point_of_the_model_moves_no_label():
    """A single point 12 px off the path is dropped: the label stays on the path."""
    path = [_seen(n, (115.0, 113.0) if n != 15 else (127.0, 101.0)) for n in range(30)]
    labels, by_model = labels_of(path, 0)
    assert by_model
    assert labels[15].ground_px == pytest.approx((160.0, 113.0), abs=0.5)


def test_without_a_lane_paths_that_the_model_knows_go_first():
    """A person's path is left out where the model knows the car's; where it knows none, both are shown to the user."""
    known = [_seen(n, (115.0, 113.0)) for n in range(40)]
    unknown = [_seen(n, None, (100.0, 20.0, 140.0, 80.0)) for n in range(80)]
    for one, other in ((known, unknown), (unknown, known)):
        assert choose_paths([one, other], None) == [known]
    assert choose_paths([unknown], None) == [unknown]
