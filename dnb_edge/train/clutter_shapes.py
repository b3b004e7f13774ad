"""Shapes and paints that clutter is made of: limbs, balls, plates, tubes, rings, cloth, skin, wood, metal.

Knows convex bodies in metres, z up, and colours; nothing of what they stand for. Adds to `solids` what cars have no use for.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dnb_edge.train.solids import Colour, FloatArray, Solid, turned

Rng = np.random.Generator
Point = tuple[float, float, float]

WHITE: Colour = (232.0, 235.0, 235.0)
BLACK: Colour = (18.0, 17.0, 16.0)
STEEL: Colour = (178.0, 176.0, 172.0)
GOLD: Colour = (90.0, 170.0, 200.0)


def near(rng: Rng, colour: Colour, spread: float = 0.15) -> Colour:
    """A colour like the given one, of another brightness and a slightly other hue."""
    gain = float(np.exp(rng.normal(0.0, spread)))
    blue, green, red = (min(250.0, float(value * gain * np.exp(rng.normal(0.0, spread * 0.25)))) for value in colour)
    return (blue, green, red)


def paint(rng: Rng) -> Colour:
    """Any paint: half of them vivid, the others grey, white or black."""
    kind = rng.random()
    if kind < 0.22:
        return rubber(rng)
    if kind < 0.36:
        return near(rng, WHITE, 0.1)
    if kind < 0.48:
        return near(rng, (110.0, 110.0, 110.0), 0.3)
    hue, full, value = float(rng.uniform(0, 6)), float(rng.uniform(0.35, 1.0)), float(rng.uniform(70, 250))
    channels = [value * (1 - full * min(1.0, max(0.0, 2 - abs((hue + turn) % 6 - 3)))) for turn in (0.0, 2.0, 4.0)]
    return (channels[0], channels[1], channels[2])


def rubber(rng: Rng) -> Colour:
    """Nearly black: rubber, plastic of devices, castors, cables."""
    grey = float(rng.uniform(10, 62))
    return (grey + float(rng.uniform(0, 7)), grey + float(rng.uniform(0, 4)), grey)


def cloth(rng: Rng) -> Colour:
    """Trousers, sleeves, bags: denim, black, khaki, grey or anything."""
    choices: tuple[Colour, ...] = ((95, 60, 40), (35, 30, 28), (95, 130, 150), (105, 100, 98), (130, 95, 70))
    if rng.random() < 0.3:
        return paint(rng)
    return near(rng, choices[int(rng.integers(len(choices)))], 0.25)


def skin(rng: Rng) -> Colour:
    """Human skin, from dark to light."""
    share = float(rng.uniform(0, 1))
    return (45 + 125 * share, 62 + 130 * share, 95 + 135 * share)


def wood(rng: Rng) -> Colour:
    """Wood or cardboard."""
    choices: tuple[Colour, ...] = ((85, 140, 185), (110, 165, 200), (45, 75, 110), (150, 190, 215))
    return near(rng, choices[int(rng.integers(len(choices)))], 0.15)


def loft(lower: FloatArray, upper: FloatArray, colour: Colour, cap_colour: Colour | None = None) -> Solid:
    """The convex body between two rings, each (n, 3), both counter-clockwise seen from the upper ring's side."""
    n = len(lower)
    around = tuple((i, (i + 1) % n, (i + 1) % n + n, i + n) for i in range(n))
    caps = (tuple(range(n - 1, -1, -1)), tuple(range(n, 2 * n)))
    colours = None if cap_colour is None else (colour,) * n + (cap_colour, cap_colour)
    return Solid(vertices_m=np.vstack([lower, upper]), faces=around + caps, colour=colour, face_colours=colours)


def limb(start: Point, end: Point, radii: tuple[float, float], colour: Colour, *, sides: int = 8) -> Solid:
    """A round bar from `start` to `end` that tapers from the first radius to the second."""
    a, b = np.array(start), np.array(end)
    along = (b - a) / (float(np.linalg.norm(b - a)) + 1e-12)
    helper = np.array([1.0, 0.0, 0.0]) if abs(along[0]) < 0.8 else np.array([0.0, 1.0, 0.0])
    side = np.cross(helper, along)
    side /= np.linalg.norm(side)
    up = np.cross(along, side)
    angles = np.arange(sides) * (2 * math.pi / sides)
    ring = np.cos(angles)[:, None] * side + np.sin(angles)[:, None] * up
    return loft(a + ring * radii[0], b + ring * radii[1], colour)


def plate(
    outline: Sequence[tuple[float, float]], low_m: float, high_m: float, colour: Colour, top: float = 1.0
) -> Solid:
    """A convex outline (x, y), counter-clockwise, from height `low_m` to `high_m`; the upper one scaled by `top`."""
    flat = np.array(outline, dtype=np.float64)
    middle = flat.mean(axis=0)
    lower = np.column_stack([flat, np.full(len(flat), low_m)])
    upper = np.column_stack([middle + (flat - middle) * top, np.full(len(flat), high_m)])
    return loft(lower, upper, colour)


