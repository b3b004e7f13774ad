"""Devices that lie about: bricks, sockets, controllers, headphones, computers, transmitters, cables, tools, spare parts.

Knows shapes in metres; nothing of cameras or pictures. Each thing stands on z = 0 about the origin.
"""

from __future__ import annotations

import math

import numpy as np

from dnb_edge.train.clutter_shapes import (
    BLACK,
    GOLD,
    STEEL,
    WHITE,
    Rng,
    arc,
    ball,
    limb,
    near,
    paint,
    placed,
    plate,
    rubber,
    slab,
    tipped,
    tube,
)
from dnb_edge.train.solids import Colour, FloatArray, Solid, box, prism


def _shell(rng: Rng) -> Colour:
    """A device's plastic: mostly black, at times white or a vivid colour."""
    kind = rng.random()
    return rubber(rng) if kind < 0.65 else (near(rng, WHITE, 0.1) if kind < 0.85 else paint(rng))


def wandering(
    rng: Rng, start: tuple[float, float], heading: float, length_m: float, step_m: float = 0.07
) -> FloatArray:
    """Points (n, 3) of a cable on the floor from `start`."""
    count = max(2, int(length_m / step_m))
    turns = heading + np.cumsum(
        rng.normal(0, 0.15, count) + np.sin(np.arange(count) * float(rng.uniform(0.2, 0.8))) * 0.35
    )
    steps = np.column_stack([np.cos(turns), np.sin(turns), np.zeros(count)]) * step_m
    return np.asarray(
        np.vstack([np.zeros(3), np.cumsum(steps, axis=0)]) + np.array([start[0], start[1], 0.005]), dtype=np.float64
    )


def power_brick(rng: Rng) -> list[Solid]:
    """A power supply with its two cables."""
    colour = _shell(rng)
    x, y, z = float(rng.uniform(0.07, 0.17)), float(rng.uniform(0.04, 0.075)), float(rng.uniform(0.025, 0.04))
    out = [slab((x, y, z), colour, round_m=0.008)]
    if rng.random() < 0.6:
        out.append(
            slab((x * 0.6, y * 0.6, 0.001), near(rng, WHITE if rng.random() < 0.5 else STEEL, 0.2), at=(0, 0, z))
        )
    for side in (0.0, math.pi):
        points = wandering(rng, (math.cos(side) * x / 2, 0), side, float(rng.uniform(0.15, 0.7)))
        out += tube(points, 0.003, colour)
    return out


def extension_socket(rng: Rng) -> list[Solid]:
    """A socket strip of three to eight round sockets, a lit switch, and its cable."""
    colour = near(rng, WHITE, 0.06) if rng.random() < 0.6 else rubber(rng)
    count = int(rng.integers(3, 9))
    x = 0.045 * count + 0.05
    out = [slab((x, 0.055, 0.04), colour, round_m=0.008)]
    hole = near(rng, colour, 0.1) if rng.random() < 0.4 else near(rng, (70, 70, 70), 0.3)
    for number in range(count):
        at = -x / 2 + 0.035 + 0.045 * number
        out.append(prism((at, 0, 0.0405), 0.019, 0.001, hole, sides=12))
        if rng.random() < 0.3:
            plug = near(rng, WHITE, 0.1) if rng.random() < 0.4 else rubber(rng)
            out.append(limb((at, 0, 0.04), (at, 0, 0.075), (0.019, 0.015), plug))
            out += tube(
                np.array([[at, 0, 0.07], [at, 0.06, 0.06], [at + 0.02, 0.14, 0.005], [at, 0.3, 0.005]]), 0.003, plug
            )
    out.append(slab((0.02, 0.025, 0.003), (40, 40, 220), at=(x / 2 - 0.02, 0, 0.04)))
    return out + tube(wandering(rng, (-x / 2, 0), math.pi, float(rng.uniform(0.2, 0.8))), 0.004, colour)


