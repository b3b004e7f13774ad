"""Small robots: Duckiebot-, JetBot- and Thymio-like ones, motor kits, acrylic four-wheelers, tracked and round ones.

Knows what these robots look like; nothing of cameras or pictures. Makers build a robot about one unit long, nose along +x, on
z = 0; `dnb_edge.train.cars` scales and places it.
"""

from __future__ import annotations

import math

import numpy as np

from dnb_edge.train.car_boards import antenna, battery, board, camera, cells, electronics, eyes, lidar, tag_plate, wires
from dnb_edge.train.car_parts import (
    any_colour,
    between,
    chance,
    dark,
    light,
    paint,
    pick,
    point,
    rim_colour,
    vivid,
    wheel,
    wheels,
)
from dnb_edge.train.solids import Colour, Solid, box, prism, rod

Rng = np.random.Generator

_YELLOW: Colour = (25, 195, 240)


def _pair(
    rng: Rng, *, axle: float, gauge: float, radius: float, width: float, rim: Colour | None = None
) -> list[Solid]:
    colours = (dark(rng), rim if rim is not None else rim_colour(rng))
    share = between(rng, 0.6, 0.82)
    return [
        part
        for y in (-gauge / 2, gauge / 2)
        for part in wheel(rng, (axle, y), (radius, width), colours, rim_share=share)
    ]


def _castor(x: float, radius: float) -> list[Solid]:
    metal = (175.0, 178.0, 182.0)
    return [
        prism((x, 0, radius * 0.5), radius * 0.3, radius, metal, sides=8, top_scale=3.0),
        prism((x, 0, radius * 1.6), radius, radius * 1.2, (40, 40, 42), sides=8),
    ]


def _deck(rng: Rng, x: float, z: float, length: float, width: float, colour: Colour) -> list[Solid]:
    """A plate, square or with a rounded nose."""
    if chance(rng, 0.5):
        return [box((x, 0, z), (length, width, 0.018), colour)]
    body = length - width / 2
    return [
        box((x - width / 4, 0, z), (body, width, 0.018), colour),
        prism((x + length / 2 - width / 2, 0, z), width / 2, 0.018, colour, sides=16),
    ]


def _motors(axle: float, gauge: float, radius: float) -> list[Solid]:
    """Two yellow geared motors lying along the car behind the axle, as kits have."""
    out: list[Solid] = []
    for side in (-1, 1):
        y = side * (gauge / 2 - 0.13)
        out.append(box((axle - 0.1, y, radius), (0.32, 0.1, 0.12), _YELLOW))
        out.append(prism((axle - 0.3, y, radius), 0.055, 0.12, (185, 190, 192), sides=8, axis="x"))
    return out


def duckiebot(rng: Rng) -> list[Solid]:
    """Two wheels, plates in blue or yellow, a computer, a camera in front, a duck on top."""
    radius, width = between(rng, 0.15, 0.19), between(rng, 0.1, 0.14)
    gauge = between(rng, 0.6, 0.72)
    axle = between(rng, 0.18, 0.26)
    out = _pair(rng, axle=axle, gauge=gauge, radius=radius, width=width, rim=_YELLOW if chance(rng, 0.6) else None)
    out += _castor(-0.3, 0.06)
    frame = pick(rng, ((170.0, 80.0, 20.0), (190.0, 110.0, 40.0), _YELLOW, (30.0, 30.0, 32.0), (220.0, 220.0, 220.0)))
    low = radius * between(rng, 0.8, 1.1)
    wide = gauge - width - 0.03
    out += _deck(rng, 0.0, low, 0.86, wide, frame)
    parts, high = battery(rng, (-0.05, 0), low, 0.5, wide * 0.6)
    out += parts
    upper = high + between(rng, 0.03, 0.08)
    out.append(box((-0.08, 0, upper), (between(rng, 0.5, 0.68), wide * 0.95, 0.018), frame))
    for sx in (-0.28, 0.15):
        for sy in (-0.4, 0.4):
            out.append(rod(point(sx, sy * wide, low), point(sx, sy * wide, upper), 0.014, light(rng)))
    more, top = board(rng, (-0.1, between(rng, -0.05, 0.05)), upper, 0.4, 0.28)
    out += more
    out += camera(rng, x=between(rng, 0.3, 0.4), low=low, high=upper + between(rng, -0.04, 0.12), tilt_rad=0.25)
    out += wires(rng, length=0.75, width=wide, low=low, high=top, count=int(rng.integers(2, 7)))
    if chance(rng, 0.75):
        out += _duck(rng, between(rng, -0.25, 0.12), between(rng, -0.06, 0.06), top, between(rng, 0.08, 0.13))
    if chance(rng, 0.4):
        out.append(box((-0.44, 0, low), (0.03, gauge * 0.9, 0.06), frame))
    if chance(rng, 0.3):
        out += tag_plate(rng, x=-0.25, z=top + 0.08, size=0.2)
    return out


