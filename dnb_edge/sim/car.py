"""The simulated cars: a small open robot car of chassis, wheels, battery, board and wing, in the style of lab kits, and painted
ones for races of several, open or with a body over the works.

Knows the car's own shape in metres and colours; knows no track and no camera. The car's frame: origin at the ground point
(centre of the footprint on the floor), x ahead, y to the left, z up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dnb_edge.sim.driver import Pose
from dnb_edge.sim.solids import Colour, Mesh, Solid, box, cylinder, mesh

LENGTH_M = 0.235
WIDTH_M = 0.165

_TYRE: Colour = (38, 36, 36)
_HUBS: tuple[Colour, ...] = ((40, 200, 235), (215, 215, 215), (60, 60, 225))
_PLATE: Colour = (58, 54, 52)
_BOARDS: tuple[Colour, ...] = ((86, 128, 24), (150, 82, 22), (48, 120, 40))
_BATTERIES: tuple[Colour, ...] = ((190, 110, 30), (40, 60, 205), (60, 190, 230))
_WINGS: tuple[Colour, ...] = ((45, 45, 200), (35, 140, 240), (190, 90, 40))
_CHIP: Colour = (40, 38, 36)
_METAL: Colour = (196, 200, 202)
_BRASS: Colour = (92, 168, 200)
_GLASS: Colour = (62, 52, 46)


@dataclass(frozen=True, slots=True, kw_only=True)
class Paint:
    """What a car is painted with."""

    name: str
    bgr: Colour

    @property
    def hex(self) -> str:
        """#rrggbb."""
        blue, green, red = map(round, self.bgr)
        return f"#{red:02x}{green:02x}{blue:02x}"


PAINTS: tuple[Paint, ...] = (
    Paint(name="red", bgr=(40, 36, 214)),
    Paint(name="blue", bgr=(214, 96, 20)),
    Paint(name="yellow", bgr=(24, 208, 240)),
    Paint(name="green", bgr=(60, 170, 40)),
    Paint(name="white", bgr=(240, 242, 242)),
    Paint(name="purple", bgr=(190, 40, 130)),
    Paint(name="orange", bgr=(20, 120, 246)),
    Paint(name="cyan", bgr=(230, 200, 30)),
)
"""The cars' paints in races of several, in the order of their numbers."""


def car_mesh(seed: int) -> Mesh:
    """The car that `seed` chooses, in the car's frame."""
    random = np.random.default_rng([seed, 2])
    hub, board, battery, wing = (choice[random.integers(3)] for choice in (_HUBS, _BOARDS, _BATTERIES, _WINGS))
    return mesh([*_wheels(hub), *_chassis(wing), *_battery(battery), *_electronics(board), *_wing(wing)])


def painted_car_mesh(seed: int, number: int) -> Mesh:
    """Car `number`, from 0, of a race of several: painted `PAINTS[number]`, of one of three bodies in turn."""
    random = np.random.default_rng([seed, 2, number])
    paint = PAINTS[number].bgr
    hub, board, battery = (choice[random.integers(3)] for choice in (_HUBS, _BOARDS, _BATTERIES))
    below = [*_wheels(hub), *_chassis(paint)]
    bodies = (_painted_open(paint, board, battery), _saloon(paint), _pickup(paint))
    return mesh([*below, *bodies[number % len(bodies)]])


def posed(car: Mesh, pose: Pose) -> Mesh:
    """`car` of the car's frame brought to the world at `pose`."""
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    rotation = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return car.moved(rotation, np.array([*pose.track_m, 0.0]))


def _wheels(hub: Colour) -> list[Solid]:
    return [
        cylinder((x, y, 0.033), 0.033, 0.028, 1, _TYRE, cap=hub, layer=0)
        for x in (-0.074, 0.078)
        for y in (-0.068, 0.068)
    ]


