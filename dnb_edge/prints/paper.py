"""Sheets of paper, to scale: one unit of a sheet's only axes is one millimetre, from the bottom left corner.

Knows paper, matplotlib's PDF and SVG, and the bar by which a print is checked. Knows nothing of what is printed.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from dnb_edge.errors import InputError

BAR_MM = 100.0
"""Length of the check bar on every sheet."""
BAR_HEIGHT_MM = 4.0
INK, GREY, FAINT = "#1f2328", "#606870", "#b0b0b0"

_MM_PER_INCH = 25.4


class Paper(StrEnum):
    """Sizes of paper."""

    A4 = "a4"
    A3 = "a3"
    LETTER = "letter"


PAPER_MM = {Paper.A4: (210.0, 297.0), Paper.A3: (297.0, 420.0), Paper.LETTER: (215.9, 279.4)}
"""Width and height, upright."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Page:
    """One sheet, drawn."""

    name: str
    """Short, fit for a file's name, such as `B3`."""
    figure: Figure


def parse_paper(text: str) -> Paper:
    """The paper of that name, in any case. Raises `InputError`."""
    if text.lower() not in set(Paper):
        raise InputError(f"--paper {text}: must be one of {', '.join(Paper)}")
    return Paper(text.lower())


def blank(width_mm: float, height_mm: float) -> tuple[Figure, Axes]:
    """An empty sheet and its axes, in millimetres of paper."""
    figure = Figure(figsize=(width_mm / _MM_PER_INCH, height_mm / _MM_PER_INCH), facecolor="white")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_xlim(0.0, width_mm)
    axes.set_ylim(0.0, height_mm)
    return figure, axes


def draw_bar(axes: Axes, left_mm: float, bottom_mm: float) -> None:
    """The check bar: its outer ends are `BAR_MM` apart, its boxes 10 mm."""
    box = BAR_MM / 10.0
    axes.add_patch(Rectangle((left_mm, bottom_mm), BAR_MM, BAR_HEIGHT_MM, facecolor="black", linewidth=0.0))
    for k in range(1, 10, 2):
        at = (left_mm + box * k, bottom_mm + BAR_HEIGHT_MM * 0.25)
        axes.add_patch(Rectangle(at, box, BAR_HEIGHT_MM / 2.0, facecolor="white", linewidth=0.0))


def write(axes: Axes, at_mm: tuple[float, float], text: str, *, size: float = 9.0, **how: Any) -> None:
    """Text on the sheet, its baseline's left end at `at_mm` unless told otherwise; signs of TeX stand as they are."""
    kept: dict[str, Any] = {"color": INK, "fontsize": size, "parse_math": False, **how}
    axes.text(*at_mm, text, **kept)


def pdf_of(pages: Iterable[Page], *, title: str) -> bytes:
    """All pages as one PDF file. No date and no chance gets into it: the same pages are the same bytes."""
    stream = io.BytesIO()
    metadata = {"Title": title, "Creator": "dnb-edge", "CreationDate": None}
    with _exact(), PdfPages(stream, metadata=metadata) as file:
        for page in pages:
            file.savefig(page.figure)
    return stream.getvalue()


def svgs_of(pages: Iterable[Page]) -> Iterator[tuple[str, bytes]]:
    """Name and SVG file of each page, with its size in points; text as outlines, the same bytes each time."""
    for page in pages:
        stream = io.BytesIO()
        with _exact():
            page.figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": "dnb-edge"})
        yield page.name, stream.getvalue()


@contextmanager
def _exact() -> Iterator[None]:
    """No point of a line is left out, whatever the user's own settings of matplotlib say."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update({"pdf.fonttype": 42, "path.simplify": False, "svg.hashsalt": "dnb-edge"})
        yield
