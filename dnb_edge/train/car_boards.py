"""What rides on a small robot car: computers, batteries, speed controllers, wires, cameras, lidars, antennas, tags.

Knows these parts' shapes and colours; nothing of whole cars, cameras or pictures. Lengths are in the maker's unit (makers
build cars one unit long and scale them at the end); the car's nose is along +x, z up. Colours are blue, green, red.
"""

from __future__ import annotations

import itertools

import numpy as np

from dnb_edge.train.car_parts import any_colour, between, chance, dark, light, paint, pick, point, shaded, vivid
from dnb_edge.train.solids import Colour, FloatArray, Solid, box, pitched, prism, rod, turned

Rng = np.random.Generator

_WIRES: tuple[Colour, ...] = (
    (20, 20, 205),
    (15, 15, 15),
    (20, 150, 220),
    (230, 230, 230),
    (160, 60, 20),
    (40, 120, 230),
    (40, 210, 235),
    (60, 160, 50),
    (140, 50, 120),
)


def board_colour(rng: Rng) -> Colour:
    """A printed circuit board: green, blue, black, red, purple or white."""
    choices: tuple[Colour, ...] = (
        (55, 110, 25),
        (60, 80, 10),
        (120, 60, 10),
        (25, 25, 25),
        (28, 32, 28),
        (30, 25, 150),
        (110, 30, 90),
        (200, 205, 205),
        (50, 130, 30),
    )
    return shaded(pick(rng, choices), between(rng, 0.6, 1.25))


def board(rng: Rng, centre: tuple[float, float], z: float, length: float, width: float) -> tuple[list[Solid], float]:
    """A computer or a shield on stand-offs: pin header, ports along one end, chips, perhaps a heat sink with a fan.

    Returns the solids and the height of their top.
    """
    x, y = centre
    colour = board_colour(rng)
    lift = between(rng, 0.01, 0.05)
    z += lift
    out = [box((x, y, z), (length, width, 0.012), colour)]
    out += [
        box((x + sx * length, y + sy * width, z - lift / 2), (0.015, 0.015, lift), (90, 170, 190))
        for sx in (-0.46, 0.46)
        for sy in (-0.44, 0.44)
    ]
    side = pick(rng, (-1, 1))
    out.append(box((x, y + side * width * 0.42, z + 0.02), (length * 0.6, width * 0.09, 0.03), (25, 25, 25)))
    port_end = pick(rng, (-1, 1))
    top = z + 0.02
    for place in (-0.32, 0.0, 0.3):
        if chance(rng, 0.85):
            tall = between(rng, 0.03, 0.065)
            metal = (190.0, 195.0, 198.0) if chance(rng, 0.75) else (150.0, 90.0, 30.0)
            out.append(
                box(
                    (x + port_end * length * 0.4, y + place * width, z + tall / 2),
                    (length * 0.22, width * 0.22, tall),
                    metal,
                )
            )
            top = max(top, z + tall)
    for _ in range(int(rng.integers(2, 7))):
        size = length * between(rng, 0.05, 0.18)
        chip = dark(rng) if chance(rng, 0.7) else light(rng)
        place_x, place_y = x + length * between(rng, -0.35, 0.3), y + width * between(rng, -0.35, 0.35)
        out.append(box((place_x, place_y, z + 0.012), (size, size * between(rng, 0.6, 1.3), 0.014), chip))
    if chance(rng, 0.45):
        out += _heat_sink(rng, (x - port_end * length * 0.1, y), z + 0.01, width * between(rng, 0.4, 0.65))
        top = z + 0.07
    return out, top


def _heat_sink(rng: Rng, centre: tuple[float, float], z: float, size: float) -> list[Solid]:
    x, y = centre
    metal = pick(rng, ((175.0, 178.0, 180.0), (35.0, 35.0, 38.0), (40.0, 40.0, 170.0), (160.0, 80.0, 20.0)))
    out = [box((x, y, z + 0.012), (size, size, 0.02), metal)]
    out += [
        box((x, y + size * (i / 4 - 0.5) * 0.9, z + 0.035), (size, size * 0.07, 0.035), shaded(metal, 1.1))
        for i in range(5)
    ]
    if chance(rng, 0.5):
        out.append(box((x, y, z + 0.055), (size * 0.95, size * 0.95, 0.02), (28, 28, 30)))
        out.append(prism((x, y, z + 0.066), size * 0.42, 0.006, (55, 55, 58), sides=12))
        out.append(prism((x, y, z + 0.07), size * 0.14, 0.006, light(rng), sides=8))
    return out


