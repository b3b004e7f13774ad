"""Floor markers to print, one on a sheet, and a sheet that shows where they may lie.

Knows paper and printed codes; knows no printer and no camera.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from dnb_edge.errors import InputError
from dnb_edge.prints.code import draw_code
from dnb_edge.prints.layout import PlacedMarker
from dnb_edge.prints.paper import BAR_MM, FAINT, GREY, INK, PAPER_MM, Page, Paper, blank, draw_bar, write
from dnb_edge.values import PointM
from dnb_edge.view.markers import marker_cells

_FOOT_MM = 62.0
"""Room that the words and the bar need below a marker's white border."""
_NUMBER_MM, _WORDS_MM, _BAR_AT_MM = 50.0, 39.0, 22.0
_TICK_MM = 7.0
_BESIDE_M = 0.3
"""Floor round the outermost markers that the plan's twin holds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FloorSettings:
    """What to print."""

    family: str
    numbers: tuple[int, ...]
    size_mm: float
    """Side of the black square."""
    paper: Paper


def floor_pages(settings: FloorSettings) -> Iterator[Page]:
    """One sheet a marker. Raises `InputError` where one does not fit on the paper, or the family has no such number."""
    codes = [marker_cells(settings.family, number) for number in settings.numbers]
    _check_size(settings, len(codes[0]))
    width, height = PAPER_MM[settings.paper]
    for number, cells in zip(settings.numbers, codes, strict=True):
        figure, axes = blank(width, height)
        left = (width - settings.size_mm) / 2.0
        bottom = height - _border_mm(settings, len(cells)) - settings.size_mm
        draw_code(axes, cells, left, bottom, settings.size_mm)
        _draw_ticks(axes, left, bottom, settings.size_mm, settings.size_mm / len(cells))
        _words(axes, settings, number)
        _bar(axes, width)
        yield Page(name=str(number), figure=figure)


def placed(numbers: tuple[int, ...], area_m: tuple[float, float]) -> tuple[PlacedMarker, ...]:
    """A place for each marker on a rectangle of floor: corners, long sides' middles, then where others are farthest."""
    width, depth = area_m
    steps = [k / 20 for k in range(21)]
    middle, side = width / 2.0, depth / 2.0
    room = [(width * a, depth * b) for b in steps for a in steps]
    taken: list[PointM] = [(0.0, 0.0), (width, 0.0), (width, depth), (0.0, depth)]
    taken += [(middle, 0.0), (middle, depth)] if width >= depth else [(0.0, side), (width, side)]
    while len(taken) < len(numbers):
        taken.append(max(room, key=lambda at: round(min(math.dist(at, other) for other in taken), 9)))
    return tuple(
        PlacedMarker(number=number, at_m=(x + _BESIDE_M, y + _BESIDE_M))
        for number, (x, y) in zip(numbers, taken, strict=False)
    )


