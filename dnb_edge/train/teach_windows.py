"""From the user's labelled pictures to training windows, mixed with drawn scenes: a thin adapter over `batches`.

Knows how a part of a picture becomes an input with targets like those of `batches`, which makes the drawn ones. Nothing of
torch.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.detect.background import difference
from dnb_edge.detect.centre import CentreDetectorSettings
from dnb_edge.detect.lean import UNKNOWN, LeanField, lean_bytes
from dnb_edge.train.batches import WINDOW_PX, Batch, make_window, moved_labels, targets_for
from dnb_edge.train.scene import LABEL_FIELDS, SCENE_PX, Sample, make_sample
from dnb_edge.train.teach_labels import LabelledPicture
from dnb_edge.values import BgrImage, PointPx

Rng = np.random.Generator

_HARD_SHARE = 0.3
_ANYWHERE_SHARE = 0.2
_BLIND_SHARE = 0.45
_LEAN_SHARE = 0.65


@dataclass(frozen=True, slots=True, kw_only=True)
class HardPlace:
    """A place of a picture that the network takes for a car though there is none."""

    picture: int
    centre_px: PointPx
    scale: float
    """Network px a picture px at which it was taken for one."""


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
    """One input and its targets, as `batches.make_window` gives them, that shows the place `centre_px` at about `scale`.

    A user's camera and car are what they are, so the place, scale, turn and light vary less than those of drawn scenes. A still
    has no background: its difference is always zero, as the detector's is before it has one; a drive's is zero now and then.
    """
    pictures, labels = cut_sample(picture, centre_px, scale)
    turn, mirror = float(rng.normal(0, 0.08)), (-1.0 if rng.random() < 0.5 else 1.0)
    linear = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]) @ np.diag([mirror, 1.0])
    linear = linear * math.exp(float(rng.normal(0, 0.06)))
    middle = np.full(2, (WINDOW_PX - 1) / 2.0) - linear @ np.full(2, (SCENE_PX - 1) / 2.0)
    transform = np.column_stack([linear, middle])
    image = _warped(pictures[0], transform)
    moved = np.zeros(image.shape[:2], dtype=np.uint8)
    if picture.background is not None and rng.random() > _BLIND_SHARE:
        if rng.random() < 0.3:  # a bump of the camera
            transform[:, 2] += rng.normal(0, 1.2, 2)
        moved = difference(image, _relit(_warped(pictures[1], np.column_stack([linear, transform[:, 2]])), rng, 0.03))
    window = np.dstack([_relit(image, rng, 0.12), moved])
    known = picture.lean is not None and rng.random() < _LEAN_SHARE
    window = _with_lean(window, picture.lean, centre_px, linear) if known else with_unknown_lean(window)
    return window, targets_for(moved_labels(labels, np.column_stack([linear, middle])))


def with_unknown_lean(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Colour and difference (h, w, 4) with the two channels that tell the lean, which is not known; (h, w, 6)."""
    return np.dstack([pixels, np.full((*pixels.shape[:2], 2), UNKNOWN, dtype=np.uint8)])


def _with_lean(
    pixels: NDArray[np.uint8], field: LeanField | None, centre_px: PointPx, linear: NDArray[np.float64]
) -> NDArray[np.uint8]:
    """As `with_unknown_lean`, told the lean at the window's middle, turned and mirrored as the window is."""
    if field is None:
        return with_unknown_lean(pixels)
    turn = linear / math.sqrt(abs(float(np.linalg.det(linear))))
    lean = lean_bytes(turn @ field(np.array([centre_px]))[0])
    return np.dstack([pixels, np.broadcast_to(lean, (*pixels.shape[:2], 2))])


def _warped(picture: NDArray[np.uint8], transform: NDArray[np.float64]) -> BgrImage:
    size = (WINDOW_PX, WINDOW_PX)
    return np.asarray(
        cv2.warpAffine(picture, transform, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE),
        dtype=np.uint8,
    )


def _relit(picture: BgrImage, rng: Rng, spread: float) -> BgrImage:
    """Another exposure, gamma and balance of colours, and now and then a little blur."""
    levels = (np.arange(256, dtype=np.float64) / 255.0)[:, None]
    gain = np.exp(rng.normal(0, spread) + rng.normal(0, 0.3 * spread, 3))
    table = np.clip(levels ** math.exp(float(rng.normal(0, 0.7 * spread))) * 255.0 * gain, 0, 255).astype(np.uint8)
    lit = cv2.LUT(picture, table[None])
    if rng.random() < 0.2:
        lit = cv2.GaussianBlur(lit, (0, 0), float(rng.uniform(0.4, 1.0)))
    return np.asarray(lit, dtype=np.uint8)


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
            made.append(make_window(pictures, sample.labels, rng, lean=sample.lean))
        return Batch(inputs=np.stack([window for window, _ in made]), targets=np.stack([target for _, target in made]))

    def _user(self, rng: Rng) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        kind = float(rng.random())
        hard = list(self.hard)
        if hard and kind < _HARD_SHARE:
            place = hard[int(rng.integers(len(hard)))]
            return user_window(
                self.pictures[place.picture], _beside(place.centre_px, place.scale, rng), place.scale, rng
            )
        picture = self.pictures[int(rng.integers(len(self.pictures)))]
        cars = [car for car in picture.cars if car.sure]
        if not cars or kind > 1.0 - _ANYWHERE_SHARE:
            return user_window(picture, *_anywhere(picture, rng), rng)
        car = cars[int(rng.integers(len(cars)))]
        wanted_px = CentreDetectorSettings().window_length_px * math.exp(float(rng.normal(0, 0.15)))
        if rng.random() < 0.5:
            wanted_px = math.exp(float(rng.uniform(math.log(14.0), math.log(60.0))))
        scale = wanted_px / car.length_px
        return user_window(picture, _beside(car.ground_px, scale, rng), scale, rng)


def _beside(at: PointPx, scale: float, rng: Rng) -> PointPx:
    """The centre of a window at `scale` that shows the place `at` somewhere."""
    u, v = (0.42 * WINDOW_PX / scale * rng.uniform(-1.0, 1.0, 2)).tolist()
    return at[0] + u, at[1] + v


def _anywhere(picture: LabelledPicture, rng: Rng) -> tuple[PointPx, float]:
    """A place of the picture, at one of the scales at which the detector looks for cars."""
    height, width = picture.bgr.shape[:2]
    settings = CentreDetectorSettings()
    scales = [min(1.0, settings.whole_width_px / width), min(1.0, settings.fine_width_px / width)]
    scales += [settings.window_length_px / car.length_px for car in picture.cars if car.sure]
    scale = float(scales[int(rng.integers(len(scales)))])
    reach = [max(0.0, side - SCENE_PX / scale) / 2 for side in (width, height)]
    u, v = (side / 2 + float(rng.uniform(-half, half)) for side, half in zip((width, height), reach, strict=True))
    return (u, v), scale


def drawn_samples(count: int, seed: int) -> list[Sample]:
    """Drawn scenes from `seed`, without photographs: none are needed to teach."""
    return [make_sample(np.random.default_rng([seed, 77, number])) for number in range(count)]