def _duck(rng: Rng, x: float, y: float, z: float, size: float) -> list[Solid]:
    return [
        prism((x, y, z + size * 0.4), size * 0.75, size * 0.8, _YELLOW, sides=10, top_scale=1.2),
        prism((x, y, z + size * 0.95), size * 0.9, size * 0.4, _YELLOW, sides=10, top_scale=0.5),
        prism((x + size * 0.35, y, z + size * 1.4), size * 0.5, size * 0.8, (30, 205, 248), sides=8, top_scale=0.8),
        box((x + size * 0.9, y, z + size * 1.35), (size * 0.4, size * 0.4, size * 0.15), (20, 110, 240)),
        box((x - size * 0.8, y, z + size * 0.9), (size * 0.4, size * 0.5, size * 0.25), _YELLOW),
        box((x + size * 0.7, y, z + size * 1.6), (size * 0.12, size * 0.7, size * 0.14), dark(rng)),
    ]


def jetbot(rng: Rng) -> list[Solid]:
    """Two wheels, a printed or acrylic body, a computer with a heat sink, two Wi-Fi antennas up, a camera in front."""
    radius, width = between(rng, 0.19, 0.24), between(rng, 0.07, 0.12)
    gauge = between(rng, 0.7, 0.85)
    axle = between(rng, 0.16, 0.24)
    out = _pair(rng, axle=axle, gauge=gauge, radius=radius, width=width)
    out += _castor(-0.29, 0.08)
    body = dark(rng) if chance(rng, 0.6) else paint(rng)
    wide = gauge - width - 0.04
    low, high = 0.1, between(rng, 0.3, 0.42)
    if chance(rng, 0.6):
        out.append(box((0, 0, (low + high) / 2), (0.78, wide, high - low), body))
    else:
        out.append(box((0, 0, low + 0.05), (0.84, wide, 0.02), body))
        out += battery(rng, (0, 0), low + 0.06, 0.5, wide * 0.7)[0]
        out.append(box((0, 0, high), (0.8, wide, 0.02), body))
    parts, top = board(rng, (-0.1, 0), high, 0.5, min(0.45, wide * 0.9))
    out += parts
    for side in (-1, 1):
        if chance(rng, 0.85):
            out += antenna(rng, x=-0.4, y=side * wide * 0.42, z=high * 0.8, height=between(rng, 0.35, 0.65))
    out += camera(rng, x=0.42, low=low, high=high + between(rng, 0.0, 0.18), tilt_rad=0.3)
    out.append(box((0.43, 0, high * 0.8), (0.05, wide * 0.4, high * 0.5), body))
    out += wires(rng, length=0.7, width=wide, low=high * 0.8, high=top, count=int(rng.integers(1, 5)))
    if chance(rng, 0.2):
        out += lidar(rng, x=0.0, z=top, radius=0.18)
    return out


def thymio(rng: Rng) -> list[Solid]:
    """A white D-shaped box, rounded in front, with black wheels at its sides and glowing patches."""
    shell = light(rng) if chance(rng, 0.8) else paint(rng)
    high = between(rng, 0.4, 0.48)
    half = between(rng, 0.46, 0.52)
    out = [
        box((-0.18, 0, 0.05 + high / 2), (0.6, half * 2, high), shell),
        prism((0.05, 0, 0.05 + high / 2), half, high, shell, sides=20, cap_colour=shell),
    ]
    out += _pair(rng, axle=-0.22, gauge=half * 2, radius=0.2, width=0.12, rim=dark(rng))
    out.append(prism((0.3, 0, 0.03), 0.03, 0.06, light(rng), sides=8))
    out.append(box((0.47, 0, 0.28), (0.12, half * 0.9, 0.06), dark(rng)))
    glow = vivid(rng)
    for side in (-1, 1):
        out.append(box((between(rng, -0.1, 0.1), side * half * 0.6, 0.05 + high), (0.4, 0.1, 0.008), glow))
        out.append(box((-0.2, side * half * 0.8, 0.05 + high), (0.12, 0.12, 0.02), shell))
    out.append(prism((0.0, 0, 0.05 + high), 0.08, 0.03, (200, 200, 200), sides=8))
    for dx, dy in ((0.14, 0), (-0.14, 0), (0, 0.14), (0, -0.14)):
        out.append(box((dx, dy, 0.055 + high), (0.05, 0.05, 0.012), dark(rng)))
    out.append(prism((-0.36, 0, 0.06 + high), 0.07, 0.02, dark(rng), sides=8))
    if chance(rng, 0.25):
        out += electronics(rng, length=0.5, width=0.5, deck=0.05 + high, wire_count=2)[0]
    return out


