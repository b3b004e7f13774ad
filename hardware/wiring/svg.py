"""An SVG drawing as text: rectangles, words and wires, the same every time.

Knows SVG. Knows no board. Lengths are px of the drawing, x to the right and y down.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from xml.sax.saxutils import escape

INK = "#1d2733"
FAINT = "#6b7785"
Point = tuple[float, float]


@dataclass(slots=True)
class Drawing:
    """What has been drawn so far on a white sheet; `text` is the file."""

    width: float
    height: float
    title: str
    _parts: list[str] = field(default_factory=list)

    def box(
        self, x: float, y: float, width: float, height: float, *, fill: str, line: str = INK, radius: float = 4
    ) -> None:
        """A filled rectangle with an edge."""
        self._parts.append(
            f'<rect x="{_n(x)}" y="{_n(y)}" width="{_n(width)}" height="{_n(height)}" rx="{_n(radius)}"'
            f' fill="{fill}" stroke="{line}" stroke-width="1.5"/>'
        )

    def dot(self, x: float, y: float, radius: float, *, fill: str, line: str = INK) -> None:
        """A filled circle with an edge."""
        self._parts.append(
            f'<circle cx="{_n(x)}" cy="{_n(y)}" r="{_n(radius)}" fill="{fill}" stroke="{line}" stroke-width="1.2"/>'
        )

    def words(
        self,
        x: float,
        y: float,
        text: str,
        *,
        size: float = 14,
        anchor: str = "start",
        fill: str = INK,
        bold: bool = False,
    ) -> None:
        """One line of text whose middle height is at `y`; `anchor` is start, middle or end."""
        weight = ' font-weight="700"' if bold else ""
        self._parts.append(
            f'<text x="{_n(x)}" y="{_n(y + 0.35 * size)}" font-size="{_n(size)}" text-anchor="{anchor}" fill="{fill}"{weight}>'
            f"{escape(text)}</text>"
        )

    def wire(self, points: list[Point], *, colour: str, width: float = 3) -> None:
        """A wire through `points` with rounded corners, on a white seam that parts it from what it crosses."""
        path = _rounded(points)
        for stroke, thickness in (("#ffffff", width + 4), (colour, width)):
            self._parts.append(
                f'<path d="{path}" fill="none" stroke="{stroke}" stroke-width="{_n(thickness)}" stroke-linecap="round"/>'
            )

    def text(self) -> str:
        """The file."""
        inside = "\n".join(self._parts)
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_n(self.width)} {_n(self.height)}"'
            f' width="{_n(self.width)}" height="{_n(self.height)}" font-family="Helvetica, Arial, sans-serif" role="img">\n'
            f"<title>{escape(self.title)}</title>\n"
            f'<rect width="{_n(self.width)}" height="{_n(self.height)}" fill="#ffffff"/>\n{inside}\n</svg>\n'
        )


def _rounded(points: list[Point], radius: float = 7) -> str:
    """The path through `points`, each corner cut by a curve."""
    path = [f"M{_n(points[0][0])} {_n(points[0][1])}"]
    for before, corner, after in zip(points, points[1:], points[2:], strict=False):
        start, end = _towards(corner, before, radius), _towards(corner, after, radius)
        path.append(f"L{_n(start[0])} {_n(start[1])}")
        path.append(f"Q{_n(corner[0])} {_n(corner[1])} {_n(end[0])} {_n(end[1])}")
    path.append(f"L{_n(points[-1][0])} {_n(points[-1][1])}")
    return " ".join(path)


def _towards(start: Point, end: Point, distance: float) -> Point:
    """A point `distance` on the way, but not beyond the middle of it."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    length = (dx * dx + dy * dy) ** 0.5
    share = min(distance, length / 2) / length if length else 0.0
    return start[0] + dx * share, start[1] + dy * share


def _n(value: float) -> str:
    """A number with one decimal at most."""
    text = f"{value:.1f}"
    return text.removesuffix(".0")
