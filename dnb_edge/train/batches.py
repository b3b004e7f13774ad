"""Training batches: random windows of samples, an imperfect background difference, and the targets on the network's grid.

Knows how a sample becomes an input and its targets; nothing of torch. Everything random comes from the generator handed in.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.detect.background import difference
from dnb_edge.detect.lean import UNKNOWN, lean_bytes
from dnb_edge.train.scene import SCENE_PX
from dnb_edge.values import BgrImage

Rng = np.random.Generator
FloatImage = NDArray[np.float32]

WINDOW_PX = 128
CELL_PX = 4
GRID = WINDOW_PX // CELL_PX
TARGETS = 11
"""Channels of the targets: heat, vote weight, offset u, offset v, log size, cos 2a, sin 2a, cos a, sin a, heat weight, sense
weight."""
FOLLOWED_LENGTH_PX = 44.0
"""Length of a followed car in its window: half of the windows are made like that, the others of all sizes."""
REFERENCE_LENGTH_PX = 32.0
_VOTE_CELLS = 1.6
_LEAST_SCALE = WINDOW_PX / SCENE_PX + 0.001


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Batch:
    """Inputs (n, 128, 128, 6) uint8 and targets (n, 11, 32, 32) float32."""

    inputs: NDArray[np.uint8]
    targets: NDArray[np.float32]


def _window_transform(labels: FloatImage, rng: Rng, about_px: tuple[float, float] | None = None) -> NDArray[np.float64]:
    """A (2, 3) affine map from sample px to window px: scale, slight turn, mirror, and a place that mostly shows a car.

    No quarter turns: a camera that hangs the right way up is the rule (the samples hold the exceptions), and what stands on the
    floor then leans up in the picture, which is what tells the ground point from the body's middle.
    """
    scale = float(np.exp(rng.uniform(math.log(_LEAST_SCALE), math.log(1.4))))
    cars = labels[(labels[:, 2] > 0) & (labels[:, 5] > 0)]
    if about_px is not None:
        scale = float(np.exp(rng.uniform(math.log(_LEAST_SCALE), math.log(1.8))))
        centre = np.array(about_px) + rng.uniform(-0.35, 0.35, 2) * WINDOW_PX / scale
    elif len(cars) and rng.random() < 0.85:
        car = cars[int(rng.integers(len(cars)))]
        followed = rng.random() < 0.5
        wanted = FOLLOWED_LENGTH_PX * math.exp(rng.normal(0, 0.15)) if followed else math.exp(rng.uniform(2.5, 4.25))
        scale = float(np.clip(wanted / float(car[2]), _LEAST_SCALE, 2.2))
        reach = (1.0 * float(car[2]) * scale if followed else WINDOW_PX * 0.5 - 5.0) / scale
        centre = car[:2].astype(np.float64) + rng.uniform(-reach, reach, 2)
    else:
        half = WINDOW_PX * 0.5 / scale
        low, high = min(half, SCENE_PX / 2), max(SCENE_PX - half, SCENE_PX / 2)
        centre = rng.uniform(low, high, 2)
    half = WINDOW_PX * 0.5 / scale
    if 2 * half < SCENE_PX:
        centre = np.clip(centre, half, SCENE_PX - half)
    mirror = -1.0 if rng.random() < 0.5 else 1.0
    turn = float(rng.normal(0, 0.1))
    linear = (
        scale * np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]) @ np.diag([mirror, 1.0])
    )
    shift = np.full(2, (WINDOW_PX - 1) / 2.0) - linear @ centre
    return np.column_stack([linear, shift])


def _imperfect(difference_of: tuple[BgrImage, BgrImage], transform: NDArray[np.float64], rng: Rng) -> NDArray[np.uint8]:
    """The background difference as it comes in life: absent, after a bump of the camera, after a change of light, blurred."""
    image, background = difference_of
    kind = rng.random()
    if kind < 0.24:
        return np.zeros(image.shape[:2], dtype=np.uint8)
    moved = transform.copy()
    if kind < 0.46:
        moved[:, 2] += rng.normal(0, 1.0, 2) * rng.uniform(0.5, 4.0)
    size = (WINDOW_PX, WINDOW_PX)
    behind = cv2.warpAffine(background, moved, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    if rng.random() < 0.35:
        behind = cv2.convertScaleAbs(behind, alpha=float(np.exp(rng.normal(0, 0.12))), beta=float(rng.normal(0, 5)))
    if rng.random() < 0.15:
        share = float(rng.uniform(0.1, 0.6))
        behind = cv2.addWeighted(behind, 1.0 - share, image, share, 0.0)
    if rng.random() < 0.5:  # the detector compares at the background's reduced size
        side = int(WINDOW_PX * float(rng.uniform(0.3, 0.9)))
        few = (side, side)
        few_image, few_behind = (cv2.resize(one, few, interpolation=cv2.INTER_AREA) for one in (image, behind))
        coarse = difference(np.asarray(few_image, dtype=np.uint8), np.asarray(few_behind, dtype=np.uint8))
        return np.asarray(cv2.resize(coarse, size, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
    return difference(image, np.asarray(behind, dtype=np.uint8))


def _recoloured(image: NDArray[np.uint8], rng: Rng) -> NDArray[np.uint8]:
    """A change of gain, offset and balance, sometimes grey, sometimes inverted channels' order, by a table."""
    if rng.random() < 0.12:
        image = cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR).astype(np.uint8)
    elif rng.random() < 0.25:
        image = np.ascontiguousarray(image[:, :, rng.permutation(3)])
    gain = np.exp(rng.normal(0, 0.18) + rng.normal(0, 0.05, 3))
    levels = np.arange(256, dtype=np.float64)[:, None]
    gamma = float(np.exp(rng.normal(0, 0.12)))
    table = np.clip((levels / 255.0) ** gamma * 255.0 * gain + rng.normal(0, 6.0), 0, 255)
    return np.asarray(cv2.LUT(image, table.astype(np.uint8)[None]), dtype=np.uint8)


