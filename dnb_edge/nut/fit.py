"""What of a model's inputs is the picture, and how a picture becomes what it takes.

Knows shapes, layouts and colours; nothing of what runs the model, of vehicles or of time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.nut.onnx import Model, Shape, Tensor
from dnb_edge.values import BgrImage

TYPES = ("float32", "uint8")
MOST_SIDE_PX = 8192
MOST_ASIDE = 1_000_000
"""Numbers that an input beside the picture may have."""

WANTED = "(1, channels, height, width) or (1, height, width, channels), channels 1 or 3, float32 or uint8"


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureInput:
    """The input that takes one picture, its size settled."""

    name: str
    kind: str
    """`float32`, values 0 to 1, or `uint8`, values 0 to 255."""
    channels: int
    """3: red, green, blue; 1: grey."""
    channels_first: bool
    width_px: int
    height_px: int

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Of the tensor that `tensor` makes."""
        sides = (self.height_px, self.width_px)
        return (1, self.channels, *sides) if self.channels_first else (1, *sides, self.channels)

    def tensor(self, bgr: BgrImage) -> NDArray[Any]:
        """The picture (h, w, 3) uint8 as the input wants it: resized, in its colours, its type and its layout; C order."""
        size = (self.width_px, self.height_px)
        if (bgr.shape[1], bgr.shape[0]) != size:
            smaller = self.width_px < bgr.shape[1] or self.height_px < bgr.shape[0]
            bgr = cv2.resize(bgr, size, interpolation=cv2.INTER_AREA if smaller else cv2.INTER_LINEAR)  # type: ignore[assignment]
        pixels: NDArray[Any] = cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB if self.channels == 3 else cv2.COLOR_BGR2GRAY)
        pixels = pixels.reshape(self.height_px, self.width_px, self.channels)
        if self.channels_first:
            pixels = pixels.transpose(2, 0, 1)
        if self.kind == "float32":
            scaled: NDArray[Any] = np.multiply(pixels[None], np.float32(1 / 255.0), dtype=np.float32, order="C")
            return scaled
        return np.ascontiguousarray(pixels[None])


def picture_input(model: Model, size_px: tuple[int, int] | None = None) -> PictureInput:
    """The picture's input of `model`, which is its first; (width, height) `size_px` for sides that it leaves open.

    Raises InputError, naming the shape that it has and the shape wanted, where it takes no single picture, where open sides
    have no size, and where a size is given that it cannot take.
    """
    if not model.inputs:
        raise InputError(f"{model.path}: the model has no input; wanted one picture {WANTED}")
    given = model.inputs[0]
    channels_first = _channels_first(given)
    if channels_first is None:
        raise InputError(f"{model.path}: its input {given.words} takes no single picture; wanted {WANTED}")
    channels = given.shape[1 if channels_first else 3]
    height, width = given.shape[2:4] if channels_first else given.shape[1:3]
    assert isinstance(channels, int)
    if size_px is None:
        if not (isinstance(width, int) and isinstance(height, int)):
            raise InputError(
                f"{model.path}: its input {given.words} leaves the picture's size open: give one, such as --size 160x120"
            )
        size_px = (width, height)
    for had, wanted in zip((width, height), size_px, strict=True):
        if isinstance(had, int) and had != wanted:
            raise InputError(
                f"{model.path}: its input {given.words} takes no picture of {size_px[0]}x{size_px[1]} (width x height)"
            )
    return PictureInput(
        name=given.name,
        kind=given.kind,
        channels=channels,
        channels_first=channels_first,
        width_px=size_px[0],
        height_px=size_px[1],
    )


def _channels_first(given: Tensor) -> bool | None:
    """Whether the channels come before the sides; None where the input is no picture."""
    shape = given.shape
    if given.kind not in TYPES or len(shape) != 4 or not _one(shape[0]):
        return None
    for first, channels, sides in ((True, shape[1], shape[2:]), (False, shape[3], shape[1:3])):
        if channels in (1, 3) and all(not isinstance(side, int) or 0 < side <= MOST_SIDE_PX for side in sides):
            return first
    return None


def _one(side: int | str | None) -> bool:
    """Whether a batch may be of one."""
    return side == 1 or not isinstance(side, int)


def aside_inputs(model: Model) -> dict[str, NDArray[Any]]:
    """Zeros for every input beside the picture, such as a speed: what they hold does not change how long a network takes.

    Raises InputError where one of them has no plain type, open sides beyond the first, or a picture's size.
    """
    asides: dict[str, NDArray[Any]] = {}
    for given in model.inputs[1:]:
        shape = _closed(given.shape)
        if given.kind not in {*TYPES, "float64", "int64", "int32", "bool"} or shape is None:
            raise InputError(
                f"{model.path}: beside the picture it wants {given.words}; wanted no second input, or a small one of "
                "known shape such as float32 (1, 1)"
            )
        asides[given.name] = np.zeros(shape, dtype=given.kind)
    return asides


def _closed(shape: Shape) -> tuple[int, ...] | None:
    """The shape with an open first side as 1; None where others are open or it is large."""
    sides = [1 if number == 0 and not isinstance(side, int) else side for number, side in enumerate(shape)]
    known = tuple(side for side in sides if isinstance(side, int) and side >= 0)
    return known if len(known) == len(sides) and math.prod(known) <= MOST_ASIDE else None
