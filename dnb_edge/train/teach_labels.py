"""What a model is taught from: pictures with their cars, hand-labelled ones read from YOLO text files, and the held-out part.

Knows pictures, label files and how a box becomes a ground point; nothing of networks and nothing of motion.

A YOLO box says nothing of the floor. A camera that looks down at 30 to 90 degrees sees the footprint's centre between the
box's centre (looking straight down) and a little below it, since what stands up leans up in the picture: the ground point of
a box is its centre moved down by `GROUND_SHARE` of its height.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import cv2
import numpy as np

from dnb_edge.detect.lean import LeanField
from dnb_edge.errors import InputError
from dnb_edge.values import BgrImage, PointPx

Box: TypeAlias = tuple[float, float, float, float]
"""Left, top, right, bottom, px of the picture."""

GROUND_SHARE = 0.1
"""Share of a box's height by which the ground point lies below the box's centre."""
LARGEST_SIDE_PX = 1920
"""Larger pictures are shrunk to it: a car is then still larger than the network wants to see it."""
LEAST_LABELS = 20
"""Fewer labelled cars teach nothing that lasts."""
HELD_OUT_SHARE = 0.2
_LEAST_LENGTH_PX = 6.0
_KINDS = {".jpg", ".jpeg", ".png", ".bmp", ".webp"}


@dataclass(frozen=True, slots=True, kw_only=True)
class CarLabel:
    """One car in one picture."""

    ground_px: PointPx
    length_px: float
    """Longest side of its upright box, px of the picture."""
    heading_rad: float | None = None
    """As in `Detection.heading_rad`; None where nobody knows."""
    box_px: Box | None = None
    """Its box, where a person drew one."""
    path: int | None = None
    """Number of the path in its drive; None in a hand-labelled picture."""
    sure: bool = True
    """False: there may be a car or not; nothing is learnt here."""

    def is_hit_by(self, point_px: PointPx) -> bool:
        """True where a found ground point counts as this car: in its box, or within half its length without one."""
        if self.box_px is not None:
            left, top, right, bottom = self.box_px
            return left <= point_px[0] <= right and top <= point_px[1] <= bottom
        apart = np.hypot(point_px[0] - self.ground_px[0], point_px[1] - self.ground_px[1])
        return bool(apart <= 0.5 * self.length_px)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LabelledPicture:
    """A picture with all its cars."""

    name: str
    """Its file, or the drive and the second in it."""
    bgr: BgrImage
    background: BgrImage | None
    """The same view without cars, of the same size; None for a still."""
    cars: tuple[CarLabel, ...]
    number: int | None = None
    """Its place in its drive; None for a still."""
    lean: LeanField | None = None
    """How things lean in it, by the calibration; None where that is not known."""


def shrunk(picture: BgrImage) -> tuple[BgrImage, float]:
    """The picture, at most LARGEST_SIDE_PX on its longer side, and the factor by which it was shrunk."""
    factor = LARGEST_SIDE_PX / max(picture.shape[:2])
    if factor >= 1.0:
        return picture, 1.0
    return np.asarray(cv2.resize(picture, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA), np.uint8), factor


def car_of_box(box: Box) -> CarLabel:
    """The label of a box that a person drew."""
    left, top, right, bottom = box
    width, height = right - left, bottom - top
    length = max(width, height)
    ground = ((left + right) / 2.0, (top + bottom) / 2.0 + GROUND_SHARE * height)
    return CarLabel(ground_px=ground, length_px=length, box_px=box, sure=length >= _LEAST_LENGTH_PX)


def read_yolo(path: Path, width_px: int, height_px: int) -> tuple[CarLabel, ...]:
    """The cars of one YOLO text file: a line `class cx cy w h` each, in shares of the picture; every class is a car.

    Raises InputError, naming file and line, for anything else.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()  # some editors begin a text with a mark
    except (OSError, UnicodeDecodeError) as fault:
        raise InputError(f"{path}: the labels cannot be read: they are text, a line 'class cx cy w h' a car") from fault
    return tuple(
        car_of_box(_box(path, number, line, width_px, height_px))
        for number, line in enumerate(lines, 1)
        if line.strip()
    )


