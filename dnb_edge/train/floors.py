"""A floor seen by a camera: a texture laid on it, a photograph in its place, and patches of light and shade on it.

Knows how textures and light fall on the floor; what they look like is in `floor_textures`, tracks are in `lanes`. Reads
photographs only where it is handed them, opens no file itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.train.camera import View
from dnb_edge.train.floor_textures import procedural_texture
from dnb_edge.train.lanes import paint_lanes, track_walls
from dnb_edge.values import BgrImage

__all__ = ["laid_texture", "light_patches", "paint_lanes", "photo_crop", "procedural_texture", "track_walls"]

Rng = np.random.Generator
Picture = NDArray[np.float32]


def laid_texture(texture: Picture, view: View, rng: Rng) -> Picture:
    """The texture laid on the floor, mirrored at its edges without end, and seen by the camera, (h, w, 3)."""
    texels_per_m = float(rng.uniform(120, 700))
    yaw = float(rng.uniform(0, 2 * math.pi))
    c, s = math.cos(yaw) * texels_per_m, math.sin(yaw) * texels_per_m
    floor = view.floor_map()
    shift = rng.uniform(0, texture.shape[0], 2)
    x = floor[:, :, 0] * np.float32(c) - floor[:, :, 1] * np.float32(s) + np.float32(shift[0])
    y = floor[:, :, 0] * np.float32(s) + floor[:, :, 1] * np.float32(c) + np.float32(shift[1])
    # texels a pixel: too many would flicker, so the texture is shrunk first, as mipmaps do
    footprint = float(np.median(np.hypot(np.diff(x, axis=1), np.diff(y, axis=1))))
    shrink = 2 ** int(np.clip(math.log2(max(1.0, footprint)) + 0.3, 0, 6))
    side = texture.shape[0] // shrink
    small = texture if shrink == 1 else cv2.resize(texture, (side, side), interpolation=cv2.INTER_AREA)
    return np.asarray(
        cv2.remap(small, _mirrored(x / shrink, side), _mirrored(y / shrink, side), cv2.INTER_LINEAR), dtype=np.float32
    )


def _mirrored(at: Picture, side: int) -> Picture:
    """Places along an endless row of mirrored textures as places 0..side - 1 in one."""
    return np.asarray(np.abs(np.mod(at, np.float32(2 * side - 2)) - np.float32(side - 1)), dtype=np.float32)


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


def light_patches(view: View, rng: Rng) -> Picture:
    """A gain (h, w, 1) of about 0.4 to 2.5 to multiply a floor by: window light, lamps' glare, or a shadow's edge.

    One call for what stays; another for one of a frame and its background stands for light that moved between them.
    """
    height, width = view.height_px, view.width_px
    gain = np.ones((height, width), dtype=np.float32)
    for _ in range(int(rng.choice([1, 2], p=[0.7, 0.3]))):
        kind, blur = rng.random(), float(np.exp(rng.uniform(math.log(0.6), math.log(12.0))))
        mask = np.zeros((height, width), dtype=np.float32)
        if kind < 0.45:
            strength = float(rng.uniform(0.25, 1.4))
            _window(mask, rng)
        elif kind < 0.75:
            strength = float(rng.uniform(-0.55, -0.15))
            _shade(mask, rng)
        else:
            strength, blur = float(rng.uniform(0.3, 1.5)), blur + 2.0
            centre = (int(rng.uniform(0, width)), int(rng.uniform(0, height)))
            axes = (int(rng.uniform(3, width / 5)), int(rng.uniform(2, height / 8)))
            cv2.ellipse(mask, centre, axes, float(rng.uniform(0, 180)), 0, 360, (1.0,), -1, cv2.LINE_AA)
        gain *= np.float32(1.0) + np.float32(strength) * cv2.GaussianBlur(mask, (0, 0), blur)
    return gain[:, :, None]


def _window(mask: Picture, rng: Rng) -> None:
    """A slanted row of panes with bars between them, in place."""
    height, width = mask.shape
    slant = np.array([rng.uniform(-0.8, 0.8), 1.0]) * height * float(rng.uniform(0.15, 0.5))
    wide = np.array([1.0, rng.uniform(-0.5, 0.5)]) * width * float(rng.uniform(0.1, 0.35))
    start = rng.uniform(-0.2, 0.8, 2) * (width, height)
    for column in range(int(rng.integers(1, 4))):
        for row in range(int(rng.integers(1, 3))):
            corner = start + wide * (column * 1.08) + slant * (row * 1.08)
            outline = np.stack([corner, corner + wide, corner + wide + slant, corner + slant])
            cv2.fillConvexPoly(mask, np.rint(outline * 16).astype(np.int32), (1.0,), cv2.LINE_AA, 4)


def _shade(mask: Picture, rng: Rng) -> None:
    """The shadow of somebody or something outside the picture: a half plane, or a broad limb, in place."""
    height, width = mask.shape
    middle, angle = rng.uniform(0, 1, 2) * (width, height), float(rng.uniform(0, 2 * math.pi))
    along = np.array([math.cos(angle), math.sin(angle)]) * 2.0 * width
    side = np.array([-along[1], along[0]]) * (1.0 if rng.random() < 0.35 else float(rng.uniform(0.03, 0.12)))
    back = -along if rng.random() < 0.5 else np.zeros(2)
    outline = np.stack([middle + back, middle + along, middle + along + side * 1.5, middle + back + side])
    cv2.fillConvexPoly(mask, np.rint(outline * 16).astype(np.int32), (1.0,), cv2.LINE_AA, 4)
