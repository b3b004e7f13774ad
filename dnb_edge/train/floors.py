"""Floors to drive on: wood, carpet, concrete, tile, paper or a photograph, with lanes of tape, print, vinyl or plastic.

Knows textures and painted lines; nothing of cars. Reads photographs only where it is handed them, opens no file itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.train.camera import View
from dnb_edge.train.car_parts import any_colour
from dnb_edge.values import BgrImage

Rng = np.random.Generator
Picture = NDArray[np.float32]
_TEXTURE_PX = 512


def _blotches(rng: Rng, size_px: int, cells: int) -> Picture:
    """Smooth noise, about -1..1, with `cells` bumps across."""
    coarse = rng.normal(0.0, 0.5, (cells + 2, cells + 2)).astype(np.float32)
    return cv2.resize(coarse, (size_px, size_px), interpolation=cv2.INTER_CUBIC).astype(np.float32)


def _floor_colour(rng: Rng) -> Picture:
    """A floor's colour: mostly dull, of any brightness."""
    value = float(rng.uniform(25, 235))
    tint = rng.normal(0.0, 0.06, 3) + np.array([-0.05, 0.0, 0.05]) * rng.uniform(-0.5, 2.5)
    return np.asarray(value * (1.0 + tint), dtype=np.float32)


def _grain(rng: Rng) -> Picture:
    noise = rng.normal(0.0, 1.0, (_TEXTURE_PX, _TEXTURE_PX)).astype(np.float32)
    return cv2.GaussianBlur(noise, (0, 0), float(rng.uniform(0.5, 2.0))).astype(np.float32)


def procedural_texture(rng: Rng) -> Picture:
    """A seamless-enough floor texture, (512, 512, 3), 0..255."""
    tone = (
        1.0
        + float(rng.uniform(0.01, 0.08)) * _blotches(rng, _TEXTURE_PX, 5)
        + float(rng.uniform(0.0, 0.05)) * _blotches(rng, _TEXTURE_PX, 40)
    )
    kind = int(rng.integers(5))
    if kind == 0:
        tone = _planks(rng, tone)
    elif kind == 1:
        tone = tone + float(rng.uniform(0.05, 0.25)) * _grain(rng)
    elif kind == 2:
        tone = _tiles(rng, tone)
    else:
        tone = tone + float(rng.uniform(0.0, 0.06)) * _grain(rng)
        specks = rng.random((_TEXTURE_PX, _TEXTURE_PX)) < float(rng.uniform(0, 0.01))
        tone = tone + specks.astype(np.float32) * float(rng.uniform(-0.4, 0.4))
    return np.asarray(tone[:, :, None] * _floor_colour(rng), dtype=np.float32)


def _planks(rng: Rng, tone: Picture) -> Picture:
    plank = int(rng.integers(18, 64))
    out = tone.copy()
    for row in range(0, _TEXTURE_PX, plank):
        start = int(rng.integers(-200, 0))
        while start < _TEXTURE_PX:
            end = start + int(rng.integers(120, 400))
            out[row : row + plank, max(0, start) : max(0, end)] *= float(rng.uniform(0.82, 1.12))
            if 0 < end < _TEXTURE_PX:
                out[row : row + plank, end : end + 2] *= 0.7
            start = end
        out[row : row + int(rng.integers(1, 3))] *= float(rng.uniform(0.6, 0.95))
    fibre = rng.normal(0.0, 0.06, (_TEXTURE_PX, 24)).astype(np.float32)
    return np.asarray(
        out + cv2.resize(fibre, (_TEXTURE_PX, _TEXTURE_PX), interpolation=cv2.INTER_LINEAR), dtype=np.float32
    )