def game_controller(rng: Rng) -> list[Solid]:
    """A gamepad, about 15 cm: a body, two grips, two sticks, a cross and four coloured buttons."""
    colour = _shell(rng)
    out = [slab((0.07, 0.12, 0.035), colour, at=(0.01, 0, 0.01), round_m=0.02)]
    for side in (-1, 1):
        out.append(limb((0.025, side * 0.05, 0.028), (-0.065, side * 0.075, 0.014), (0.028, 0.014), colour))
        x, y = (-0.005, side * 0.028) if rng.random() < 0.5 else (0.012, side * 0.045)
        out.append(limb((x, y, 0.04), (x, y, 0.055), (0.006, 0.01), rubber(rng)))
        out.append(box((0.05, side * 0.045, 0.03), (0.02, 0.03, 0.015), rubber(rng)))
    vivid: tuple[Colour, ...] = ((60, 60, 220), (220, 120, 40), (70, 180, 60), (60, 200, 230))
    for number, hue in enumerate(vivid):
        angle = number * math.pi / 2
        spot = (0.025 + 0.011 * math.cos(angle), -0.045 + 0.011 * math.sin(angle), 0.047)
        out.append(prism(spot, 0.005, 0.005, hue if rng.random() < 0.7 else near(rng, STEEL), sides=6))
    out += [box((0.025, 0.045, 0.047), size, rubber(rng)) for size in ((0.024, 0.008, 0.005), (0.008, 0.024, 0.005))]
    return out


def headphones(rng: Rng) -> list[Solid]:
    """Headphones that lie flat: two cups and a bow."""
    colour, pad, r = _shell(rng), rubber(rng), float(rng.uniform(0.07, 0.09))
    bow = arc((0, 0, 0.03), r, (-0.35, math.pi + 0.35), count=11)
    out = tube(bow, 0.008, colour)
    for side in (-1, 1):
        at = (side * r * 0.95, -0.045)
        out.append(limb((at[0], at[1], 0.04), (at[0] - side * 0.022, at[1], 0.04), (0.04, 0.037), pad, sides=12))
        out.append(limb((at[0] + side * 0.015, at[1], 0.04), (at[0], at[1], 0.04), (0.033, 0.038), colour, sides=12))
    return out + (tube(wandering(rng, (r, -0.08), -1.2, 0.5), 0.002, pad) if rng.random() < 0.5 else [])


def transmitter(rng: Rng) -> list[Solid]:
    """An RC car's pistol transmitter with its wheel, lying, or a two-stick box with an aerial."""
    colour = _shell(rng)
    if rng.random() < 0.55:
        out = [
            slab((0.13, 0.09, 0.05), colour, round_m=0.02),
            limb((0.0, 0.04, 0.03), (-0.03, 0.16, 0.022), (0.022, 0.02), colour),
        ]
        out.append(slab((0.11, 0.05, 0.05), near(rng, colour, 0.2), at=(-0.03, 0.17, 0), round_m=0.015))
        foam = rubber(rng) if rng.random() < 0.7 else paint(rng)
        out.append(prism((0.01, -0.01, 0.065), 0.033, 0.03, foam, sides=14, cap_colour=near(rng, STEEL, 0.3)))
        out.append(limb((0.05, 0, 0.04), (0.2, 0, 0.05), (0.005, 0.004), BLACK))
        return out
    out = [slab((0.15, 0.17, 0.05), colour, round_m=0.02)]
    for side in (-0.05, 0.05):
        out.append(prism((0.02, side, 0.051), 0.024, 0.003, near(rng, STEEL), sides=12))
        out.append(limb((0.02, side, 0.05), (0.03, side, 0.075), (0.004, 0.005), STEEL))
    out.append(slab((0.03, 0.07, 0.002), near(rng, (120, 140, 120)), at=(-0.045, 0, 0.05)))
    return [*out, limb((0.07, 0, 0.04), (0.2, 0.05, 0.1), (0.004, 0.003), rubber(rng))]


def laptop(rng: Rng) -> list[Solid]:
    """A laptop, open with a lit or dark screen, or closed."""
    colour = near(rng, STEEL, 0.15) if rng.random() < 0.5 else rubber(rng)
    wide, deep = float(rng.uniform(0.29, 0.36)), float(rng.uniform(0.2, 0.25))
    out = [slab((deep, wide, 0.018), colour, round_m=0.008)]
    if rng.random() < 0.25:
        return [*out, prism((0, 0, 0.0185), 0.02, 0.001, near(rng, WHITE, 0.3), sides=8)]
    out.append(slab((deep * 0.42, wide * 0.88, 0.001), rubber(rng), at=(-deep * 0.12, 0, 0.018)))
    out.append(slab((deep * 0.3, wide * 0.3, 0.001), near(rng, colour, 0.1), at=(deep * 0.3, 0, 0.018)))
    lean, face = float(rng.uniform(0.02, 0.35)), near(rng, (170, 120, 90), 0.5) if rng.random() < 0.7 else BLACK
    lid = tipped(
        [slab((0.008, wide, deep), colour), slab((0.001, wide * 0.94, deep * 0.86), face, at=(0.005, 0, deep * 0.08))],
        -lean,
    )
    return out + placed(lid, 0.0, (-deep / 2, 0, 0.015))