def _box(path: Path, number: int, line: str, width_px: int, height_px: int) -> Box:
    words = line.split()
    try:
        cx, cy, w, h = (float(word) for word in words[1:])
        int(float(words[0]))
    except (ValueError, OverflowError) as fault:
        raise InputError(
            f"{path}, line {number}: {line.strip()[:60]!r} is not 'class cx cy w h': export the labels as YOLO boxes"
        ) from fault
    if not (0.0 <= cx <= 1.0 and 0.0 <= cy <= 1.0 and 0.0 < w <= 1.0 and 0.0 < h <= 1.0):
        raise InputError(
            f"{path}, line {number}: box {cx:g} {cy:g} {w:g} {h:g} is not in shares of the picture, 0 to 1"
        )
    # pixel centres lie at whole numbers
    return (
        (cx - w / 2) * width_px - 0.5,
        (cy - h / 2) * height_px - 0.5,
        (cx + w / 2) * width_px - 0.5,
        (cy + h / 2) * height_px - 0.5,
    )


def label_file(picture: Path) -> Path | None:
    """The label file of a picture: beside it, or in `labels` where the picture is in `images`; None where there is none."""
    places = [picture.with_suffix(".txt")]
    parts = list(picture.parts)
    if "images" in parts:
        at = len(parts) - 1 - parts[::-1].index("images")
        places.append(Path(*parts[:at], "labels", *parts[at + 1 :]).with_suffix(".txt"))
    return next((place for place in places if place.is_file()), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelledFolder:
    """What a folder of hand-labelled pictures held."""

    pictures: tuple[LabelledPicture, ...]
    unlabelled: int
    """Pictures without a label file: left out, since nobody said whether they show a car."""


def read_labelled(folder: Path, *, most_bytes: int) -> LabelledFolder:
    """The labelled pictures under `folder` in the order of their names, evenly thinned to `most_bytes` of pixels.

    Raises InputError for a folder without pictures or without any label file, an unreadable picture and a bad label.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: not a folder: give one with pictures and YOLO labels")
    paths = sorted(path for path in folder.rglob("*") if path.suffix.lower() in _KINDS and path.is_file())
    if not paths:
        raise InputError(f"{folder}: no pictures (.jpg, .png) in this folder")
    found = [(path, label_file(path)) for path in paths]
    labelled = [(path, labels) for path, labels in found if labels is not None]
    if not labelled:
        raise InputError(
            f"{folder}: {len(paths)} pictures and no label file: put YOLO labels beside them, NAME.txt for NAME.jpg"
        )
    first = _read_picture(*labelled[0])
    room = max(1, most_bytes // first.bgr.nbytes)
    kept = [labelled[number] for number in evenly(len(labelled), room)]
    return LabelledFolder(
        pictures=tuple(_read_picture(path, labels) for path, labels in kept), unlabelled=len(paths) - len(labelled)
    )


def _read_picture(path: Path, labels: Path) -> LabelledPicture:
    read = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if read is None:
        raise InputError(f"{path}: not a readable picture: mend or remove it")
    picture, _ = shrunk(np.asarray(read, dtype=np.uint8))
    cars = read_yolo(labels, picture.shape[1], picture.shape[0])
    return LabelledPicture(name=path.name, bgr=picture, background=None, cars=cars)


def evenly(count: int, most: int) -> list[int]:
    """At most `most` of the numbers 0 .. count - 1, evenly spread."""
    if count <= most:
        return list(range(count))
    return [int(number) for number in np.linspace(0, count - 1, most).round()]


def split_stills(pictures: Sequence[LabelledPicture], seed: int) -> tuple[list[LabelledPicture], list[LabelledPicture]]:
    """Pictures to learn from and a fifth of them to compare on, drawn by `seed`; at least one each."""
    order = np.random.default_rng([seed, 20]).permutation(len(pictures))
    held = max(1, round(HELD_OUT_SHARE * len(pictures)))
    chosen = {int(number) for number in order[:held]}
    return (
        [one for number, one in enumerate(pictures) if number not in chosen],
        [one for number, one in enumerate(pictures) if number in chosen],
    )


def count_cars(pictures: Sequence[LabelledPicture]) -> int:
    """Number of sure cars in the pictures."""
    return sum(car.sure for picture in pictures for car in picture.cars)
