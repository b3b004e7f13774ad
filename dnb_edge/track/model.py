"""The track as the rest of the house knows it: scale, centreline, start, finish and sector lines, in metres.

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
from dnb_edge.values import PointM, Points

START_LINE = "start"
"""Name of the start line in crossings."""

FINISH_LINE = "finish"
"""Name of the finish line in crossings, where the track has one of its own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """A route with its lines, each crossed forward, once a lap, by a car that drives along +s.

    The start line of a closed route lies at s_m = 0; an open route begins a little before its start line and ends a little
    behind its finish line.
    """

    name: str
    scale: TwinScale
    centreline: Centreline
    start_line: DirectedLine
    sector_lines: tuple[DirectedLine, ...] = ()
    """In the order in which a lap crosses them; may be empty."""
    finish_line: DirectedLine | None = None
    """Where a lap ends, if not at the start line; an open route has one."""

    def __post_init__(self) -> None:
        """Raises `InputError` where an open route has no finish line."""
        if not self.centreline.closed and self.finish_line is None:
            raise InputError(f"track {self.name!r}: an open route needs a finish line: draw one")

    @property
    def lines(self) -> tuple[DirectedLine, ...]:
        """The start line, the finish line if it is another, and the sector lines."""
        return (self.start_line, *(() if self.finish_line is None else (self.finish_line,)), *self.sector_lines)

    def lap_m(self) -> tuple[float, float]:
        """(s_m of a lap's start, its length along the route), metres: once round, or from the start to the finish line.

        Raises `InputError` where one of the two lines does not cross the route.
        """
        if self.finish_line is None:
            return 0.0, self.centreline.length_m
        places = [crossings_of(self.centreline, line) for line in (self.start_line, self.finish_line)]
        if not all(places):
            raise InputError(
                f"track {self.name!r}: the start or the finish line does not cross the route: draw it anew"
            )
        (start_m, _), (finish_m, _) = places[0][0], places[1][0]
        if self.centreline.closed:
            return start_m, (finish_m - start_m) % self.centreline.length_m
        return start_m, finish_m - start_m

    def lap_route_m(self) -> Points:
        """A lap's stretch of the route as a polyline (n, 2), track m, from the line where it starts to where it ends."""
        route = self.centreline
        if self.finish_line is None:
            return np.vstack([route.points_m, route.points_m[:1]])
        start_m, length_m = self.lap_m()
        at = start_m + np.linspace(0.0, length_m, max(2, len(route.points_m)))
        return route.points_at(np.asarray(at, dtype=np.float64))

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON types; `from_dict` gives back an equal track, bit for bit."""
        return {
            "name": self.name,
            "scale": wire.to_dict(self.scale),
            "centreline": self.centreline.to_dict(),
            "start_line": wire.to_dict(self.start_line),
            "sector_lines": [wire.to_dict(line) for line in self.sector_lines],
            "finish_line": None if self.finish_line is None else wire.to_dict(self.finish_line),
        }

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Self:
        """The track that `to_dict` wrote. Raises `InputError` where a member is missing or of the wrong kind.

        What was stored before there were finish lines has none.
        """
        try:
            finish = data.get("finish_line")
            return cls(
                name=str(data["name"]),
                scale=wire.from_dict(TwinScale, data["scale"]),
                centreline=Centreline.from_dict(data["centreline"]),
                start_line=wire.from_dict(DirectedLine, data["start_line"]),
                sector_lines=tuple(wire.from_dict(DirectedLine, line) for line in data["sector_lines"]),
                finish_line=None if finish is None else wire.from_dict(DirectedLine, finish),
            )
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise InputError(f"track: {error!r} in its stored form: build the track file anew") from error


def crossings_of(centreline: Centreline, line: DirectedLine) -> tuple[tuple[float, bool], ...]:
    """Every place where the route crosses `line`, as (s_m, forward), in the order of s_m."""
    points: list[PointM] = [(float(x), float(y)) for x, y in centreline.points_m]
    found: list[tuple[float, bool]] = []
    ends = centreline.s_m
    if centreline.closed:
        points.append(points[0])
        ends = np.append(ends, centreline.length_m)
    for i, (a, b) in enumerate(pairwise(points)):
        fraction = line.intersects_segment(a, b)
        if fraction is not None:
            s_m = float(ends[i] + fraction * (ends[i + 1] - ends[i]))
            found.append((s_m % centreline.length_m if centreline.closed else s_m, line.signed_distance(b) >= 0))
    return tuple(sorted(found))
