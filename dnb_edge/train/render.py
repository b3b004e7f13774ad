"""Draws solids into a picture: shaded faces in painter's order, smoothed by supersampling, with a cast shadow.

Knows colour and light; nothing of what a solid stands for. Writes no file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.train.camera import View
from dnb_edge.train.solids import Solid
from dnb_edge.values import BgrImage

FloatArray = NDArray[np.float64]
_SUPER = 3  # small polygons drawn by fillConvexPoly come out too large: draw three times larger, then shrink
_SHIFT = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Light:
    """A far lamp and the light from everywhere."""

    direction: FloatArray
    """Unit vector (3,) from the floor to the lamp, z > 0."""
    ambient: float
    """Share of light that reaches every face, 0..1."""
    shadow_strength: float
    """How much a full shadow darkens the floor, 0..1."""
    shadow_blur_px: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sprite:
    """A drawn object, ready to lay over a picture of the view's size."""

    x_px: int
    y_px: int
    bgr: NDArray[np.float32]
    """Shape (h, w, 3), 0..255, colour where alpha > 0."""
    alpha: NDArray[np.float32]
    """Shape (h, w), 0..1."""
    distance_m: float
    """From the camera, for painter's order between objects."""


def _visible_faces(solids: Sequence[Solid], view: View, light: Light) -> list[tuple[float, FloatArray, FloatArray]]:
    """(distance, corners in px (k, 2), shaded colour (3,)) of each face that looks at the camera, farthest first."""
    out: list[tuple[float, FloatArray, FloatArray]] = []
    for solid in solids:
        pixels = view.project(solid.vertices_m)
        for number, face in enumerate(solid.faces):
            index = list(face)
            corners = solid.vertices_m[index]
            a, b = corners[1] - corners[0], corners[2] - corners[0]
            normal = np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
            centre = corners.mean(axis=0)
            to_eye = view.eye_m - centre
            if float(normal @ to_eye) <= 0.0:
                continue
            length = float(np.sqrt(normal @ normal)) + 1e-12
            lit = max(0.0, float(normal @ light.direction) / length)
            colour = solid.colour if solid.face_colours is None else solid.face_colours[number]
            shade = light.ambient + (1.0 - light.ambient) * lit
            out.append((float(np.sqrt(to_eye @ to_eye)), pixels[index], np.array(colour) * shade))
    out.sort(key=lambda face: -face[0])
    return out


def draw(solids: Sequence[Solid], view: View, light: Light, rng: np.random.Generator) -> Sprite | None:
    """The solids as one sprite; None where nothing of them is in the picture."""
    faces = _visible_faces(solids, view, light)
    if not faces:
        return None
    points = np.concatenate([pixels for _, pixels, _ in faces])
    low = np.maximum(np.floor(points.min(axis=0)).astype(int) - 1, 0)
    high = np.minimum(np.ceil(points.max(axis=0)).astype(int) + 2, view.size_px)
    if np.any(high - low < 2):
        return None
    width, height = (int(value) for value in high - low)
    canvas = np.zeros((height * _SUPER, width * _SUPER, 4), dtype=np.uint8)
    for _, pixels, colour in faces:
        corners = ((pixels - low + 0.5) * _SUPER - 0.5) * (1 << _SHIFT)
        corners = np.clip(corners, -60000, 60000)
        blue, green, red = (float(min(255.0, max(1.0, value))) for value in colour)
        cv2.fillConvexPoly(canvas, np.rint(corners).astype(np.int32), (blue, green, red, 255.0), cv2.LINE_8, _SHIFT)
    small = cv2.resize(canvas, (width, height), interpolation=cv2.INTER_AREA).astype(np.float32)
    alpha = small[:, :, 3] / np.float32(255.0)
    colour_sum = small[:, :, :3] / np.maximum(alpha, np.float32(1e-3))[:, :, None]
    grain = 1.0 + rng.normal(0.0, 0.05, (height, width, 1)).astype(np.float32)
    return Sprite(
        x_px=int(low[0]),
        y_px=int(low[1]),
        bgr=np.minimum(colour_sum * grain, np.float32(255.0)),
        alpha=alpha,
        distance_m=float(np.mean([distance for distance, _, _ in faces])),
    )


