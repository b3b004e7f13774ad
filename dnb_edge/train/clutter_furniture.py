"""Furniture and what stands about in a room: chairs, castors, tables, tripods, radiators, skirting, cartons, bags.

Knows shapes in metres; nothing of cameras or pictures. Each thing stands on z = 0 about the origin.
"""

from __future__ import annotations

import math

import numpy as np

from dnb_edge.train.clutter_shapes import (
    BLACK,
    STEEL,
    WHITE,
    Rng,
    arc,
    ball,
    cloth,
    limb,
    near,
    paint,
    placed,
    plate,
    rubber,
    scaled,
    slab,
    tipped,
    tube,
    wood,
)
from dnb_edge.train.solids import Colour, Solid, box, prism


def twin_castor(rng: Rng, radius_m: float = 0.027) -> list[Solid]:
    """A furniture castor: two wheels under a hood, about 5 cm, turned anyhow."""
    wheel = rubber(rng) if rng.random() < 0.8 else near(rng, (150, 150, 150), 0.3)
    r = radius_m
    parts = [prism((0, side * r * 0.55, r), r, r * 0.7, wheel, sides=12, axis="y") for side in (-1, 1)]
    hood = rubber(rng) if rng.random() < 0.8 else paint(rng)
    parts.append(box((r * 0.15, 0, r * 1.35), (r * 1.5, r * 0.5, r * 1.5), hood, taper=(0.6, 1.0)))
    if rng.random() < 0.4:
        parts.extend(
            prism((0, side * r * 0.92, r), r * 0.45, r * 0.1, near(rng, STEEL, 0.3), sides=8, axis="y")
            for side in (-1, 1)
        )
    return placed(parts, float(rng.uniform(0, 2 * math.pi)))


def plate_castor(rng: Rng) -> list[Solid]:
    """A trolley's castor: one wheel, grey or red or blue tread, in a steel fork under a leg or a board."""
    r = float(rng.uniform(0.025, 0.06))
    tread = near(rng, ((110, 110, 110), (35, 35, 150), (140, 70, 30), (25, 25, 25))[int(rng.integers(4))])
    steel = near(rng, STEEL, 0.15)
    parts = [prism((0, 0, r), r, r * 0.7, tread, sides=14, axis="y", cap_colour=near(rng, WHITE, 0.3))]
    parts += [box((0, side * r * 0.5, r * 1.4), (r * 0.9, r * 0.12, r * 1.8), steel) for side in (-1, 1)]
    parts.append(slab((r * 2.2, r * 1.8, r * 0.15), steel, at=(0, 0, r * 2.3)))
    top = float(rng.uniform(0.15, 0.6))
    leg = paint(rng)
    parts.append(slab((0.04, 0.04, top), leg, at=(0, 0, r * 2.4)))
    return parts


def office_chair(rng: Rng) -> list[Solid]:
    """An office chair: a five-star base with castors, a gas spring, perhaps a foot ring, mostly a seat and a back."""
    base = rubber(rng) if rng.random() < 0.65 else near(rng, STEEL if rng.random() < 0.7 else WHITE, 0.15)
    reach, thick = float(rng.uniform(0.26, 0.35)), float(rng.uniform(0.016, 0.026))
    out: list[Solid] = []
    for number in range(5 if rng.random() < 0.92 else 4):
        angle = 2 * math.pi * number / 5 if reach else 0.0
        spoke = limb((0.03, 0, 0.115), (reach, 0, 0.075), (thick * 1.4, thick * 0.8), base, sides=6)
        castor = placed(twin_castor(rng, float(rng.uniform(0.024, 0.032))), 0.0, (reach, 0, 0))
        out += placed([spoke, *castor], angle)
    out.append(limb((0, 0, 0.07), (0, 0, 0.15), (0.045, 0.035), base))
    out.append(limb((0, 0, 0.15), (0, 0, 0.32), (0.026, 0.026), rubber(rng)))
    out.append(limb((0, 0, 0.28), (0, 0, 0.44), (0.014, 0.014), near(rng, STEEL, 0.1)))
    if rng.random() < 0.2:
        out += tube(arc((0, 0, 0.24), 0.21, (0, 2 * math.pi), count=15), 0.011, near(rng, STEEL, 0.1))
    if rng.random() < 0.55:
        fabric, high = cloth(rng), float(rng.uniform(0.42, 0.52))
        out.append(slab((0.47, 0.48, 0.07), fabric, at=(0, 0, high), round_m=0.1))
        out.append(box((-0.25, 0, high + 0.36), (0.06, 0.44, 0.5), fabric, taper=(0.6, 0.85), shift_top_m=-0.08))
        if rng.random() < 0.6:
            for side in (-0.27, 0.27):
                out.append(slab((0.25, 0.06, 0.025), rubber(rng), at=(0.02, side, high + 0.22), round_m=0.02))
                out.append(slab((0.05, 0.025, 0.24), rubber(rng), at=(-0.02, side, high - 0.02)))
    return out


