"""Parts that miniature cars are built of: paints, tyres and rims, shock absorbers, wings, bumpers, drivers.

Knows the parts' shapes and colours; nothing of whole cars, cameras or pictures. Lengths are in the maker's unit (makers build
cars one unit long and scale them at the end); the car's nose is along +x, z up. Colours are blue, green, red.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from dnb_edge.train.solids import Colour, FloatArray, Solid, box, pitched, prism, rod, turned

Rng = np.random.Generator
Item = TypeVar("Item")

VIVID: tuple[Colour, ...] = (
    (25, 20, 205),
    (200, 80, 10),
    (30, 200, 235),
    (40, 170, 30),
    (10, 110, 240),
    (160, 30, 120),
    (170, 190, 20),
    (150, 60, 230),
    (60, 230, 190),
    (120, 25, 10),
)
"""Paints that small cars wear most: red, blue, yellow, green, orange, purple, turquoise, pink, lime, navy."""


def between(rng: Rng, low: float, high: float) -> float:
    """A number evenly drawn."""
    return low + (high - low) * float(rng.random())


def chance(rng: Rng, share: float) -> bool:
    """True in `share` of the draws."""
    return bool(rng.random() < share)


def pick(rng: Rng, items: Sequence[Item]) -> Item:
    """One of the items, evenly drawn."""
    return items[int(rng.integers(len(items)))]


def shaded(colour: Colour, gain: float) -> Colour:
    """The colour made darker or lighter."""
    return (min(255.0, colour[0] * gain), min(255.0, colour[1] * gain), min(255.0, colour[2] * gain))


def any_colour(rng: Rng) -> Colour:
    """Mostly a saturated paint, sometimes grey, white or black."""
    kind = rng.random()
    if kind < 0.25:
        grey = float(rng.uniform(10, 70))
        return (grey + float(rng.uniform(0, 12)), grey + float(rng.uniform(0, 8)), grey)
    if kind < 0.4:
        grey = float(rng.uniform(150, 250))
        return (grey, grey + float(rng.uniform(-8, 5)), grey + float(rng.uniform(-12, 5)))
    low, middle, high = (float(value) for value in np.sort(rng.uniform(5, 255, 3)))
    order = rng.permutation(3)
    values = (low * 0.6, middle, max(high, 90.0))
    return (values[order[0]], values[order[1]], values[order[2]])


def dark(rng: Rng) -> Colour:
    """Rubber, plastic, carbon."""
    grey = float(rng.uniform(8, 60))
    return (grey + float(rng.uniform(0, 10)), grey + float(rng.uniform(0, 6)), grey + float(rng.uniform(0, 4)))


def light(rng: Rng) -> Colour:
    """White plastic or bare aluminium."""
    grey = between(rng, 150, 250)
    return (grey, grey + between(rng, -6, 4), grey + between(rng, -10, 4))


def vivid(rng: Rng) -> Colour:
    """A saturated paint, a little lighter or darker and a little off its name."""
    gain = between(rng, 0.7, 1.15)
    base = pick(rng, VIVID)
    b, g, r = (min(255.0, max(4.0, value * gain + between(rng, -15, 15))) for value in base)
    return (b, g, r)


def paint(rng: Rng) -> Colour:
    """A body's colour: vivid, white, silver, black, or anything."""
    kind = rng.random()
    if kind < 0.45:
        return vivid(rng)
    if kind < 0.68:
        return light(rng)
    return dark(rng) if kind < 0.84 else any_colour(rng)


def anodised(rng: Rng) -> Colour:
    """A chassis plate: black or carbon mostly; blue, purple, red, orange or gold anodised, or bare aluminium."""
    if chance(rng, 0.6):
        return dark(rng)
    plates: tuple[Colour, ...] = (
        (190, 70, 20),
        (170, 40, 90),
        (30, 25, 190),
        (20, 110, 220),
        (60, 150, 180),
        (175, 178, 180),
        (90, 92, 95),
    )
    return shaded(pick(rng, plates), between(rng, 0.7, 1.15))


def rim_colour(rng: Rng) -> Colour:
    """White, yellow, silver, black or chromed rims."""
    rims: tuple[Colour, ...] = ((240, 240, 240), (60, 220, 240), (190, 195, 200), (30, 30, 32), (40, 240, 230))
    return pick(rng, rims) if chance(rng, 0.75) else any_colour(rng)


