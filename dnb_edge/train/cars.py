"""Miniature cars of many looks, as solids: open chassis, shells, formula cars, two-wheelers with castors, boxes and discs.

Knows what small robot cars are built of; nothing of cameras or pictures. Every car stands on z = 0 with the centre of its
footprint (the middle of its wheel contacts) at the origin and its nose along +x.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np

from dnb_edge.train.solids import Colour, Solid, box, pitched, prism, rod

Rng = np.random.Generator


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


def board_colour(rng: Rng) -> Colour:
    """A printed circuit board: green, blue, black, red or white."""
    choices: tuple[Colour, ...] = (
        (40, 110, 20),
        (60, 80, 10),
        (120, 60, 10),
        (25, 25, 25),
        (30, 25, 140),
        (200, 205, 205),
        (50, 90, 40),
    )
    base = choices[int(rng.integers(len(choices)))]
    gain = float(rng.uniform(0.6, 1.3))
    return (base[0] * gain, base[1] * gain, base[2] * gain)


def _wheels(rng: Rng, *, wheelbase_m: float, gauge_m: float, radius_m: float, width_m: float) -> list[Solid]:
    tyre = dark(rng) if rng.random() < 0.85 else any_colour(rng)
    hub = any_colour(rng) if rng.random() < 0.8 else tyre
    out: list[Solid] = []
    sides = int(rng.integers(8, 13))
    for x in (-wheelbase_m / 2, wheelbase_m / 2):
        for y in (-gauge_m / 2, gauge_m / 2):
            out.append(prism((x, y, radius_m), radius_m, width_m, tyre, sides=sides, axis="y"))
            out.append(
                prism(
                    (x, y, radius_m), radius_m * float(rng.uniform(0.45, 0.7)), width_m * 1.06, hub, sides=8, axis="y"
                )
            )
    return out


def _clutter_on_top(rng: Rng, *, length_m: float, width_m: float, deck_m: float) -> list[Solid]:
    """Boards, batteries, chips, connectors and wires on a deck."""
    out: list[Solid] = []
    z = deck_m
    for _ in range(int(rng.integers(1, 4))):
        thickness = length_m * float(rng.uniform(0.015, 0.14))
        size = (length_m * float(rng.uniform(0.25, 0.6)), width_m * float(rng.uniform(0.35, 0.8)), thickness)
        colour = board_colour(rng) if rng.random() < 0.65 else any_colour(rng)
        x = length_m * float(rng.uniform(-0.18, 0.18))
        y = width_m * float(rng.uniform(-0.08, 0.08))
        z += float(rng.uniform(0.0, 0.07)) * length_m + thickness / 2
        out.append(box((x, y, z), size, colour))
        z += thickness / 2
        for _ in range(int(rng.integers(1, 7))):
            chip = length_m * rng.uniform(0.02, 0.1, 2)
            chip_height = length_m * float(rng.uniform(0.01, 0.06))
            place = (
                x + size[0] * float(rng.uniform(-0.4, 0.4)),
                y + size[1] * float(rng.uniform(-0.4, 0.4)),
                z + chip_height / 2,
            )
            out.append(box(place, (float(chip[0]), float(chip[1]), chip_height), any_colour(rng)))
    for _ in range(int(rng.integers(0, 6))):
        out.extend(_wire(rng, length_m=length_m, width_m=width_m, z_m=z))
    return out


def _wire(rng: Rng, *, length_m: float, width_m: float, z_m: float) -> list[Solid]:
    colours: tuple[Colour, ...] = (
        (20, 20, 200),
        (15, 15, 15),
        (20, 150, 220),
        (230, 230, 230),
        (160, 60, 20),
        (40, 120, 230),
    )
    colour = colours[int(rng.integers(len(colours)))]
    start = np.array([length_m * rng.uniform(-0.4, 0.4), width_m * rng.uniform(-0.4, 0.4), z_m * rng.uniform(0.5, 1.0)])
    points = [start]
    for _ in range(int(rng.integers(2, 5))):
        step = rng.normal(0, 0.12, 3) * length_m
        following = points[-1] + step
        following[2] = float(np.clip(following[2], 0.3 * z_m, 1.25 * z_m))
        following[:2] = np.clip(following[:2], [-length_m * 0.5, -width_m * 0.5], [length_m * 0.5, width_m * 0.5])
        points.append(following)
    radius = length_m * float(rng.uniform(0.006, 0.015))
    return [rod(a, b, radius, colour) for a, b in itertools.pairwise(points)]


def _wing(rng: Rng, *, length_m: float, width_m: float, height_m: float, x_m: float) -> list[Solid]:
    colour = dark(rng) if rng.random() < 0.6 else any_colour(rng)
    span = width_m * float(rng.uniform(0.6, 1.05))
    chord = length_m * float(rng.uniform(0.08, 0.2))
    z = height_m + length_m * float(rng.uniform(0.05, 0.28))
    blade = pitched(
        box((x_m, 0, z), (chord, span, length_m * 0.02), colour), float(rng.uniform(-0.5, 0.1)), about_m=(x_m, 0, z)
    )
    plates = [box((x_m, side * span / 2, z), (chord, length_m * 0.02, chord * 0.7), colour) for side in (-1, 1)]
    stays = [
        rod(
            np.array([x_m, side * span * 0.2, height_m * 0.5]),
            np.array([x_m, side * span * 0.2, z]),
            length_m * 0.02,
            colour,
        )
        for side in (-1, 1)
    ]
    return [blade, *stays, *(plates if rng.random() < 0.6 else [])]


def _mast(rng: Rng, *, length_m: float, deck_m: float) -> list[Solid]:
    """A camera on a stick, a lidar, or an antenna."""
    kind = rng.random()
    x = length_m * float(rng.uniform(-0.3, 0.4))
    if kind < 0.4:
        z = deck_m + length_m * float(rng.uniform(0.1, 0.35))
        stick = rod(np.array([x, 0.0, deck_m]), np.array([x, 0.0, z]), length_m * 0.02, dark(rng))
        width = length_m * float(rng.uniform(0.08, 0.3))
        return [stick, box((x, 0, z), (length_m * 0.06, width, length_m * 0.07), any_colour(rng))]
    if kind < 0.75:
        radius = length_m * float(rng.uniform(0.08, 0.16))
        z = deck_m + length_m * float(rng.uniform(0.02, 0.2))
        return [prism((x, 0, z), radius, length_m * 0.1, dark(rng), sides=12, cap_colour=any_colour(rng))]
    y = length_m * float(rng.uniform(-0.1, 0.1))
    top = np.array([x - 0.1 * length_m, y, deck_m + length_m * float(rng.uniform(0.3, 0.7))])
    return [rod(np.array([x, y, deck_m]), top, length_m * 0.012, dark(rng))]


def open_chassis(rng: Rng, length_m: float) -> list[Solid]:
    """A radio-controlled chassis with boards, batteries, wires, shock absorbers, often a wing or a mast."""
    width = length_m / float(rng.uniform(1.25, 2.1))
    radius = length_m * float(rng.uniform(0.08, 0.17))
    wheel_width = radius * float(rng.uniform(0.5, 1.2))
    wheelbase = length_m * float(rng.uniform(0.58, 0.78))
    out = _wheels(rng, wheelbase_m=wheelbase, gauge_m=width - wheel_width, radius_m=radius, width_m=wheel_width)
    deck = radius * float(rng.uniform(0.7, 1.8))
    plate = any_colour(rng) if rng.random() < 0.3 else dark(rng)
    out.append(
        box(
            (0, 0, deck),
            (length_m * float(rng.uniform(0.75, 0.95)), width * float(rng.uniform(0.35, 0.7)), length_m * 0.04),
            plate,
        )
    )
    if rng.random() < 0.6:
        bumper = length_m * 0.46
        out.append(
            box(
                (bumper, 0, deck * 0.8),
                (length_m * 0.08, width * float(rng.uniform(0.4, 0.9)), length_m * 0.06),
                dark(rng),
            )
        )
    if rng.random() < 0.5:
        shock = any_colour(rng)
        for x in (-wheelbase / 2, wheelbase / 2):
            for side in (-1, 1):
                low = np.array([x, side * width * 0.3, radius])
                out.append(
                    rod(low, np.array([x * 0.92, side * width * 0.16, deck + length_m * 0.14]), length_m * 0.018, shock)
                )
    out.extend(_clutter_on_top(rng, length_m=length_m, width_m=width, deck_m=deck + length_m * 0.02))
    if rng.random() < 0.35:
        out.extend(
            _wing(
                rng,
                length_m=length_m,
                width_m=width,
                height_m=deck + 0.12 * length_m,
                x_m=-length_m * float(rng.uniform(0.35, 0.48)),
            )
        )
    if rng.random() < 0.45:
        out.extend(_mast(rng, length_m=length_m, deck_m=deck + length_m * 0.1))
    return out


def shell(rng: Rng, length_m: float) -> list[Solid]:
    """A closed car body with a cabin, windows, half-hidden wheels and sometimes a stripe, a wing, or boards on the roof."""
    width = length_m / float(rng.uniform(1.7, 2.4))
    radius = length_m * float(rng.uniform(0.06, 0.11))
    wheel_width = width * 0.18
    out = _wheels(
        rng, wheelbase_m=length_m * 0.6, gauge_m=width - wheel_width * 0.8, radius_m=radius, width_m=wheel_width
    )
    paint = any_colour(rng)
    body_height = length_m * float(rng.uniform(0.12, 0.2))
    base = radius * float(rng.uniform(0.5, 0.9))
    lower = box(
        (0, 0, base + body_height / 2),
        (length_m, width, body_height),
        paint,
        taper=(float(rng.uniform(0.85, 0.97)), 0.9),
    )
    out.append(lower)
    cabin_length = length_m * float(rng.uniform(0.4, 0.62))
    cabin_height = length_m * float(rng.uniform(0.09, 0.17))
    cabin_x = length_m * float(rng.uniform(-0.15, 0.03))
    cabin = box(
        (cabin_x, 0, base + body_height + cabin_height / 2),
        (cabin_length, width * 0.85, cabin_height),
        paint,
        taper=(float(rng.uniform(0.5, 0.8)), float(rng.uniform(0.75, 0.9))),
        shift_top_m=length_m * float(rng.uniform(-0.05, 0.02)),
    )
    glass = dark(rng) if rng.random() < 0.7 else paint
    roof = paint if rng.random() < 0.7 else any_colour(rng)
    cabin_faces = (paint, roof, glass, glass, glass, glass)
    out.append(Solid(vertices_m=cabin.vertices_m, faces=cabin.faces, colour=paint, face_colours=cabin_faces))
    top = base + body_height
    if rng.random() < 0.4:
        out.append(
            box(
                (0, 0, top + 0.002 * length_m),
                (length_m * 0.84, width * float(rng.uniform(0.1, 0.3)), length_m * 0.006),
                any_colour(rng),
            )
        )
    for side in (-1, 1):
        out.append(
            box(
                (length_m * 0.47, side * width * 0.3, top * 0.8),
                (length_m * 0.05, width * 0.18, length_m * 0.04),
                (220, 235, 240),
            )
        )
        out.append(
            box(
                (-length_m * 0.47, side * width * 0.3, top * 0.8),
                (length_m * 0.05, width * 0.18, length_m * 0.04),
                (30, 20, 190),
            )
        )
    if rng.random() < 0.3:
        out.extend(_wing(rng, length_m=length_m, width_m=width, height_m=top, x_m=-length_m * 0.44))
    if rng.random() < 0.25:
        out.extend(_clutter_on_top(rng, length_m=length_m * 0.8, width_m=width * 0.8, deck_m=top + cabin_height))
    return out


def formula(rng: Rng, length_m: float) -> list[Solid]:
    """A narrow body with open wheels, front and rear wings and a driver's head: also a go-kart or a slot car."""
    width = length_m / float(rng.uniform(1.5, 2.3))
    radius = length_m * float(rng.uniform(0.06, 0.1))
    out = _wheels(
        rng,
        wheelbase_m=length_m * 0.62,
        gauge_m=width * 0.84,
        radius_m=radius,
        width_m=width * float(rng.uniform(0.14, 0.26)),
    )
    paint = any_colour(rng)
    height = length_m * float(rng.uniform(0.1, 0.18))
    out.append(
        box(
            (0, 0, radius * 0.6 + height / 2),
            (length_m * 0.92, width * float(rng.uniform(0.35, 0.6)), height),
            paint,
            taper=(0.9, 0.7),
        )
    )
    out.append(
        box(
            (-0.05 * length_m, 0, radius),
            (length_m * 0.4, width * 0.75, height * 0.8),
            any_colour(rng),
            taper=(0.9, 0.9),
        )
    )
    out.append(box((length_m * 0.46, 0, radius * 0.7), (length_m * 0.1, width * 0.9, length_m * 0.02), any_colour(rng)))
    head = length_m * float(rng.uniform(0.05, 0.12))
    out.append(
        prism(
            (-0.05 * length_m, 0, radius + height + head * 0.6),
            head,
            head * 1.7,
            any_colour(rng),
            sides=8,
            top_scale=0.6,
        )
    )
    if rng.random() < 0.6:
        out.extend(_wing(rng, length_m=length_m, width_m=width, height_m=radius + height * 0.6, x_m=-length_m * 0.45))
    return out