def four_leg_chair(rng: Rng) -> list[Solid]:
    """A chair or stool on four legs or a steel frame, some with rubber feet."""
    leg = near(rng, STEEL, 0.2) if rng.random() < 0.4 else (wood(rng) if rng.random() < 0.5 else paint(rng))
    seat = wood(rng) if rng.random() < 0.4 else paint(rng)
    width, height, thick = (
        float(rng.uniform(0.32, 0.48)),
        float(rng.uniform(0.42, 0.65)),
        float(rng.uniform(0.009, 0.022)),
    )
    out = [slab((width, width, 0.03), seat, at=(0, 0, height), round_m=0.04)]
    splay = float(rng.uniform(0.42, 0.52))
    for x in (-1, 1):
        for y in (-1, 1):
            foot, top = (x * width * splay, y * width * splay, 0.0), (x * width * 0.42, y * width * 0.42, height)
            out.append(limb(foot, top, (thick, thick), leg))
            out.append(limb((*foot[:2], 0.0), (*foot[:2], 0.025), (thick * 1.4, thick * 1.3), rubber(rng)))
    if rng.random() < 0.5:
        out.extend(
            limb(
                (-width * splay, s * width * splay, 0.15), (width * splay, s * width * splay, 0.15), (0.009, 0.009), leg
            )
            for s in (-1, 1)
        )
    if rng.random() < 0.6:
        out.append(box((-width * 0.48, 0, height + 0.3), (0.03, width * 0.9, 0.22), seat))
        out.extend(
            limb(
                (-width * 0.45, s * width * 0.42, height),
                (-width * 0.48, s * width * 0.42, height + 0.4),
                (thick, thick),
                leg,
            )
            for s in (-1, 1)
        )
    return out


def table(rng: Rng) -> list[Solid]:
    """A table's legs, on levelling feet or castors, mostly one pair at a picture's edge; at times a low table's top."""
    leg = near(rng, STEEL, 0.3) if rng.random() < 0.5 else paint(rng)
    span, thick, square = float(rng.uniform(0.4, 0.8)), float(rng.uniform(0.015, 0.035)), rng.random() < 0.5
    high, low_table = float(rng.uniform(0.5, 0.75)), rng.random() < 0.25
    if low_table:
        high = float(rng.uniform(0.3, 0.45))
    out: list[Solid] = []
    for x in (-span / 2, span / 2):
        for y in (-span / 2, span / 2) if low_table else (0.0,):
            bar = slab((thick * 2, thick * 2, high), leg, at=(x, y, 0.02))
            out.append(bar if square else limb((x, y, 0.02), (x, y, high), (thick, thick), leg))
            out.append(limb((x, y, 0.0), (x, y, 0.025), (thick * 1.3, thick), rubber(rng)))
    if low_table:
        out.append(
            slab((span * 1.2, span * 1.1, 0.025), wood(rng) if rng.random() < 0.6 else paint(rng), at=(0, 0, high))
        )
    elif rng.random() < 0.5:
        out.append(slab((span, thick, 0.05), leg, at=(0, 0, 0.01 if rng.random() < 0.5 else 0.3)))
    return out


def single_leg(rng: Rng) -> list[Solid]:
    """One leg, pipe or pole with its foot: a disc, a rubber cap, a castor or an L-shaped beam."""
    high, radius, colour = float(rng.uniform(0.4, 0.8)), float(rng.uniform(0.012, 0.04)), paint(rng)
    out = [limb((0, 0, 0), (float(rng.normal(0, 0.03)), 0, high), (radius, radius), colour)]
    kind = rng.random()
    if kind < 0.3:
        out.append(
            limb(
                (0, 0, 0),
                (0, 0, 0.015),
                (radius * float(rng.uniform(2, 6)), radius * 2),
                near(rng, STEEL, 0.5),
                sides=14,
            )
        )
    elif kind < 0.6:
        out.append(limb((0, 0, 0), (0, 0, 0.03), (radius * 1.5, radius * 1.2), rubber(rng)))
    elif kind < 0.8:
        out.append(slab((0.55, 0.06, 0.04), colour, at=(0.1, 0, 0), round_m=0.01))
    return out


