"""A part's drawing on a sheet of A4 as SVG: three views with their hidden lines, dimensions, a picture and a title block.

Knows lines on paper in mm. Which lines are seen is worked out by the modeller (hidden-line removal); the numbers come from
`dimensions`. The sheet prints at the scale that its title block names.
"""

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from xml.sax.saxutils import escape

from hardware.drawing.dimensions import TOWARDS_EYE, UP, Hole, Length, ViewName, flat, rim
from hardware.drawing.picture import Body, View, shaded

SHEET_MM = (297.0, 210.0)
SCALES = (2.0, 1.5, 1.0, 2 / 3, 0.5, 0.4, 1 / 3, 0.25)
_MARGIN_MM, _TITLE_MM, _ROW_MM, _LETTER_MM = 10.0, 22.0, 7.0, 1.75
_INK = "#1a4f8b"
_LETTERS_A_NOTE = 105
_FAR_MM = 10_000.0
_PICTURE = View(towards_eye=(0.7, 0.5, 1.0), up=(0, 1, 0))

Segment = tuple[tuple[float, float], ...]
Bounds = tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sheet:
    """What a drawing needs to know of its part; lengths in mm in the part's own frame."""

    title: str
    shape: Any
    dimensions: tuple[Length | Hole, ...]
    notes: tuple[str, ...] = ()
    colour: tuple[int, int, int] = (150, 190, 120)
    picture: View = _PICTURE
    hidden_lines: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class _Frame:
    """Where a view stands: its bounds in the part (mm) and the paper's place of their lower left corner."""

    name: ViewName
    least: tuple[float, float]
    most: tuple[float, float]
    corner: tuple[float, float]
    scale: float

    def on_paper(self, point: tuple[float, float]) -> tuple[float, float]:
        """Paper mm: x to the right, y down."""
        x, y = self.corner
        return x + (point[0] - self.least[0]) * self.scale, y - (point[1] - self.least[1]) * self.scale


def drawing(sheet: Sheet) -> str:
    """The sheet as an SVG document; the same part gives the same bytes."""
    frames = _layout(sheet)
    parts = [_border(sheet, frames["front"].scale), _corner_picture(sheet, frames)]
    for name, frame in frames.items():
        seen, hidden = _edges(sheet.shape, name)
        # What is hidden exactly behind a seen line is not drawn.
        if sheet.hidden_lines:
            parts.append(
                _polylines(
                    sorted(set(hidden) - set(seen)), frame, 'stroke-width="0.18" stroke-dasharray="1.6 1" stroke="#667"'
                )
            )
        parts.append(_polylines(sorted(set(seen)), frame, 'stroke-width="0.4" stroke="#111"'))
    for dimension in sheet.dimensions:
        frame = frames[dimension.view]
        parts.append(_length(dimension, frame) if isinstance(dimension, Length) else _hole(dimension, frame))
    width, height = SHEET_MM
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}mm" height="{height:g}mm" viewBox="0 0 {width:g} {height:g}" '
        f'font-family="Helvetica, Arial, sans-serif" font-size="3.2"><title>{escape(sheet.title)}</title>'
        f'<rect width="{width:g}" height="{height:g}" fill="#fff"/>'
    )
    return head + "\n" + "\n".join(part for part in parts if part) + "\n</svg>\n"