def battery(rng: Rng, centre: tuple[float, float], z: float, length: float, width: float) -> tuple[list[Solid], float]:
    """A LiPo pack with a label and its two leads, or a power bank; returns the solids and the height of their top."""
    x, y = centre
    height = between(rng, 0.05, 0.1)
    case = pick(rng, (dark(rng), dark(rng), vivid(rng), light(rng), (190.0, 90.0, 30.0), (40.0, 200.0, 230.0)))
    out = [box((x, y, z + height / 2), (length, width, height), case)]
    label = paint(rng) if chance(rng, 0.7) else case
    out.append(
        box(
            (x + length * between(rng, -0.12, 0.12), y, z + height),
            (length * between(rng, 0.3, 0.75), width * between(rng, 0.6, 0.95), 0.006),
            label,
        )
    )
    if chance(rng, 0.5):
        strap = dark(rng) if chance(rng, 0.6) else vivid(rng)
        out += [
            box((x + sx * length, y, z + height / 2), (0.035, width * 1.04, height * 1.08), strap)
            for sx in (-0.25, 0.25)
        ]
    end = x + pick(rng, (-1, 1)) * length / 2
    for colour, sy in (((20.0, 20.0, 205.0), -0.2), ((15.0, 15.0, 15.0), 0.2)):
        start = point(end, y + sy * width, z + height * 0.7)
        out += wire(
            rng, start, start + point((end - x) * between(rng, 0.1, 0.4), between(rng, -0.1, 0.1), 0), colour, 0.011
        )
    return out, z + height


def cells(rng: Rng, centre: tuple[float, float], z: float, count: int) -> list[Solid]:
    """A holder with round 18650 cells side by side, along x."""
    x, y = centre
    sleeve = pick(
        rng, ((190.0, 90.0, 30.0), (60.0, 170.0, 60.0), (150.0, 50.0, 150.0), (40.0, 190.0, 225.0), (30.0, 60.0, 200.0))
    )
    pitch, length = 0.085, between(rng, 0.28, 0.34)
    out = [box((x, y, z + 0.02), (length * 1.12, pitch * count * 1.05, 0.04), (22, 22, 24))]
    return out + [
        prism((x, y + (i - (count - 1) / 2) * pitch, z + 0.05), 0.04, length, sleeve, sides=8, axis="x")
        for i in range(count)
    ]


def wire(rng: Rng, start: FloatArray, end: FloatArray, colour: Colour, radius: float) -> list[Solid]:
    """A wire that bows up or droops between two places."""
    bow = np.array([between(rng, -0.05, 0.05), between(rng, -0.06, 0.06), between(rng, -0.02, 0.12)])
    middle = (start + end) / 2 + bow
    s = np.array([[0.0], [0.25], [0.5], [0.75], [1.0]])
    points = start * (1 - s) ** 2 + middle * (2 * s * (1 - s)) + end * s**2
    points[:, 2] = np.maximum(points[:, 2], radius * 1.5)
    return [rod(a, b, radius, colour) for a, b in itertools.pairwise(points)]


def wires(rng: Rng, *, length: float, width: float, low: float, high: float, count: int) -> list[Solid]:
    """Single wires and, at times, a ribbon of several colours side by side, over a deck."""
    out: list[Solid] = []
    for _ in range(count):
        ends = [
            point(length * between(rng, -0.45, 0.45), width * between(rng, -0.48, 0.48), between(rng, low, high))
            for _ in range(2)
        ]
        radius = between(rng, 0.005, 0.011)
        strands = int(rng.integers(3, 6)) if chance(rng, 0.3) else 1
        shift = point(0, radius * 2, 0)
        state = int(rng.integers(2**31))
        first = int(rng.integers(len(_WIRES)))
        for strand in range(strands):
            same_bow = np.random.default_rng(state)
            colour = _WIRES[(first + strand) % len(_WIRES)]
            out += wire(same_bow, ends[0] + shift * strand, ends[1] + shift * strand, colour, radius)
    return out


def camera(rng: Rng, *, x: float, low: float, high: float, tilt_rad: float = 0.2) -> list[Solid]:
    """A camera board or a depth camera on a bracket, its lens to the front."""
    wide = chance(rng, 0.3)
    width = between(rng, 0.2, 0.3) if wide else between(rng, 0.06, 0.11)
    tall = 0.06 if wide else width
    case = pick(rng, (dark(rng), board_colour(rng), (185.0, 188.0, 190.0)))
    out = [box((x - 0.02, 0, (low + high) / 2), (0.02, between(rng, 0.03, 0.12), max(0.01, high - low)), dark(rng))]
    head = [box((x, 0, high), (0.03 if not wide else 0.06, width, tall), case)]
    lenses = (-0.3 * width, 0.3 * width) if wide else (0.0,)
    head += [prism((x + 0.03, y, high), 0.026, 0.03, (20, 20, 22), sides=8, axis="x") for y in lenses]
    return out + [pitched(part, tilt_rad, about_m=(x, 0, high)) for part in head]


