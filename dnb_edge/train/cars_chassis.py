"""Open radio-controlled chassis and the robot racers built on them: bare, donkey-like, F1TENTH-like, DeepRacer-like.

Knows what these cars are built of; nothing of cameras or pictures. Makers build a car about one unit long, nose along +x, on
z = 0; `dnb_edge.train.cars` scales and places it.
"""

from __future__ import annotations

import math

import numpy as np

from dnb_edge.train.car_boards import antenna, board, camera, electronics, lidar, tag_plate, wires
from dnb_edge.train.car_parts import (
    anodised,
    any_colour,
    between,
    bumper,
    chance,
    dark,
    light,
    paint,
    pick,
    point,
    suspension,
    vivid,
    wheels,
    wing,
)
from dnb_edge.train.solids import Solid, box, prism, rod

Rng = np.random.Generator


def _rolling(rng: Rng, style: str) -> tuple[list[Solid], float, float, float]:
    """Wheels, plate, suspension and bumper; returns (solids, deck height, deck width, wheelbase)."""
    truck = style == "truck"
    radius = {"touring": between(rng, 0.075, 0.1), "buggy": between(rng, 0.095, 0.125)}.get(
        style, between(rng, 0.13, 0.18)
    )
    tyre = {"touring": between(rng, 0.06, 0.085), "buggy": between(rng, 0.085, 0.115)}.get(
        style, between(rng, 0.11, 0.16)
    )
    width = {"touring": between(rng, 0.46, 0.54), "buggy": between(rng, 0.56, 0.66)}.get(
        style, between(rng, 0.62, 0.78)
    )
    wheelbase = between(rng, 0.62, 0.7)
    gauge = width - tyre
    slim = tyre * between(rng, 0.6, 0.85) if style == "buggy" and chance(rng, 0.6) else tyre
    out = wheels(
        rng,
        wheelbase=wheelbase,
        gauge=gauge,
        radius=radius,
        width=tyre,
        front_width=slim,
        knobbly=style != "touring" or chance(rng, 0.2),
    )
    deck = radius * between(rng, 0.9, 1.3) if truck else radius * between(rng, 0.5, 0.9)
    deck_width = (gauge - tyre) * between(rng, 0.6, 0.92)
    plate = anodised(rng)
    out.append(box((-0.01, 0, deck), (wheelbase + 0.08, deck_width, 0.018), plate))
    nose_width = deck_width * between(rng, 0.5, 0.8)
    out.append(box((wheelbase / 2 + 0.06, 0, deck), (0.14, nose_width, 0.016), plate))
    if chance(rng, 0.3):
        for side in (-1, 1):
            out.append(box((-0.01, side * deck_width / 2, deck + 0.02), (wheelbase * 0.7, 0.02, 0.05), dark(rng)))
    tower = max(deck + 0.1, radius * between(rng, 1.7, 2.3))
    for x in (-wheelbase / 2, wheelbase / 2):
        if chance(rng, 0.9):
            out += suspension(rng, x=x, gauge=gauge - tyre * 0.5, hub=radius, tower=tower)
    if chance(rng, 0.85):
        out += bumper(rng, x=0.5, width=width * between(rng, 0.5, 1.0), z=deck + between(rng, 0.0, 0.03))
    else:
        out.append(box((wheelbase / 2 + 0.12, 0, deck), (0.05, nose_width, 0.03), dark(rng)))
    if chance(rng, 0.5):
        out.append(box((-0.455, 0, deck + 0.02), (0.05, deck_width * 0.7, 0.04), dark(rng)))
    if chance(rng, 0.5):
        out.append(rod(point(-wheelbase / 2, 0, deck + 0.06), point(wheelbase / 2, 0, deck + 0.06), 0.012, light(rng)))
    if chance(rng, 0.5):
        can = vivid(rng) if chance(rng, 0.4) else light(rng)
        out.append(prism((-wheelbase * 0.28, deck_width * 0.2, deck + 0.06), 0.05, 0.13, can, sides=10, axis="x"))
    return out, deck + 0.012, deck_width, wheelbase