def motor_kit(rng: Rng) -> list[Solid]:
    """An acrylic, wooden or cardboard deck with yellow geared motors: two wheels and a castor, or four wheels."""
    four = chance(rng, 0.45)
    radius, width = between(rng, 0.13, 0.16), between(rng, 0.1, 0.13)
    gauge = between(rng, 0.56, 0.68)
    plates: tuple[Colour, ...] = (
        (225, 228, 228),
        (110, 170, 205),
        (90, 140, 185),
        (190, 90, 20),
        (30, 30, 32),
        (30, 30, 190),
    )
    deck = pick(rng, plates) if chance(rng, 0.75) else paint(rng)
    rim = _YELLOW if chance(rng, 0.6) else light(rng)
    if four:
        out = wheels(rng, wheelbase=0.52, gauge=gauge, radius=radius, width=width, colours=(dark(rng), rim))
        out += _motors(0.26, gauge, radius) + _motors(-0.1, gauge, radius)
    else:
        axle = between(rng, 0.2, 0.3) * (1 if chance(rng, 0.7) else -1)
        out = _pair(rng, axle=axle, gauge=gauge, radius=radius, width=width, rim=rim)
        out += _motors(axle + (0.0 if axle > 0 else 0.2), gauge, radius) + _castor(-math.copysign(0.32, axle), 0.08)
    z = radius + between(rng, 0.06, 0.09)
    wide = gauge - width - (0.03 if chance(rng, 0.7) else -0.05)
    out += _deck(rng, 0.0, z, 0.94, wide, deck)
    if chance(rng, 0.35):
        z += between(rng, 0.12, 0.18)
        out += _deck(rng, 0.0, z, between(rng, 0.7, 0.92), wide, deck)
    if chance(rng, 0.6):
        out += cells(rng, (-0.22, 0), z, int(rng.integers(2, 5)))
    out += electronics(rng, length=0.8, width=wide, deck=z + 0.01)[0]
    if chance(rng, 0.65):
        out.append(box((0.42, 0, z + 0.04), (0.08, 0.09, 0.08), (180, 90, 20) if chance(rng, 0.5) else dark(rng)))
        out += eyes(rng, x=0.44, z=z + between(rng, 0.08, 0.2))
    return out


def acrylic_car(rng: Rng) -> list[Solid]:
    """A steered kit car: decks in one colour, a computer in the middle, cells behind, eyes or a camera on a servo in front."""
    radius, width = between(rng, 0.12, 0.15), between(rng, 0.09, 0.13)
    gauge = between(rng, 0.52, 0.64)
    rim = rim_colour(rng)
    out = wheels(
        rng, wheelbase=between(rng, 0.5, 0.6), gauge=gauge, radius=radius, width=width, colours=(dark(rng), rim)
    )
    plate = pick(rng, (dark(rng), (200.0, 100.0, 20.0), (205.0, 210.0, 212.0), (170.0, 172.0, 175.0), paint(rng)))
    low = radius * between(rng, 0.9, 1.2)
    wide = gauge - width - 0.04
    out += _deck(rng, 0.02, low, 0.9, wide, plate)
    high = low + between(rng, 0.1, 0.2)
    out.append(box((-0.08, 0, high), (between(rng, 0.5, 0.66), wide * 0.95, 0.016), plate))
    for sx in (-0.3, 0.15):
        for sy in (-0.42, 0.42):
            out.append(rod(point(sx, sy * wide, low), point(sx, sy * wide, high), 0.013, (90, 170, 190)))
    parts, top = board(rng, (between(rng, -0.12, 0.05), 0), high, 0.34, min(0.28, wide * 0.9))
    out += parts
    out += cells(rng, (-0.3, 0), low if chance(rng, 0.4) else high, 2)
    out.append(box((0.34, 0, low + 0.08), (0.09, 0.1, 0.14), (180, 90, 20) if chance(rng, 0.5) else dark(rng)))
    if chance(rng, 0.7):
        out += eyes(rng, x=0.42, z=low + between(rng, 0.1, 0.2))
    if chance(rng, 0.75):
        out += camera(rng, x=0.38, low=low + 0.1, high=high + between(rng, 0.1, 0.25), tilt_rad=between(rng, -0.1, 0.3))
    out += wires(rng, length=0.75, width=wide, low=low, high=top, count=int(rng.integers(2, 9)))
    return out


