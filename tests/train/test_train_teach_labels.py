"""Hand-labelled pictures: YOLO files become ground points, and what cannot be learnt from is refused in one line."""

from itertools import pairwise

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.errors import InputError
from dnb_edge.train.teach_labels import (
    GROUND_SHARE,
    LARGEST_SIDE_PX,
    CarLabel,
    LabelledPicture,
    count_cars,
    evenly,
    read_labelled,
    read_yolo,
    split_stills,
)


def _picture(path, size=(60, 80)):
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), np.full((*size, 3), 90, np.uint8))


def test_a_boxs_ground_point_lies_a_little_below_its_centre(tmp_path):
    """A box of 20 x 10 px about (40, 30): ground point a tenth of its height below the centre, length its longer side."""
    path = tmp_path / "one.txt"
    path.write_text("0 0.5 0.5 0.25 0.16666666666\n\n")
    (car,) = read_yolo(path, 80, 60)
    assert car.ground_px == pytest.approx((39.5, 29.5 + GROUND_SHARE * 10.0), abs=1e-6)
    assert car.length_px == pytest.approx(20.0)
    assert car.box_px == pytest.approx((29.5, 24.5, 49.5, 34.5), abs=1e-6)
    assert car.heading_rad is None
    assert car.sure


def test_a_byte_order_mark_is_no_part_of_a_label(tmp_path):
    """Label files that an editor began with a mark are read as those without."""
    path = tmp_path / "one.txt"
    path.write_text("0 0.5 0.5 0.25 0.25\n", encoding="utf-8-sig")
    assert len(read_yolo(path, 80, 60)) == 1


def test_a_tiny_box_is_neither_car_nor_floor(tmp_path):
    """Five pixels are too few to learn from, and no proof that there is no car."""
    path = tmp_path / "one.txt"
    path.write_text("1 0.5 0.5 0.05 0.05\n")
    (car,) = read_yolo(path, 100, 100)
    assert not car.sure


@pytest.mark.parametrize(
    "line",
    [
        "0 0.5 0.5 0.2",
        "0 0.5 0.5 0.2 0.2 0.9",
        "car 0.5 0.5 0.2 0.2",
        "0 50 50 20 20",
        "0 0.5 0.5 0 0.1",
        "0 nan 0.5 0.1 0.1",
        "inf 0.5 0.5 0.1 0.1",
    ],
)
def test_a_bad_line_is_named(tmp_path, line):
    """Missing, surplus and ill-typed numbers, pixels instead of shares: an InputError with file and line number."""
    path = tmp_path / "bad.txt"
    path.write_text(f"0 0.5 0.5 0.1 0.1\n{line}\n")
    with pytest.raises(InputError, match=r"bad\.txt, line 2"):
        read_yolo(path, 100, 100)


@pytest.mark.parametrize(("images", "labels"), [(".", "."), ("images", "labels"), ("train/images", "train/labels")])
def test_labels_are_found_beside_the_pictures_or_in_their_own_folder(tmp_path, images, labels):
    """Both layouts of YOLO folders are read; an empty label file says that there is no car."""
    for name, text in (("a", "0 0.5 0.5 0.3 0.3\n0 0.2 0.2 0.2 0.2\n"), ("b", "")):
        _picture(tmp_path / images / f"{name}.png")
        (tmp_path / labels).mkdir(parents=True, exist_ok=True)
        (tmp_path / labels / f"{name}.txt").write_text(text)
    _picture(tmp_path / images / "c.png")
    folder = read_labelled(tmp_path, most_bytes=10**9)
    assert [(one.name, len(one.cars)) for one in folder.pictures] == [("a.png", 2), ("b.png", 0)]
    assert folder.unlabelled == 1
    assert all(one.background is None for one in folder.pictures)