def bare_chassis(rng: Rng) -> list[Solid]:
    """A radio-controlled chassis without its shell, with whatever a maker straps on top."""
    out, deck, width, wheelbase = _rolling(rng, pick(rng, ("touring", "touring", "buggy", "buggy", "truck")))
    room = max(width, 0.2)
    parts, top = electronics(rng, length=wheelbase * 0.92, width=room, deck=deck)
    out += parts
    if chance(rng, 0.15):  # a printed or cardboard box holds the works
        size = (between(rng, 0.25, 0.5), room * between(rng, 0.7, 1.1), between(rng, 0.1, 0.25))
        out.append(box((between(rng, -0.12, 0.05), 0, deck + size[2] / 2), size, paint(rng)))
        parts, top = electronics(rng, length=size[0], width=size[1], deck=deck + size[2], wire_count=2)
        out += parts
    if chance(rng, 0.35):
        lift = top + between(rng, 0.01, 0.12)
        long, wide = between(rng, 0.3, 0.62), room * between(rng, 0.8, 1.15)
        roof = anodised(rng) if chance(rng, 0.6) else paint(rng)
        out.append(box((between(rng, -0.06, 0.03), 0, lift), (long, wide, 0.014), roof))
        for sx in (-0.45, 0.45):
            for sy in (-0.42, 0.42):
                out.append(rod(point(sx * long, sy * wide, deck), point(sx * long, sy * wide, lift), 0.009, light(rng)))
        top = lift + 0.01
        if chance(rng, 0.7):
            more, top = board(
                rng, (between(rng, -0.12, 0.1), 0.0), lift, between(rng, 0.18, 0.3), between(rng, 0.14, 0.22)
            )
            out += more
            out += wires(rng, length=long, width=wide, low=lift, high=top, count=int(rng.integers(0, 4)))
    return out + _mounts(rng, deck=deck, top=top, width=width)


def _mounts(rng: Rng, *, deck: float, top: float, width: float) -> list[Solid]:
    """A camera, a lidar, a tag, antennas, a wing: some of them."""
    out: list[Solid] = []
    if chance(rng, 0.5):
        out += camera(
            rng, x=between(rng, 0.2, 0.42), low=deck, high=top + between(rng, 0.02, 0.25), tilt_rad=between(rng, 0, 0.5)
        )
    if chance(rng, 0.25):
        out += lidar(rng, x=between(rng, -0.1, 0.28), z=top, radius=between(rng, 0.07, 0.11))
    if chance(rng, 0.3):
        out += tag_plate(
            rng, x=between(rng, -0.15, 0.1), z=top + between(rng, 0.02, 0.12), size=between(rng, 0.16, 0.3)
        )
    if chance(rng, 0.35):
        for _ in range(int(rng.integers(1, 3))):
            x, y = between(rng, -0.3, 0.2), width * between(rng, -0.4, 0.4)
            out += antenna(rng, x=x, y=y, z=deck, height=between(rng, 0.2, 0.6))
    if chance(rng, 0.2):
        out += wing(rng, x=-0.43, low=deck, high=top + 0.1, span=width * 1.5, chord=between(rng, 0.1, 0.17))
    return out


def donkey(rng: Rng) -> list[Solid]:
    """A radio-controlled chassis with a printed plate and a roll hoop that carries the camera above the nose."""
    out, deck, width, wheelbase = _rolling(rng, pick(rng, ("buggy", "touring", "truck")))
    plastic = dark(rng) if chance(rng, 0.45) else paint(rng)
    plate = deck + between(rng, 0.06, 0.12)
    half = between(rng, 0.12, 0.17)
    out.append(box((-0.03, 0, plate), (wheelbase * 0.9, half * 1.7, 0.016), plastic))
    parts, top = board(rng, (between(rng, -0.16, 0.0), 0.0), plate, 0.27, 0.18)
    out += parts
    high = plate + between(rng, 0.22, 0.38)
    thick = between(rng, 0.014, 0.024)
    front, back = between(rng, 0.08, 0.2), between(rng, -0.34, -0.2)
    lean = between(rng, -0.02, 0.1)
    for side in (-1, 1):
        y = side * half
        corner_front, corner_back = point(front + lean, y * 0.8, high), point(back + 0.1, y * 0.8, high)
        out.append(rod(point(front, y, plate), corner_front, thick, plastic))
        if chance(rng, 0.9):
            out.append(rod(point(back, y, plate), corner_back, thick, plastic))
            out.append(rod(corner_back, corner_front, thick, plastic))
    out.append(box((front + lean, 0, high), (0.05, half * 1.7, thick * 2), plastic))
    if chance(rng, 0.5):
        out.append(box((back + 0.1, 0, high), (0.04, half * 1.7, thick * 2), plastic))
    out += camera(
        rng, x=front + lean + 0.04, low=high, high=high + between(rng, 0.0, 0.06), tilt_rad=between(rng, 0.1, 0.5)
    )
    out += electronics(rng, length=wheelbase * 0.9, width=max(0.18, width), deck=deck, wire_count=2)[0]
    out += wires(rng, length=0.5, width=half * 2, low=plate, high=top, count=int(rng.integers(1, 6)))
    return out


