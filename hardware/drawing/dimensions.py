"""What a drawing says in numbers: lengths between two points of a part, and holes.

Knows the three views of a part and how a point of the part lies in each; every number is computed from the points, so a
drawing cannot say what the part is not. Views, in the part's own frame: `front` sees it from +z with y up, `top` from +y,
drawn above the front; `side` from +x, drawn to its right (third-angle projection).
"""

import math
from dataclasses import dataclass
from typing import Literal

Point = tuple[float, float, float]
ViewName = Literal["front", "top", "side"]

TOWARDS_EYE: dict[ViewName, Point] = {"front": (0, 0, 1), "top": (0, 1, 0), "side": (1, 0, 0)}
UP: dict[ViewName, Point] = {"front": (0, 1, 0), "top": (0, 0, -1), "side": (0, 1, 0)}


def flat(view: ViewName, point: Point) -> tuple[float, float]:
    """A point of the part in a view: mm to the right and up."""
    x, y, z = point
    if view == "front":
        return x, y
    return (x, -z) if view == "top" else (-z, y)


@dataclass(frozen=True, slots=True, kw_only=True)
class Length:
    """A distance to draw: along the view's horizontal or vertical between two points."""

    view: ViewName
    start: Point
    end: Point
    upright: bool = False
    """Measured along the view's vertical, not its horizontal."""
    at: float = 1.0
    """Which row: 1, 2, 3 below the view (or left of it); -1, -2 above (or right of it)."""

    @property
    def value_mm(self) -> float:
        """What the drawing says."""
        a, b = flat(self.view, self.start), flat(self.view, self.end)
        return abs(b[1] - a[1]) if self.upright else abs(b[0] - a[0])

    @property
    def text(self) -> str:
        """The value as it is written."""
        return number(self.value_mm)


@dataclass(frozen=True, slots=True, kw_only=True)
class Hole:
    """A round hole or disc, seen as a circle in its view, with a note on a leader."""

    view: ViewName
    centre: Point
    diameter_mm: float
    count: int = 1
    note: str = ""
    """Added after the diameter."""
    towards_deg: float = 45.0
    """Where the note lies as seen from the centre."""
    leader_mm: float = 12.0
    """Length of the leader on paper."""

    @property
    def text(self) -> str:
        """How many, the diameter and the note."""
        many = f"{self.count}x " if self.count > 1 else ""
        return f"{many}Ø{number(self.diameter_mm)}{' ' + self.note if self.note else ''}"


def number(value_mm: float) -> str:
    """Millimetres to a tenth, without needless zeros."""
    return f"{round(value_mm, 1):g}"


def rim(hole: Hole) -> tuple[float, float]:
    """Where the leader touches the circle, in the view."""
    x, y = flat(hole.view, hole.centre)
    angle = math.radians(hole.towards_deg)
    return x + hole.diameter_mm / 2 * math.cos(angle), y + hole.diameter_mm / 2 * math.sin(angle)