def test_a_large_picture_is_shrunk_with_its_labels(tmp_path):
    """A picture of 4000 px: at most LARGEST_SIDE_PX, and the label where it was, in shares."""
    _picture(tmp_path / "large.png", (2000, 4000))
    (tmp_path / "large.txt").write_text("0 0.25 0.5 0.1 0.1\n")
    (one,) = read_labelled(tmp_path, most_bytes=10**9).pictures
    assert max(one.bgr.shape) == LARGEST_SIDE_PX
    assert one.cars[0].length_px == pytest.approx(LARGEST_SIDE_PX / 10)


def test_what_is_no_labelled_folder_is_refused(tmp_path):
    """No folder, an empty one, one without any label file, an unreadable picture: one line that names it."""
    empty = tmp_path / "empty"
    empty.mkdir()
    bare = tmp_path / "bare"
    _picture(bare / "a.jpg")
    torn = tmp_path / "torn"
    torn.mkdir()
    (torn / "a.jpg").write_bytes(b"no picture")
    (torn / "a.txt").write_text("0 0.5 0.5 0.2 0.2\n")
    for folder, says in (
        (tmp_path / "none", "not a folder"),
        (empty, "no pictures"),
        (bare, "no label file"),
        (torn, r"a\.jpg: not a readable picture"),
    ):
        with pytest.raises(InputError, match=says) as caught:
            read_labelled(folder, most_bytes=10**9)
        assert folder.name in str(caught.value)


def test_many_pictures_are_thinned_to_what_memory_holds(tmp_path):
    """Ten pictures and room for four: the first, the last and two between."""
    for number in range(10):
        _picture(tmp_path / f"{number}.png")
        (tmp_path / f"{number}.txt").write_text("0 0.5 0.5 0.2 0.2\n")
    kept = read_labelled(tmp_path, most_bytes=4 * 60 * 80 * 3).pictures
    assert [one.name for one in kept] == ["0.png", "3.png", "6.png", "9.png"]


@given(count=st.integers(1, 400), most=st.integers(1, 100))
def test_evenly_keeps_order_and_ends(count, most):
    """Never more than asked, strictly increasing, from first to last."""
    chosen = evenly(count, most)
    assert len(chosen) == min(count, most)
    assert all(a < b for a, b in pairwise(chosen))
    assert chosen[0] == 0
    assert most == 1 or chosen[-1] == count - 1


@given(count=st.integers(2, 120), seed=st.integers(0, 5))
def test_the_split_is_a_partition_that_the_seed_decides(count, seed):
    """A fifth is held out, nothing is on both sides, and the same seed splits the same way."""
    pictures = [
        LabelledPicture(name=str(n), bgr=np.zeros((2, 2, 3), np.uint8), background=None, cars=()) for n in range(count)
    ]
    learn, held = split_stills(pictures, seed)
    assert sorted(int(one.name) for one in [*learn, *held]) == list(range(count))
    assert len(held) == max(1, round(count / 5))
    assert [one.name for one in split_stills(pictures, seed)[1]] == [one.name for one in held]


def test_a_find_counts_in_the_box_or_within_half_a_length():
    """With a drawn box the find must lie in it; without, within half the car's length of the ground point."""
    boxed = CarLabel(ground_px=(10.0, 10.0), length_px=10.0, box_px=(5.0, 5.0, 15.0, 14.0))
    free = CarLabel(ground_px=(10.0, 10.0), length_px=10.0)
    assert boxed.is_hit_by((14.9, 13.9))
    assert not boxed.is_hit_by((10.0, 14.5))
    assert not boxed.is_hit_by((4.0, 10.0))
    assert not boxed.is_hit_by((16.0, 10.0))
    assert free.is_hit_by((10.0, 14.9))
    assert not free.is_hit_by((14.0, 14.0))


def test_only_sure_cars_are_counted():
    """Doubtful labels are no cars to learn from."""
    cars = (CarLabel(ground_px=(1.0, 1.0), length_px=9.0), CarLabel(ground_px=(1.0, 1.0), length_px=9.0, sure=False))
    picture = LabelledPicture(name="a", bgr=np.zeros((2, 2, 3), np.uint8), background=None, cars=cars)
    assert count_cars([picture, picture]) == 2