def tripod(rng: Rng) -> list[Solid]:
    """A tripod or light stand with rubber feet, a mid brace and a column."""
    colour = rubber(rng) if rng.random() < 0.7 else near(rng, STEEL, 0.2)
    reach, high = float(rng.uniform(0.15, 0.5)), float(rng.uniform(0.25, 0.9))
    out = [limb((0, 0, high * 0.3), (0, 0, high * 1.15), (0.012, 0.012), colour)]
    for number in range(3):
        leg = [
            limb((reach, 0, 0.02), (reach * 0.45, 0, high * 0.55), (0.008, 0.009), near(rng, colour, 0.3)),
            limb((reach * 0.45, 0, high * 0.55), (0.02, 0, high), (0.013, 0.014), colour),
            ball((reach, 0, 0.014), (0.014, 0.014, 0.014), rubber(rng)),
            limb((0, 0, high * 0.4), (reach * 0.45, 0, high * 0.5), (0.005, 0.005), colour, sides=4),
        ]
        out += placed(leg, number * 2 * math.pi / 3)
    if rng.random() < 0.5:
        out.append(box((0.02, 0, high * 1.2), (0.1, 0.09, 0.07), rubber(rng)))
    return out


def wall_piece(rng: Rng) -> list[Solid]:
    """A piece of wall with its skirting board, sometimes a socket, a radiator before it, or a door stop."""
    wide, high = float(rng.uniform(0.6, 2.0)), float(rng.uniform(0.3, 0.6))
    wall, skirting = near(rng, (205, 215, 220), 0.15), WHITE if rng.random() < 0.5 else wood(rng)
    out = [
        slab((wide, 0.08, high), wall),
        slab((wide, 0.015, float(rng.uniform(0.05, 0.12))), skirting, at=(0, -0.047, 0)),
    ]
    kind = rng.random()
    if kind < 0.35:
        ribs = int(wide / 0.07)
        out += [
            slab((0.05, 0.05, high * 0.7), near(rng, WHITE, 0.03), at=((i - ribs / 2) * 0.07, -0.11, 0.1))
            for i in range(ribs)
        ]
        out.append(limb((-wide / 2, -0.11, 0.12), (wide / 2, -0.11, 0.12), (0.012, 0.012), WHITE, sides=6))
    elif kind < 0.55:
        out.append(box((0, -0.045, 0.22), (0.085, 0.012, 0.085), WHITE))
        out.append(prism((0, -0.054, 0.22), 0.02, 0.008, near(rng, (190, 190, 190), 0.1), axis="y"))
    elif kind < 0.75:
        x = float(rng.uniform(-wide / 3, wide / 3))
        out.append(limb((x, -0.12, 0), (x, -0.12, 0.035), (0.025, 0.018), rubber(rng)))
    return out


def door_stop(rng: Rng) -> list[Solid]:
    """A wedge or a half dome of rubber."""
    colour = rubber(rng) if rng.random() < 0.5 else paint(rng)
    if rng.random() < 0.5:
        return [box((0, 0, 0.017), (0.13, 0.045, 0.034), colour, taper=(0.05, 1.0), shift_top_m=0.06)]
    return [
        limb((0, 0, 0), (0, 0, 0.025), (0.03, 0.024), near(rng, STEEL, 0.2), sides=12),
        slab((0.03, 0.04, 0.02), colour, at=(0.02, 0, 0.003)),
    ]


def cabinet(rng: Rng) -> list[Solid]:
    """A drawer unit on castors, a shelf's foot, or a PC tower."""
    size = (float(rng.uniform(0.2, 0.5)), float(rng.uniform(0.35, 0.6)), float(rng.uniform(0.3, 0.6)))
    body = near(rng, WHITE, 0.15) if rng.random() < 0.4 else (wood(rng) if rng.random() < 0.5 else rubber(rng))
    lift = 0.06 if rng.random() < 0.5 else 0.0
    out = [slab(size, body, at=(0, 0, lift))]
    for number in range(3):
        z = lift + size[2] * (number + 0.5) / 3
        out.append(box((size[0] / 2, 0, z), (0.01, size[1] * 0.92, size[2] * 0.29), near(rng, body, 0.08)))
        out.append(box((size[0] / 2 + 0.012, 0, z), (0.015, 0.12, 0.012), STEEL))
    if lift:
        for x in (-0.4, 0.4):
            for y in (-0.4, 0.4):
                out += placed(twin_castor(rng), 0.0, (x * size[0], y * size[1], 0))
    return out


