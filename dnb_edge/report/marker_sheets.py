"""Floor markers to print: a PDF with one sheet a marker, all in lines and rectangles, to scale.

Knows paper, the printed codes and matplotlib; knows no printer and no camera. The page's unit is the millimetre: the figure is
as large as the paper and its one axis covers it, so a length in the drawing is that length on paper.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from enum import StrEnum

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.view.markers import marker_cells

BAR_MM = 100.0
"""Length of the check bar on every sheet."""

_MM_PER_INCH = 25.4
_FOOT_MM = 62.0
"""Room that the words and the bar need below a marker's white border."""
_NUMBER_MM, _WORDS_MM, _BAR_AT_MM = 50.0, 39.0, 22.0
_BAR_HEIGHT_MM = 4.0
_TICK_MM = 7.0
_GREY = "#b0b0b0"


class Paper(StrEnum):
    """Sizes of paper."""

    A4 = "a4"
    LETTER = "letter"


PAPER_MM = {Paper.A4: (210.0, 297.0), Paper.LETTER: (215.9, 279.4)}
"""Width and height."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SheetSettings:
    """What to print."""

    family: str
    numbers: tuple[int, ...]
    size_mm: float
    """Side of the black square."""
    paper: Paper


def marker_sheets(settings: SheetSettings) -> bytes:
    """The PDF. Raises `InputError` where a marker does not fit on the paper, or the family has no such number."""
    cells = [marker_cells(settings.family, number) for number in settings.numbers]
    _check_size(settings, len(cells[0]))
    stream = io.BytesIO()
    # No date and no identifiers: the same sheets are the same bytes.
    with mpl.rc_context({"pdf.fonttype": 42}), PdfPages(stream, metadata={"CreationDate": None}) as pages:
        for number, code in zip(settings.numbers, cells, strict=True):
            pages.savefig(sheet_figure(settings, number, code))
    return stream.getvalue()


def sheet_figure(settings: SheetSettings, number: int, cells: NDArray[np.bool_]) -> Figure:
    """One sheet, as large as the paper."""
    width, height = PAPER_MM[settings.paper]
    figure = Figure(figsize=(width / _MM_PER_INCH, height / _MM_PER_INCH), facecolor="white")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_xlim(0.0, width)
    axes.set_ylim(0.0, height)
    cell = settings.size_mm / len(cells)
    left, bottom = (width - settings.size_mm) / 2.0, height - _border_mm(settings, len(cells)) - settings.size_mm
    _draw_code(axes, cells, left, bottom, settings.size_mm)
    _draw_ticks(axes, left, bottom, settings.size_mm, cell)
    _write(axes, settings, number)
    _draw_bar(axes, (width - BAR_MM) / 2.0, _BAR_AT_MM)
    return figure


def _check_size(settings: SheetSettings, cells: int) -> None:
    width, height = PAPER_MM[settings.paper]
    # The white border is one cell wide, at the top it may be narrower by nothing.
    most = min(width / (1.0 + 2.0 / cells), (height - _FOOT_MM) / (1.0 + 2.0 / cells))
    if settings.size_mm > most:
        raise InputError(
            f"--size-mm {settings.size_mm:g}: with its white border a marker of this family may be {int(most)} mm large on "
            f"{settings.paper.value}"
        )


def _border_mm(settings: SheetSettings, cells: int) -> float:
    """White above the square: as much as at its sides, where the words leave room for it."""
    width, height = PAPER_MM[settings.paper]
    beside = (width - settings.size_mm) / 2.0
    cell = settings.size_mm / cells
    return max(cell, min(beside, height - _FOOT_MM - settings.size_mm - cell))


def _draw_code(axes: Axes, cells: NDArray[np.bool_], left: float, bottom: float, size: float) -> None:
    """The black square, and its white cells as runs along rows and columns: two white neighbours then have no seam between
    them in which a viewer could show the black below."""
    count = len(cells)
    cell = size / count
    axes.add_patch(Rectangle((left, bottom), size, size, facecolor="black", linewidth=0.0))
    for row, first, last in _runs(cells):
        at = (left + first * cell, bottom + (count - 1 - row) * cell)
        axes.add_patch(Rectangle(at, (last - first) * cell, cell, facecolor="white", linewidth=0.0))
    for column, first, last in _runs(cells.T):
        at = (left + column * cell, bottom + (count - last) * cell)
        axes.add_patch(Rectangle(at, cell, (last - first) * cell, facecolor="white", linewidth=0.0))


def _runs(cells: NDArray[np.bool_]) -> list[tuple[int, int, int]]:
    """Row, first and one past the last column of every run of white cells."""
    found = []
    for row, line in enumerate(cells):
        edges = np.flatnonzero(np.diff(np.concatenate(([False], line, [False])).astype(np.int8)))
        found += [(row, int(first), int(last)) for first, last in edges.reshape(-1, 2)]
    return found


def _draw_ticks(axes: Axes, left: float, bottom: float, size: float, cell: float) -> None:
    """Thin lines at the middle of each side, outside: a tape measure finds the square's middle by them."""
    start, middle = min(cell, 12.0), size / 2.0
    for x, y, dx, dy in (
        (left + middle, bottom - start, 0.0, -_TICK_MM),
        (left + middle, bottom + size + start, 0.0, _TICK_MM),
        (left - start, bottom + middle, -_TICK_MM, 0.0),
        (left + size + start, bottom + middle, _TICK_MM, 0.0),
    ):
        axes.plot((x, x + dx), (y, y + dy), color=_GREY, linewidth=0.5)


def _write(axes: Axes, settings: SheetSettings, number: int) -> None:
    width, _ = PAPER_MM[settings.paper]
    axes.text(width / 2.0, _NUMBER_MM, f"floor marker {number}", ha="center", va="center", fontsize=22)
    words = (
        f"family {settings.family}   number {number}   black square {settings.size_mm:g} mm   (dnb-edge calibrate markers)",
        "Lay it flat on the floor, anywhere the camera sees all of it. Keep the white border free.",
    )
    for k, line in enumerate(words):
        axes.text(width / 2.0, _WORDS_MM - 5.0 * k, line, ha="center", va="center", fontsize=9)


def _draw_bar(axes: Axes, left: float, bottom: float) -> None:
    """The check bar: its outer ends are `BAR_MM` apart."""
    axes.add_patch(Rectangle((left, bottom), BAR_MM, _BAR_HEIGHT_MM, facecolor="black", linewidth=0.0))
    for k in range(1, 10, 2):
        at = (left + BAR_MM / 10.0 * k, bottom + _BAR_HEIGHT_MM * 0.25)
        axes.add_patch(Rectangle(at, BAR_MM / 10.0, _BAR_HEIGHT_MM / 2.0, facecolor="white", linewidth=0.0))
    text = f"Print at 100 %, not fitted to the page. Then measure this bar: {BAR_MM:g} mm from end to end."
    axes.text(left + BAR_MM / 2.0, bottom - 4.0, text, ha="center", va="center", fontsize=9)
