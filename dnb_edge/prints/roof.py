"""Roof markers to print, several on a sheet, each with a line to cut along and an arrow to the car's nose.

Knows paper and printed codes; knows no printer, no car and no camera.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.patches import Polygon, Rectangle

from dnb_edge.errors import InputError
from dnb_edge.prints.code import draw_code
from dnb_edge.prints.paper import FAINT, GREY, INK, PAPER_MM, Page, Paper, blank, draw_bar, write
from dnb_edge.view.markers import marker_cells

_MARGIN_MM, _FOOT_MM, _GAP_MM = 8.0, 30.0, 3.0
_STRIP_MM = 6.0
"""Above a marker's white border for the arrow, and below it for the words."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RoofSettings:
    """What to print."""

    family: str
    numbers: tuple[int, ...]
    size_mm: float
    """Side of the black square."""
    paper: Paper


def roof_pages(settings: RoofSettings) -> Iterator[Page]:
    """The sheets. Raises `InputError` where a marker does not fit on the paper, or the family has no such number."""
    cells = {number: marker_cells(settings.family, number) for number in settings.numbers}
    count = len(cells[settings.numbers[0]])
    width, height = label_mm(settings.size_mm, count)
    columns, rows = _grid(settings, width, height, count)
    for first in range(0, len(settings.numbers), columns * rows):
        figure, axes = blank(*PAPER_MM[settings.paper])
        for k, number in enumerate(settings.numbers[first : first + columns * rows]):
            row, column = divmod(k, columns)
            left = _MARGIN_MM + column * (width + _GAP_MM)
            top = PAPER_MM[settings.paper][1] - _MARGIN_MM - row * (height + _GAP_MM)
            _draw_label(axes, settings, number, (left, top - height), (width, height))
            border = settings.size_mm / count
            draw_code(axes, cells[number], left + border, top - _STRIP_MM - border - settings.size_mm, settings.size_mm)
        _foot(axes, settings)
        yield Page(name=str(1 + first // (columns * rows)), figure=figure)


def label_mm(size_mm: float, cells: int) -> tuple[float, float]:
    """Width and height of what is cut out: the square, its white border of one cell, and a strip above and below."""
    across = size_mm * (1.0 + 2.0 / cells)
    return across, across + 2.0 * _STRIP_MM


def _grid(settings: RoofSettings, width: float, height: float, cells: int) -> tuple[int, int]:
    """Columns and rows of markers on a sheet."""
    page_width, page_height = PAPER_MM[settings.paper]
    across, down = page_width - 2.0 * _MARGIN_MM, page_height - _MARGIN_MM - _FOOT_MM
    if width > across or height > down:
        most = min(across, down - 2.0 * _STRIP_MM) / (1.0 + 2.0 / cells)
        raise InputError(
            f"--size-mm {settings.size_mm:g}: with its white border a marker of {settings.family} may be {int(most)} mm large "
            f"on {settings.paper.value}"
        )
    return int((across + _GAP_MM) // (width + _GAP_MM)), int((down + _GAP_MM) // (height + _GAP_MM))


def _draw_label(
    axes: Axes, settings: RoofSettings, number: int, at: tuple[float, float], size: tuple[float, float]
) -> None:
    """The line to cut along, the arrow to the nose, and what it is."""
    (left, bottom), (width, height) = at, size
    axes.add_patch(
        Rectangle(at, width, height, facecolor="none", edgecolor=FAINT, linewidth=0.4, linestyle=(0, (6, 4)))
    )
    middle, top = left + width / 2.0, bottom + height
    arrow = [(middle - 3.0, top - 5.0), (middle + 3.0, top - 5.0), (middle, top - 1.2)]
    axes.add_patch(Polygon(arrow, facecolor=INK, linewidth=0.0))
    if width >= 40.0:
        write(axes, (middle + 5.0, top - 3.4), "nose", size=7, va="center", color=GREY)
    words = f"{number}   {settings.family}   {settings.size_mm:g} mm" if width >= 55.0 else f"{number}"
    write(axes, (middle, bottom + 2.6), words, size=7, ha="center", va="center", color=GREY)


def _foot(axes: Axes, settings: RoofSettings) -> None:
    draw_bar(axes, _MARGIN_MM, 12.0)
    lines = (
        "Print at 100 %, not fitted to the page, on matt paper: this bar must measure 100 mm from end to end.",
        "Cut along the dashed line and stick it flat on the roof, arrow to the nose. Keep the white border free.",
    )
    for k, line in enumerate(lines):
        write(axes, (_MARGIN_MM, 23.0 - 4.2 * k), line, size=8)
    said = f"detector.markers: dictionary {settings.family}, marker_size_m {settings.size_mm / 1000.0:g}"
    write(axes, (_MARGIN_MM + 104.0, 14.0), said, size=6.5, va="center", color=GREY)