def _tiles(rng: Rng, tone: Picture) -> Picture:
    side, joint = int(rng.integers(40, 200)), int(rng.integers(2, 6))
    out, other = tone.copy(), float(rng.uniform(0.5, 1.0)) if rng.random() < 0.25 else 1.0
    for row in range(0, _TEXTURE_PX, side):
        for column in range(0, _TEXTURE_PX, side):
            chequer = other if (row // side + column // side) % 2 else 1.0
            out[row : row + side, column : column + side] *= chequer * float(rng.uniform(0.96, 1.04))
    gain = float(rng.uniform(0.5, 1.4))
    for line in range(0, _TEXTURE_PX, side):
        out[line : line + joint] *= gain
        out[:, line : line + joint] *= gain
    return out


def laid_texture(texture: Picture, view: View, rng: Rng) -> Picture:
    """The texture laid on the floor and seen by the camera, (size, size, 3)."""
    texels_per_m = float(rng.uniform(120, 700))
    yaw = float(rng.uniform(0, 2 * math.pi))
    c, s = math.cos(yaw) * texels_per_m, math.sin(yaw) * texels_per_m
    floor_to_texture = np.array([[c, -s, _TEXTURE_PX / 2], [s, c, _TEXTURE_PX / 2], [0.0, 0.0, 1.0]])
    picture_to_texture = floor_to_texture @ np.linalg.inv(view.floor_homography())
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    size = (view.size_px, view.size_px)
    return cv2.warpPerspective(
        texture, picture_to_texture, size, flags=flags, borderMode=cv2.BORDER_REFLECT_101
    ).astype(np.float32)


def photo_crop(photos: Sequence[BgrImage], size_px: int, rng: Rng) -> Picture:
    """A random square of a random photograph at a random scale, turned by quarter turns, (size, size, 3)."""
    photo = photos[int(rng.integers(len(photos)))]
    height, width = photo.shape[:2]
    side = int(min(height, width) * float(rng.uniform(0.25, 1.0)))
    top, left = int(rng.integers(0, height - side + 1)), int(rng.integers(0, width - side + 1))
    part = np.rot90(photo[top : top + side, left : left + side], int(rng.choice([0, 0, 0, 1, 2, 3])))
    if rng.random() < 0.5:
        part = part[:, ::-1]
    shrink = cv2.INTER_AREA if side > size_px else cv2.INTER_LINEAR
    return cv2.resize(np.ascontiguousarray(part), (size_px, size_px), interpolation=shrink).astype(np.float32)


def _lane_path(rng: Rng, extent_m: float) -> NDArray[np.float64]:
    """A winding path (n, 2), metres, through the neighbourhood of the origin."""
    count = 60
    steps = np.full(count, 2.6 * extent_m / count)
    bend = cv2.GaussianBlur(rng.normal(0, 1.0, (count, 1)), (0, 0), 6.0, borderType=cv2.BORDER_REFLECT).ravel()
    turn = np.cumsum(bend * float(rng.uniform(0.0, 0.45))) + float(rng.uniform(0, 2 * math.pi))
    path = np.cumsum(np.column_stack([np.cos(turn), np.sin(turn)]) * steps[:, None], axis=0)
    anchor = path[int(rng.integers(count // 3, 2 * count // 3))]
    return np.asarray(path - anchor + rng.normal(0, 0.12, 2) * extent_m, dtype=np.float64)


def _strip(path: NDArray[np.float64], centre_m: float, width_m: float) -> NDArray[np.float64]:
    """The outline (n, 2) of a strip of `width_m` whose middle runs `centre_m` to the left of the path."""
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True) + 1e-12
    left = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    return np.vstack([path + left * (centre_m + width_m / 2), (path + left * (centre_m - width_m / 2))[::-1]])


def _paint(picture: Picture, view: View, outline_m: NDArray[np.float64], colour: Picture, opacity: float) -> None:
    """Fill a floor outline with a colour, in place; the floor's own texture shows through the rest."""
    pixels = view.project(np.column_stack([outline_m, np.zeros(len(outline_m))]))
    mask = np.zeros((view.size_px * 2, view.size_px * 2), dtype=np.uint8)
    corners = np.clip(((pixels + 0.5) * 2 - 0.5) * 16, -4e5, 4e5)
    cv2.fillPoly(mask, [np.rint(corners).astype(np.int32)], (255.0,), cv2.LINE_8, 4)
    alpha = cv2.resize(mask, (view.size_px, view.size_px), interpolation=cv2.INTER_AREA).astype(
        np.float32
    ) * np.float32(opacity / 255.0)
    detail = picture.mean(axis=2, keepdims=True) / (float(picture.mean()) + 1.0)
    picture += (colour * (0.75 + 0.25 * np.clip(detail, 0.4, 1.6)) - picture) * alpha[:, :, None]


def paint_lanes(picture: Picture, view: View, car_length_m: float, rng: Rng) -> None:
    """Lay one to three lanes of a random make on the floor, in place."""
    extent = view.size_px / max(
        1.0,
        float(
            np.linalg.norm(view.project(np.array([[0.0, 0, 0], [0.01, 0, 0]]))[1] - view.project(np.zeros((1, 3)))[0])
            * 100
        ),
    )
    for _ in range(int(rng.integers(1, 4))):
        path = _lane_path(rng, extent)
        width = car_length_m * float(rng.uniform(0.7, 2.6))
        line = width * float(rng.uniform(0.03, 0.14))
        kind = rng.random()
        if kind < 0.75:
            lane = _floor_colour(rng) if kind < 0.6 else np.asarray(any_colour(rng), dtype=np.float32)
            if rng.random() < 0.5:
                lane *= np.float32(0.35)
            _paint(picture, view, _strip(path, 0.0, width), lane, float(rng.uniform(0.5, 1.0)))
        edge = (
            np.array(any_colour(rng), dtype=np.float32)
            if rng.random() < 0.4
            else np.full(3, rng.uniform(180, 250), np.float32)
        )
        if kind < 0.35 or kind >= 0.6:
            for side in (-0.5, 0.5):
                _paint(picture, view, _strip(path, side * width, line), edge, float(rng.uniform(0.7, 1.0)))
        if rng.random() < 0.3:
            _dashes(picture, view, path, line, edge)
        elif rng.random() < 0.2:
            for side in (-0.12, 0.12):
                _paint(picture, view, _strip(path, side * width, line * 0.5), np.full(3, 20, np.float32), 0.9)
        if rng.random() < 0.3:
            place = int(rng.integers(5, 50))
            _paint(picture, view, _strip(path[place : place + 2], 0.0, width), edge, 0.9)


def _dashes(picture: Picture, view: View, path: NDArray[np.float64], line_m: float, colour: Picture) -> None:
    for start in range(0, len(path) - 3, 5):
        _paint(picture, view, _strip(path[start : start + 3], 0.0, line_m), colour, 0.9)
