"""From the user's labelled pictures to training windows, mixed with drawn scenes: a thin adapter over `batches`.

Knows how a part of a picture becomes a sample as `scene.make_sample` gives one, so that `batches.make_window` varies both
alike (scale, mirror, turn, light, imperfect or missing difference). Nothing of torch.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.detect.centre import CentreDetectorSettings
from dnb_edge.train.batches import Batch, make_window
from dnb_edge.train.scene import LABEL_FIELDS, SCENE_PX, Sample, make_sample
from dnb_edge.train.teach_labels import CarLabel, LabelledPicture
from dnb_edge.values import BgrImage, PointPx

Rng = np.random.Generator

_LARGEST_CAR_PX = 64.0
"""A car in a sample is at most so long: the network never sees it much longer."""
_HARD_SHARE = 0.3
_ANYWHERE_SHARE = 0.2
_BLIND_SHARE = 0.33


@dataclass(frozen=True, slots=True, kw_only=True)
class HardPlace:
    """A place of a picture that the network takes for a car though there is none."""

    picture: int
    centre_px: PointPx
    scale: float
    """Network px a picture px at which it was taken for one."""


def car_scale(car: CarLabel) -> float:
    """Sample px a picture px for a sample that shows this car: 1, or what makes a large car small enough."""
    return min(1.0, _LARGEST_CAR_PX / car.length_px)


def cut_sample(
    picture: LabelledPicture, centre_px: PointPx, scale: float
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Pictures (2, SCENE_PX, SCENE_PX, 3), image then background, and labels (k, 6) of the square about `centre_px`.

    A still is its own background. A heading that is not known is (0, 0).
    """
    side = max(16, round(SCENE_PX / scale))
    left, top = round(centre_px[0] - side / 2), round(centre_px[1] - side / 2)
    image = _square(picture.bgr, left, top, side)
    behind = image if picture.background is None else _square(picture.background, left, top, side)
    scale = SCENE_PX / side
    rows = []
    for car in picture.cars:
        u = (car.ground_px[0] - left + 0.5) * scale - 0.5
        v = (car.ground_px[1] - top + 0.5) * scale - 0.5
        length = car.length_px * scale
        if -length < u < SCENE_PX + length and -length < v < SCENE_PX + length:
            ahead = (0.0, 0.0)
            if car.heading_rad is not None:
                ahead = (math.cos(car.heading_rad), math.sin(car.heading_rad))
            rows.append([u, v, length, *ahead, float(car.sure)])
    labels = np.array(rows, dtype=np.float32).reshape(-1, LABEL_FIELDS)
    return np.stack([image, behind]), labels


def _square(picture: BgrImage, left: int, top: int, side: int) -> BgrImage:
    """A square of the picture at SCENE_PX; beyond the picture's edge the edge is repeated."""
    height, width = picture.shape[:2]
    x0, y0 = min(max(0, left), width - 1), min(max(0, top), height - 1)
    x1, y1 = max(x0 + 1, min(width, left + side)), max(y0 + 1, min(height, top + side))
    borders = (max(0, y0 - top), max(0, top + side - y1), max(0, x0 - left), max(0, left + side - x1))
    part = cv2.copyMakeBorder(picture[y0:y1, x0:x1], *borders, cv2.BORDER_REPLICATE)
    method = cv2.INTER_AREA if side > SCENE_PX else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(part, (SCENE_PX, SCENE_PX), interpolation=method), dtype=np.uint8)


def user_window(
    picture: LabelledPicture, centre_px: PointPx, scale: float, rng: Rng
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """One input and its targets, as `batches.make_window`, from a part of a user's picture.

    A still has no background: its difference is always zero, as the detector's is for the first picture that it sees. That of
    a drive is zero in a third of the windows, beside those that `make_window` leaves without one.
    """
    pictures, labels = cut_sample(picture, centre_px, scale)
    window, targets = make_window(pictures, labels, rng)
    if picture.background is None or rng.random() < _BLIND_SHARE:
        window[:, :, 3] = 0
    return window, targets


@dataclass(slots=True, kw_only=True)
class WindowMaker:
    """Makes batches of the user's windows and of drawn ones."""

    pictures: Sequence[LabelledPicture]
    drawn: Sequence[Sample]
    """Drawn scenes, so that nothing is forgotten."""
    user_share: float = 0.6
    """Share of a batch that is the user's."""
    hard: list[HardPlace] = field(default_factory=list)
    """What to learn is no car; added to while learning."""

    def batch(self, size: int, rng: Rng) -> Batch:
        """A batch of `size` windows."""
        users = round(self.user_share * size) if self.drawn else size
        made = [self._user(rng) for _ in range(users)]
        for _ in range(size - users):
            sample = self.drawn[int(rng.integers(len(self.drawn)))]
            pictures = np.stack([sample.image, sample.background])
            made.append(make_window(pictures, sample.labels, rng))
        return Batch(inputs=np.stack([window for window, _ in made]), targets=np.stack([target for _, target in made]))

    def _user(self, rng: Rng) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        kind = float(rng.random())
        hard = list(self.hard)
        if hard and kind < _HARD_SHARE:
            place = hard[int(rng.integers(len(hard)))]
            shift = rng.uniform(-0.3, 0.3, 2) * SCENE_PX / place.scale
            at = (place.centre_px[0] + float(shift[0]), place.centre_px[1] + float(shift[1]))
            return user_window(self.pictures[place.picture], at, place.scale, rng)
        picture = self.pictures[int(rng.integers(len(self.pictures)))]
        cars = [car for car in picture.cars if car.sure]
        if not cars or kind > 1.0 - _ANYWHERE_SHARE:
            return user_window(picture, *_anywhere(picture, rng), rng)
        car = cars[int(rng.integers(len(cars)))]
        scale = car_scale(car)
        shift = rng.uniform(-0.35, 0.35, 2) * SCENE_PX / scale
        return user_window(
            picture, (car.ground_px[0] + float(shift[0]), car.ground_px[1] + float(shift[1])), scale, rng
        )


def _anywhere(picture: LabelledPicture, rng: Rng) -> tuple[PointPx, float]:
    """A place of the picture, at one of the scales at which the detector looks for cars."""
    height, width = picture.bgr.shape[:2]
    settings = CentreDetectorSettings()
    scales = [min(1.0, settings.whole_width_px / width), min(1.0, settings.fine_width_px / width)]
    scales += [car_scale(car) for car in picture.cars]
    scale = float(scales[int(rng.integers(len(scales)))])
    reach = [max(0.0, side - SCENE_PX / scale) / 2 for side in (width, height)]
    u, v = (side / 2 + float(rng.uniform(-half, half)) for side, half in zip((width, height), reach, strict=True))
    return (u, v), scale


def drawn_samples(count: int, seed: int) -> list[Sample]:
    """Drawn scenes from `seed`, without photographs: none are needed to teach."""
    return [make_sample(np.random.default_rng([seed, 77, number])) for number in range(count)]
