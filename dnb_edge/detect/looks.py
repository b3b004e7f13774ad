"""Cuts the part of a frame that the network is to see, at the scale it wants, with the difference from the background.

Knows rectangles and resampling; nothing of cars. Pure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.detect.background import MOVED_LEVEL, difference
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


def window_look(
    centre_px: PointPx, length_px: float, *, window_px: int, window_length_px: float, step_px: int = 1
) -> Look:
    """A square window about `centre_px` in which a car of `length_px` frame px is about `window_length_px` long.

    Its edges are multiples of `step_px`, the background's cell in frame px, so that both are cut alike.
    """
    side = max(1, round(max(16.0, window_px * length_px / window_length_px) / step_px)) * step_px
    return Look(
        left_px=round((centre_px[0] + 0.5 - side / 2) / step_px) * step_px,
        top_px=round((centre_px[1] + 0.5 - side / 2) / step_px) * step_px,
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


def tile_looks(
    width_px: int,
    height_px: int,
    *,
    working_width_px: int,
    tile_px: tuple[int, int],
    overlap_px: int = 0,
    step_px: int = 1,
) -> list[Look]:
    """Tiles of `tile_px` network px that cover the frame where it is `working_width_px` wide; one where it fits into one.

    Neighbours overlap by at least about `overlap_px` network px, so that a car on a seam is whole in one of them.
    """
    scale = min(1.0, working_width_px / width_px)
    overlap = round(overlap_px / scale)
    width, height = (min(full, round(side / scale)) for full, side in zip((width_px, height_px), tile_px, strict=True))
    return [
        Look(
            left_px=left,
            top_px=top,
            width_px=width,
            height_px=height,
            out_width_px=max(1, round(width * scale)),
            out_height_px=max(1, round(height * scale)),
        )
        for top in _starts(height_px, height, overlap, step_px)
        for left in _starts(width_px, width, overlap, step_px)
    ]


def _starts(full: int, side: int, overlap: int, step: int) -> list[int]:
    """Where tiles of `side` begin so that they cover `full`, at multiples of `step` but for the last."""
    if side >= full:
        return [0]
    count = -(-(full - overlap) // max(1, side - overlap))
    return [(full - side) * i // (count - 1) // step * step for i in range(count - 1)] + [full - side]


def halvings(width_px: int, least_width_px: int) -> int:
    """How often a frame can be halved and stays at least `least_width_px` wide: halving is the cheapest way to reduce."""
    times = 0
    while width_px >> (times + 1) >= least_width_px:
        times += 1
    return times


def halved(image: BgrImage, times: int) -> BgrImage:
    """The picture halved so often, each pixel the mean of its four; what is left over at the right and below falls away."""
    for _ in range(times):
        height, width = image.shape[0] // 2, image.shape[1] // 2
        even = image[: 2 * height, : 2 * width]
        image = np.asarray(cv2.resize(even, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)
    return image


def resized(image: BgrImage, size: tuple[int, int]) -> BgrImage:
    """The picture at `size` (width, height): halved as long as it is twice as large, then interpolated."""
    while image.shape[1] >= 2 * size[0] and image.shape[0] >= 2 * size[1]:
        image = halved(image, 1)
    if (image.shape[1], image.shape[0]) == size:
        return image
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)


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
    return resized(part, (look.out_width_px, look.out_height_px))


def _difference_cut(image: BgrImage, background: BgrImage, look: Look, times: int) -> NDArray[np.uint8]:
    """The look's part of the difference from a background that is the frame halved `times` times; before resizing.

    Compared at the background's own resolution, since what the background cannot resolve would look like motion.
    """
    rows, columns = background.shape[:2]
    left, top = look.left_px >> times, look.top_px >> times
    right, bottom = (look.left_px + look.width_px) >> times, (look.top_px + look.height_px) >> times
    x0, y0, x1, y1 = max(0, left), max(0, top), min(columns, right), min(rows, bottom)
    if x1 - x0 < 2 or y1 - y0 < 2:
        return np.zeros((2, 2), dtype=np.uint8)
    part = halved(image[y0 << times : y1 << times, x0 << times : x1 << times], times)
    apart = difference(part, background[y0:y1, x0:x1])
    borders = (y0 - top, bottom - y1, x0 - left, right - x1)
    if any(borders):
        apart = np.asarray(cv2.copyMakeBorder(apart, *borders, cv2.BORDER_CONSTANT, value=(0.0,)), dtype=np.uint8)
    return apart


def _padded(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    height, width = pixels.shape[:2]
    below, right = -height % SIDE_MULTIPLE_PX, -width % SIDE_MULTIPLE_PX
    if not below and not right:
        return pixels
    return np.asarray(cv2.copyMakeBorder(pixels, 0, below, 0, right, cv2.BORDER_REPLICATE), dtype=np.uint8)


def _stacked(part: BgrImage, moved: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Colour and difference as four channels; several times faster than numpy's own stacking."""
    if moved.shape != part.shape[:2]:
        size = (part.shape[1], part.shape[0])
        moved = np.asarray(cv2.resize(moved, size, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
    return _padded(np.asarray(cv2.merge([part, moved]), dtype=np.uint8))


def whole_pixels(reduced: BgrImage, moved: NDArray[np.uint8], look: Look) -> NDArray[np.uint8]:
    """The network's input (h, w, 4), sides padded to multiples of 16, of the whole frame.

    `reduced` is the frame at any reduced size, `moved` its difference from the background at any size.
    """
    return _stacked(resized(reduced, (look.out_width_px, look.out_height_px)), moved)


def look_pixels(
    image: BgrImage, background: BgrImage | None, look: Look, background_scale: float, *, most_moved: float = 1.0
) -> NDArray[np.uint8]:
    """The network's input (h, w, 4), sides padded to multiples of 16, for one look.

    `background` is the frame halved some times, `background_scale` its size over the frame's: 1, 1/2, 1/4 ... The difference
    is zero where there is no background, and where more than the share `most_moved` has moved: then the light has changed.
    """
    if background is None:
        part = _cut(image, look)
        return _stacked(part, np.zeros(part.shape[:2], dtype=np.uint8))
    times = round(math.log2(1.0 / background_scale))
    half = _halved_look(image, background, look, times)
    if half is not None:
        part = resized(half, (look.out_width_px, look.out_height_px))
        left, top = look.left_px >> times, look.top_px >> times
        moved = difference(half, background[top : top + half.shape[0], left : left + half.shape[1]])
    else:
        part, moved = _cut(image, look), _difference_cut(image, background, look, times)
    if most_moved < 1.0:
        _, over = cv2.threshold(moved, MOVED_LEVEL, 255.0, cv2.THRESH_BINARY)
        if cv2.countNonZero(over) > most_moved * over.size:
            moved = np.zeros_like(moved)
    return _stacked(part, moved)


def _halved_look(image: BgrImage, background: BgrImage, look: Look, times: int) -> BgrImage | None:
    """The look's part of the frame at the background's size, where that is fine enough and wholly inside; else None."""
    edges = (look.left_px, look.top_px, look.left_px + look.width_px, look.top_px + look.height_px)
    left, top, right, bottom = (edge >> times for edge in edges)
    inside = left >= 0 and top >= 0 and right <= background.shape[1] and bottom <= background.shape[0]
    enough = right - left >= look.out_width_px and bottom - top >= look.out_height_px
    if not (inside and enough) or any(edge % (1 << times) for edge in edges):
        return None
    return halved(image[edges[1] : edges[3], edges[0] : edges[2]], times)
