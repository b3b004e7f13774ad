"""Things that stand or lie about a race track and are no car: chair bases, legs, shoes, boxes, bags, cables, papers, markers.

Knows their shapes in metres; nothing of cameras or pictures. Each thing stands on z = 0 about the origin.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dnb_edge.train.car_parts import any_colour, dark
from dnb_edge.train.solids import Colour, Solid, box, prism, rod, turned

Rng = np.random.Generator


def chair_base(rng: Rng) -> list[Solid]:
    """An office chair: spokes with castors, a column, perhaps a foot ring and a seat."""
    colour = dark(rng) if rng.random() < 0.7 else any_colour(rng)
    radius = float(rng.uniform(0.25, 0.36))
    out: list[Solid] = []
    count = 5 if rng.random() < 0.85 else 4
    for number in range(count):
        angle = 2 * math.pi * number / count
        tip = np.array([math.cos(angle) * radius, math.sin(angle) * radius, 0.07])
        out.append(rod(np.array([0.0, 0.0, 0.12]), tip, float(rng.uniform(0.012, 0.025)), colour))
        wheel = prism((0, 0, 0.028), 0.028, 0.045, dark(rng), sides=8, axis="y")
        out.append(turned(wheel, float(rng.uniform(0, 6.3)), shift_m=(float(tip[0]), float(tip[1]), 0.0)))
    out.append(prism((0, 0, 0.25), 0.025, 0.3, colour if rng.random() < 0.5 else (180, 180, 180), sides=8))
    if rng.random() < 0.35:
        ring = [np.array([math.cos(a) * 0.2, math.sin(a) * 0.2, 0.22]) for a in np.linspace(0, 2 * math.pi, 13)]
        out.extend(rod(a, b, 0.012, (190, 190, 195)) for a, b in itertools.pairwise(ring))
    if rng.random() < 0.5:
        out.append(box((0, 0, 0.45), (0.42, 0.44, 0.07), any_colour(rng)))
        out.append(box((-0.24, 0, 0.7), (0.06, 0.4, 0.4), any_colour(rng)))
    return out


def castor(rng: Rng) -> list[Solid]:
    """One castor on a stub of a leg."""
    radius = float(rng.uniform(0.02, 0.05))
    leg_colour, hub = any_colour(rng), any_colour(rng)
    lean = np.array([rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1), float(rng.uniform(0.1, 0.5))])
    return [
        prism((0, 0, radius), radius, radius * 0.8, dark(rng), sides=8, axis="y"),
        prism((0, radius, radius), radius, radius * 0.6, dark(rng), sides=8, axis="y"),
        prism((0, -radius * 0.1, radius), radius * 0.5, radius * 1.2, hub, sides=8, axis="y"),
        box((0, radius * 0.5, radius * 1.6), (radius * 1.7, radius * 1.9, radius * 0.7), dark(rng), taper=(0.6, 0.8)),
        rod(np.array([0.0, 0.0, radius * 1.5]), lean, float(rng.uniform(0.01, 0.025)), leg_colour),
    ]


def four_leg_chair(rng: Rng) -> list[Solid]:
    """A chair or stool on four thin legs, some with castors or rubber feet."""
    leg, seat = any_colour(rng), any_colour(rng)
    width, height = float(rng.uniform(0.3, 0.5)), float(rng.uniform(0.4, 0.7))
    out = [box((0, 0, height), (width, width, 0.04), seat, taper=(0.9, 0.9))]
    for x in (-1, 1):
        for y in (-1, 1):
            foot = np.array([x * width * 0.55, y * width * 0.55, 0.03])
            out.append(
                rod(foot, np.array([x * width * 0.4, y * width * 0.4, height]), float(rng.uniform(0.008, 0.016)), leg)
            )
            out.append(
                prism(
                    (float(foot[0]), float(foot[1]), 0.02),
                    float(rng.uniform(0.012, 0.03)),
                    0.04,
                    dark(rng),
                    sides=8,
                    axis="y",
                )
            )
    if rng.random() < 0.6:
        out.append(box((-width * 0.5, 0, height + 0.2), (0.04, width * 0.9, 0.3), seat))
    return out


def person(rng: Rng) -> list[Solid]:
    """Two shoes and two legs, in mid-step or standing."""
    trousers = any_colour(rng) if rng.random() < 0.5 else dark(rng)
    shoe = any_colour(rng) if rng.random() < 0.6 else dark(rng)
    sole: Colour = (235, 235, 235) if rng.random() < 0.5 else (20, 20, 20)
    out: list[Solid] = []
    for side in (-1, 1):
        x, y = float(rng.uniform(-0.22, 0.22)), side * float(rng.uniform(0.07, 0.16))
        lift = max(0.0, float(rng.uniform(-0.1, 0.08)))
        out.append(box((x, y, lift + 0.015), (0.29, 0.1, 0.03), sole))
        out.append(box((x, y, lift + 0.065), (0.27, 0.09, 0.07), shoe, taper=(0.7, 0.75), shift_top_m=-0.03))
        ankle = np.array([x - 0.08, y, lift + 0.1])
        knee = np.array([x * 0.5, y, 0.5])
        if rng.random() < 0.25:
            out.append(rod(ankle, ankle + (knee - ankle) * 0.3, 0.045, (130, 150, 190)))
            ankle = ankle + (knee - ankle) * 0.3
        out.append(rod(ankle, knee, float(rng.uniform(0.05, 0.075)), trousers))
        out.append(rod(knee, np.array([0.0, y * 0.8, 0.95]), float(rng.uniform(0.065, 0.09)), trousers))
    return out


def shoe(rng: Rng) -> list[Solid]:
    """A lone shoe."""
    return [
        box((0, 0, 0.015), (0.28, 0.1, 0.03), any_colour(rng)),
        box((0, 0, 0.06), (0.26, 0.09, 0.06), any_colour(rng), taper=(0.6, 0.7)),
    ]


def carton(rng: Rng) -> list[Solid]:
    """A cardboard or plastic box, with a strip of tape and a label."""
    gain = float(rng.uniform(0.6, 1.2))
    colour: Colour = (90 * gain, 140 * gain, 180 * gain) if rng.random() < 0.6 else any_colour(rng)
    size = tuple(float(value) for value in rng.uniform(0.08, 0.6, 3))
    body = box((0, 0, size[2] / 2), (size[0], size[1], size[2]), colour)
    label = box((size[0] * 0.2, 0, size[2] + 0.001), (size[0] * 0.3, size[1] * 0.4, 0.002), (225, 230, 230))
    tape = box((0, 0, size[2] + 0.001), (size[0], size[1] * 0.1, 0.002), (120, 170, 205))
    return [body, label, tape]


def bag(rng: Rng) -> list[Solid]:
    """A rucksack or a heap of cloth with straps."""
    colour = dark(rng) if rng.random() < 0.6 else any_colour(rng)
    out = [
        prism((0, 0, 0.12), float(rng.uniform(0.1, 0.2)), 0.24, colour, sides=9, top_scale=float(rng.uniform(0.4, 0.9)))
    ]
    out.append(box((0.15, 0, 0.08), (0.12, 0.22, 0.16), colour, taper=(0.6, 0.8)))
    if rng.random() < 0.6:
        points = [np.array([rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3), rng.uniform(0.01, 0.25)]) for _ in range(4)]
        out.extend(rod(a, b, 0.012, dark(rng)) for a, b in itertools.pairwise(points))
    return out


def cable(rng: Rng) -> list[Solid]:
    """A cable that winds over the floor, sometimes with a plug strip."""
    colour = dark(rng) if rng.random() < 0.7 else any_colour(rng)
    angle, point = float(rng.uniform(0, 6.3)), np.array([-0.4, float(rng.uniform(-0.2, 0.2)), 0.005])
    radius = float(rng.uniform(0.003, 0.008))
    out: list[Solid] = []
    for _ in range(int(rng.integers(6, 16))):
        angle += float(rng.normal(0, 0.6))
        following = point + 0.09 * np.array([math.cos(angle), math.sin(angle), 0.0])
        out.append(rod(point, following, radius, colour))
        point = following
    if rng.random() < 0.4:
        strip = box((0, 0, 0.02), (0.3, 0.06, 0.04), (225, 225, 225) if rng.random() < 0.5 else dark(rng))
        out.append(turned(strip, angle, shift_m=(float(point[0]), float(point[1]), 0.0)))
    return out


def flat_scraps(rng: Rng) -> list[Solid]:
    """Papers, tape crosses, stickers and stains that lie flat."""
    out: list[Solid] = []
    for _ in range(int(rng.integers(1, 4))):
        place = (float(rng.uniform(-0.3, 0.3)), float(rng.uniform(-0.3, 0.3)), 0.0005)
        yaw = float(rng.uniform(0, 6.3))
        if rng.random() < 0.5:
            size = (float(rng.uniform(0.03, 0.3)), float(rng.uniform(0.03, 0.25)), 0.001)
            out.append(turned(box((0, 0, 0), size, any_colour(rng)), yaw, shift_m=place))
        else:
            colour, arm = any_colour(rng), float(rng.uniform(0.06, 0.2))
            out.extend(
                turned(box((0, 0, 0), (arm, 0.025, 0.001), colour), yaw + turn, shift_m=place) for turn in (0.0, 1.57)
            )
    return out


def marker(rng: Rng) -> list[Solid]:
    """A square fiducial marker of 4 to 6 cells, flat or on a low block."""
    side, cells = float(rng.uniform(0.06, 0.25)), int(rng.integers(4, 7))
    z = 0.001 if rng.random() < 0.7 else float(rng.uniform(0.02, 0.1))
    out = [
        box((0, 0, z / 2), (side * 1.25, side * 1.25, z), (235, 235, 235)),
        box((0, 0, z), (side, side, 0.001), (15, 15, 15)),
    ]
    cell = side / (cells + 2)
    for row in range(cells):
        for column in range(cells):
            if rng.random() < 0.45:
                place = ((row - (cells - 1) / 2) * cell, (column - (cells - 1) / 2) * cell, z + 0.001)
                out.append(box(place, (cell, cell, 0.001), (235, 235, 235)))
    return out


def gadget(rng: Rng) -> list[Solid]:
    """A controller, mouse, charger, battery, headphones or tool: a few small dark parts, no wheels."""
    colour = dark(rng) if rng.random() < 0.6 else any_colour(rng)
    size = float(rng.uniform(0.05, 0.2))
    out = [
        box((0, 0, size * 0.12), (size, size * float(rng.uniform(0.3, 0.7)), size * 0.24), colour, taper=(0.85, 0.85))
    ]
    out.extend(
        prism((size * 0.3, side * size * 0.35, size * 0.15), size * 0.18, size * 0.3, dark(rng), sides=8, top_scale=0.7)
        for side in (-1, 1)
        if rng.random() < 0.6
    )
    for _ in range(int(rng.integers(0, 4))):
        spot = size * rng.uniform(-0.3, 0.3, 2)
        out.append(
            prism((float(spot[0]), float(spot[1]), size * 0.26), size * 0.06, size * 0.05, any_colour(rng), sides=6)
        )
    if rng.random() < 0.35:
        ring = [np.array([math.cos(a), math.sin(a), 0.1]) * size * 0.7 for a in np.linspace(0, 4.5, 9)]
        out.extend(rod(a, b, size * 0.07, colour) for a, b in itertools.pairwise(ring))
    return out


def furniture_leg(rng: Rng) -> list[Solid]:
    """A table leg or pipe that stands on the floor, with a foot."""
    colour, radius = any_colour(rng), float(rng.uniform(0.012, 0.04))
    top = np.array([rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1), 0.75])
    return [
        rod(np.array([0.0, 0.0, 0.0]), top, radius, colour),
        prism((0, 0, 0.01), radius * 1.6, 0.02, dark(rng), sides=8),
    ]


def can_or_cup(rng: Rng) -> list[Solid]:
    """A cup, a can, a ball, a cone."""
    radius, scale = float(rng.uniform(0.03, 0.1)), float(rng.uniform(0.15, 1.2))
    height = radius * float(rng.uniform(1.0, 3.5))
    return [
        prism(
            (0, 0, height / 2), radius, height, any_colour(rng), sides=12, top_scale=scale, cap_colour=any_colour(rng)
        )
    ]


def hand(rng: Rng) -> list[Solid]:
    """A hand that reaches in, with an arm."""
    skin: Colour = tuple(value * float(rng.uniform(0.45, 1.1)) for value in (140.0, 170.0, 215.0))  # type: ignore[assignment]
    sleeve = any_colour(rng)
    palm = box((0, 0, 0.06), (0.1, 0.085, 0.03), skin)
    fingers = [
        rod(np.array([0.05, y, 0.06]), np.array([0.11, y * 1.2, float(rng.uniform(0.01, 0.06))]), 0.009, skin)
        for y in (-0.03, -0.01, 0.01, 0.03)
    ]
    arm = rod(np.array([-0.05, 0.0, 0.07]), np.array([-0.3, 0.0, 0.2]), 0.032, skin if rng.random() < 0.4 else sleeve)
    upper = rod(np.array([-0.3, 0.0, 0.2]), np.array([-0.75, 0.1, 0.5]), 0.05, sleeve)
    return [palm, *fingers, arm, upper]


_STATIC: tuple[tuple[Callable[[Rng], list[Solid]], float], ...] = (
    (chair_base, 0.19), (castor, 0.13), (four_leg_chair, 0.07), (person, 0.1), (shoe, 0.04),
    (carton, 0.08), (bag, 0.08), (cable, 0.07), (flat_scraps, 0.08),
    (marker, 0.06), (gadget, 0.1), (furniture_leg, 0.06), (can_or_cup, 0.05),
)  # fmt: skip
_MOVING: tuple[tuple[Callable[[Rng], list[Solid]], float], ...] = (
    (person, 0.52), (chair_base, 0.2), (four_leg_chair, 0.05), (hand, 0.12),
    (shoe, 0.03), (carton, 0.03), (bag, 0.03), (gadget, 0.02),
)  # fmt: skip


def _pick(rng: Rng, kinds: tuple[tuple[Callable[[Rng], list[Solid]], float], ...]) -> list[Solid]:
    weights = np.array([weight for _, weight in kinds])
    return kinds[int(rng.choice(len(kinds), p=weights / weights.sum()))][0](rng)


def any_static(rng: Rng) -> list[Solid]:
    """Something that stays where it is; small things are at times larger than life, so that size alone tells nothing."""
    thing = _pick(rng, _STATIC)
    extent_m = max(float(np.abs(solid.vertices_m).max()) for solid in thing)
    if extent_m < 0.3 and rng.random() < 0.4:
        size = float(np.exp(rng.uniform(0.0, 1.0)))
        thing = [replace(solid, vertices_m=solid.vertices_m * size) for solid in thing]
    return thing


def any_mover(rng: Rng) -> list[Solid]:
    """Something that moves through the picture and is no car."""
    return _pick(rng, _MOVING)
