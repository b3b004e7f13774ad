"""Pictures that come from a browser: looked at by their first bytes and their stated size before anything is decoded.

Knows PNG's and JPEG's heads. Knows no route: whether a twin has a lane is found out later.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from dnb_edge.errors import InputError
from dnb_edge.values import BgrImage

MOST_BYTES = 20 * 1000 * 1000
MOST_PIXELS = 40 * 1000 * 1000
_LEAST_SIDE_PX = 32
_MOST_SIDE_PX = 20_000
_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG = b"\xff\xd8\xff"
_NO_SIZE = frozenset({0xC4, 0xC8, 0xCC})
"""Markers among JPEG's start-of-frame numbers that start no frame."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Upload:
    """A picture that can be decoded."""

    data: bytes
    suffix: str
    """.png or .jpg."""
    width_px: int
    height_px: int


def checked(data: bytes, *, what: str, upright: bool = False) -> Upload:
    """The uploaded picture `data`, called `what` in errors. Raises `InputError` where it is none that we take.

    `upright`: a camera's picture, which no note in the file (EXIF) may turn, since frames have no such note.
    """
    if len(data) > MOST_BYTES:
        raise InputError(f"{what}: {len(data) / 1e6:.0f} MB are too many: {MOST_BYTES / 1e6:.0f} MB at most; save it smaller, "
                         "or as JPEG")  # fmt: skip
    stated = _stated_size(data, what)
    _check_size(*stated, what)
    image = decoded(data, what=what)
    height, width = image.shape[:2]
    if upright and not np.array_equal(image, _as_stored(data, what)):
        raise InputError(f"{what}: is shown turned, by a note in the file (EXIF) that the camera's frames do not have: take it "
                         "with the box's camera, or save it upright without the note")  # fmt: skip
    return Upload(data=data, suffix=".png" if data.startswith(_PNG) else ".jpg", width_px=width, height_px=height)


def decoded(data: bytes, *, what: str) -> BgrImage:
    """The picture (h, w, 3). Raises `InputError` where it cannot be read."""
    try:
        image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_COLOR)
    except cv2.error as error:
        raise InputError(f"{what}: cannot be read: save it as PNG or JPEG anew") from error
    if image is None:
        raise InputError(f"{what}: is damaged: save it as PNG or JPEG anew")
    return np.asarray(image, dtype=np.uint8)


def _as_stored(data: bytes, what: str) -> BgrImage:
    image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    if image is None:
        raise InputError(f"{what}: is damaged: save it as PNG or JPEG anew")
    return np.asarray(image, dtype=np.uint8)


def _stated_size(data: bytes, what: str) -> tuple[int, int]:
    """(width, height), px, that the head states."""
    if data.startswith(_PNG) and data[12:16] == b"IHDR" and len(data) >= 24:
        return int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")
    if data.startswith(_JPEG):
        found = _jpeg_size(data)
        if found is None:
            raise InputError(f"{what}: is damaged: save it as PNG or JPEG anew")
        return found
    raise InputError(f"{what}: is neither PNG nor JPEG{_guess(data)}: save it as one of the two")


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    at = 2
    while at + 9 <= len(data):
        if data[at] != 0xFF:
            return None
        marker = data[at + 1]
        if marker == 0xFF:
            at += 1
        elif 0xC0 <= marker <= 0xCF and marker not in _NO_SIZE:
            return int.from_bytes(data[at + 7 : at + 9], "big"), int.from_bytes(data[at + 5 : at + 7], "big")
        elif marker in (0x01, *range(0xD0, 0xD8)):
            at += 2
        else:
            at += 2 + max(2, int.from_bytes(data[at + 2 : at + 4], "big"))
    return None


def _check_size(width_px: int, height_px: int, what: str) -> None:
    if width_px * height_px > MOST_PIXELS or max(width_px, height_px) > _MOST_SIDE_PX:
        raise InputError(f"{what}: {width_px}x{height_px} px are too many: {MOST_PIXELS / 1e6:.0f} megapixels and "
                         f"{_MOST_SIDE_PX} px a side at most; save it smaller")  # fmt: skip
    if min(width_px, height_px) < _LEAST_SIDE_PX:
        raise InputError(f"{what}: {width_px}x{height_px} px are too few to show a track: give a larger picture")


_HEADS = (
    (b"%PDF", "a PDF"),
    (b"GIF8", "a GIF"),
    (b"RIFF", "a WebP"),
    (b"BM", "a BMP"),
    (b"<svg", "an SVG"),
    (b"<?xml", "an SVG"),
    (b"II*\x00", "a TIFF"),
    (b"MM\x00*", "a TIFF"),
    (b"PK", "an archive"),
)


def _guess(data: bytes) -> str:
    if data[4:8] == b"ftyp":
        return " but a HEIC or AVIF, as telephones take them"
    return next((f" but {name}" for head, name in _HEADS if data.startswith(head)), "")
