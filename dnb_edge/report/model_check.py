"""A contact sheet of the pictures in which a detector did worst, with labels, finds, misses and false finds drawn.

Knows pictures and marks; nothing of models, label files or what makes a find right.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from dnb_edge.errors import WorkError
from dnb_edge.values import BgrImage, PointPx

TILE_PX = (420, 420)
"""Width and height of a tile."""
COLUMNS = 3
_CAPTION_PX = 22
_MARGIN_PX = 4
_DARK = (40, 40, 40)
_WHITE = (255, 255, 255)
_FOUND = (80, 220, 80)
_MISSED = (40, 160, 255)
_FALSE = (60, 60, 255)
_LEGEND = (("car found", _FOUND), ("car missed", _MISSED), ("false find", _FALSE))


@dataclass(frozen=True, slots=True, kw_only=True)
class BoxMark:
    """A labelled car: left, top, right, bottom in px of the picture, and whether it was found."""

    box_px: tuple[float, float, float, float]
    found: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class FindMark:
    """A find: its point in px of the picture, and whether it was a car."""

    camera_px: PointPx
    length_px: float
    confidence: float
    right: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Case:
    """One picture with what is to be drawn in it."""

    name: str
    bgr: BgrImage
    boxes: tuple[BoxMark, ...]
    finds: tuple[FindMark, ...]


def contact_sheet(cases: Sequence[Case]) -> BgrImage:
    """The sheet, (h, w, 3): a legend, then a tile a case in the order given; the legend alone where there is none."""
    columns = max(1, min(COLUMNS, len(cases)))
    rows = math.ceil(len(cases) / columns)
    width, height = TILE_PX[0] + _MARGIN_PX, TILE_PX[1] + _CAPTION_PX + _MARGIN_PX
    sheet = np.full((_CAPTION_PX + rows * height, columns * width, 3), _DARK, dtype=np.uint8)
    _legend(sheet, "nothing missed, nothing false" if not cases else None)
    for index, case in enumerate(cases):
        row, column = divmod(index, columns)
        top, left = _CAPTION_PX + row * height, column * width
        _text(sheet, _caption(case), (left + 3, top + _CAPTION_PX - 7), _WHITE)
        tile = _tile(case)
        at = top + _CAPTION_PX
        sheet[at : at + tile.shape[0], left : left + tile.shape[1]] = tile
    return sheet


def encoded_sheet(cases: Sequence[Case]) -> bytes:
    """The sheet as a PNG file."""
    done, png = cv2.imencode(".png", contact_sheet(cases))
    if not done:
        raise WorkError("the picture of the worst cases could not be encoded")
    return png.tobytes()


def _legend(sheet: BgrImage, note: str | None) -> None:
    at = 3
    for words, colour in (*_LEGEND, *([(note, _WHITE)] if note else [])):
        _text(sheet, words, (at, _CAPTION_PX - 7), colour)
        at += 9 * len(words) + 16


def _caption(case: Case) -> str:
    missed = sum(not box.found for box in case.boxes)
    false = sum(not find.right for find in case.finds)
    name = case.name if len(case.name) <= 30 else case.name[:27] + "..."
    return f"{name}: {missed} missed, {false} false"


def _tile(case: Case) -> BgrImage:
    """The picture in a tile's size, shapes kept, with its marks."""
    height, width = case.bgr.shape[:2]
    scale = min(TILE_PX[0] / width, TILE_PX[1] / height)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    method = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_LINEAR
    tile = np.asarray(cv2.resize(case.bgr, size, interpolation=method), dtype=np.uint8)
    for box in case.boxes:
        left, top, right, bottom = (round((edge + 0.5) * scale) for edge in box.box_px)
        colour = _FOUND if box.found else _MISSED
        cv2.rectangle(tile, (left, top), (right, bottom), colour, 1 if box.found else 2)
    for find in case.finds:
        colour = _FOUND if find.right else _FALSE
        at = (round((find.camera_px[0] + 0.5) * scale), round((find.camera_px[1] + 0.5) * scale))
        cv2.drawMarker(tile, at, colour, cv2.MARKER_CROSS, 11, 1)
        if not find.right:
            radius = max(6, round(0.5 * find.length_px * scale))
            cv2.circle(tile, at, radius, colour, 1, cv2.LINE_AA)
            _text(tile, f"{find.confidence:.2f}", (at[0] + 7, at[1] - 5), colour)
    return tile


def _text(picture: BgrImage, text: str, at: tuple[int, int], colour: tuple[int, int, int]) -> None:
    cv2.putText(picture, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.42, colour, 1, cv2.LINE_AA)