def lidar(rng: Rng, *, x: float, z: float, radius: float) -> list[Solid]:
    """A spinning lidar: a flat base, a black (or orange-topped) turret."""
    out = [prism((x, 0, z + radius * 0.25), radius * 1.05, radius * 0.5, dark(rng), sides=16)]
    top = dark(rng) if chance(rng, 0.75) else pick(rng, ((190.0, 195.0, 195.0), (20.0, 110.0, 240.0)))
    turret = between(rng, 0.5, 1.1)
    out.append(
        prism(
            (x, 0, z + radius * (0.5 + turret / 2)),
            radius * 0.88,
            radius * turret,
            (26, 24, 24),
            sides=16,
            cap_colour=top,
        )
    )
    out.append(
        prism((x, 0, z + radius * (0.5 + turret * 0.55)), radius * 0.9, radius * turret * 0.3, (60, 30, 45), sides=16)
    )
    if chance(rng, 0.5):
        out.append(prism((x, 0, z + radius * (0.51 + turret)), radius * 0.4, radius * 0.06, any_colour(rng), sides=10))
    return out


def antenna(rng: Rng, *, x: float, y: float, z: float, height: float) -> list[Solid]:
    """A stick antenna, leaning a little, at times with a coloured tip."""
    top = point(x - between(rng, 0.0, 0.15) * height, y + between(rng, -0.15, 0.15) * height, z + height)
    thick = between(rng, 0.006, 0.016)
    out = [rod(point(x, y, z), top, thick, dark(rng) if chance(rng, 0.75) else light(rng))]
    if chance(rng, 0.2):
        out.append(box((float(top[0]), float(top[1]), float(top[2])), (0.03, 0.03, 0.03), vivid(rng)))
    return out


def tag_plate(rng: Rng, *, x: float, z: float, size: float) -> list[Solid]:
    """A square black-and-white marker lying flat: an AprilTag, more or less."""
    cells_across = int(rng.integers(4, 7))
    out = [
        box((0, 0, 0), (size * 1.25, size * 1.25, 0.008), (242, 242, 242)),
        box((0, 0, 0.004), (size, size, 0.006), (18, 18, 18)),
    ]
    step = size / (cells_across + 2)
    for i in range(cells_across):
        for j in range(cells_across):
            if chance(rng, 0.5):
                place = ((i - (cells_across - 1) / 2) * step, (j - (cells_across - 1) / 2) * step, 0.008)
                out.append(box(place, (step, step, 0.004), (240, 240, 240)))
    turn = between(rng, -0.06, 0.06)
    return [turned(part, turn, shift_m=(x, 0, z)) for part in out]


def eyes(rng: Rng, *, x: float, z: float) -> list[Solid]:
    """An ultrasonic sensor: a blue or black board with two silver cylinders to the front."""
    plate = (150.0, 80.0, 20.0) if chance(rng, 0.65) else dark(rng)
    cans = [
        prism((x + 0.04, side * 0.07, z), 0.045, 0.07, (185, 188, 190), sides=10, axis="x", cap_colour=(70, 72, 75))
        for side in (-1, 1)
    ]
    return [box((x, 0, z), (0.02, 0.24, 0.1), plate), *cans]


def electronics(
    rng: Rng, *, length: float, width: float, deck: float, wire_count: int | None = None
) -> tuple[list[Solid], float]:
    """Batteries, boards, a speed controller, a receiver and a servo spread over a deck, tied with wires.

    Returns the solids and the height of the highest board.
    """
    out: list[Solid] = []
    top = deck
    side = pick(rng, (-1, 1))
    if chance(rng, 0.8):
        along = between(rng, 0.3, 0.46)
        across = width * between(rng, 0.4, 0.75)
        parts, high = battery(
            rng, (between(rng, -0.15, 0.08), side * width * 0.12), deck, min(along, length * 0.8), across
        )
        out += parts
        top = max(top, high)
    for _ in range(int(rng.integers(1, 5))):
        size = (between(rng, 0.06, 0.14), between(rng, 0.05, 0.11), between(rng, 0.03, 0.09))
        place = (length * between(rng, -0.42, 0.4), width * between(rng, -0.4, 0.4), deck + size[2] / 2)
        colour = dark(rng) if chance(rng, 0.6) else paint(rng)
        out.append(box(place, size, colour))
        if chance(rng, 0.4):
            out.append(
                box((place[0], place[1], deck + size[2]), (size[0] * 0.6, size[1] * 0.6, 0.008), any_colour(rng))
            )
    for _ in range(int(rng.choice([0, 1, 2, 3], p=[0.1, 0.45, 0.3, 0.15]))):
        size_x, size_y = between(rng, 0.16, 0.34), min(width, between(rng, 0.13, 0.26))
        parts, high = board(
            rng, (length * between(rng, -0.22, 0.2), width * between(rng, -0.12, 0.12)), top, size_x, size_y
        )
        out += parts
        top = min(high, deck + 0.3)
    count = int(rng.integers(2, 10)) if wire_count is None else wire_count
    out += wires(rng, length=length, width=width, low=deck, high=top + 0.02, count=count)
    return out, top
