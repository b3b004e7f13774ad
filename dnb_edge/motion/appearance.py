"""What tells one car from another besides its motion: the number on its roof, its colour, which way it points.

Knows single sightings and what was learnt of a car from them. Knows no frame, no life cycle and no track.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

from dnb_edge.values import Observation

Colour: TypeAlias = tuple[float, float, float]
"""Blue, green, red, 0..255 each."""

MARKER_COST = 100.0
"""Cost of another number on the roof: more than any distance inside the gate."""

COLOUR_CAP = 16.0
"""Greatest cost of a wrong colour in one frame: a patch of light must not outweigh everything else."""

DISTINCT = 8.0
"""Squared distance of two cars' colours, in their spreads, from which on colour tells them apart."""

HEADING_WEIGHT = 1.0
HEADING_SPEED_MPS = 0.3
"""Speed below which a target's velocity does not say where it points."""

_COLOUR_FLOOR = 12.0
"""Least spread of a car's colour, 0..255: the floor's light differs from place to place."""

_LEARN_SHARE = 0.1
_COLOURS_NEEDED = 3
_READS_NEEDED = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Sighting:
    """One observation with all that is known of it besides its place."""

    observation: Observation
    on_lane: bool
    length_m: float
    """Length of what was seen, on the floor, metres."""
    marker_id: int | None = None
    colour_bgr: Colour | None = None
    heading_rad: float | None = None
    """Direction in which the car points, track plane, atan2(dy, dx)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Appearance:
    """What was learnt of one car's looks."""

    marker_id: int | None = None
    reads: int = 0
    """Readings of `marker_id`, less those of other numbers since."""
    colour_bgr: Colour | None = None
    """Smoothed colour."""
    variance: float = 0.0
    """Smoothed squared deviation from it, mean of the three channels."""
    colours: int = 0
    """Sightings that told a colour."""

    @property
    def marker(self) -> int | None:
        """The number on the roof once it was read twice: a single reading may be a misreading."""
        return self.marker_id if self.reads >= _READS_NEEDED else None

    @property
    def colour(self) -> Colour | None:
        """The colour once it was seen often enough to compare with."""
        return self.colour_bgr if self.colours >= _COLOURS_NEEDED else None

    def after(self, sighting: Sighting) -> Appearance:
        """With one more sighting of the same car."""
        marker_id, reads = self._read(sighting.marker_id)
        colour, variance, colours = self.colour_bgr, self.variance, self.colours
        seen = sighting.colour_bgr
        if seen is not None:
            colours += 1
            share = max(_LEARN_SHARE, 1.0 / colours)
            if colour is None:
                colour = seen
            else:
                variance += share * (_squared(seen, colour) / 3.0 - variance)
                colour = _mixed(colour, seen, share)
        return Appearance(marker_id=marker_id, reads=reads, colour_bgr=colour, variance=variance, colours=colours)

    def _read(self, marker_id: int | None) -> tuple[int | None, int]:
        """Majority by counting up and down (R. S. Boyer and J S. Moore, "MJRTY", 1991), at most ten ahead."""
        if marker_id is None:
            return self.marker_id, self.reads
        if marker_id == self.marker_id:
            return marker_id, min(self.reads + 1, 10)
        return (self.marker_id, self.reads - 1) if self.reads > 0 else (marker_id, 1)

    def marker_cost(self, marker_id: int | None) -> float:
        """0 where the number agrees or either is not known, else `MARKER_COST`."""
        return 0.0 if marker_id is None or self.marker is None or marker_id == self.marker else MARKER_COST

    def agrees(self, marker_id: int | None) -> bool:
        """Whether `marker_id` is this car's own number, both being known."""
        return marker_id is not None and marker_id == self.marker

    def is_another(self, other: Appearance) -> bool:
        """Whether the looks `other` bear a number that is not this car's: no likeness makes up for that."""
        return self.marker is not None and other.reads > 0 and other.marker_id != self.marker

    def colour_cost(self, colour_bgr: Colour | None) -> float:
        """Squared distance of a colour from this car's, in its spread; 0 where either is not known."""
        if colour_bgr is None or self.colour is None:
            return 0.0
        return _squared(colour_bgr, self.colour) / (self.variance + _COLOUR_FLOOR**2)

    def misfit(self, other: Appearance) -> float:
        """How badly the looks `other`, learnt elsewhere, fit this car: 0 and up, uncapped."""
        return self.marker_cost(other.marker_id) + self.colour_cost(other.colour_bgr)

    def differs_from(self, other: Appearance) -> bool:
        """Whether looks can tell the two cars apart."""
        if self.marker is not None and other.marker is not None:
            return self.marker != other.marker
        if self.colour is None or other.colour is None:
            return False
        spread = self.variance + other.variance + 2.0 * _COLOUR_FLOOR**2
        return _squared(self.colour, other.colour) / spread >= DISTINCT


UNKNOWN = Appearance()
"""The looks of a car of which nothing was seen yet."""


def evidence(
    cars: Sequence[Appearance], velocities_mps: Sequence[tuple[float, float]], sighting: Sighting
) -> list[float]:
    """Cost of giving the sighting to each car, from looks alone.

    Colour and heading cost what they fit worse than the best of the cars: what fits all cars alike, or badly alike because
    the light has changed, says nothing, and with a single car there is nothing to say.
    """
    if len(cars) == 1:
        return [cars[0].marker_cost(sighting.marker_id)]
    colours = [min(car.colour_cost(sighting.colour_bgr), COLOUR_CAP) for car in cars]
    headings = [_heading_cost(velocity, sighting.heading_rad) for velocity in velocities_mps]
    base = min(colours, default=0.0), min(headings, default=0.0)
    return [
        car.marker_cost(sighting.marker_id) + (colour - base[0]) + (heading - base[1])
        for car, colour, heading in zip(cars, colours, headings, strict=True)
    ]


def _heading_cost(velocity_mps: tuple[float, float], heading_rad: float | None) -> float:
    speed = math.hypot(*velocity_mps)
    if heading_rad is None or speed < HEADING_SPEED_MPS:
        return 0.0
    along = (velocity_mps[0] * math.cos(heading_rad) + velocity_mps[1] * math.sin(heading_rad)) / speed
    return HEADING_WEIGHT * (1.0 - along)


def _squared(a: Colour, b: Colour) -> float:
    blue, green, red = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return blue * blue + green * green + red * red


def _mixed(a: Colour, b: Colour, share: float) -> Colour:
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])
