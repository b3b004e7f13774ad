"""The track as the rest of the house knows it: scale, centreline, start line and sector lines, in metres.

Knows how the lines lie on the route. Knows no picture: `build` makes a track from one. A recording embeds the track's
stored form, so it goes to JSON and back bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Self

import numpy as np

from dnb_edge import wire
from dnb_edge.errors import InputError
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.line import DirectedLine
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import PointM

START_LINE = "start"
"""Name of the start line in crossings."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """A closed route with its lines. The start line is crossed forward, once a lap, by a car that drives along +s,
    and lies at s_m = 0.
    """

    name: str
    scale: TwinScale
    centreline: Centreline
    start_line: DirectedLine
    sector_lines: tuple[DirectedLine, ...] = ()
    """In the order in which a lap crosses them; may be empty."""

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON types; `from_dict` gives back an equal track, bit for bit."""
        return {
            "name": self.name,
            "scale": wire.to_dict(self.scale),
            "centreline": self.centreline.to_dict(),
            "start_line": wire.to_dict(self.start_line),
            "sector_lines": [wire.to_dict(line) for line in self.sector_lines],
        }

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Self:
        """The track that `to_dict` wrote. Raises `InputError` where a member is missing or of the wrong kind."""
        try:
            return cls(
                name=str(data["name"]),
                scale=wire.from_dict(TwinScale, data["scale"]),
                centreline=Centreline.from_dict(data["centreline"]),
                start_line=wire.from_dict(DirectedLine, data["start_line"]),
                sector_lines=tuple(wire.from_dict(DirectedLine, line) for line in data["sector_lines"]),
            )
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"track: {error!r} in its stored form: build the track file anew") from error


def crossings_of(centreline: Centreline, line: DirectedLine) -> tuple[tuple[float, bool], ...]:
    """Every place where the route crosses `line`, as (s_m, forward), in the order of s_m."""
    points: list[PointM] = [(float(x), float(y)) for x, y in centreline.points_m]
    found: list[tuple[float, bool]] = []
    ends = np.append(centreline.s_m, centreline.length_m)
    for i, (a, b) in enumerate(pairwise([*points, points[0]])):
        fraction = line.intersects_segment(a, b)
        if fraction is not None:
            s_m = float(ends[i] + fraction * (ends[i + 1] - ends[i])) % centreline.length_m
            found.append((s_m, line.signed_distance(b) >= 0))
    return tuple(sorted(found))
