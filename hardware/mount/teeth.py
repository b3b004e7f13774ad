"""Face teeth: two discs that lock at equal steps when pressed together, as in a Hirth coupling.

Knows one crown of teeth. Every crest and every root is a straight line through the axis at the pitch plane z = 0, so
all flanks are planes, two crowns of one number of teeth touch along whole flanks, and the crown is a polyhedron.
"""

import math
from dataclasses import dataclass, replace

from build123d import Face, Part, Rot, Shell, Solid, Wire

Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Crown:
    """Teeth round the z axis between two radii, in mm; flanks of 45 degrees, which print without support."""

    teeth: int
    inner_mm: float
    outer_mm: float
    blunt: float = 0.15
    """Part of the height cut off each crest: it can be printed, and two crowns never touch crest to root."""

    @property
    def step_deg(self) -> float:
        """Degrees from tooth to tooth."""
        return 360 / self.teeth

    @property
    def height_mm(self) -> float:
        """From root to unblunted crest at the outer radius: half the pitch there, since flanks have 45 degrees."""
        return math.pi * self.outer_mm / self.teeth

    @property
    def crest_mm(self) -> float:
        """Highest point above the pitch plane."""
        return self.height_mm * (0.5 - self.blunt)

    @property
    def root_mm(self) -> float:
        """Depth of the lowest point below the pitch plane."""
        return self.height_mm * 0.5

    def longer(self, more_mm: float) -> "Crown":
        """The same flanks, reaching further in and out by so much."""
        return replace(self, inner_mm=self.inner_mm - more_mm, outer_mm=self.outer_mm + more_mm)


def crown(size: Crown, floor_mm: float) -> Part:
    """The teeth, crests up, one of them along +x, standing on a flat floor `floor_mm` below the pitch plane."""
    pitch = 2 * math.pi / size.teeth
    profile = [
        line
        for tooth in range(size.teeth)
        for line in (
            (tooth * pitch - size.blunt * pitch / 2, size.crest_mm),
            (tooth * pitch + size.blunt * pitch / 2, size.crest_mm),
            ((tooth + 0.5) * pitch, -size.root_mm),
        )
    ]

    def on_tooth(radius: float, index: int) -> Point:
        angle, z = profile[index % len(profile)]
        return radius * math.cos(angle), radius * math.sin(angle), z * radius / size.outer_mm

    def on_floor(radius: float, index: int) -> Point:
        x, y, _ = on_tooth(radius, index)
        return x, y, -floor_mm

    inner, outer = size.inner_mm, size.outer_mm
    faces = []
    for i in range(len(profile)):
        j = i + 1
        faces.append(_face(on_tooth(inner, i), on_tooth(outer, i), on_tooth(outer, j), on_tooth(inner, j)))
        faces.append(_face(on_tooth(outer, i), on_floor(outer, i), on_floor(outer, j), on_tooth(outer, j)))
        faces.append(_face(on_tooth(inner, i), on_tooth(inner, j), on_floor(inner, j), on_floor(inner, i)))
    rim = [Wire.make_polygon([on_floor(r, i) for i in range(len(profile))], close=True) for r in (outer, inner)]
    faces.append(Face(rim[0], [rim[1]]))
    return Part(Solid(Shell(faces)).wrapped)


def facing_down(size: Crown, floor_mm: float) -> Part:
    """The same teeth, crests down, turned by half a tooth: at the same pitch plane they fit into `crown`'s."""
    return Rot(0, 0, size.step_deg / 2) * Rot(180, 0, 0) * crown(size, floor_mm)


def _face(*corners: Point) -> Face:
    return Face(Wire.make_polygon(corners, close=True))