def carton(rng: Rng) -> list[Solid]:
    """A cardboard or plastic box with tape, a label, print, sometimes open flaps."""
    colour = wood(rng) if rng.random() < 0.65 else paint(rng)
    x, y, z = (float(value) for value in np.exp(rng.uniform(math.log(0.07), math.log(0.5), 3)))
    out = [slab((x, y, z), colour)]
    if rng.random() < 0.6:
        out.append(
            slab(
                (x * 1.002, 0.045 if y > 0.1 else y * 0.3, z * 0.3),
                near(rng, (120, 170, 205), 0.2),
                at=(0, 0, z * 0.702),
            )
        )
    if rng.random() < 0.6:
        out.append(slab((x * 0.35, y * 0.3, 0.001), WHITE, at=(x * 0.2, y * 0.25, z)))
    if rng.random() < 0.3:
        out.append(box((x / 2, 0, z * 0.5), (0.002, y * 0.5, z * 0.4), paint(rng)))
    if rng.random() < 0.3:
        out.append(slab((x * 0.94, y * 0.94, 0.001), near(rng, BLACK, 0.3), at=(0, 0, z)))
        out += [box((s * x * 0.65, 0, z + y * 0.05), (x * 0.32, y, 0.004), colour) for s in (-1, 1)]
    return out


def bag(rng: Rng) -> list[Solid]:
    """A rucksack that lies or stands, a holdall with handles, or a paper carrier bag."""
    colour = cloth(rng)
    kind = rng.random()
    if kind < 0.55:
        out = [ball((0, 0, 0.2), (0.13, 0.16, 0.24), colour, sides=10), slab((0.2, 0.26, 0.3), colour, round_m=0.07)]
        out.append(ball((0.12, 0, 0.13), (0.07, 0.12, 0.11), near(rng, colour, 0.3)))
        for side in (-0.08, 0.08):
            out += tube(
                arc((-0.12, side, 0.22), 0.14, (-1.9, 1.9), upright=True, count=6)[:, [1, 0, 2]] * [0.6, 1, 1]
                + [-0.05, side, 0],
                0.012,
                rubber(rng),
            )
        out = [part for part in out if part.vertices_m[:, 2].min() >= 0 or part is out[0]]
        return tipped(
            out, float(rng.uniform(1.2, 1.7)) * (1 if rng.random() < 0.5 else -1) if rng.random() < 0.5 else 0.0
        )
    if kind < 0.8:
        out = [ball((0, 0, 0.13), (0.28, 0.14, 0.13), colour, sides=10), slab((0.42, 0.2, 0.1), colour, round_m=0.05)]
        out += tube(arc((0, 0, 0.2), 0.11, (0.2, 2.9), upright=True, count=7)[:, [1, 0, 2]], 0.009, rubber(rng))
        return out
    tall = float(rng.uniform(0.25, 0.42))
    colour = wood(rng) if rng.random() < 0.5 else paint(rng)
    out = [box((0, 0, tall / 2), (0.28, 0.12, tall), colour, taper=(1.05, 0.4))]
    return out + tube(arc((0, 0, tall), 0.06, (0, math.pi), upright=True, count=6)[:, [1, 0, 2]], 0.004, WHITE)


def bucket(rng: Rng) -> list[Solid]:
    """A waste bin or bucket, open at the top."""
    r, high, colour = float(rng.uniform(0.1, 0.16)), float(rng.uniform(0.2, 0.35)), paint(rng)
    body = limb((0, 0, 0), (0, 0, high), (r * 0.75, r), colour, sides=14)
    inside = limb((0, 0, high), (0, 0, high + 0.001), (r * 0.93, r * 0.93), near(rng, BLACK, 0.4), sides=14)
    return [body, inside]


def robot_base(rng: Rng) -> list[Solid]:
    """A robot vacuum or a round platform without visible wheels: a disc with a lid and a button."""
    r, colour = float(rng.uniform(0.12, 0.18)), near(rng, WHITE, 0.1) if rng.random() < 0.5 else rubber(rng)
    outline = [(math.cos(a) * r, math.sin(a) * r) for a in np.linspace(0, 2 * math.pi, 20, endpoint=False)]
    return [
        plate(outline, 0.0, 0.08, colour, top=0.96),
        *scaled([slab((0.06, 0.06, 0.02), paint(rng), at=(0.05, 0, 0.08), round_m=0.02)], 1.0),
    ]


def clamp_stand(rng: Rng) -> list[Solid]:
    """Frames of slotted aluminium: bars that lie or stand, as lab rigs have them."""
    colour: Colour = near(rng, STEEL, 0.1) if rng.random() < 0.75 else rubber(rng)
    thick, long = float(rng.choice([0.02, 0.03, 0.04])), float(rng.uniform(0.3, 0.9))
    bars = [slab((long, thick, thick), colour), slab((thick, long * 0.6, thick), colour, at=(long / 2, 0, 0))]
    bars.append(
        slab((thick, thick, float(rng.uniform(0.1, 0.6))), colour, at=(-long / 2 * float(rng.uniform(0, 1)), 0, thick))
    )
    bars.append(slab((long, thick * 0.25, 0.001), near(rng, BLACK, 0.4), at=(0, 0, thick)))
    return bars
