"""Screws and nuts, and the holes and pockets that take them in printed plastic.

Knows metric sizes (ISO 4762, 4032, 7040 rounded up to what is sold) and the 1/4"-20 camera thread, in mm. Knows no part.
Clearances are for a 0.4 mm nozzle: a printed hole comes out 0.1 to 0.3 mm smaller than drawn.
"""

import math
from dataclasses import dataclass

from build123d import Align, Cylinder, Part, Pos, RegularPolygon, Rot, extrude

LOW = (Align.CENTER, Align.CENTER, Align.MIN)


@dataclass(frozen=True, slots=True, kw_only=True)
class Screw:
    """One size of screw with its nut; all lengths in mm."""

    name: str
    hole_mm: float
    """Diameter of a hole that the screw passes without cutting a thread."""
    nut_flats_mm: float
    """Across the flats of the nut, as sold."""
    nut_mm: float
    """Height of the nut; of the self-locking kind where we ask for it (M5)."""
    head_mm: float
    """Diameter of a cylinder head or washer that must find room."""


M2 = Screw(name="M2", hole_mm=2.4, nut_flats_mm=4.0, nut_mm=1.6, head_mm=4.5)
M2_5 = Screw(name="M2.5", hole_mm=2.9, nut_flats_mm=5.0, nut_mm=2.0, head_mm=5.5)
M3 = Screw(name="M3", hole_mm=3.4, nut_flats_mm=5.5, nut_mm=2.4, head_mm=6.5)
M4 = Screw(name="M4", hole_mm=4.5, nut_flats_mm=7.0, nut_mm=3.2, head_mm=8.0)
M5 = Screw(name="M5", hole_mm=5.5, nut_flats_mm=8.0, nut_mm=5.0, head_mm=10.0)
CAMERA = Screw(name='1/4"-20', hole_mm=6.8, nut_flats_mm=11.12, nut_mm=5.6, head_mm=13.0)

TRAP_PLAY_MM = 0.3
"""Added across the flats of a pocket, so that the nut goes in by hand and cannot turn."""
TRAP_EXTRA_DEPTH_MM = 0.4


def trap_flats_mm(screw: Screw) -> float:
    """Across the flats of the pocket for this screw's nut."""
    return screw.nut_flats_mm + TRAP_PLAY_MM


def trap_depth_mm(screw: Screw) -> float:
    """Depth of a pocket in which the nut lies flush."""
    return screw.nut_mm + TRAP_EXTRA_DEPTH_MM


def bore(diameter_mm: float, length_mm: float) -> Part:
    """A round cutter from z = 0 upwards."""
    return Cylinder(diameter_mm / 2, length_mm, align=LOW)


def nut_pocket(screw: Screw, depth_mm: float | None = None) -> Part:
    """A hexagonal cutter from z = 0 upwards, flats facing +-y, as deep as the nut where no depth is given."""
    circumradius = trap_flats_mm(screw) / math.sqrt(3)
    depth = trap_depth_mm(screw) if depth_mm is None else depth_mm
    return extrude(RegularPolygon(circumradius, 6), amount=depth)


def through(screw: Screw, thickness_mm: float, *, pocket_at_z0: bool) -> Part:
    """A cutter for a screw through a wall from z = 0 to `thickness_mm`, with its nut's pocket at one end."""
    cutter = Pos(0, 0, -1) * bore(screw.hole_mm, thickness_mm + 2)
    pocket = nut_pocket(screw, trap_depth_mm(screw) + 1)
    if pocket_at_z0:
        return cutter + Pos(0, 0, -1) * pocket
    return cutter + Pos(0, 0, thickness_mm + 1) * Rot(180, 0, 0) * pocket