def keyboard_or_mouse(rng: Rng) -> list[Solid]:
    """A keyboard with rows of keys, a mouse with its wheel and cable, or a phone or tablet."""
    colour, kind = _shell(rng), rng.random()
    if kind < 0.4:
        wide = float(rng.uniform(0.28, 0.44))
        keys = near(rng, colour, 0.35) if rng.random() < 0.7 else _shell(rng)
        out = [slab((0.13, wide, 0.018), colour, round_m=0.006)]
        for row in range(5):
            for start, share in ((-0.47, 0.62), (0.18, 0.12), (0.33, 0.15)):
                out.append(
                    slab((0.016, wide * share, 0.006), keys, at=(row * 0.02 - 0.04, wide * (start + share / 2), 0.017))
                )
        return out
    if kind < 0.75:
        out = [
            ball((0, 0, 0.016), (0.055, 0.031, 0.02), colour, sides=12),
            slab((0.1, 0.056, 0.012), colour, round_m=0.02),
        ]
        out.append(prism((0.03, 0, 0.03), 0.01, 0.006, rubber(rng), axis="y"))
        return out + (tube(wandering(rng, (0.055, 0), 0.0, 0.6), 0.002, colour) if rng.random() < 0.6 else [])
    size = float(rng.choice([0.15, 0.15, 0.25]))
    wide, glass = size * 0.5 if size < 0.2 else 0.17, near(rng, (60, 40, 30), 0.8)
    return [
        slab((size, wide, 0.009), colour, round_m=0.01),
        slab((size * 0.95, wide * 0.93, 0.001), glass, at=(0, 0, 0.009)),
    ]


def battery(rng: Rng) -> list[Solid]:
    """A battery pack with red and black leads and a plug, round cells, or a power bank."""
    kind = rng.random()
    if kind < 0.6:
        wrap = paint(rng)
        out = [
            slab((0.14, 0.045, 0.025), wrap, round_m=0.005),
            slab((0.07, 0.0455, 0.0255), near(rng, WHITE) if rng.random() < 0.5 else rubber(rng)),
        ]
        ends = ((0.01, (30, 30, 210)), (-0.01, BLACK))
        for y, hue in ends:
            out += tube(np.array([[0.07, y, 0.018], [0.1, y * 1.5, 0.012], [0.14, y, 0.006]]), 0.003, hue)
        return [*out, slab((0.025, 0.02, 0.01), GOLD if rng.random() < 0.5 else paint(rng), at=(0.15, 0, 0.001))]
    if kind < 0.8:
        cell, many = paint(rng), int(rng.integers(2, 7))
        return [part for i in range(many) for part in (
            prism((0, i * 0.019, 0.009), 0.009, 0.065, cell, sides=10, axis="x", cap_colour=STEEL),)]  # fmt: skip
    return [
        slab((0.13, 0.065, 0.02), _shell(rng), round_m=0.012),
        slab((0.01, 0.002, 0.004), (220, 200, 60), at=(0, -0.033, 0.01)),
    ]


def cable_on_floor(rng: Rng) -> list[Solid]:
    """A cable that winds over the floor, straight under tape, or coiled up."""
    colour = rubber(rng) if rng.random() < 0.6 else paint(rng)
    thick = float(rng.uniform(0.002, 0.006))
    if rng.random() < 0.5:
        points = wandering(rng, (-0.5, 0.0), float(rng.uniform(-0.5, 0.5)), float(rng.uniform(0.6, 1.8)))
        return tube(points + np.array([0, 0, max(0.0, thick - 0.005)]), thick, colour)
    out: list[Solid] = []
    r = float(rng.uniform(0.05, 0.13))
    for number in range(int(rng.integers(2, 5))):
        ring = arc(
            (float(rng.normal(0, r * 0.06)), float(rng.normal(0, r * 0.06)), thick * (1 + 1.2 * number)),
            r * float(rng.uniform(0.88, 1.08)),
            (0, 2 * math.pi),
            count=15,
        )
        out += tube(ring, thick, colour)
    return out + tube(
        wandering(rng, (r, 0), 1.0, float(rng.uniform(0.1, 0.6))) + np.array([0, 0, max(0.0, thick - 0.005)]),
        thick,
        colour,
    )


