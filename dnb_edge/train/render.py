"""Draws bodies of coloured triangles with a depth buffer, supersampled, with shadows on the floor and true motion blur.

Knows colour, light and depth; nothing of what a body stands for. Writes no file. The rasteriser is OpenCV's own
(`cv2.triangleRasterize`, OpenCV 5); perspective and lens are applied to each corner before it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.train.camera import LEAST_DEPTH_M, View
from dnb_edge.train.solids import Solid
from dnb_edge.values import BgrImage

FloatArray = NDArray[np.float64]
Picture = NDArray[np.float32]
"""Shape (h, w, 3), blue-green-red, 0..255."""

SUPER = 2
"""Drawn so many times larger, then shrunk: smooth edges, and the rasteriser's half pixel of growth shrinks with it."""
_FAR_M = 300.0


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
    gloss: float = 0.0
    """Strength of the mirror-like highlight, 0..1."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Body:
    """A thing made of coloured triangles."""

    corners_m: FloatArray
    """Shape (n, 3, 3): triangle, corner, (x, y, z), metres."""
    colours_bgr: FloatArray
    """Shape (n, 3), 0..255: one a triangle."""
    two_sided: bool = False
    """True for meshes whose triangles do not all wind the same way."""

    def moved(self, yaw_rad: float, shift_m: tuple[float, float]) -> Body:
        """The body turned about the z axis, then moved on the floor."""
        c, s = math.cos(yaw_rad), math.sin(yaw_rad)
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        corners = self.corners_m @ rotation.T + np.array([shift_m[0], shift_m[1], 0.0])
        return Body(corners_m=corners, colours_bgr=self.colours_bgr, two_sided=self.two_sided)


def body_of(solids: Sequence[Solid]) -> Body:
    """Convex solids as one body, each face cut into a fan of triangles."""
    corners: list[FloatArray] = []
    colours: list[FloatArray] = []
    for solid in solids:
        for number, face in enumerate(solid.faces):
            index = np.array([(face[0], face[i], face[i + 1]) for i in range(1, len(face) - 1)])
            colour = solid.colour if solid.face_colours is None else solid.face_colours[number]
            corners.append(solid.vertices_m[index])
            colours.append(np.tile(np.array(colour, dtype=np.float64), (len(index), 1)))
    return Body(corners_m=np.concatenate(corners), colours_bgr=np.concatenate(colours))


@dataclass(slots=True, kw_only=True, eq=False)
class Canvas:
    """What has been drawn so far, SUPER times the view's size; the only mutable thing here."""

    bgr: Picture
    depth_m: NDArray[np.float32]
    """Shape (h, w); 300 where nothing is drawn."""

    def copy(self) -> Canvas:
        """The same, to draw on apart."""
        return Canvas(bgr=self.bgr.copy(), depth_m=self.depth_m.copy())


def blank(view: View) -> Canvas:
    """An empty canvas for `view`."""
    height, width = view.height_px * SUPER, view.width_px * SUPER
    return Canvas(
        bgr=np.zeros((height, width, 3), dtype=np.float32), depth_m=np.full((height, width), _FAR_M, dtype=np.float32)
    )


_SETTINGS = cv2.TriangleRasterizeSettings()
_SETTINGS.setShadingType(cv2.RASTERIZE_SHADING_FLAT)
_SETTINGS.setCullingMode(cv2.RASTERIZE_CULLING_NONE)
_EYE = np.eye(4, dtype=np.float32)


def _before_rasteriser(
    pixels: FloatArray, depth_m: FloatArray, height: int, width: int, times: int
) -> NDArray[np.float32]:
    """Corners (n, 1, 3) for a camera of 90 degrees over `height` that put depth `depth_m` at `pixels`, `times` enlarged."""
    half = height / 2.0
    x = ((pixels[:, 0] + 0.5) * times - width / 2.0) / half * depth_m
    y = -((pixels[:, 1] + 0.5) * times - half) / half * depth_m
    return np.column_stack([x, y, -depth_m]).astype(np.float32)[:, None]


def _silhouette(corners_m: FloatArray, view: View, times: int) -> NDArray[np.float32] | None:
    """Depth (h, w), `times` the view's size, of triangles (n, 3, 3) alone; None where one is too near to be drawn."""
    camera = view.camera_m(corners_m.reshape(-1, 3))
    if float(camera[:, 2].min()) < LEAST_DEPTH_M * 2:
        return None
    height, width = view.height_px * times, view.width_px * times
    alone = np.full((height, width), _FAR_M, dtype=np.float32)
    corners = _before_rasteriser(view.project_camera(camera), camera[:, 2], height, width, times)
    index = np.arange(len(corners), dtype=np.int32).reshape(-1, 1, 3)
    cv2.triangleRasterizeDepth(corners, index, alone, _EYE, math.pi / 2, LEAST_DEPTH_M, _FAR_M, _SETTINGS)
    return alone