def two_wheeler(rng: Rng, length_m: float) -> list[Solid]:
    """Two driven wheels and a castor: a school robot, an open one with boards or a closed box."""
    width = length_m / float(rng.uniform(0.9, 1.4))
    radius = length_m * float(rng.uniform(0.13, 0.24))
    axle = length_m * float(rng.uniform(0.1, 0.3)) * (1 if rng.random() < 0.7 else -1)
    wheel_width = width * float(rng.uniform(0.08, 0.16))
    tyre, hub = (dark(rng) if rng.random() < 0.7 else any_colour(rng)), any_colour(rng)
    out: list[Solid] = []
    for side in (-1, 1):
        y = side * (width - wheel_width) / 2
        out.append(prism((axle, y, radius), radius, wheel_width, tyre, sides=12, axis="y"))
        out.append(prism((axle, y, radius), radius * 0.65, wheel_width * 1.06, hub, sides=8, axis="y"))
    castor = length_m * 0.07
    out.append(
        prism(
            (-math.copysign(length_m * 0.36, axle), 0, castor),
            castor,
            castor * 2,
            (170, 175, 180),
            sides=8,
            top_scale=0.6,
        )
    )
    deck = radius * float(rng.uniform(0.7, 1.4))
    body = any_colour(rng)
    if rng.random() < 0.4:
        height = length_m * float(rng.uniform(0.2, 0.45))
        out.append(
            box((0, 0, deck * 0.6 + height / 2), (length_m * 0.9, width * 0.72, height), body, taper=(0.9, 0.95))
        )
        deck = deck * 0.6 + height
    else:
        out.append(box((0, 0, deck), (length_m * 0.92, width * 0.7, length_m * 0.05), body))
    if rng.random() < 0.85:
        out.extend(_clutter_on_top(rng, length_m=length_m * 0.85, width_m=width * 0.75, deck_m=deck))
    if rng.random() < 0.5:
        out.extend(_mast(rng, length_m=length_m, deck_m=deck + length_m * 0.1))
    return out