def moved_labels(labels: FloatImage, transform: NDArray[np.float64]) -> FloatImage:
    """Labels (k, 6) under an affine map that keeps shape up to scale and mirror."""
    out = labels.astype(np.float64).copy()
    linear = transform[:, :2]
    out[:, :2] = labels[:, :2] @ linear.T + transform[:, 2]
    scale = math.sqrt(abs(float(np.linalg.det(linear))))
    out[:, 2] = labels[:, 2] * scale
    ahead = np.column_stack([labels[:, 3], -labels[:, 4]]) @ linear.T / scale
    out[:, 3], out[:, 4] = ahead[:, 0], -ahead[:, 1]
    return out.astype(np.float32)


def targets_for(labels: FloatImage, grid: tuple[int, int] = (GRID, GRID)) -> NDArray[np.float32]:
    """Targets (11, rows, columns) for labels (k, 6) in the window's px."""
    rows, columns = grid
    out = np.zeros((TARGETS, rows, columns), dtype=np.float32)
    out[9] = 1.0
    row, column = np.mgrid[0:rows, 0:columns].astype(np.float32)
    for u, v, length, cosine, sine, weight in labels:
        if length <= 0.0:
            continue
        du = (u + 0.5) / CELL_PX - 0.5 - column
        dv = (v + 0.5) / CELL_PX - 0.5 - row
        squared = du * du + dv * dv
        if weight < 0.5 or length < 9.0:
            out[9][squared < (0.5 * length / CELL_PX + 2.0) ** 2] = 0.0
            continue
        spread = float(np.clip(0.1 * length / CELL_PX, 0.75, 1.6))
        np.maximum(out[0], np.exp(-squared / (2 * spread * spread)), out=out[0])
        nearest = np.unravel_index(int(np.argmin(squared)), squared.shape)
        if squared[nearest] <= 0.55:
            out[0][nearest] = 1.0
        near = (squared < _VOTE_CELLS**2) & (squared < np.where(out[1] > 0, out[2] ** 2 + out[3] ** 2, np.inf))
        out[1][near] = 1.0
        for channel, value in ((2, du), (3, dv)):
            out[channel][near] = value[near]
        out[4][near] = math.log(length / REFERENCE_LENGTH_PX)
        out[5][near], out[6][near] = cosine * cosine - sine * sine, 2.0 * cosine * sine
        body = (squared < max(_VOTE_CELLS, 0.4 * length / CELL_PX) ** 2) & (out[10] == 0.0)
        out[7][body], out[8][body], out[10][body] = cosine, sine, 1.0
    return out


def _lean_channels(lean: FloatImage | None, transform: NDArray[np.float64], rng: Rng) -> NDArray[np.uint8]:
    """The two channels (128, 128, 2) that tell the lean: not known, a little wrong, or the same all over as in small windows.

    `lean` is a sample's plane (2, 3); None for a picture of which nothing is known.
    """
    if lean is None or rng.random() < 0.35:
        return np.full((WINDOW_PX, WINDOW_PX, 2), UNKNOWN, dtype=np.uint8)
    linear = transform[:, :2]
    back = np.linalg.inv(linear)
    turn = linear / math.sqrt(abs(float(np.linalg.det(linear))))
    slope = lean[:, :2].astype(np.float64) @ back
    level = lean[:, 2] - slope @ transform[:, 2] + rng.normal(0, 0.03, 2)
    if rng.random() < 0.6:
        flat = turn @ (level + slope @ np.full(2, (WINDOW_PX - 1) / 2.0))
        return np.tile(lean_bytes(flat), (WINDOW_PX, WINDOW_PX, 1))
    v, u = np.mgrid[0:WINDOW_PX, 0:WINDOW_PX].astype(np.float32)
    slope, level = turn @ slope, turn @ level
    return lean_bytes(np.dstack([slope[i, 0] * u + slope[i, 1] * v + level[i] for i in (0, 1)]))


def make_window(
    pictures: NDArray[np.uint8],
    labels: FloatImage,
    rng: Rng,
    *,
    lean: FloatImage | None = None,
    about_px: tuple[float, float] | None = None,
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """One input (128, 128, 6) and its targets from a sample's pictures (2, 192, 192, 3), labels (k, 6) and lean (2, 3).

    The window shows a car in most cases, or the place `about_px` of the sample.
    """
    transform = _window_transform(labels, rng, about_px)
    size = (WINDOW_PX, WINDOW_PX)
    warped = cv2.warpAffine(pictures[0], transform, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    image: NDArray[np.uint8] = np.asarray(warped, dtype=np.uint8)
    moved = _imperfect((image, np.asarray(pictures[1])), transform, rng)
    window = np.dstack([_recoloured(image, rng), moved, _lean_channels(lean, transform, rng)])
    return window, targets_for(moved_labels(labels, transform))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Source:
    """What one window is cut from."""

    pictures: NDArray[np.uint8]
    """Shape (2, 192, 192, 3): image, background."""
    labels: FloatImage
    lean: FloatImage | None
    about_px: tuple[float, float] | None = None


def make_batch(sources: Sequence[Source], rng: Rng) -> Batch:
    """A batch of one window from each source."""
    made = [make_window(one.pictures, one.labels, rng, lean=one.lean, about_px=one.about_px) for one in sources]
    return Batch(inputs=np.stack([window for window, _ in made]), targets=np.stack([target for _, target in made]))
