"""Solids made of flat faces: boxes, prisms, cylinders and lofts, and how they move.

Knows shapes and face colours; nothing of cameras, pictures or what the solids stand for. Metres, z up.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Colour = tuple[float, float, float]
"""Blue, green, red, each 0..255."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solid:
    """One convex body."""

    vertices_m: FloatArray
    """Shape (n, 3)."""
    faces: tuple[tuple[int, ...], ...]
    """Vertex numbers of each convex face, counter-clockwise seen from outside."""
    colour: Colour
    face_colours: tuple[Colour, ...] | None = None
    """One colour a face, where they differ."""


_BOX_FACES = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))


def box(
    centre_m: tuple[float, float, float],
    size_m: tuple[float, float, float],
    colour: Colour,
    *,
    taper: tuple[float, float] = (1.0, 1.0),
    shift_top_m: float = 0.0,
) -> Solid:
    """An upright box; its top face is scaled by `taper` in x and y and moved by `shift_top_m` along x."""
    (x, y, z), (a, b, c) = centre_m, (size_m[0] / 2.0, size_m[1] / 2.0, size_m[2] / 2.0)
    d, e, t = a * taper[0], b * taper[1], x + shift_top_m
    bottom = ((x - a, y - b, z - c), (x + a, y - b, z - c), (x + a, y + b, z - c), (x - a, y + b, z - c))
    top = ((t - d, y - e, z + c), (t + d, y - e, z + c), (t + d, y + e, z + c), (t - d, y + e, z + c))
    return Solid(vertices_m=np.array(bottom + top, dtype=np.float64), faces=_BOX_FACES, colour=colour)


def prism(
    centre_m: tuple[float, float, float],
    radius_m: float,
    height_m: float,
    colour: Colour,
    *,
    sides: int = 10,
    axis: str = "z",
    top_scale: float = 1.0,
    cap_colour: Colour | None = None,
) -> Solid:
    """A regular prism (a cylinder, nearly), its axis along x, y or z; `top_scale` makes it a cone's stump."""
    angles = np.arange(sides) * (2 * math.pi / sides)
    ring = np.column_stack([np.cos(angles), np.sin(angles)]) * radius_m
    half = height_m / 2.0
    vertices = np.vstack(
        [np.column_stack([ring, np.full(sides, -half)]), np.column_stack([ring * top_scale, np.full(sides, half)])]
    )
    order = {"z": (0, 1, 2), "x": (2, 0, 1), "y": (1, 2, 0)}[axis]
    around = tuple((i, (i + 1) % sides, (i + 1) % sides + sides, i + sides) for i in range(sides))
    caps = (tuple(range(sides - 1, -1, -1)), tuple(range(sides, 2 * sides)))
    colours = None if cap_colour is None else (colour,) * sides + (cap_colour, cap_colour)
    return Solid(
        vertices_m=vertices[:, order] + np.array(centre_m), faces=around + caps, colour=colour, face_colours=colours
    )


def rod(start_m: FloatArray, end_m: FloatArray, radius_m: float, colour: Colour) -> Solid:
    """A thin square bar between two points."""
    x, y, z = (end_m - start_m).tolist()  # plain numbers from here: a car has a hundred rods
    length = math.sqrt(x * x + y * y + z * z)
    x, y, z = (x / length, y / length, z / length) if length > 1e-9 else (1.0, 0.0, 0.0)
    side = (y, -x, 0.0) if abs(z) < 0.9 else (0.0, z, -y)
    gain = radius_m / math.hypot(*side)
    p, q, r = (value * gain for value in side)
    u, v, w = q * z - r * y, r * x - p * z, p * y - q * x
    ring = ((u - p, v - q, w - r), (p + u, q + v, r + w), (p - u, q - v, r - w), (-p - u, -q - v, -r - w))
    section = np.array(ring)
    corners = np.concatenate((section + start_m, section + end_m))
    return Solid(vertices_m=corners, faces=_BOX_FACES, colour=colour)


def turned(solid: Solid, yaw_rad: float, *, shift_m: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Solid:
    """The solid turned about the z axis, then moved."""
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return replace(solid, vertices_m=solid.vertices_m @ rotation.T + np.array(shift_m))


def pitched(solid: Solid, pitch_rad: float, *, about_m: tuple[float, float, float]) -> Solid:
    """The solid turned about an axis along y through `about_m`."""
    c, s = math.cos(pitch_rad), math.sin(pitch_rad)
    rotation = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    centre = np.array(about_m)
    return replace(solid, vertices_m=(solid.vertices_m - centre) @ rotation.T + centre)


def loft(
    sections: Sequence[tuple[float, FloatArray]],
    colours: Sequence[Colour],
    *,
    top_colours: Sequence[Colour] | None = None,
    end_colours: tuple[Colour, Colour] | None = None,
) -> list[Solid]:
    """A body along x through cross-sections, one solid between each two neighbours.

    `sections` gives (x, points (k, 2) of y and z, counter-clockwise seen from +x) with growing x and one k; `colours` one
    colour for each of the k sides (from point i to point i + 1); `top_colours` one for each stretch, in place of the colour of
    side k // 2 (the roof of `rounded_section`); `end_colours` those of the rear and the front end.
    """
    k = len(sections[0][1])
    around = tuple((i, (i + 1) % k, (i + 1) % k + k, i + k) for i in range(k))
    caps = (tuple(range(k - 1, -1, -1)), tuple(range(k, 2 * k)))
    rear, front = (colours[0], colours[0]) if end_colours is None else end_colours
    out: list[Solid] = []
    for number, ((x0, low), (x1, high)) in enumerate(itertools.pairwise(sections)):
        vertices = np.vstack([np.column_stack([np.full(k, x0), low]), np.column_stack([np.full(k, x1), high])])
        sides = list(colours)
        if top_colours is not None:
            sides[k // 2] = top_colours[number]
        out.append(Solid(vertices_m=vertices, faces=around + caps, colour=sides[0], face_colours=(*sides, rear, front)))
    return out


def rounded_section(
    half_width_m: float, low_m: float, high_m: float, *, roof_share: float = 0.8, belt_share: float = 0.6
) -> FloatArray:
    """A car's cross-section, shape (6, 2), y and z: flat below, upright to the belt, then drawn in to the roof.

    `roof_share` is the roof's width over the body's, `belt_share` how far up the widest place lies. Sides in `loft`'s order:
    floor, left flank, left shoulder, roof, right shoulder, right flank.
    """
    belt = low_m + (high_m - low_m) * belt_share
    roof = half_width_m * roof_share
    right = [(-half_width_m * 0.94, low_m), (half_width_m * 0.94, low_m), (half_width_m, belt), (roof, high_m)]
    return np.array([*right, (-roof, high_m), (-half_width_m, belt)])