def shadow_mask(solids: Sequence[Solid], view: View, light: Light) -> NDArray[np.float32]:
    """How dark the floor is, 0..1, shape (size, size): each convex solid's shadow along the light, joined and blurred."""
    mask = np.zeros((view.size_px, view.size_px), dtype=np.uint8)
    slope = light.direction[:2] / light.direction[2]
    for solid in solids:
        vertices = solid.vertices_m
        height = np.maximum(vertices[:, 2:3], 0.0)
        ground = np.column_stack([vertices[:, :2] - height * slope, np.zeros(len(vertices))])
        pixels = np.clip(view.project(ground), -3000, 3000)
        hull = cv2.convexHull(np.rint(pixels * (1 << _SHIFT)).astype(np.int32))
        cv2.fillConvexPoly(mask, hull, (255.0,), cv2.LINE_AA, _SHIFT)
    blurred = cv2.GaussianBlur(mask, (0, 0), max(0.4, light.shadow_blur_px))
    return np.asarray(blurred, dtype=np.float32) * np.float32(light.shadow_strength / 255.0)


def darken(picture: NDArray[np.float32], mask: NDArray[np.float32]) -> None:
    """Apply a shadow mask to a float picture (h, w, 3) in place."""
    picture *= (np.float32(1.0) - mask)[:, :, None]


def lay_over(picture: NDArray[np.float32], sprite: Sprite) -> None:
    """Composite a sprite over a float picture (h, w, 3) in place."""
    height, width = sprite.alpha.shape
    part = picture[sprite.y_px : sprite.y_px + height, sprite.x_px : sprite.x_px + width]
    part += (sprite.bgr - part) * sprite.alpha[:, :, None]


def motion_blurred(sprite: Sprite, direction_px: tuple[float, float], size_px: int) -> Sprite:
    """The sprite smeared evenly along `direction_px` (u, v), half before and half after its place."""
    du, dv = direction_px
    reach = int(np.ceil(max(abs(du), abs(dv)) / 2)) + 1
    y0, x0 = max(0, sprite.y_px - reach), max(0, sprite.x_px - reach)
    y1 = min(size_px, sprite.y_px + sprite.alpha.shape[0] + reach)
    x1 = min(size_px, sprite.x_px + sprite.alpha.shape[1] + reach)
    wide = np.zeros((y1 - y0, x1 - x0, 4), dtype=np.float32)
    top, left = sprite.y_px - y0, sprite.x_px - x0
    inner = wide[top : top + sprite.alpha.shape[0], left : left + sprite.alpha.shape[1]]
    inner[:, :, :3] = sprite.bgr * sprite.alpha[:, :, None]
    inner[:, :, 3] = sprite.alpha
    side = 2 * reach + 1
    kernel = np.zeros((side * 4, side * 4), dtype=np.float32)
    middle = (side * 4 - 1) / 2.0
    start = (round(middle - du * 2), round(middle - dv * 2))
    end = (round(middle + du * 2), round(middle + dv * 2))
    cv2.line(kernel, start, end, (1.0,), 4)
    kernel = np.asarray(cv2.resize(kernel, (side, side), interpolation=cv2.INTER_AREA), dtype=np.float32)
    filtered = cv2.filter2D(wide, -1, kernel / kernel.sum(), borderType=cv2.BORDER_CONSTANT)
    smeared = np.asarray(filtered, dtype=np.float32)
    alpha = np.ascontiguousarray(smeared[:, :, 3])
    return Sprite(
        x_px=x0,
        y_px=y0,
        bgr=np.asarray(smeared[:, :, :3] / np.maximum(alpha, np.float32(1e-3))[:, :, None], dtype=np.float32),
        alpha=np.clip(alpha, 0.0, 1.0),
        distance_m=sprite.distance_m,
    )


def to_picture(picture: NDArray[np.float32]) -> BgrImage:
    """Rounded and clipped to uint8."""
    return np.asarray(np.clip(picture + np.float32(0.5), 0.0, 255.0), dtype=np.uint8)
