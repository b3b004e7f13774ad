"""The contact sheet: what it shows, what a rejection means, and what is refused."""

import numpy as np
import pytest

from dnb_edge.errors import InputError
from dnb_edge.train.teach_labels import CarLabel, LabelledPicture, count_cars
from dnb_edge.train.teach_sheet import (
    MOST_SHOWN,
    LabelPlace,
    draw_sheet,
    parse_rejected,
    shown_places,
    without_rejected,
)


def _drive(count, paths=1):
    """Pictures with one car of each path, whose ground point tells picture and path."""
    picture = np.full((90, 160, 3), 60, np.uint8)
    return [
        LabelledPicture(
            name=str(n),
            bgr=picture,
            background=picture,
            number=n,
            cars=tuple(CarLabel(ground_px=(20.0 + n, 20.0 + 30 * p), length_px=16.0, path=p) for p in range(paths)),
        )
        for n in range(count)
    ]


@pytest.mark.parametrize("count", [1, 7, 60, 200])
def test_the_sheet_shows_all_labels_or_sixty_of_them(count):
    """One tile a label up to sixty; beyond, sixty from the first to the last."""
    pictures = _drive(count)
    shown = shown_places(pictures)
    assert len(shown) == min(count, MOST_SHOWN)
    assert (shown[0].picture, shown[-1].picture) == (0, count - 1)
    sheet = draw_sheet(pictures, shown)
    assert sheet.shape[0] == -(-len(shown) // 10) * 146
    assert sheet.max() > 200


def test_unsure_labels_are_not_on_the_sheet():
    """What nothing is learnt from needs nobody's consent."""
    doubtful = CarLabel(ground_px=(5.0, 5.0), length_px=9.0, sure=False)
    picture = LabelledPicture(name="a", bgr=np.zeros((9, 9, 3), np.uint8), background=None, cars=(doubtful,))
    assert shown_places([picture]) == []
    assert draw_sheet([picture], []).size


def test_numbers_and_letters_are_understood():
    """Numbers with commas or spaces, letters of either case; nothing is nothing."""
    pictures = _drive(10, paths=2)
    shown = shown_places(pictures)
    assert parse_rejected("3, 17", pictures, shown) == {2, 16}
    assert parse_rejected("b", pictures, shown) == set(range(10, 20))
    assert parse_rejected("1 1,2", pictures, shown) == {0, 1}
    assert parse_rejected("  ", pictures, shown) == set()


@pytest.mark.parametrize("text", ["0", "21", "-1", "C", "3;4", "1.5", "²"])
def test_what_is_not_on_the_sheet_is_refused(text):
    """A number beyond the sheet, a letter of no path and anything else is an InputError that says what there is."""
    pictures = _drive(10, paths=2)
    with pytest.raises(InputError, match="from 1 to 20"):
        parse_rejected(text, pictures, shown_places(pictures))


def test_a_rejected_label_takes_those_that_it_stands_for_with_it():
    """Of 200 labels and 60 on the sheet, rejecting one makes the three or four about it unsure, and no other path's."""
    pictures = _drive(200, paths=2)
    shown = shown_places(pictures)
    rejected = parse_rejected("30", pictures, shown)
    kept = without_rejected(pictures, shown, rejected)
    gone = [(n, car.path) for n, one in enumerate(kept) for car in one.cars if not car.sure]
    place = shown[29]
    path = pictures[place.picture].cars[place.car].path
    assert 5 <= len(gone) <= 8
    assert {other for _, other in gone} == {path}
    assert all(abs(n - place.picture) <= 4 for n, _ in gone)


def test_rejecting_a_letter_leaves_the_other_path_whole():
    """Path B goes, all of it; path A stays, all of it."""
    pictures = _drive(100, paths=2)
    shown = shown_places(pictures)
    kept = without_rejected(pictures, shown, parse_rejected("B", pictures, shown))
    assert count_cars(kept) == 100
    assert all(car.path == 0 for one in kept for car in one.cars if car.sure)
    assert len(kept[0].cars) == 2


def test_a_rejected_label_at_the_end_of_a_path_leaves_the_next_path_alone():
    """The end of path A stands for path A alone, though the beginning of B follows it on the sheet."""
    pictures = _drive(50, paths=2)
    shown = [LabelPlace(picture=49, car=0), LabelPlace(picture=49, car=1)]
    kept = without_rejected(pictures, shown, {0})
    assert count_cars(kept) == 50
    assert {car.path for one in kept for car in one.cars if not car.sure} == {0}