def tool(rng: Rng) -> list[Solid]:
    """A screwdriver, pliers, a hex key, scissors, a spanner, a hot-glue gun or a drill that lies."""
    handle, kind = paint(rng), int(rng.integers(6))
    steel = near(rng, STEEL, 0.2)
    if kind == 0:
        return [
            limb((-0.1, 0, 0.015), (0, 0, 0.014), (0.015, 0.011), handle),
            limb((0, 0, 0.013), (0.12, 0, 0.004), (0.003, 0.003), steel),
        ]
    if kind == 1:
        out = [limb((0, 0, 0.008), (0.06, s * 0.004, 0.006), (0.01, 0.004), steel) for s in (-1, 1)]
        return out + [
            part
            for s in (-1, 1)
            for part in tube(
                np.array([[0, 0, 0.009], [-0.05, s * 0.025, 0.009], [-0.13, s * 0.02, 0.009]]), 0.007, handle
            )
        ]
    if kind == 2:
        return tube(np.array([[0, 0.03, 0.003], [0, 0, 0.003], [0.09, 0, 0.003]]), 0.002, steel)
    if kind == 3:
        out = [
            plate([(0, -0.006), (0.11, 0), (0, 0.006)], 0.0, 0.003, steel),
            *tube(arc((-0.05, 0.03, 0.006), 0.025, (0, 6.28), count=9), 0.005, handle),
        ]
        return out + tube(arc((-0.05, -0.03, 0.006), 0.025, (0, 6.28), count=9), 0.005, handle)
    if kind == 4:
        ends = [slab((0.035, 0.035, 0.008), steel, at=(s * 0.09, 0, 0), round_m=0.01) for s in (-1, 1)]
        return [slab((0.18, 0.015, 0.007), steel), *ends]
    drill = [
        limb((-0.09, 0, 0.035), (0.06, 0, 0.035), (0.032, 0.03), handle),
        limb((0.06, 0, 0.035), (0.11, 0, 0.035), (0.022, 0.013), rubber(rng)),
    ]
    drill += [
        limb((-0.05, 0, 0.035), (-0.07, 0.14, 0.03), (0.02, 0.02), rubber(rng)),
        slab((0.11, 0.07, 0.06), rubber(rng), at=(-0.06, 0.17, 0), round_m=0.01),
    ]
    return [*drill, limb((0.11, 0, 0.035), (0.18, 0, 0.035), (0.003, 0.003), STEEL)]


def spare_parts(rng: Rng) -> list[Solid]:
    """A robot's spare wheels, lying or standing, alone or in a heap: wheels that are no car."""
    r, broad = float(rng.uniform(0.015, 0.05)), float(rng.uniform(0.35, 0.9))
    tyre, hub = rubber(rng), paint(rng)
    out: list[Solid] = []
    for _ in range(int(rng.choice([1, 2, 3, 4], p=[0.5, 0.3, 0.1, 0.1]))):
        wheel = [
            prism((0, 0, r * broad), r, r * broad * 2, tyre, sides=14),
            prism((0, 0, r * broad), r * 0.62, r * broad * 2.15, hub, sides=10),
        ]
        if rng.random() < 0.25:
            wheel = tipped(wheel, math.pi / 2)
        out += placed(
            wheel, float(rng.uniform(0, 6.3)), (float(rng.normal(0, r * 2.5)), float(rng.normal(0, r * 2.5)), 0)
        )
    return [part for part in out if part.vertices_m[:, 2].min() >= -1e-9]


def circuit_board(rng: Rng) -> list[Solid]:
    """A bare board with connectors and chips, a sensor box or a small motor, some with wires."""
    board: Colour = near(rng, ((50, 100, 30), (110, 60, 20), (30, 30, 30), (40, 30, 130))[int(rng.integers(4))], 0.2)
    x, y = float(rng.uniform(0.04, 0.1)), float(rng.uniform(0.03, 0.07))
    out = [slab((x, y, 0.003), board, at=(0, 0, 0.004)), slab((x * 0.8, y * 0.8, 0.004), rubber(rng))]
    for _ in range(int(rng.integers(3, 8))):
        at = (float(rng.uniform(-0.35, 0.35)) * x, float(rng.uniform(-0.35, 0.35)) * y, 0.007)
        out.append(
            slab(
                (x * float(rng.uniform(0.1, 0.3)), y * float(rng.uniform(0.1, 0.3)), float(rng.uniform(0.002, 0.014))),
                STEEL if rng.random() < 0.4 else rubber(rng),
                at=at,
            )
        )
    return out + (tube(wandering(rng, (x / 2, 0), 0.0, 0.3), 0.002, paint(rng)) if rng.random() < 0.5 else [])