def tracked(rng: Rng) -> list[Solid]:
    """Two tracks with ribs, a deck or a box between them, boards or a turret on top."""
    radius, width = between(rng, 0.1, 0.15), between(rng, 0.12, 0.18)
    gauge = between(rng, 0.5, 0.68)
    belt, guide = dark(rng), any_colour(rng)
    straight = 0.96 - 2 * radius
    out: list[Solid] = []
    for y in (-gauge / 2, gauge / 2):
        out.append(box((0, y, radius), (straight, width, radius * 2), belt))
        ends = (-straight / 2, straight / 2)
        out += [prism((end, y, radius), radius, width, belt, sides=14, axis="y") for end in ends]
        for i in range(11):
            x = straight * (i / 10 - 0.5)
            out.append(box((x, y, radius * 2), (straight * 0.045, width, 0.016), (70, 72, 75)))
        for i in range(4):
            x = straight * (i / 3 - 0.5)
            out.append(prism((x, y, radius), radius * 0.6, width * 1.06, guide, sides=10, axis="y"))
    hull = paint(rng)
    deck = radius * between(rng, 1.4, 2.4)
    out.append(box((0, 0, deck * 0.6), (0.8, gauge - width, deck * 0.8), hull))
    if chance(rng, 0.6):
        out.append(box((-0.02, 0, deck), (0.78, gauge * between(rng, 0.8, 1.2), 0.02), hull))
    out += electronics(rng, length=0.7, width=gauge * 0.8, deck=deck + 0.01)[0]
    if chance(rng, 0.5):
        out += camera(rng, x=between(rng, 0.2, 0.4), low=deck, high=deck + between(rng, 0.08, 0.3))
    if chance(rng, 0.3):
        out += eyes(rng, x=0.42, z=deck + 0.06)
    return out


def round_robot(rng: Rng) -> list[Solid]:
    """A disc on two wheels: a smooth shell with a bumper in front, or stacked plates with a lidar on top."""
    shell = light(rng) if chance(rng, 0.4) else dark(rng) if chance(rng, 0.6) else vivid(rng)
    high = between(rng, 0.16, 0.34)
    out = [prism((0, 0, 0.04 + high / 2), 0.5, high, shell, sides=24, cap_colour=shell)]
    out += _pair(rng, axle=0.0, gauge=0.88, radius=0.12, width=0.07)
    for x in (-0.36, 0.36):
        out += _castor(x, 0.03)
    skirt = dark(rng)
    for i in range(5):
        angle = (i - 2) * 0.45
        place = (0.49 * math.cos(angle), 0.49 * math.sin(angle), 0.04 + high * 0.45)
        out.append(prism(place, 0.05, high * 0.5, skirt, sides=6))
    top = 0.04 + high
    if chance(rng, 0.5):
        for level in range(int(rng.integers(1, 3))):
            top += between(rng, 0.1, 0.2)
            out.append(prism((0, 0, top), 0.46, 0.02, shell, sides=20))
            for angle in (0.8, 2.3, -2.3, -0.8):
                x, y = 0.38 * math.cos(angle), 0.38 * math.sin(angle)
                out.append(rod(point(x, y, top - 0.2), point(x, y, top), 0.015, light(rng)))
            if level == 0:
                out += wires(rng, length=0.6, width=0.6, low=top - 0.1, high=top, count=2)
        out += lidar(rng, x=between(rng, -0.15, 0.2), z=top, radius=between(rng, 0.12, 0.17))
    elif chance(rng, 0.5):
        out.append(prism((between(rng, -0.2, 0.0), 0, top), between(rng, 0.12, 0.2), 0.012, any_colour(rng), sides=16))
        out.append(box((0.3, 0, top), (0.06, 0.25, 0.012), dark(rng)))
    else:
        out += electronics(rng, length=0.6, width=0.55, deck=top)[0]
    return out


def box_robot(rng: Rng) -> list[Solid]:
    """A home-made closed box on small wheels, with a face in front and something on top."""
    width = between(rng, 0.5, 0.75)
    high = between(rng, 0.18, 0.4)
    radius = between(rng, 0.09, 0.15)
    body = paint(rng)
    out = wheels(rng, wheelbase=0.58, gauge=width, radius=radius, width=radius * 0.8)
    low = radius * 0.6
    out.append(
        box(
            (0, 0, low + high / 2),
            (0.96, width * 0.88, high),
            body,
            taper=(between(rng, 0.85, 1), between(rng, 0.85, 1)),
        )
    )
    out.append(box((0.47, 0, low + high * 0.6), (0.05, width * 0.5, high * 0.4), dark(rng)))
    top = low + high
    if chance(rng, 0.4):
        out += tag_plate(rng, x=0.0, z=top + 0.006, size=between(rng, 0.25, 0.4))
    elif chance(rng, 0.7):
        out += electronics(rng, length=0.75, width=width * 0.75, deck=top)[0]
    if chance(rng, 0.4):
        out += camera(rng, x=0.4, low=low, high=top + between(rng, 0.03, 0.2))
    if chance(rng, 0.25):
        out += antenna(rng, x=-0.35, y=0.1, z=top, height=between(rng, 0.3, 0.6))
    return out