def _layout(sheet: Sheet) -> dict[ViewName, _Frame]:
    """Third angle: top above front, side to its right, all at the largest scale that leaves room for the dimensions."""
    box = sheet.shape.bounding_box()
    corners = [
        (x, y, z) for x in (box.min.X, box.max.X) for y in (box.min.Y, box.max.Y) for z in (box.min.Z, box.max.Z)
    ]
    bounds: dict[ViewName, Bounds] = {}
    for name in TOWARDS_EYE:
        points = [flat(name, corner) for corner in corners]
        bounds[name] = (
            (min(p[0] for p in points), min(p[1] for p in points)),
            (max(p[0] for p in points), max(p[1] for p in points)),
        )
    width, height, depth = (box.max.X - box.min.X, box.max.Y - box.min.Y, box.max.Z - box.min.Z)
    for scale in SCALES:
        gaps = {name: _gap(sheet.dimensions, name, bounds[name], scale) for name in TOWARDS_EYE}
        left = max(gaps["front"].left, gaps["top"].left)
        between_x = gaps["front"].right + gaps["side"].left + 6
        between_y = gaps["top"].below + gaps["front"].above + 6
        free_x = SHEET_MM[0] - 2 * _MARGIN_MM - 4 - left - between_x - gaps["side"].right - scale * (width + depth)
        free_y = (
            SHEET_MM[1]
            - 2 * _MARGIN_MM
            - _TITLE_MM
            - 4
            - gaps["top"].above
            - between_y
            - gaps["front"].below
            - scale * (height + depth)
        )
        if free_x >= 0 and free_y >= 0:
            break
    x = _MARGIN_MM + 2 + left + min(12.0, max(0.0, free_x) / 3)
    top_y = _MARGIN_MM + 2 + gaps["top"].above + scale * depth + max(0.0, free_y) / 4
    front_y = top_y + between_y + scale * height + max(0.0, free_y) / 4
    places: dict[ViewName, tuple[float, float]] = {
        "front": (x, front_y),
        "top": (x, top_y),
        "side": (x + scale * width + between_x, front_y),
    }
    return {
        name: _Frame(name=name, least=bounds[name][0], most=bounds[name][1], corner=places[name], scale=scale)
        for name in ("front", "top", "side")
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class _Gap:
    """Paper needed round a view for its dimensions and notes, mm."""

    left: float
    right: float
    above: float
    below: float


def _gap(dimensions: Sequence[Length | Hole], view: ViewName, bounds: Bounds, scale: float) -> _Gap:
    (x0, y0), (x1, y1) = bounds
    left = right = above = below = 2.0
    for item in dimensions:
        if item.view != view:
            continue
        if isinstance(item, Hole):
            note = _note(item, rim(item), scale)
            left, right = max(left, x0 * scale - note.left), max(right, note.right - x1 * scale)
            above, below = max(above, note.y + 3 - y1 * scale), max(below, y0 * scale - note.y + 3)
            continue
        room = abs(item.at) * _ROW_MM + 4
        if item.upright:
            left, right = (max(left, room), right) if item.at > 0 else (left, max(right, room))
        else:
            above, below = (above, max(below, room)) if item.at > 0 else (max(above, room), below)
    return _Gap(left=left, right=right, above=above, below=below)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Note:
    """A hole's note on paper, y up: the leader's bend, and where the text begins and ends."""

    bend: tuple[float, float]
    left: float
    right: float
    y: float
    to_the_right: bool


def _note(item: Hole, edge: tuple[float, float], scale: float) -> _Note:
    angle = math.radians(item.towards_deg)
    bend = (edge[0] * scale + item.leader_mm * math.cos(angle), edge[1] * scale + item.leader_mm * math.sin(angle))
    length = _LETTER_MM * len(item.text) + 4
    to_the_right = math.cos(angle) >= 0
    left = bend[0] if to_the_right else bend[0] - length
    return _Note(bend=bend, left=left, right=left + length, y=bend[1], to_the_right=to_the_right)


def _edges(shape: Any, view: ViewName) -> tuple[list[Segment], list[Segment]]:
    """Seen and hidden lines of a view in mm of the part, each as a row of points in a fixed order."""
    box = shape.bounding_box()
    middle = ((box.min.X + box.max.X) / 2, (box.min.Y + box.max.Y) / 2, (box.min.Z + box.max.Z) / 2)
    eye = tuple(m + _FAR_MM * t for m, t in zip(middle, TOWARDS_EYE[view], strict=True))
    seen, hidden = shape.project_to_viewport(eye, viewport_up=UP[view], look_at=middle)
    # The viewport's origin is the point looked at.
    shift = flat(view, middle)
    return [_row(edge, shift) for edge in seen], [_row(edge, shift) for edge in hidden]


def _row(edge: Any, shift: tuple[float, float]) -> Segment:
    straight = edge.geom_type.name == "LINE"
    count = 1 if straight else max(4, math.ceil(edge.length / 0.8))
    points = [edge.position_at(i / count) for i in range(count + 1)]
    row = tuple((round(p.X + shift[0], 2) + 0.0, round(p.Y + shift[1], 2) + 0.0) for p in points)
    return min(row, row[::-1])


def _polylines(rows: Sequence[Segment], frame: _Frame, style: str) -> str:
    if not rows:
        return ""
    data = "".join("M" + "L".join(_xy(frame.on_paper(point)) for point in row) for row in rows)
    return f'<path fill="none" stroke-linecap="round" stroke-linejoin="round" {style} d="{data}"/>'


def _length(item: Length, frame: _Frame) -> str:
    """Extension lines from the two points, the dimension line with arrows, the number on it."""
    a, b = (frame.on_paper(flat(item.view, point)) for point in (item.start, item.end))
    low, high = frame.on_paper(frame.least), frame.on_paper(frame.most)
    away = _ROW_MM * abs(item.at) + 1
    if item.upright:
        line_x = low[0] - away if item.at > 0 else high[0] + away
        ends = (line_x, a[1]), (line_x, b[1])
        beyond = (math.copysign(1.5, line_x - a[0]), 0.0)
        angle, text_at = -90, (line_x - 1.0, (a[1] + b[1]) / 2)
    else:
        line_y = low[1] + away if item.at > 0 else high[1] - away
        ends = (a[0], line_y), (b[0], line_y)
        beyond = (0.0, math.copysign(1.5, line_y - a[1]))
        angle, text_at = 0, ((a[0] + b[0]) / 2, line_y - 1.0)
    out = []
    for point, end in zip((a, b), ends, strict=True):
        out.append(f"M{_xy(point)}L{_xy((end[0] + beyond[0], end[1] + beyond[1]))}")
    path = f'<path fill="none" stroke="#1a4f8b" stroke-width="0.15" d="{"".join(out)}M{_xy(ends[0])}L{_xy(ends[1])}"/>'
    short = math.dist(*ends) < 8
    arrows = _arrow(ends[0], ends[1], outside=short) + _arrow(ends[1], ends[0], outside=short)
    x, y = text_at
    if short:
        # No room between the arrows: the number stands beside them.
        x, y = (x, min(ends[0][1], ends[1][1]) - 5.5) if item.upright else (max(ends[0][0], ends[1][0]) + 5.5, y)
    turn = f' transform="rotate({angle} {x:.2f} {y:.2f})"' if angle else ""
    return path + arrows + _words(item.text, f'x="{x:.2f}" y="{y:.2f}" text-anchor="middle"{turn}')


def _arrow(tip: tuple[float, float], other: tuple[float, float], *, outside: bool) -> str:
    length = math.dist(tip, other) or 1.0
    ux, uy = (other[0] - tip[0]) / length, (other[1] - tip[1]) / length
    if outside:
        ux, uy = -ux, -uy
    back = (tip[0] + 2.2 * ux, tip[1] + 2.2 * uy)
    wings = (back[0] - 0.5 * uy, back[1] + 0.5 * ux), (back[0] + 0.5 * uy, back[1] - 0.5 * ux)
    tail = (
        f'<path stroke="#1a4f8b" stroke-width="0.15" d="M{_xy(tip)}L{_xy((tip[0] + 4 * ux, tip[1] + 4 * uy))}"/>'
        if outside
        else ""
    )
    return tail + f'<path fill="#1a4f8b" d="M{_xy(tip)}L{_xy(wings[0])}L{_xy(wings[1])}Z"/>'


def _hole(item: Hole, frame: _Frame) -> str:
    edge = frame.on_paper(rim(item))
    note = _note(item, (0.0, 0.0), frame.scale)
    bend = (edge[0] + note.bend[0], edge[1] - note.bend[1])
    sign, anchor = (1, "start") if note.to_the_right else (-1, "end")
    shelf = (bend[0] + 3 * sign, bend[1])
    return (
        f'<path fill="none" stroke="#1a4f8b" stroke-width="0.15" d="M{_xy(edge)}L{_xy(bend)}L{_xy(shelf)}"/>'
        + _arrow(edge, bend, outside=False)
        + _words(item.text, f'x="{shelf[0] + 0.8 * sign:.2f}" y="{shelf[1] + 1.1:.2f}" text-anchor="{anchor}"')
    )


def _words(text: str, place: str) -> str:
    """Text on a white edge of its own, so that it can be read where it crosses a line."""
    words = escape(text)
    return f'<text {place} stroke="#fff" stroke-width="0.9">{words}</text><text {place} fill="{_INK}">{words}</text>'


def _corner_picture(sheet: Sheet, frames: dict[ViewName, _Frame]) -> str:
    """A shaded picture in the free corner, above the side view."""
    picture = shaded([Body(shape=sheet.shape, colour=sheet.colour)], sheet.picture, line_mm=0.3)
    x0, y0, x1, y1 = picture.bounds
    top = frames["top"]
    gap = _gap(sheet.dimensions, "top", (top.least, top.most), top.scale)
    left = top.on_paper(top.most)[0] + max(gap.right, 8) + 6
    bottom = top.corner[1] + 8
    room = SHEET_MM[0] - _MARGIN_MM - 4 - left, bottom - _MARGIN_MM - 4
    scale = min(room[0] / (x1 - x0), room[1] / (y1 - y0), 1.2)
    dx = left + (room[0] - scale * (x1 - x0)) / 2 - scale * x0
    dy = _MARGIN_MM + 4 + (room[1] - scale * (y1 - y0)) / 2 - scale * y0
    return f'<g transform="translate({dx:.2f} {dy:.2f}) scale({scale:.3f})">{picture.svg}</g>'


def _border(sheet: Sheet, scale: float) -> str:
    width, height = SHEET_MM
    m, top = _MARGIN_MM, height - _MARGIN_MM - _TITLE_MM
    thick, letters = 'stroke="#111" stroke-width="0.5"', min(5.0, 150 / len(sheet.title))
    ratio = f"{scale:g}:1" if scale >= 1 else f"1:{1 / scale:.3g}"
    lines = [
        f'<rect x="{m:g}" y="{m:g}" width="{width - 2 * m:g}" height="{height - 2 * m:g}" {thick} fill="none"/>',
        f'<path {thick} d="M{m:g} {top:g}H{width - m:g}M{width - 100:g} {top:g}V{height - m:g}"/>',
        f'<text x="{width - 96:g}" y="{top + 8:g}" font-size="{letters:.3g}" font-weight="bold">{escape(sheet.title)}</text>',
        f'<text x="{width - 96:g}" y="{top + 14:g}">dnb-edge kit · millimetres · scale {ratio} on A4 · third angle</text>',
        f'<text x="{width - 96:g}" y="{top + 19:g}">general tolerance ±0.2 · GPL-3.0-or-later</text>',
    ]
    notes = [line for note in sheet.notes for line in textwrap.wrap(note, _LETTERS_A_NOTE)]
    for row, note in enumerate(notes):
        lines.append(f'<text x="{m + 4:g}" y="{top + 5.5 + 4.4 * row:g}">{escape(note)}</text>')
    return "\n".join(lines)


def _xy(point: tuple[float, float]) -> str:
    return f"{round(point[0], 2) + 0.0:g} {round(point[1], 2) + 0.0:g}"