def slab(
    size: tuple[float, float, float], colour: Colour, *, at: Point = (0.0, 0.0, 0.0), round_m: float = 0.0
) -> Solid:
    """An upright box whose lower side's middle is `at`; its upright edges are cut by `round_m`."""
    x, y, cut = size[0] / 2, size[1] / 2, min(round_m, 0.45 * min(size[:2]))
    corners = [(x - cut, -y), (x, -y + cut), (x, y - cut), (x - cut, y), (-x + cut, y), (-x, y - cut), (-x, -y + cut)]
    corners.append((-x + cut, -y))
    if cut <= 0.0:
        corners = [(x, -y), (x, y), (-x, y), (-x, -y)]
    return plate([(u + at[0], v + at[1]) for u, v in corners], at[2], at[2] + size[2], colour)


def ball(centre: Point, radii: Point, colour: Colour, *, sides: int = 8, other: Colour | None = None) -> Solid:
    """An ellipsoid of flat faces; with `other` its sectors alternate in colour."""
    angles = np.arange(sides) * (2 * math.pi / sides)
    heights = (-0.88, -0.45, 0.0, 0.45, 0.88)
    rings = [np.column_stack([np.cos(angles), np.sin(angles)]) * math.sqrt(1 - h * h) for h in heights]
    vertices = np.vstack([np.column_stack([ring, np.full(sides, h)]) for ring, h in zip(rings, heights, strict=True)])
    vertices = np.vstack([vertices, [[0, 0, -1.0], [0, 0, 1.0]]])
    faces: list[tuple[int, ...]] = []
    colours: list[Colour] = []
    for i in range(sides):
        j, last, pole = (i + 1) % sides, (len(heights) - 1) * sides, len(heights) * sides
        faces += [(pole, j, i), (i + last, j + last, pole + 1)]
        faces += [(i + k, j + k, j + k + sides, i + k + sides) for k in range(0, last, sides)]
        colours += [other if other is not None and i % 2 else colour] * (len(heights) + 1)
    return Solid(
        vertices_m=vertices * np.array(radii) + np.array(centre),
        faces=tuple(faces),
        colour=colour,
        face_colours=None if other is None else tuple(colours),
    )


def tube(points: FloatArray, radius_m: float, colour: Colour) -> list[Solid]:
    """Bars of five sides from point to point, points (n, 3); they reach a little into each other so that bends close."""
    out: list[Solid] = []
    for a, b in itertools.pairwise(points):
        reach = (b - a) * (0.3 * radius_m / (float(np.linalg.norm(b - a)) + 1e-12))
        start, end = a - reach, b + reach
        out.append(limb(tuple(start.tolist()), tuple(end.tolist()), (radius_m, radius_m), colour, sides=5))
    return out


def arc(
    centre: Point, radius_m: float, span: tuple[float, float], *, upright: bool = False, count: int = 12
) -> FloatArray:
    """Points (count, 3) of a circle's part from angle to angle, rad: flat, or upright in the plane y, z."""
    angles = np.linspace(span[0], span[1], count)
    across, along, none = np.cos(angles) * radius_m, np.sin(angles) * radius_m, np.zeros(count)
    columns = [none, across, along] if upright else [across, along, none]
    return np.asarray(np.column_stack(columns) + np.array(centre), dtype=np.float64)


def placed(parts: Sequence[Solid], yaw_rad: float = 0.0, shift: Point = (0.0, 0.0, 0.0)) -> list[Solid]:
    """All parts turned about z, then moved."""
    return [turned(part, yaw_rad, shift_m=shift) for part in parts]


def grounded(parts: Sequence[Solid]) -> list[Solid]:
    """All parts moved up as one where a corner is below the floor."""
    return resting(parts) if min(float(part.vertices_m[:, 2].min()) for part in parts) < 0.0 else list(parts)


def resting(parts: Sequence[Solid]) -> list[Solid]:
    """All parts moved up or down as one, so that the lowest corner is on the floor."""
    low = min(float(part.vertices_m[:, 2].min()) for part in parts)
    return [replace(part, vertices_m=part.vertices_m - np.array([0.0, 0.0, low])) for part in parts]


def tipped(parts: Sequence[Solid], angle_rad: float) -> list[Solid]:
    """All parts turned about the y axis and put on the floor: things that have fallen over."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    rotation = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    return resting([replace(part, vertices_m=part.vertices_m @ rotation.T) for part in parts])


def scaled(parts: Sequence[Solid], size: float) -> list[Solid]:
    """All parts grown by `size` about the origin."""
    return [replace(part, vertices_m=part.vertices_m * size) for part in parts]
