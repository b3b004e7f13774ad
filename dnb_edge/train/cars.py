"""Miniature cars of many looks, as solids: open chassis, shells, formula cars, two-wheelers with castors, boxes and discs.

Knows what small robot cars are built of; nothing of cameras or pictures. Every car stands on z = 0 with the centre of its
footprint (the middle of its wheel contacts) at the origin and its nose along +x.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from dnb_edge.train.car_parts import any_colour, clutter_on_top, dark, mast, wheels, wing
from dnb_edge.train.solids import Solid, box, prism, rod

Rng = np.random.Generator


def open_chassis(rng: Rng, length_m: float) -> list[Solid]:
    """A radio-controlled chassis with boards, batteries, wires, shock absorbers, often a wing or a mast."""
    width = length_m / float(rng.uniform(1.25, 2.1))
    radius = length_m * float(rng.uniform(0.08, 0.17))
    wheel_width = radius * float(rng.uniform(0.5, 1.2))
    wheelbase = length_m * float(rng.uniform(0.58, 0.78))
    out = wheels(rng, wheelbase_m=wheelbase, gauge_m=width - wheel_width, radius_m=radius, width_m=wheel_width)
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
    out.extend(clutter_on_top(rng, length_m=length_m, width_m=width, deck_m=deck + length_m * 0.02))
    if rng.random() < 0.35:
        out.extend(
            wing(
                rng,
                length_m=length_m,
                width_m=width,
                height_m=deck + 0.12 * length_m,
                x_m=-length_m * float(rng.uniform(0.35, 0.48)),
            )
        )
    if rng.random() < 0.45:
        out.extend(mast(rng, length_m=length_m, deck_m=deck + length_m * 0.1))
    return out


def shell(rng: Rng, length_m: float) -> list[Solid]:
    """A closed car body with a cabin, windows, half-hidden wheels and sometimes a stripe, a wing, or boards on the roof."""
    width = length_m / float(rng.uniform(1.7, 2.4))
    radius = length_m * float(rng.uniform(0.06, 0.11))
    wheel_width = width * 0.18
    out = wheels(
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
        out.extend(wing(rng, length_m=length_m, width_m=width, height_m=top, x_m=-length_m * 0.44))
    if rng.random() < 0.25:
        out.extend(clutter_on_top(rng, length_m=length_m * 0.8, width_m=width * 0.8, deck_m=top + cabin_height))
    return out


def formula(rng: Rng, length_m: float) -> list[Solid]:
    """A narrow body with open wheels, front and rear wings and a driver's head: also a go-kart or a slot car."""
    width = length_m / float(rng.uniform(1.5, 2.3))
    radius = length_m * float(rng.uniform(0.06, 0.1))
    out = wheels(
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
        out.extend(wing(rng, length_m=length_m, width_m=width, height_m=radius + height * 0.6, x_m=-length_m * 0.45))
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
        out.extend(clutter_on_top(rng, length_m=length_m * 0.85, width_m=width * 0.75, deck_m=deck))
    if rng.random() < 0.5:
        out.extend(mast(rng, length_m=length_m, deck_m=deck + length_m * 0.1))
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
        out.extend(wheels(rng, wheelbase_m=length_m * 0.6, gauge_m=width, radius_m=radius, width_m=radius * 0.8))
    if rng.random() < 0.7:
        out.extend(clutter_on_top(rng, length_m=length_m * 0.8, width_m=width * 0.8, deck_m=top))
    if rng.random() < 0.4:
        out.extend(mast(rng, length_m=length_m, deck_m=top))
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