def wheel(
    rng: Rng,
    centre: tuple[float, float],
    size: tuple[float, float],
    colours: tuple[Colour, Colour],
    *,
    knobbly: bool = False,
    steer_rad: float = 0.0,
    rim_share: float = 0.62,
) -> list[Solid]:
    """One wheel that stands on z = 0 with its hub above `centre`: a tyre with drawn-in shoulders, a rim that stands proud.

    `size` is radius and width; `colours` those of tyre and rim.
    """
    radius, width = size
    tyre, rim = colours
    sides = 14
    lugs = tuple(shaded(tyre, 1.0 if i % 2 else 2.0 if knobbly else 1.15) for i in range(sides))
    shoulder = between(rng, 0.82, 0.93)
    tread = (*lugs, tyre, tyre)
    quarter = width * 0.25
    outer = prism((0, quarter, 0), radius, width * 0.5, tyre, sides=sides, axis="y", top_scale=shoulder)
    inner = prism(
        (0, -quarter, 0), radius * shoulder, width * 0.5, tyre, sides=sides, axis="y", top_scale=1.0 / shoulder
    )
    disc = radius * rim_share
    proud = between(rng, 1.03, 1.2)
    hub = prism((0, 0, 0), disc, width * proud, shaded(rim, 0.8), sides=10, axis="y", cap_colour=rim)
    nut = prism((0, 0, 0), disc * 0.3, width * (proud + 0.06), shaded(rim, 0.35), sides=6, axis="y")
    parts = [replace(outer, face_colours=tread), replace(inner, face_colours=tread), hub, nut]
    return [turned(part, steer_rad, shift_m=(centre[0], centre[1], radius)) for part in parts]


def wheels(
    rng: Rng,
    *,
    wheelbase: float,
    gauge: float,
    radius: float,
    width: float,
    front_width: float | None = None,
    knobbly: bool = False,
    colours: tuple[Colour, Colour] | None = None,
) -> list[Solid]:
    """Four wheels; `gauge` is between the tyres' middles; the front ones may be narrower and are often steered."""
    if colours is None:
        colours = (dark(rng) if chance(rng, 0.96) else any_colour(rng), rim_colour(rng))
    share = between(rng, 0.5, 0.76)
    steer = between(rng, -0.45, 0.45) if chance(rng, 0.6) else 0.0
    out: list[Solid] = []
    for x in (-wheelbase / 2, wheelbase / 2):
        front = x > 0
        size = (radius, front_width if front and front_width is not None else width)
        angle = steer if front else 0.0
        for y in (-gauge / 2, gauge / 2):
            out += wheel(rng, (x, y), size, colours, knobbly=knobbly, steer_rad=angle, rim_share=share)
    return out


def point(x: float, y: float, z: float) -> FloatArray:
    """A place as an array."""
    return np.array([x, y, z])


def shock(low: FloatArray, high: FloatArray, radius: float, spring: Colour, body: Colour) -> list[Solid]:
    """A shock absorber: a shaft below, a coil spring in stripes, a cap at the top."""
    steps = 6
    out = [rod(low, high, radius * 0.5, body)]
    for i in range(steps):
        a = low + (high - low) * (0.25 + 0.6 * i / steps)
        b = low + (high - low) * (0.25 + 0.6 * (i + 0.6) / steps)
        out.append(rod(a, b, radius, spring))
    out.append(rod(low + (high - low) * 0.85, high, radius * 1.1, body))
    return out


def suspension(rng: Rng, *, x: float, gauge: float, hub: float, tower: float) -> list[Solid]:
    """A shock tower, two coil shocks, wishbones and drive shafts of the axle at `x`."""
    spring = vivid(rng) if chance(rng, 0.75) else light(rng)
    body = pick(rng, ((25.0, 25.0, 28.0), (190.0, 70.0, 20.0), (60.0, 150.0, 190.0), (180.0, 180.0, 185.0)))
    arm = dark(rng)
    inward = -math.copysign(0.03, x)
    out = [
        box((x + inward, 0, (hub + tower) / 2), (0.02, gauge * 0.36, tower - hub), anodised(rng), taper=(1, 1.4)),
        box((x, 0, hub), (0.1, gauge * 0.26, hub * 0.8), dark(rng)),
    ]
    for side in (-1, 1):
        out += shock(
            point(x + inward * 0.3, side * gauge * 0.33, hub * 0.9),
            point(x + inward * 0.3, side * gauge * 0.2, tower),
            between(rng, 0.016, 0.024),
            spring,
            body,
        )
        for shift in (-0.035, 0.035):
            out.append(
                rod(point(x + shift, side * gauge * 0.1, hub * 0.8), point(x, side * gauge * 0.46, hub), 0.011, arm)
            )
        out.append(rod(point(x, side * gauge * 0.1, hub * 1.3), point(x, side * gauge * 0.46, hub * 1.25), 0.008, body))
    return out