def f1tenth(rng: Rng) -> list[Solid]:
    """A long chassis with a black platform, a computer with antennas and a lidar in front."""
    out, deck, width, wheelbase = _rolling(rng, pick(rng, ("touring", "buggy")))
    platform = deck + between(rng, 0.08, 0.14)
    plate = dark(rng) if chance(rng, 0.8) else paint(rng)
    wide = between(rng, 0.24, 0.34)
    out.append(box((-0.03, 0, platform), (between(rng, 0.6, 0.8), wide, 0.014), plate))
    for sx in (-0.3, 0.25):
        for sy in (-0.4, 0.4):
            out.append(rod(point(sx, sy * wide, deck), point(sx, sy * wide, platform), 0.01, light(rng)))
    out += lidar(rng, x=between(rng, 0.12, 0.28), z=platform, radius=between(rng, 0.065, 0.1))
    parts, top = board(
        rng, (between(rng, -0.14, -0.05), 0.0), platform, between(rng, 0.2, 0.28), wide * between(rng, 0.6, 0.9)
    )
    out += parts
    out += electronics(rng, length=wheelbase * 0.8, width=max(0.2, width), deck=deck, wire_count=2)[0]
    out.append(box((-0.3, wide * between(rng, -0.2, 0.2), platform + 0.035), (0.12, 0.1, 0.06), any_colour(rng)))
    if chance(rng, 0.7):
        for side in (-1, 1):
            out += antenna(rng, x=-0.36, y=side * wide * 0.4, z=platform, height=between(rng, 0.15, 0.32))
    if chance(rng, 0.4):
        out += camera(rng, x=0.36, low=deck, high=platform + 0.04)
    out += wires(rng, length=0.65, width=wide, low=platform, high=top, count=int(rng.integers(1, 7)))
    return out


def deepracer(rng: Rng) -> list[Solid]:
    """A monster-truck chassis under a dark moulded shell with a blunt nose, cameras on it and a battery behind."""
    tyre = between(rng, 0.1, 0.13)
    radius = between(rng, 0.12, 0.15)
    gauge = between(rng, 0.5, 0.58)
    out = wheels(rng, wheelbase=0.62, gauge=gauge, radius=radius, width=tyre, knobbly=True)
    for x in (-0.31, 0.31):
        out += suspension(rng, x=x, gauge=gauge - 0.03, hub=radius, tower=radius * 1.9)
    body = dark(rng) if chance(rng, 0.65) else paint(rng)
    low = radius * 1.1
    tall = between(rng, 0.12, 0.17)
    out.append(box((0.0, 0, low), (0.86, 0.24, 0.03), dark(rng)))
    out.append(box((-0.03, 0, low + tall / 2), (0.72, 0.3, tall), body, taper=(0.82, 0.75), shift_top_m=-0.02))
    out.append(box((0.36, 0, low + tall * 0.4), (0.16, 0.24, tall * 0.8), body, taper=(0.5, 0.8), shift_top_m=-0.04))
    out.append(box((-0.12, 0, low + tall + 0.02), (0.36, 0.17, 0.05), dark(rng) if chance(rng, 0.5) else light(rng)))
    out += camera(
        rng, x=0.27, low=low + tall * 0.7, high=low + tall + between(rng, 0.03, 0.09), tilt_rad=math.radians(15)
    )
    if chance(rng, 0.5):
        out += lidar(rng, x=0.02, z=low + tall + 0.04, radius=0.08)
    out += bumper(rng, x=0.5, width=0.42, z=low)
    if chance(rng, 0.5):
        stripe = vivid(rng)
        for side in (-1, 1):
            out.append(box((0.0, side * 0.115, low + tall + 0.002), (0.5, 0.02, 0.006), stripe))
    return out
