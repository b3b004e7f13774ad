"""Boxes and cylinders in space, seen by a camera: flat shaded faces drawn from the farthest to the nearest.

Knows convex solids, one distant light and their picture. Knows no car and no track. All solids stand in *world m*.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.sim.camera import PinholeCamera
from dnb_edge.values import BgrImage

Colour = tuple[float, float, float]
"""Blue, green, red, 0..255."""

LIGHT = np.array([-0.35, 0.25, 1.0]) / np.linalg.norm([-0.35, 0.25, 1.0])
"""Unit vector towards the light, world axes."""

_AMBIENT = 0.45
_SUBPIXEL_BITS = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Face:
    """A flat convex polygon with its outward normal."""

    corners_m: NDArray[np.float64]
    """(n, 3) world m."""
    normal: NDArray[np.float64]
    colour: Colour


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solid:
    """One convex body; its faces that look away from the camera are not drawn."""

    faces: tuple[Face, ...]
    layer: int = 0
    """Solids of a higher layer are drawn over those of a lower one, whatever their distance: a board over its chassis."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mesh:
    """Many solids as a few arrays, so that a frame costs a handful of array operations."""

    corners_m: NDArray[np.float64]
    """(n, 3) corners of all faces, one face after another, world m (or the frame of a body that `moved` brings there)."""
    starts: NDArray[np.int64]
    """(faces + 1,) where each face's corners begin."""
    normals: NDArray[np.float64]
    """(faces, 3) outward unit vectors."""
    colours: NDArray[np.float64]
    """(faces, 3) blue, green, red, 0..255."""
    solid_starts: NDArray[np.int64]
    """(solids + 1,) where each solid's faces begin."""
    layers: NDArray[np.int64]
    """(solids,)"""

    def moved(self, rotation: NDArray[np.float64], shift_m: NDArray[np.float64]) -> Mesh:
        """This mesh turned by `rotation` (3, 3), then moved by `shift_m` (3,)."""
        return replace(self, corners_m=self.corners_m @ rotation.T + shift_m, normals=self.normals @ rotation.T)


def mesh(solids: Sequence[Solid]) -> Mesh:
    """All of `solids`, at least one, as one mesh."""
    faces = [face for solid in solids for face in solid.faces]
    return Mesh(
        corners_m=np.concatenate([face.corners_m for face in faces]),
        starts=np.cumsum([0] + [len(face.corners_m) for face in faces]),
        normals=np.array([face.normal for face in faces]),
        colours=np.array([face.colour for face in faces], dtype=np.float64),
        solid_starts=np.cumsum([0] + [len(solid.faces) for solid in solids]),
        layers=np.array([solid.layer for solid in solids]),
    )


def box(
    centre_m: tuple[float, float, float],
    size_m: tuple[float, float, float],
    colour: Colour,
    *,
    layer: int = 0,
    top: Colour | None = None,
) -> Solid:
    """An upright box, sides along the axes; `top` colours its upper face."""
    c, half = np.asarray(centre_m), 0.5 * np.asarray(size_m)
    faces = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for sign in (-1.0, 1.0):
            corners = np.zeros((4, 3))
            corners[:, axis] = sign * half[axis]
            corners[:, u] = half[u] * np.array([-1, 1, 1, -1])
            corners[:, v] = half[v] * np.array([-1, -1, 1, 1])
            normal = np.zeros(3)
            normal[axis] = sign
            faces.append(
                Face(
                    corners_m=corners + c,
                    normal=normal,
                    colour=top if top is not None and axis == 2 and sign > 0 else colour,
                )
            )
    return Solid(faces=tuple(faces), layer=layer)


