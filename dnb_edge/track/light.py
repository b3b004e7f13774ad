"""Light in a picture: brightness measured against the floor nearby, and a photograph's light made even.

Knows brightness only, so that a window's light on one side or a lens's dark corners change nothing. Knows no lane and no route.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import BgrImage

Mask = NDArray[np.bool_]
Plane = NDArray[np.float32]

BRIGHTEST = 1.5
"""Brightness against the floor is told up to this."""
THIN = 0.04
"""What is thinner than this share of the picture's shorter side (tape, glints) is not the floor."""

_SMALL_SIDE_PX = 480
"""Longest side of the picture in which the floor's brightness is estimated and lanes are judged."""
_WIDEST_LANE = 0.3
"""A lane is no wider than this share of the picture's shorter side."""
_ROUNDS = 12
_LEAST_SPREAD = 0.03
_DEEPEST = 1.5
"""Light is taken to differ by no more than this many natural logarithms from its middle."""


def even_light(image: BgrImage, seen: Mask | None = None) -> BgrImage:
    """The picture as if its light were even: divided by the smooth surface that its brightness follows, its median kept.

    The surface is of the second order in both directions, fitted to the logarithm of brightness; what lies off it (the lane,
    things on the floor) loses its say from round to round. For photographs; a drawing's colours are what they are.
    """
    small, shown = _reduced(image, seen)
    logs = np.log(np.maximum(small.max(axis=2).astype(np.float64), 4.0))
    if not shown.any():
        return image
    terms, values, inside = _surface_terms(logs.shape), logs.ravel(), shown.ravel()
    surface = np.full(values.shape, float(np.median(values[inside])))
    for _ in range(_ROUNDS):
        off = np.abs(values - surface)
        spread = max(_LEAST_SPREAD, 1.5 * float(np.median(off[inside])))
        trust = inside / (1.0 + (off / spread) ** 2) ** 2
        normal = terms.T @ (trust[:, None] * terms) + 1e-6 * np.eye(terms.shape[1])
        surface = (terms @ np.linalg.solve(normal, terms.T @ (trust * values))).reshape(-1)
    deep = np.clip(surface - np.median(surface[inside]), -_DEEPEST, _DEEPEST)
    field = np.exp(deep).reshape(logs.shape).astype(np.float32)
    whole = cv2.resize(field, (image.shape[1], image.shape[0]), interpolation=cv2.INTER_LINEAR)
    return np.asarray(np.clip(image / np.asarray(whole)[..., None], 0, 255), dtype=np.uint8)


def brightness(image: BgrImage, seen: Mask | None) -> Plane:
    """Brightness (height, width), 1..256; where nothing is seen, that of the middle of what is."""
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    grey = cv2.medianBlur(grey, 3).astype(np.float32) + np.float32(1.0)
    if seen is not None and seen.any():
        grey[~seen] = np.median(grey[seen])
    return np.asarray(grey, dtype=np.float32)


def against_floor(grey: Plane, seen: Mask | None, *, light: bool, thin: bool) -> Plane:
    """Brightness as a share of the floor's near it (its inverse for `light` things), so that what is sought is below 1."""
    # A light lane on a dark floor is a dark one on a light floor in the inverse picture.
    wanted = np.float32(65536.0) / (grey + np.float32(8.0)) if light else grey
    share = np.clip(wanted / _floor(wanted, thin=thin), 0.0, BRIGHTEST)
    share = np.asarray(cv2.GaussianBlur(share, (0, 0), max(0.6, max(grey.shape) / 2500)), dtype=np.float32)
    if seen is not None:
        share[~seen] = np.float32(1.0)
    return share


def reduced_size(shape: tuple[int, ...]) -> tuple[int, int]:
    """(width, height) in which a picture of `shape` is judged."""
    factor = min(1.0, _SMALL_SIDE_PX / max(shape[:2]))
    return max(1, round(shape[1] * factor)), max(1, round(shape[0] * factor))


def disc(diameter_px: float) -> NDArray[np.uint8]:
    """A disc for morphology, of odd diameter, px."""
    radius = max(1, round(diameter_px / 2))
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1)), dtype=np.uint8)


def _surface_terms(shape: tuple[int, ...]) -> NDArray[np.float64]:
    """(n, 6) values of 1, x, y, x^2, xy, y^2 at the px of a picture of `shape`, row by row, x and y in -1..1."""
    down, across = np.meshgrid(np.linspace(-1, 1, shape[0]), np.linspace(-1, 1, shape[1]), indexing="ij")
    x, y = across.ravel(), down.ravel()
    return np.column_stack((np.ones_like(x), x, y, x * x, x * y, y * y))


def _reduced(image: BgrImage, seen: Mask | None) -> tuple[BgrImage, Mask]:
    height, width = image.shape[:2]
    size = reduced_size((height, width))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    shown = np.ones((height, width), dtype=np.uint8) if seen is None else seen.astype(np.uint8)
    shown = np.asarray(cv2.resize(shown, size, interpolation=cv2.INTER_NEAREST))
    return np.asarray(small, dtype=np.uint8), np.asarray(shown > 0)


def _floor(grey: Plane, *, thin: bool) -> Plane:
    """The floor's brightness about every px: what is left when thin light things and all dark ones narrower than the widest
    lane are filled from around them.
    """
    height, width = grey.shape
    size = reduced_size(grey.shape)
    small = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
    shorter = min(size)
    wide = disc((2 * THIN if thin else _WIDEST_LANE) * shorter)
    if not thin:
        small = cv2.morphologyEx(small, cv2.MORPH_OPEN, disc(THIN * shorter), borderType=cv2.BORDER_REPLICATE)
    filled = cv2.morphologyEx(small, cv2.MORPH_CLOSE, wide, borderType=cv2.BORDER_REPLICATE)
    smooth = cv2.GaussianBlur(filled, (0, 0), max(1.0, 0.02 * shorter), borderType=cv2.BORDER_REPLICATE)
    return np.asarray(cv2.resize(smooth, (width, height), interpolation=cv2.INTER_LINEAR), dtype=np.float32)