def box_robot(rng: Rng, length_m: float) -> list[Solid]:
    """A box on hidden or small wheels, or a disc, with something on top."""
    height = length_m * float(rng.uniform(0.2, 0.6))
    clearance = length_m * 0.04
    top = clearance + height
    out: list[Solid] = []
    if rng.random() < 0.4:
        body = prism(
            (0, 0, clearance + height / 2), length_m / 2, height, any_colour(rng), sides=16, cap_colour=any_colour(rng)
        )
        width = length_m
        out.append(body)
    else:
        width = length_m / float(rng.uniform(1.1, 1.9))
        out.append(box((0, 0, clearance + height / 2), (length_m, width * 0.85, height), any_colour(rng)))
        radius = length_m * float(rng.uniform(0.09, 0.16))
        out.extend(_wheels(rng, wheelbase_m=length_m * 0.6, gauge_m=width, radius_m=radius, width_m=radius * 0.8))
    if rng.random() < 0.7:
        out.extend(_clutter_on_top(rng, length_m=length_m * 0.8, width_m=width * 0.8, deck_m=top))
    if rng.random() < 0.4:
        out.extend(_mast(rng, length_m=length_m, deck_m=top))
    return out


_KINDS: tuple[tuple[Callable[[Rng, float], list[Solid]], float], ...] = (
    (open_chassis, 0.45),
    (shell, 0.2),
    (formula, 0.11),
    (two_wheeler, 0.14),
    (box_robot, 0.1),
)


def any_car(rng: Rng, length_m: float) -> list[Solid]:
    """One car of a random kind and look, `length_m` long."""
    weights = np.array([weight for _, weight in _KINDS])
    kind = _KINDS[int(rng.choice(len(_KINDS), p=weights / weights.sum()))][0]
    return kind(rng, length_m)
