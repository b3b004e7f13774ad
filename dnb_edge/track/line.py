"""Directed lines across the track: the start line and the sector lines.

Knows a segment on the track plane and which way across it is forward. Knows no car, no time and no hysteresis; those
are the race's. FORWARD is to the line's left for somebody who stands at `start_m` and looks to `end_m`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from dnb_edge.errors import InputError
from dnb_edge.track.centreline import Centreline
from dnb_edge.values import PointM


@dataclass(frozen=True, slots=True, kw_only=True)
class DirectedLine:
    """A named segment on the track plane, track m, crossed forward from its right to its left."""

    name: str
    start_m: PointM
    end_m: PointM

    def __post_init__(self) -> None:
        """Raises `InputError` where the ends are not finite or not apart."""
        length_m = math.dist(self.start_m, self.end_m)
        if not (math.isfinite(length_m) and length_m > 0):
            raise InputError(
                f"line {self.name!r}: its ends {self.start_m} and {self.end_m} must be two different points"
            )

    @property
    def length_m(self) -> float:
        """Distance between the ends."""
        return math.dist(self.start_m, self.end_m)

    @property
    def forward(self) -> tuple[float, float]:
        """Unit vector, track plane, perpendicular to the line, in the direction of a forward crossing."""
        (x0, y0), (x1, y1) = self.start_m, self.end_m
        length_m = self.length_m
        return -(y1 - y0) / length_m, (x1 - x0) / length_m

    def signed_distance(self, point_m: PointM) -> float:
        """Metres from the infinite line through both ends to `point_m`; positive after a forward crossing."""
        (x0, y0), (x1, y1) = self.start_m, self.end_m
        cross = (x1 - x0) * (point_m[1] - y0) - (y1 - y0) * (point_m[0] - x0)
        return cross / self.length_m

    def intersects_segment(self, a_m: PointM, b_m: PointM) -> float | None:
        """Where the straight way from `a_m` to `b_m` crosses this line, as a fraction 0..1 of the way; None where not.

        A point exactly on the line counts as already on its left, so a path of segments crosses once and only once.
        The direction is forward where `signed_distance(b_m)` is not negative.
        """
        before, after = self.signed_distance(a_m), self.signed_distance(b_m)
        if (before >= 0) == (after >= 0):
            return None
        fraction = before / (before - after)
        x = a_m[0] + fraction * (b_m[0] - a_m[0])
        y = a_m[1] + fraction * (b_m[1] - a_m[1])
        (x0, y0), (x1, y1) = self.start_m, self.end_m
        along = ((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / self.length_m
        return fraction if 0.0 <= along <= self.length_m else None


def line_across(centreline: Centreline, s_m: float, *, name: str, margin_m: float = 0.0) -> DirectedLine:
    """The line perpendicular to the route at `s_m`, over the whole lane and `margin_m` beyond either edge, crossed
    forward by a car that drives along +s.
    """
    left_m, right_m = centreline.half_widths_at(s_m)
    return DirectedLine(
        name=name,
        start_m=centreline.point_at(s_m, left_m + margin_m),
        end_m=centreline.point_at(s_m, -(right_m + margin_m)),
    )
