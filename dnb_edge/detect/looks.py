"""Cuts the part of a frame that the network is to see, at the scale it wants, with the difference from the background.

Knows rectangles and resampling; nothing of cars. Pure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.detect.background import difference
from dnb_edge.detect.onnx import SIDE_MULTIPLE_PX
from dnb_edge.values import BgrImage, PointPx


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """A rectangle of the frame and the size at which the network sees it. It may stick out of the frame."""

    left_px: int
    top_px: int
    width_px: int
    height_px: int
    out_width_px: int
    out_height_px: int

    @property
    def scale(self) -> float:
        """Network px a frame px."""
        return self.out_width_px / self.width_px

    def to_frame(self, u_px: float, v_px: float) -> PointPx:
        """Frame px of a point in the network's input px."""
        return (
            self.left_px + (u_px + 0.5) * self.width_px / self.out_width_px - 0.5,
            self.top_px + (v_px + 0.5) * self.height_px / self.out_height_px - 0.5,
        )


def window_look(centre_px: PointPx, length_px: float, *, window_px: int, window_length_px: float) -> Look:
    """A square window about `centre_px` in which a car of `length_px` frame px is `window_length_px` long."""
    side = max(16, round(window_px * length_px / window_length_px))
    return Look(
        left_px=round(centre_px[0] - side / 2),
        top_px=round(centre_px[1] - side / 2),
        width_px=side,
        height_px=side,
        out_width_px=window_px,
        out_height_px=window_px,
    )


def whole_look(width_px: int, height_px: int, working_width_px: int) -> Look:
    """The whole frame, `working_width_px` wide (or as wide as it is, where that is less)."""
    out_width = min(working_width_px, width_px)
    return Look(
        left_px=0,
        top_px=0,
        width_px=width_px,
        height_px=height_px,
        out_width_px=out_width,
        out_height_px=max(1, round(height_px * out_width / width_px)),
    )


def tile_looks(width_px: int, height_px: int, *, fine_width_px: int, tile_px: tuple[int, int]) -> list[Look]:
    """Overlapping tiles that cover the frame at a finer scale; none where the frame is no larger than a tile."""
    scale = min(1.0, fine_width_px / width_px)
    tile_width, tile_height = (
        min(full, round(side / scale)) for full, side in zip((width_px, height_px), tile_px, strict=True)
    )
    if tile_width >= width_px and tile_height >= height_px:
        return []
    columns, rows = -(-width_px // tile_width), -(-height_px // tile_height)
    lefts = np.linspace(0, width_px - tile_width, columns).round().astype(int)
    tops = np.linspace(0, height_px - tile_height, rows).round().astype(int)
    return [
        Look(
            left_px=int(left),
            top_px=int(top),
            width_px=tile_width,
            height_px=tile_height,
            out_width_px=max(1, round(tile_width * scale)),
            out_height_px=max(1, round(tile_height * scale)),
        )
        for top in tops
        for left in lefts
    ]


def _cut(image: BgrImage, look: Look) -> BgrImage:
    """The rectangle of the image at the look's size; beyond the frame's edge the edge is repeated."""
    height, width = image.shape[:2]
    x0, y0 = max(0, look.left_px), max(0, look.top_px)
    x1, y1 = min(width, look.left_px + look.width_px), min(height, look.top_px + look.height_px)
    if x1 - x0 < 2 or y1 - y0 < 2:
        return np.zeros((look.out_height_px, look.out_width_px, 3), dtype=np.uint8)
    part = image[y0:y1, x0:x1]
    borders = (
        y0 - look.top_px,
        look.top_px + look.height_px - y1,
        x0 - look.left_px,
        look.left_px + look.width_px - x1,
    )
    if any(borders):
        part = np.asarray(cv2.copyMakeBorder(part, *borders, cv2.BORDER_REPLICATE), dtype=np.uint8)
    size = (look.out_width_px, look.out_height_px)
    if part.shape[:2] == size[::-1]:
        return part
    method = cv2.INTER_AREA if look.scale < 1.0 else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(part, size, interpolation=method), dtype=np.uint8)


def _difference_cut(image: BgrImage, background: BgrImage, look: Look, scale: float) -> NDArray[np.uint8]:
    """The look's part of the difference from a background that is `scale` times the frame's size.

    Compared at the background's own resolution, since what the background cannot resolve would look like motion.
    """
    rows, columns = background.shape[:2]
    left, top = math.floor(look.left_px * scale) - 1, math.floor(look.top_px * scale) - 1
    right = math.ceil((look.left_px + look.width_px) * scale) + 1
    bottom = math.ceil((look.top_px + look.height_px) * scale) + 1
    left, top, right, bottom = max(0, left), max(0, top), min(columns, right), min(rows, bottom)
    size = (look.out_width_px, look.out_height_px)
    if right - left < 2 or bottom - top < 2:
        return np.zeros(size[::-1], dtype=np.uint8)
    x0, y0, x1, y1 = (round(edge / scale) for edge in (left, top, right, bottom))
    part = cv2.resize(image[y0:y1, x0:x1], (right - left, bottom - top), interpolation=cv2.INTER_AREA)
    apart = difference(np.asarray(part, dtype=np.uint8), background[top:bottom, left:right])
    step_u = look.width_px / look.out_width_px * scale
    step_v = look.height_px / look.out_height_px * scale
    first_u, first_v = look.to_frame(0.0, 0.0)
    shift_u, shift_v = (first_u + 0.5) * scale - 0.5 - left, (first_v + 0.5) * scale - 0.5 - top
    transform = np.array([[step_u, 0.0, shift_u], [0.0, step_v, shift_v]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(
        cv2.warpAffine(apart, transform, size, flags=flags, borderMode=cv2.BORDER_CONSTANT), dtype=np.uint8
    )


def _padded(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    height, width = pixels.shape[:2]
    below, right = -height % SIDE_MULTIPLE_PX, -width % SIDE_MULTIPLE_PX
    if not below and not right:
        return pixels
    return np.asarray(cv2.copyMakeBorder(pixels, 0, below, 0, right, cv2.BORDER_REPLICATE), dtype=np.uint8)


def _stacked(part: BgrImage, moved: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Colour and difference as four channels; several times faster than numpy's own stacking."""
    out = np.empty((*part.shape[:2], 4), dtype=np.uint8)
    cv2.mixChannels([part, moved], [out], [0, 0, 1, 1, 2, 2, 3, 3])
    return out


def reduce_frame(image: BgrImage, look: Look) -> BgrImage:
    """The whole frame at the working size."""
    return _cut(image, look)


def whole_pixels(reduced: BgrImage, background: BgrImage) -> NDArray[np.uint8]:
    """The network's input (h, w, 4), sides padded to multiples of 16, of a reduced frame and the background of its size."""
    return _padded(_stacked(reduced, difference(reduced, background)))


def look_pixels(image: BgrImage, background: BgrImage, look: Look, background_scale: float) -> NDArray[np.uint8]:
    """The network's input (h, w, 4), sides padded to multiples of 16, for one look."""
    return _padded(_stacked(_cut(image, look), _difference_cut(image, background, look, background_scale)))