def _shaded(body: Body, view: View, light: Light) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Colours (n, 3) 0..1 of the triangles under the light, and which of them look at the camera."""
    corners = body.corners_m
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True) + 1e-15
    centres = corners.mean(axis=1)
    to_eye = view.eye_m - centres
    to_eye /= np.linalg.norm(to_eye, axis=1, keepdims=True) + 1e-12
    facing = (normals * to_eye).sum(axis=1)
    if body.two_sided:
        normals = normals * np.where(facing < 0.0, -1.0, 1.0)[:, None]
        facing = np.abs(facing)
    lit = np.maximum(0.0, normals @ light.direction)
    half = to_eye + light.direction
    half /= np.linalg.norm(half, axis=1, keepdims=True) + 1e-12
    shine = light.gloss * np.maximum(0.0, (normals * half).sum(axis=1)) ** 24
    height = max(1e-6, float(corners[:, :, 2].max()))
    low = np.clip(0.7 + 0.6 * centres[:, 2] / height, 0.0, 1.0)  # little light reaches the underside
    shade = (light.ambient + (1.0 - light.ambient) * lit) * low
    colours = body.colours_bgr * (shade / 255.0)[:, None] + shine[:, None]
    return np.clip(colours, 0.004, 1.0), facing > 0.0


def draw(canvas: Canvas, body: Body, view: View, light: Light) -> bool:
    """Draw a body into the canvas, nearer things in front; False where none of it is in the picture.

    Bodies of which a part is nearer than 5 cm to the camera's plane are left out whole.
    """
    camera = view.camera_m(body.corners_m.reshape(-1, 3))
    if float(camera[:, 2].min()) < LEAST_DEPTH_M * 2:
        return False
    pixels = view.project_camera(camera)
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    if high[0] < 0 or high[1] < 0 or low[0] > view.width_px or low[1] > view.height_px:
        return False
    colours, facing = _shaded(body, view, light)
    height, width = canvas.depth_m.shape
    seen = np.repeat(facing, 3)
    corners = _before_rasteriser(pixels[seen], camera[seen, 2], height, width, SUPER)
    index = np.arange(len(corners), dtype=np.int32).reshape(-1, 1, 3)
    paint = np.repeat(colours[facing], 3, axis=0).astype(np.float32)[:, None]
    if len(corners):
        cv2.triangleRasterize(
            corners, index, paint, canvas.bgr, canvas.depth_m, _EYE, math.pi / 2, LEAST_DEPTH_M, _FAR_M, _SETTINGS
        )
    return True


def visible_share(canvas: Canvas, body: Body, view: View) -> float:
    """The share 0..1 of a body's own silhouette that the canvas, with all drawn, still shows."""
    alone = _silhouette(body.corners_m, view, SUPER)
    if alone is None:
        return 0.0
    covered = alone < _FAR_M - 1.0
    whole = int(np.count_nonzero(covered))
    if whole == 0:
        return 0.0
    return float(np.count_nonzero(covered & (canvas.depth_m > alone - np.float32(2e-3)))) / whole


def silhouette(body: Body, view: View) -> NDArray[np.bool_]:
    """Where a body alone is seen, shape (h, w); nowhere where it is too near to be drawn."""
    alone = _silhouette(body.corners_m, view, 1)
    if alone is None:
        return np.zeros((view.height_px, view.width_px), dtype=np.bool_)
    return np.asarray(alone < _FAR_M - 1.0, dtype=np.bool_)


def flatten(canvases: Sequence[Canvas], view: View) -> tuple[Picture, NDArray[np.float32]]:
    """Colour (h, w, 3) 0..255, multiplied by alpha, and alpha (h, w) 0..1 at the view's size: the mean of the canvases."""
    size = (view.width_px, view.height_px)
    colour = np.zeros((view.height_px, view.width_px, 3), dtype=np.float32)
    alpha = np.zeros((view.height_px, view.width_px), dtype=np.float32)
    for canvas in canvases:
        covered = (canvas.depth_m < _FAR_M - 1.0).astype(np.float32)
        colour += cv2.resize(canvas.bgr, size, interpolation=cv2.INTER_AREA) * np.float32(255.0)
        alpha += cv2.resize(covered, size, interpolation=cv2.INTER_AREA)
    count = np.float32(1.0 / len(canvases))
    return colour * count, alpha * count


def shadow_mask(bodies: Sequence[Body], view: View, light: Light) -> NDArray[np.float32]:
    """How dark the floor is, 0..1, shape (h, w): the bodies' shadows along the light, joined and blurred."""
    mask = np.zeros((view.height_px, view.width_px), dtype=np.uint8)
    slope = light.direction[:2] / light.direction[2]
    for body in bodies:
        corners = body.corners_m
        ground = np.zeros_like(corners)
        ground[..., :2] = corners[..., :2] - np.maximum(corners[..., 2:3], 0.0) * slope
        alone = _silhouette(ground, view, 1)
        if alone is not None:
            mask[alone < _FAR_M - 1.0] = 255
    blurred = cv2.GaussianBlur(mask, (0, 0), max(0.4, light.shadow_blur_px))
    return np.asarray(blurred, dtype=np.float32) * np.float32(light.shadow_strength / 255.0)


def floor_shadows(bodies: Sequence[Body], view: View, light: Light) -> NDArray[np.float32]:
    """`shadow_mask` of the lamp and of the light from above that does not reach under a body, the darker of the two."""
    contact = Light(
        direction=np.array([0.0, 0.0, 1.0]),
        ambient=1.0,
        shadow_strength=0.55,
        shadow_blur_px=min(1.5, light.shadow_blur_px),
    )
    return np.maximum(shadow_mask(bodies, view, light), shadow_mask(bodies, view, contact))


def darken(picture: Picture, mask: NDArray[np.float32]) -> None:
    """Apply a shadow mask to a float picture (h, w, 3) in place."""
    picture *= (np.float32(1.0) - mask)[:, :, None]


def lay_over(picture: Picture, colour: Picture, alpha: NDArray[np.float32]) -> None:
    """Composite what `flatten` gave over a float picture (h, w, 3) in place."""
    picture *= (np.float32(1.0) - alpha)[:, :, None]
    picture += colour


def to_picture(picture: Picture) -> BgrImage:
    """Rounded and clipped to uint8."""
    return np.asarray(np.clip(picture + np.float32(0.5), 0.0, 255.0), dtype=np.uint8)