def _chassis(accent: Colour) -> list[Solid]:
    return [
        box((0.0, 0.0, 0.034), (0.205, 0.092, 0.008), _PLATE, layer=1, top=(72, 68, 66)),
        box((0.106, 0.0, 0.034), (0.018, 0.142, 0.018), accent, layer=1),
        box((-0.108, 0.0, 0.034), (0.012, 0.100, 0.014), _PLATE, layer=1),
        box((-0.074, 0.0, 0.033), (0.016, 0.112, 0.012), _METAL, layer=0),
        box((0.078, 0.0, 0.033), (0.012, 0.112, 0.010), _METAL, layer=0),
    ]


def _battery(colour: Colour) -> list[Solid]:
    return [
        box((-0.048, 0.0, 0.053), (0.084, 0.046, 0.030), colour, layer=2),
        box((-0.048, 0.0, 0.0685), (0.040, 0.034, 0.001), (228, 230, 230), layer=3),
    ]


def _electronics(board: Colour) -> list[Solid]:
    parts = [
        cylinder((x, y, 0.052), 0.003, 0.03, 2, _BRASS, layer=2, sides=6) for x in (0.012, 0.078) for y in (-0.03, 0.03)
    ]
    parts.append(box((0.045, 0.0, 0.068), (0.085, 0.066, 0.004), board, layer=3))
    parts += [
        box((0.050, 0.004, 0.073), (0.020, 0.020, 0.006), _CHIP, layer=4),
        box((0.026, -0.014, 0.072), (0.013, 0.012, 0.004), _CHIP, layer=4),
        box((0.045, 0.028, 0.075), (0.062, 0.006, 0.010), _CHIP, layer=4),
        box((0.014, 0.012, 0.076), (0.017, 0.016, 0.012), _METAL, layer=4),
        box((0.014, -0.022, 0.075), (0.015, 0.012, 0.010), _METAL, layer=4),
        box((0.074, -0.018, 0.074), (0.016, 0.018, 0.008), (224, 222, 220), layer=4),
        box((0.092, 0.0, 0.085), (0.006, 0.028, 0.030), (60, 58, 56), layer=5),
        cylinder((0.097, 0.0, 0.092), 0.008, 0.008, 0, (30, 28, 28), layer=6, cap=(120, 70, 60), sides=10),
    ]
    return parts


def _wing(colour: Colour) -> list[Solid]:
    struts = [box((-0.098, y, 0.068), (0.008, 0.004, 0.062), _PLATE, layer=3) for y in (-0.035, 0.035)]
    return [*struts, box((-0.104, 0.0, 0.100), (0.036, 0.128, 0.004), colour, layer=7)]


def _painted_open(paint: Colour, board: Colour, battery: Colour) -> list[Solid]:
    """The open car with a painted deck, whose board sits ahead of the wing."""
    deck = box((-0.005, 0.0, 0.043), (0.190, 0.100, 0.006), paint, layer=2)
    return [deck, *_battery(battery), *_electronics(board), *_wing(paint)]


def _saloon(paint: Colour) -> list[Solid]:
    """A closed body: bonnet and boot in one, and a cabin with dark windows under a painted roof."""
    return [
        box((0.0, 0.0, 0.060), (0.216, 0.108, 0.034), paint, layer=2),
        box((-0.012, 0.0, 0.089), (0.098, 0.092, 0.024), _GLASS, layer=3, top=paint),
        box((0.106, 0.0, 0.060), (0.004, 0.080, 0.014), (222, 228, 230), layer=4),
    ]


def _pickup(paint: Colour) -> list[Solid]:
    """A cab ahead, an open bed behind it."""
    return [
        box((0.0, 0.0, 0.056), (0.214, 0.112, 0.026), paint, layer=2),
        box((-0.058, 0.0, 0.0695), (0.080, 0.088, 0.001), (74, 70, 68), layer=3),
        box((0.018, 0.0, 0.085), (0.062, 0.100, 0.032), _GLASS, layer=3, top=paint),
        *(box((-0.058, y, 0.076), (0.092, 0.008, 0.014), paint, layer=3) for y in (-0.052, 0.052)),
    ]