def cylinder(
    centre_m: tuple[float, float, float],
    radius_m: float,
    length_m: float,
    axis: int,
    colour: Colour,
    *,
    layer: int = 0,
    cap: Colour | None = None,
    sides: int = 14,
) -> Solid:
    """A cylinder whose axis is world axis `axis` (0, 1 or 2); `cap` colours the middle of its ends, as a wheel's hub."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    angles = np.arange(sides) * 2.0 * math.pi / sides
    ring = np.zeros((sides, 3))
    ring[:, u], ring[:, v] = radius_m * np.cos(angles), radius_m * np.sin(angles)
    along = np.zeros(3)
    along[axis] = 1.0
    c = np.asarray(centre_m)
    low, high = c - 0.5 * length_m * along, c + 0.5 * length_m * along
    faces = []
    for i in range(sides):
        j = (i + 1) % sides
        middle = 0.5 * (ring[i] + ring[j])
        corners = np.array([low + ring[i], low + ring[j], high + ring[j], high + ring[i]])
        faces.append(Face(corners_m=corners, normal=middle / np.linalg.norm(middle), colour=colour))
    for end, sign in ((low, -1.0), (high, 1.0)):
        faces.append(Face(corners_m=end + ring, normal=sign * along, colour=colour))
        if cap is not None:
            faces.append(Face(corners_m=end + 0.6 * ring + 1e-4 * sign * along, normal=sign * along, colour=cap))
    return Solid(faces=tuple(faces), layer=layer)


def draw_mesh(
    canvas: BgrImage, body: Mesh, camera: PinholeCamera, *, offset_px: tuple[float, float], scale: float
) -> None:
    """Draw `body` on `canvas`, which shows the camera's picture from camera px `offset_px`, enlarged `scale` times."""
    pixels = camera.project(body.corners_m)
    enlarged = ((pixels - np.asarray(offset_px) + 0.5) * scale - 0.5) * (1 << _SUBPIXEL_BITS)
    fixed = np.rint(enlarged).astype(np.int32)
    first_corners = body.corners_m[body.starts[:-1]]
    seen = np.einsum("ij,ij->i", body.normals, camera.position_m - first_corners) > 0.0
    light = _AMBIENT + (1.0 - _AMBIENT) * np.maximum(0.0, body.normals @ LIGHT)
    colours = (body.colours * light[:, None]).tolist()
    for solid in _far_to_near(body, camera):
        for face in range(body.solid_starts[solid], body.solid_starts[solid + 1]):
            if seen[face]:
                polygon = fixed[body.starts[face] : body.starts[face + 1]]
                cv2.fillConvexPoly(canvas, polygon, colours[face], cv2.LINE_AA, _SUBPIXEL_BITS)


def thrown_on_floor(body: Mesh) -> NDArray[np.float64]:
    """(n, 3) where the light throws each corner of `body` on the floor, world m."""
    return np.asarray(body.corners_m - np.maximum(body.corners_m[:, 2:], 0.0) * (LIGHT / LIGHT[2]))


def draw_shadow(
    canvas: NDArray[np.uint8], body: Mesh, camera: PinholeCamera, *, offset_px: tuple[float, float], scale: float
) -> None:
    """Fill with 255 what `body`'s shadow covers of the floor; `canvas` (h, w) lies as in `draw_mesh`."""
    pixels = (camera.project(thrown_on_floor(body)) - np.asarray(offset_px) + 0.5) * scale - 0.5
    fixed = np.rint(pixels * (1 << _SUBPIXEL_BITS)).astype(np.int32)
    corner_starts = body.starts[body.solid_starts]
    for start, end in itertools.pairwise(corner_starts):
        hull = cv2.convexHull(fixed[start:end])
        cv2.fillConvexPoly(canvas, hull, 255.0, cv2.LINE_AA, _SUBPIXEL_BITS)


def _far_to_near(body: Mesh, camera: PinholeCamera) -> list[int]:
    """The solids in the order of drawing: by layer, then from the farthest centre to the nearest."""
    corner_starts = body.starts[body.solid_starts]
    sums = np.add.reduceat(body.corners_m, corner_starts[:-1], axis=0)
    centres = sums / np.diff(corner_starts)[:, None]
    order: list[int] = np.lexsort((-camera.distance_m(centres), body.layers)).tolist()
    return order