def plan_page(settings: FloorSettings, markers: tuple[PlacedMarker, ...], area_m: tuple[float, float]) -> Page:
    """The sheet that shows the places, with all lengths that must be measured on the floor."""
    width, height = PAPER_MM[settings.paper]
    figure, axes = blank(width, height)
    write(axes, (20.0, height - 24.0), "Where the floor markers may lie", size=16)
    lines = (
        "Lay them anywhere, three at least and better spread over the whole track: nothing need be measured.",
        "Or lay them as drawn, measured with a tape from middle to middle (the thin lines beside each square point to it),",
        "upright as printed, and give the layout file: the floor then has these axes (track m).",
    )
    for k, line in enumerate(lines):
        write(axes, (20.0, height - 33.0 - 5.0 * k), line, size=8.5, color=GREY)
    scale = min((width - 70.0) / area_m[0], (height - 125.0) / area_m[1])
    left, bottom = (width - scale * area_m[0]) / 2.0, height - 60.0 - scale * area_m[1]
    axes.add_patch(
        Rectangle((left, bottom), scale * area_m[0], scale * area_m[1], facecolor="#f4f5f6", edgecolor=FAINT)
    )
    side = max(6.0, scale * settings.size_mm / 1000.0)
    for marker in markers:
        x, y = (left + scale * (marker.at_m[0] - _BESIDE_M), bottom + scale * (marker.at_m[1] - _BESIDE_M))
        axes.add_patch(Rectangle((x - side / 2.0, y - side / 2.0), side, side, facecolor=INK, linewidth=0.0))
        write(axes, (x, y), str(marker.number), size=9, ha="center", va="center", color="white", weight="bold")
        place = f"({marker.at_m[0]:.2f}, {marker.at_m[1]:.2f}) m"
        write(axes, (x, y - side / 2.0 - 3.6), place, size=7, ha="center", va="center", color=GREY)
    write(axes, (width / 2.0, bottom - 15.0), f"{area_m[0]:g} m", size=11, ha="center", va="center")
    turned = {"ha": "center", "va": "center", "rotation": 90}
    write(axes, (left - 14.0, bottom + scale * area_m[1] / 2.0), f"{area_m[1]:g} m", size=11, **turned)
    diagonal = math.hypot(*area_m)
    write(axes, (width / 2.0, bottom - 22.0), f"check: both diagonals {diagonal:.3f} m", ha="center", va="center")
    _bar(axes, width)
    return Page(name="plan", figure=figure)


def plan_size_m(area_m: tuple[float, float]) -> tuple[float, float]:
    """Width and height of the floor that the layout's twin holds."""
    return area_m[0] + 2.0 * _BESIDE_M, area_m[1] + 2.0 * _BESIDE_M


def _check_size(settings: FloorSettings, cells: int) -> None:
    width, height = PAPER_MM[settings.paper]
    # The white border is one cell wide, at the top it may be narrower by nothing.
    most = min(width / (1.0 + 2.0 / cells), (height - _FOOT_MM) / (1.0 + 2.0 / cells))
    if settings.size_mm > most:
        raise InputError(
            f"--size-mm {settings.size_mm:g}: with its white border a marker of this family may be {int(most)} mm large on "
            f"{settings.paper.value}"
        )


def _border_mm(settings: FloorSettings, cells: int) -> float:
    """White above the square: as much as at its sides, where the words leave room for it."""
    width, height = PAPER_MM[settings.paper]
    beside = (width - settings.size_mm) / 2.0
    cell = settings.size_mm / cells
    return max(cell, min(beside, height - _FOOT_MM - settings.size_mm - cell))


def _draw_ticks(axes: Axes, left: float, bottom: float, size: float, cell: float) -> None:
    """Thin lines at the middle of each side, outside: a tape measure finds the square's middle by them."""
    start, middle = min(cell, 12.0), size / 2.0
    for x, y, dx, dy in (
        (left + middle, bottom - start, 0.0, -_TICK_MM),
        (left + middle, bottom + size + start, 0.0, _TICK_MM),
        (left - start, bottom + middle, -_TICK_MM, 0.0),
        (left + size + start, bottom + middle, _TICK_MM, 0.0),
    ):
        axes.plot((x, x + dx), (y, y + dy), color=FAINT, linewidth=0.5)


def _words(axes: Axes, settings: FloorSettings, number: int) -> None:
    width, _ = PAPER_MM[settings.paper]
    write(axes, (width / 2.0, _NUMBER_MM), f"floor marker {number}", ha="center", va="center", size=22)
    lines = (
        f"family {settings.family}   number {number}   black square {settings.size_mm:g} mm   (dnb-edge calibrate markers)",
        "Lay it flat on the floor, anywhere the camera sees all of it. Keep the white border free.",
    )
    for k, line in enumerate(lines):
        write(axes, (width / 2.0, _WORDS_MM - 5.0 * k), line, ha="center", va="center")


def _bar(axes: Axes, width: float) -> None:
    draw_bar(axes, (width - BAR_MM) / 2.0, _BAR_AT_MM)
    text = f"Print at 100 %, not fitted to the page. Then measure this bar: {BAR_MM:g} mm from end to end."
    write(axes, (width / 2.0, _BAR_AT_MM - 4.0), text, ha="center", va="center")
