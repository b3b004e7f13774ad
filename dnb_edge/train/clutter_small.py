"""Household things and toys on a floor: papers, markers, cups, bottles, tape, cones, blocks, books, figures, balls.

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
    ball,
    limb,
    near,
    paint,
    placed,
    plate,
    resting,
    rubber,
    skin,
    slab,
    tipped,
    wood,
)
from dnb_edge.train.solids import Colour, Solid, box, prism


def papers(rng: Rng) -> list[Solid]:
    """One to three sheets, A5 to A3, with lines of print, a picture, or notes in colours; some lie askew on another."""
    out: list[Solid] = []
    for number in range(int(rng.integers(1, 4))):
        wide = float(rng.choice([0.148, 0.21, 0.21, 0.297, 0.076]))
        tall, z = wide * (1.0 if wide < 0.1 else math.sqrt(2)), 0.0006 * number
        sheet: Colour = near(rng, WHITE, 0.04) if rng.random() < 0.75 and wide > 0.1 else paint(rng)
        page = [slab((tall, wide, 0.0006), sheet, at=(0, 0, z))]
        if rng.random() < 0.6:
            ink = near(rng, (90, 90, 90), 0.4)
            for line in range(9):
                x = tall * (0.4 - 0.09 * line)
                page.append(
                    slab((tall * 0.025, wide * float(rng.uniform(0.3, 0.8)), 0.0003), ink, at=(x, 0, z + 0.0006))
                )
        elif rng.random() < 0.6:
            page.append(slab((tall * 0.5, wide * 0.7, 0.0003), paint(rng), at=(tall * 0.1, 0, z + 0.0006)))
        shift = (float(rng.normal(0, 0.15)), float(rng.normal(0, 0.15)), 0.0)
        out += placed(page, float(rng.uniform(0, 6.3)), shift)
    return out


def floor_marks(rng: Rng) -> list[Solid]:
    """Tape crosses, corners, arrows, dots, or stickers that lie flat."""
    colour, arm, wide = paint(rng), float(rng.uniform(0.05, 0.22)), float(rng.choice([0.012, 0.019, 0.025, 0.05]))
    kind = int(rng.integers(4))
    if kind == 0:
        return [slab((arm, wide, 0.001), colour), slab((wide, arm, 0.001), colour)]
    if kind == 1:
        return [slab((arm, wide, 0.001), colour), slab((wide, arm, 0.001), colour, at=(-arm / 2, arm / 2, 0))]
    if kind == 2:
        tip = plate([(0.0, -wide * 1.3), (wide * 2.2, 0.0), (0.0, wide * 1.3)], 0.0, 0.001, colour)
        return [slab((arm, wide, 0.001), colour, at=(-arm / 2, 0, 0)), tip]
    dots = int(rng.integers(1, 6))
    return [prism((i * wide * 4, 0, 0.0005), wide, 0.001, colour, sides=12) for i in range(dots)]


def marker(rng: Rng) -> list[Solid]:
    """A square fiducial of 4 to 8 cells in a black border on white: flat, on a block, or upright on a small stand."""
    side, cells = (
        float(rng.choice([0.04, 0.06, 0.1, 0.15, 0.2])) * float(rng.uniform(0.8, 1.2)),
        int(rng.integers(4, 8)),
    )
    low = 0.0 if rng.random() < 0.65 else float(rng.uniform(0.01, 0.1))
    base: Colour = WHITE if rng.random() < 0.7 else paint(rng)
    edge = float(rng.uniform(1.15, 1.5))
    out = [slab((side * edge, side * edge, 0.001 + low), base)]
    z, cell = 0.001 + low, side / (cells + 2)
    out += [
        slab((side * 1.15, side * 1.15, 0.0004), WHITE, at=(0, 0, z)),
        slab((side, side, 0.0004), BLACK, at=(0, 0, z + 0.0004)),
    ]
    bits = rng.random((cells, cells)) < 0.45
    for row in range(cells):
        column = 0
        while column < cells:
            run = 0
            while column + run < cells and bits[row, column + run]:
                run += 1
            if run:
                at = ((row - (cells - 1) / 2) * cell, (column + (run - 1) / 2 - (cells - 1) / 2) * cell, z + 0.0008)
                out.append(slab((cell, cell * run, 0.0004), WHITE, at=at))
            column += run + 1
    if rng.random() < 0.12:
        board = tipped(out, -math.pi / 2 + float(rng.uniform(0.0, 0.3)))
        return [*board, slab((0.06, side * 0.5, 0.02), rubber(rng))]
    return out


def chessboard(rng: Rng) -> list[Solid]:
    """A calibration chessboard that lies on the floor."""
    cell, rows, columns = float(rng.uniform(0.018, 0.045)), int(rng.integers(4, 8)), int(rng.integers(5, 10))
    out = [slab(((rows + 1.5) * cell, (columns + 1.5) * cell, 0.004), WHITE)]
    for row in range(rows):
        for column in range(row % 2, columns, 2):
            at = ((row - (rows - 1) / 2) * cell, (column - (columns - 1) / 2) * cell, 0.004)
            out.append(slab((cell, cell, 0.0004), BLACK, at=at))
    return out


def drink(rng: Rng) -> list[Solid]:
    """A cup with its drink and handle, a can, a paper cup with a lid, or a bottle that stands or lies."""
    colour, kind = paint(rng), rng.random()
    r = float(rng.uniform(0.03, 0.045))
    if kind < 0.35:
        top = near(rng, (25, 40, 70), 0.4)
        out = [
            limb((0, 0, 0), (0, 0, 0.095), (r * 0.9, r), colour, sides=12),
            prism((0, 0, 0.0955), r * 0.86, 0.001, top, sides=12),
        ]
        out += [
            box((r + 0.02, 0, 0.05), (0.008, 0.01, 0.05), colour),
            box((r + 0.008, 0, 0.07), (0.03, 0.01, 0.008), colour),
            box((r + 0.008, 0, 0.03), (0.03, 0.01, 0.008), colour),
        ]
        return out
    if kind < 0.55:
        out = [
            limb((0, 0, 0.006), (0, 0, 0.112), (0.033, 0.033), colour, sides=12),
            limb((0, 0, 0), (0, 0, 0.006), (0.025, 0.033), STEEL, sides=12),
        ]
        out.append(limb((0, 0, 0.112), (0, 0, 0.12), (0.033, 0.026), STEEL, sides=12))
        return tipped(out, math.pi / 2) if rng.random() < 0.25 else out
    if kind < 0.7:
        lid = near(rng, WHITE, 0.05) if rng.random() < 0.5 else rubber(rng)
        return [
            limb((0, 0, 0), (0, 0, 0.11), (r * 0.75, r), colour, sides=12),
            limb((0, 0, 0.108), (0, 0, 0.122), (r * 1.06, r * 0.95), lid, sides=12),
        ]
    tall = float(rng.uniform(0.14, 0.2))
    out = [
        limb((0, 0, 0), (0, 0, tall), (r, r), colour, sides=12),
        limb((0, 0, tall), (0, 0, tall + 0.05), (r, 0.013), colour, sides=12),
    ]
    out.append(limb((0, 0, tall + 0.05), (0, 0, tall + 0.075), (0.015, 0.015), paint(rng)))
    out.append(limb((0, 0, tall * 0.35), (0, 0, tall * 0.8), (r * 1.02, r * 1.02), paint(rng), sides=12))
    return tipped(out, math.pi / 2) if rng.random() < 0.4 else out


def tape_roll(rng: Rng) -> list[Solid]:
    """A roll of tape or filament, lying or standing; its core is a disc of another colour."""
    r, wide = float(rng.choice([0.035, 0.05, 0.06, 0.1])), float(rng.choice([0.012, 0.019, 0.025, 0.05]))
    hole: Colour = near(rng, BLACK, 0.4) if rng.random() < 0.5 else wood(rng)
    core = r * float(rng.uniform(0.5, 0.8))
    out = [
        prism((0, 0, wide / 2), r, wide, paint(rng), sides=16),
        prism((0, 0, wide / 2), core, wide * 1.02, wood(rng), sides=14),
    ]
    out.append(prism((0, 0, wide / 2), core * 0.88, wide * 1.04, hole, sides=14))
    return resting(tipped(out, math.pi / 2) if rng.random() < 0.35 else out)


def cone(rng: Rng) -> list[Solid]:
    """A traffic cone of 4 to 30 cm with white bands, or a flat sports cone."""
    high = float(np.exp(rng.uniform(math.log(0.04), math.log(0.3))))
    orange = near(rng, (20, 90, 235), 0.1) if rng.random() < 0.7 else paint(rng)
    if rng.random() < 0.25:
        return [
            limb((0, 0, 0), (0, 0, 0.05), (0.095, 0.035), orange, sides=14),
            prism((0, 0, 0.0505), 0.03, 0.001, near(rng, BLACK, 0.3), sides=12),
        ]
    out = [
        slab((high * 0.75, high * 0.75, high * 0.06), orange if rng.random() < 0.6 else rubber(rng), round_m=high * 0.1)
    ]
    stops, foot, tip = (0.05, 0.4, 0.65, 0.75, 1.0), high * 0.3, high * 0.06
    for number in range(4):
        a, b = stops[number], stops[number + 1]
        hue = WHITE if number % 2 else orange
        out.append(
            limb((0, 0, high * a), (0, 0, high * b), (foot + (tip - foot) * a, foot + (tip - foot) * b), hue, sides=12)
        )
    return out


def toy_blocks(rng: Rng) -> list[Solid]:
    """Building bricks with studs or wooden blocks: one, a row, or a small heap."""
    out: list[Solid] = []
    studs = rng.random() < 0.6
    for _ in range(int(rng.integers(1, 7))):
        colour = paint(rng) if rng.random() < 0.8 else wood(rng)
        unit = 0.016 if studs else 0.03
        nx, ny = int(rng.integers(1, 5)), int(rng.integers(1, 3))
        x, y, z = nx * unit, ny * unit, 0.019 if studs else float(rng.uniform(0.015, 0.06))
        block = [slab((x, y, z), colour)]
        if studs:
            block += [
                prism(((i + 0.5) * unit - x / 2, (j + 0.5) * unit - y / 2, z + 0.002), 0.005, 0.004, colour, sides=6)
                for i in range(nx)
                for j in range(ny)
            ]
        level = float(rng.choice([0.0, 0.0, 0.0, 0.019]))
        out += placed(
            block, float(rng.uniform(0, 6.3)), (float(rng.normal(0, 0.07)), float(rng.normal(0, 0.07)), level)
        )
    return out


def books(rng: Rng) -> list[Solid]:
    """A pile of one to three books with white pages, or a ring binder."""
    out: list[Solid] = []
    z = 0.0
    for _ in range(int(rng.integers(1, 4))):
        x, thick = float(rng.uniform(0.17, 0.3)), float(rng.uniform(0.01, 0.05))
        y, cover = x * float(rng.uniform(0.65, 0.8)), paint(rng)
        book = [
            slab((x, y, 0.002), cover, at=(0, 0, z)),
            slab((x * 0.97, y * 0.97, thick - 0.004), near(rng, (205, 225, 230), 0.05), at=(0, 0, z + 0.002)),
        ]
        book += [
            slab((x, y, 0.002), cover, at=(0, 0, z + thick - 0.002)),
            slab((x, 0.003, thick), cover, at=(0, -y / 2, z)),
        ]
        book.append(slab((x * 0.12, y * 0.7, 0.0005), paint(rng), at=(x * 0.22, 0, z + thick)))
        out += placed(book, float(rng.normal(0, 0.3)))
        z += thick
    return out


def ruler(rng: Rng) -> list[Solid]:
    """A ruler with its marks, a folding rule, a pen or a stick."""
    long = float(rng.choice([0.15, 0.3, 0.3, 0.5, 1.0]))
    colour = (wood(rng), near(rng, STEEL, 0.1), (40, 210, 240), near(rng, WHITE, 0.1))[int(rng.integers(4))]
    if rng.random() < 0.25:
        return [
            limb((-0.07, 0, 0.005), (0.06, 0, 0.005), (0.005, 0.005), paint(rng)),
            limb((0.06, 0, 0.005), (0.075, 0, 0.002), (0.004, 0.001), BLACK),
        ]
    marks = [
        slab((0.0015, 0.012 if i % 5 else 0.018, 0.0003), BLACK, at=(-long / 2 + long * (i + 0.5) / 20, 0.006, 0.003))
        for i in range(20)
    ]
    return [slab((long, 0.032, 0.003), colour), *marks]


def figure(rng: Rng) -> list[Solid]:
    """A doll or toy figure of 5 to 30 cm that stands, sits or lies; also bollards and signs as toy towns have them."""
    high = float(np.exp(rng.uniform(math.log(0.05), math.log(0.3))))
    shirt, legs, hair, face = paint(rng), paint(rng), near(rng, (30, 60, 100), 0.8), skin(rng)
    if rng.random() < 0.3:
        pole = limb((0, 0, 0), (0, 0, high), (high * 0.03, high * 0.03), near(rng, STEEL))
        sign = prism(
            (high * 0.04, 0, high),
            high * 0.17,
            high * 0.02,
            paint(rng),
            sides=int(rng.choice([3, 4, 8, 12])),
            axis="x",
            cap_colour=paint(rng),
        )
        return [pole, sign, limb((0, 0, 0), (0, 0, high * 0.05), (high * 0.15, high * 0.13), rubber(rng))]
    out = [
        limb((0, s * high * 0.07, 0), (0, s * high * 0.06, high * 0.45), (high * 0.05, high * 0.06), legs)
        for s in (-1, 1)
    ]
    out.append(limb((0, 0, high * 0.43), (0, 0, high * 0.75), (high * 0.11, high * 0.13), shirt))
    out += [
        limb(
            (0, s * high * 0.13, high * 0.72),
            (high * float(rng.uniform(-0.1, 0.2)), s * high * 0.2, high * 0.45),
            (high * 0.04, high * 0.03),
            shirt,
        )
        for s in (-1, 1)
    ]
    out += [
        ball((0, 0, high * 0.87), (high * 0.1, high * 0.09, high * 0.12), face),
        ball((-high * 0.02, 0, high * 0.91), (high * 0.11, high * 0.1, high * 0.1), hair),
    ]
    return tipped(out, math.pi / 2) if rng.random() < 0.4 else out


def toy_house(rng: Rng) -> list[Solid]:
    """A model house with a roof, or a tree, as they stand beside small tracks."""
    size = float(rng.uniform(0.05, 0.2))
    if rng.random() < 0.5:
        green = near(rng, (50, 120, 60), 0.3)
        crown = (
            ball((0, 0, size), (size * 0.4, size * 0.4, size * 0.5), green)
            if rng.random() < 0.5
            else limb((0, 0, size * 0.3), (0, 0, size * 1.4), (size * 0.4, 0.001), green)
        )
        return [limb((0, 0, 0), (0, 0, size * 0.7), (size * 0.08, size * 0.06), wood(rng)), crown]
    wall, roof = near(rng, (170, 200, 220), 0.25), near(rng, (50, 60, 150), 0.4)
    out = [
        slab((size, size * 0.7, size * 0.55), wall),
        box((0, 0, size * 0.75), (size * 1.1, size * 0.85, size * 0.4), roof, taper=(1.0, 0.04)),
    ]
    out += [
        box((size * 0.502, y * size, size * 0.3), (0.002, size * 0.16, size * 0.16), near(rng, (120, 80, 50), 0.5))
        for y in (-0.18, 0.18)
    ]
    return out


def loose_ball(rng: Rng) -> list[Solid]:
    """A ball from table tennis to football, plain or of two colours."""
    r = float(rng.choice([0.02, 0.033, 0.05, 0.11]))
    other = paint(rng) if rng.random() < 0.4 else None
    return [ball((0, 0, r), (r, r, r), paint(rng), sides=12, other=other)]
