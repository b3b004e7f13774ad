"""The contact sheet: what a person looks at to accept the labels or to reject some, and what a rejection does.

Knows pictures and labels; asks nobody (`cli/teach.py` does).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from string import ascii_uppercase

import cv2
import numpy as np

from dnb_edge.errors import InputError
from dnb_edge.train.teach_labels import CarLabel, LabelledPicture, evenly
from dnb_edge.values import BgrImage

MOST_SHOWN = 60
_COLUMNS = 10
_TILE_PX = 128
_CAPTION_PX = 18
_LENGTHS = 2.2
"""A tile shows as many car lengths."""
_CROSS = (80, 255, 80)


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelPlace:
    """Which label of which picture."""

    picture: int
    car: int


def sure_places(pictures: Sequence[LabelledPicture]) -> list[LabelPlace]:
    """All sure labels, path by path, in the order of the pictures."""
    places = [
        LabelPlace(picture=number, car=index)
        for number, picture in enumerate(pictures)
        for index, car in enumerate(picture.cars)
        if car.sure
    ]
    return sorted(places, key=lambda place: (_path(pictures, place), place.picture, place.car))


def _path(pictures: Sequence[LabelledPicture], place: LabelPlace) -> int:
    path = pictures[place.picture].cars[place.car].path
    return -1 if path is None else path


def shown_places(pictures: Sequence[LabelledPicture]) -> list[LabelPlace]:
    """The labels on the sheet: all, or MOST_SHOWN that are evenly spread; number n of the sheet is the n-th, from 1."""
    places = sure_places(pictures)
    return [places[index] for index in evenly(len(places), MOST_SHOWN)]


def path_letter(path: int | None) -> str:
    """A, B, ... for the paths of drives; nothing for hand-drawn labels."""
    return "" if path is None else ascii_uppercase[path % len(ascii_uppercase)]


def draw_sheet(pictures: Sequence[LabelledPicture], shown: Sequence[LabelPlace]) -> BgrImage:
    """The sheet: a tile a label, with its number, its path's letter, a cross at its ground point and its heading."""
    columns = min(_COLUMNS, max(1, len(shown)))
    rows = max(1, math.ceil(len(shown) / columns))
    sheet = np.full((rows * (_TILE_PX + _CAPTION_PX), columns * _TILE_PX, 3), 40, dtype=np.uint8)
    for index, place in enumerate(shown):
        row, column = divmod(index, columns)
        top, left = row * (_TILE_PX + _CAPTION_PX), column * _TILE_PX
        picture = pictures[place.picture]
        car = picture.cars[place.car]
        sheet[top + _CAPTION_PX : top + _CAPTION_PX + _TILE_PX, left : left + _TILE_PX] = _tile(picture.bgr, car)
        caption = f"{index + 1} {path_letter(car.path)}"
        cv2.putText(
            sheet, caption, (left + 3, top + _CAPTION_PX - 5), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (255, 255, 255), 1, cv2.LINE_AA
        )  # fmt: skip
    return sheet


def _tile(picture: BgrImage, car: CarLabel) -> BgrImage:
    side = max(16.0, _LENGTHS * car.length_px)
    scale = _TILE_PX / side
    u, v = car.ground_px
    middle = (_TILE_PX - 1) / 2.0
    transform = np.array([[scale, 0.0, middle - scale * u], [0.0, scale, middle - scale * v]])
    method = cv2.INTER_LINEAR if scale > 0.5 else cv2.INTER_AREA
    warped = cv2.warpAffine(picture, transform, (_TILE_PX, _TILE_PX), flags=method, borderValue=(40.0, 40.0, 40.0))
    tile = np.asarray(warped, dtype=np.uint8)
    at = round(middle)
    cv2.drawMarker(tile, (at, at), _CROSS, cv2.MARKER_CROSS, 13, 1)
    if car.box_px is not None:
        left, top, right, bottom = (
            round(middle + scale * (edge - own)) for edge, own in zip(car.box_px, (u, v, u, v), strict=True)
        )
        cv2.rectangle(tile, (left, top), (right, bottom), _CROSS, 1)
    if car.heading_rad is not None:
        reach = 0.5 * car.length_px * scale
        tip = (round(at + reach * math.cos(car.heading_rad)), round(at - reach * math.sin(car.heading_rad)))
        cv2.line(tile, (at, at), tip, _CROSS, 1, cv2.LINE_AA)
    return tile


def parse_rejected(text: str, pictures: Sequence[LabelledPicture], shown: Sequence[LabelPlace]) -> set[int]:
    """Indices into `shown` from a text such as `3, 17` or `B`: numbers of the sheet, or letters of whole paths.

    Raises InputError for a number or a letter that is not on the sheet.
    """
    letters = [path_letter(pictures[place.picture].cars[place.car].path) for place in shown]
    rejected: set[int] = set()
    for word in text.replace(",", " ").split():
        if word.isascii() and word.isdigit() and 1 <= int(word) <= len(shown):
            rejected.add(int(word) - 1)
        elif word.upper() in letters:
            rejected |= {index for index, letter in enumerate(letters) if letter == word.upper()}
        else:
            raise InputError(
                f"{word!r} is not on the contact sheet: reject numbers from 1 to {len(shown)}, such as 3,17"
            )
    return rejected


def without_rejected(
    pictures: Sequence[LabelledPicture], shown: Sequence[LabelPlace], rejected: set[int]
) -> list[LabelledPicture]:
    """The pictures, with the rejected labels and those that they stand for made unsure: nothing is learnt there.

    A label stands for those of its path that are nearer to it than to any other label on the sheet.
    """
    places = sure_places(pictures)
    order = {place: index for index, place in enumerate(places)}
    on_sheet = np.array([order[place] for place in shown])
    unsure: set[LabelPlace] = set()
    for index, place in enumerate(places):
        same = [n for n, other in enumerate(shown) if _path(pictures, other) == _path(pictures, place)]
        nearest = min(same, key=lambda n: (abs(int(on_sheet[n]) - index), n), default=None)
        if nearest is not None and nearest in rejected:
            unsure.add(place)
    return [
        replace(
            picture,
            cars=tuple(
                replace(car, sure=car.sure and LabelPlace(picture=number, car=index) not in unsure)
                for index, car in enumerate(picture.cars)
            ),
        )
        for number, picture in enumerate(pictures)
    ]