def wing(
    rng: Rng, *, x: float, low: float, high: float, span: float, chord: float, colour: Colour | None = None
) -> list[Solid]:
    """A wing at the rear on stays, sometimes with end plates."""
    blade_colour = colour if colour is not None else paint(rng)
    blade = pitched(
        box((x, 0, high), (chord, span, 0.014), blade_colour), between(rng, -0.4, 0.0), about_m=(x, 0, high)
    )
    plate = blade_colour if chance(rng, 0.6) else dark(rng)
    stay = dark(rng)
    out = [blade]
    if chance(rng, 0.75):
        out += [box((x, side * span / 2, high), (chord * 1.05, 0.012, chord * 0.5), plate) for side in (-1, 1)]
    for side in (-1, 1):
        out.append(
            rod(point(x + chord * 0.3, side * span * 0.22, low), point(x, side * span * 0.22, high), 0.011, stay)
        )
    return out


def bumper(rng: Rng, *, x: float, width: float, z: float, depth: float = 0.07) -> list[Solid]:
    """A foam or plastic bumper whose front edge is at `x`, its ends swept back."""
    colour = dark(rng) if chance(rng, 0.85) else paint(rng)
    height = between(rng, 0.025, 0.06)
    sweep = between(rng, 0.1, 0.45)
    out = [box((x - depth / 2, 0, z), (depth, width * 0.6, height), colour)]
    for side in (-1, 1):
        end = box((0, 0, 0), (depth * 0.9, width * 0.26, height), colour)
        out.append(turned(end, side * sweep, shift_m=(x - depth * 0.72, side * width * 0.38, z)))
    return out


def driver(rng: Rng, *, x: float, seat: float, size: float, arms_to: float) -> list[Solid]:
    """A seated figure: body, big head with a cap or helmet, nose to the front, arms to a steering wheel at x = `arms_to`."""
    shirt, cap = vivid(rng), vivid(rng) if chance(rng, 0.7) else light(rng)
    skin: Colour = pick(rng, ((140.0, 180.0, 235.0), (110.0, 150.0, 215.0), (60.0, 90.0, 150.0), (70.0, 190.0, 80.0)))
    head = size * between(rng, 0.3, 0.4)
    shoulder = seat + size * 0.55
    z_head = shoulder + head * 0.85
    out = [
        prism((x, 0, seat + size * 0.28), size * 0.3, size * 0.56, shirt, sides=8, top_scale=0.75),
        prism((x + 0.01, 0, z_head - head * 0.2), head * 0.92, head, skin, sides=10, top_scale=1.0),
        prism((x, 0, z_head + head * 0.45), head, head * 0.4, cap, sides=10, top_scale=0.9),
        prism((x, 0, z_head + head * 0.78), head * 0.9, head * 0.26, cap, sides=10, top_scale=0.6),
        box((x + head * 0.95, 0, z_head - head * 0.1), (head * 0.4, head * 0.35, head * 0.35), shaded(skin, 0.95)),
    ]
    if chance(rng, 0.7):
        out.append(box((x + head * 0.9, 0, z_head + head * 0.32), (head * 0.7, head * 1.3, head * 0.12), cap))
    if chance(rng, 0.4):
        out.append(box((x + head * 0.75, 0, z_head - head * 0.35), (head * 0.5, head, head * 0.15), dark(rng)))
    for side in (-1, 1):
        out.append(
            rod(
                point(x, side * size * 0.28, shoulder - size * 0.06),
                point(arms_to, side * size * 0.16, shoulder - size * 0.2),
                size * 0.085,
                shirt,
            )
        )
        out.append(box((arms_to, side * size * 0.16, shoulder - size * 0.2), (size * 0.18,) * 3, light(rng)))
    return out
