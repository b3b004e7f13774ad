"""Parts that miniature cars are built of: paints, wheels, boards with wires, wings, masts.

Knows the parts' shapes and colours; nothing of whole cars, cameras or pictures. Metres, the car's nose along +x, z up.
"""

from __future__ import annotations

import itertools

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


def wheels(rng: Rng, *, wheelbase_m: float, gauge_m: float, radius_m: float, width_m: float) -> list[Solid]:
    """Four wheels with hubs that stand on z = 0."""
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


def clutter_on_top(rng: Rng, *, length_m: float, width_m: float, deck_m: float) -> list[Solid]:
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


def wing(rng: Rng, *, length_m: float, width_m: float, height_m: float, x_m: float) -> list[Solid]:
    """A wing on stays, sometimes with end plates."""
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


def mast(rng: Rng, *, length_m: float, deck_m: float) -> list[Solid]:
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
