"""How a large drawing is shared out over sheets of paper that overlap.

Knows lengths in millimetres: of paper, and of the drawing, x to the right and y up from its bottom left corner. Knows nothing
of what is drawn.

Sheets are glued on one another: each is cut at its left and its upper edge, where there is a neighbour, and laid over that
neighbour's overlap. So of each sheet the part up to the next one's edge stays in sight.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from dnb_edge.errors import InputError
from dnb_edge.prints.paper import PAPER_MM, Paper

MARGIN_MM = 10.0
"""White at every side of a sheet, which printers need."""
FOOT_MM = 14.0
"""Above the lower margin, for the bar and the words."""
_MOST_SHEETS = 400


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """An upright rectangle of the drawing, mm."""

    left: float
    bottom: float
    right: float
    top: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Tile:
    """One sheet's part of the drawing."""

    column: int
    """From the left, 0 first."""
    row: int
    """From the top, 0 first."""
    printed: Box
    """What is printed on it."""
    in_sight: Box
    """What is still seen when all are glued."""

    @property
    def name(self) -> str:
        """Such as `B3`: the second row's third sheet."""
        letters, row = "", self.row
        while row >= 0:
            letters, row = chr(ord("A") + row % 26) + letters, row // 26 - 1
        return f"{letters}{self.column + 1}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Tiling:
    """All sheets of a drawing."""

    page_mm: tuple[float, float]
    """Width and height of a sheet as it is printed."""
    columns: int
    rows: int
    tiles: tuple[Tile, ...]
    """Row by row, without those on which nothing would be."""

    def used(self, column: int, row: int) -> bool:
        """Whether there is a sheet in that place."""
        return any((tile.column, tile.row) == (column, row) for tile in self.tiles)

    def only(self, needed: Callable[[Box], bool]) -> Tiling:
        """Without the sheets on which nothing would be seen: `needed` says whether anything is in a box of the drawing."""
        return replace(self, tiles=tuple(tile for tile in self.tiles if needed(tile.in_sight)))


def tilings(size_mm: tuple[float, float], paper: Paper, *, overlap_mm: float) -> tuple[Tiling, Tiling]:
    """The drawing over upright and over lying sheets, all of them.

    All columns are equally wide, and so are all rows: the last sheets end where the drawing does, and overlaps are at least
    `overlap_mm`. Raises `InputError` where the overlap leaves no room, or hundreds of sheets would be needed.
    """
    width, height = PAPER_MM[paper]
    return _tiled(size_mm, (width, height), overlap_mm), _tiled(size_mm, (height, width), overlap_mm)


def whole(size_mm: tuple[float, float]) -> Tiling:
    """The drawing on one sheet as large as need be."""
    box = Box(left=0.0, bottom=0.0, right=size_mm[0], top=size_mm[1])
    page = (max(size_mm[0], 180.0) + 2.0 * MARGIN_MM, size_mm[1] + 2.0 * MARGIN_MM + FOOT_MM)
    return Tiling(page_mm=page, columns=1, rows=1, tiles=(Tile(column=0, row=0, printed=box, in_sight=box),))


def _tiled(size_mm: tuple[float, float], page_mm: tuple[float, float], overlap_mm: float) -> Tiling:
    shown = (page_mm[0] - 2.0 * MARGIN_MM, page_mm[1] - 2.0 * MARGIN_MM - FOOT_MM)
    if not 0.0 <= overlap_mm <= 0.5 * min(shown):
        raise InputError(
            f"--overlap-mm {overlap_mm:g}: must be from 0 to {0.5 * min(shown):g}, half of what a sheet shows"
        )
    columns, across = _steps(size_mm[0], shown[0], overlap_mm)
    rows, down = _steps(size_mm[1], shown[1], overlap_mm)
    if columns * rows > _MOST_SHEETS:
        raise InputError(
            f"a track of {size_mm[0] / 1000:.2f} x {size_mm[1] / 1000:.2f} m would take {columns * rows} sheets: print it on "
            "larger paper, or let a copy shop print it in one piece (--paper poster)"
        )
    tiles = []
    for row in range(rows):
        for column in range(columns):
            left, top = column * across, size_mm[1] - row * down
            printed = Box(
                left=left,
                bottom=max(0.0, top - shown[1]),
                right=min(size_mm[0], left + shown[0]),
                top=top,
            )
            in_sight = Box(
                left=left,
                bottom=printed.bottom if row == rows - 1 else top - down,
                right=printed.right if column == columns - 1 else left + across,
                top=top,
            )
            tiles.append(Tile(column=column, row=row, printed=printed, in_sight=in_sight))
    return Tiling(page_mm=page_mm, columns=columns, rows=rows, tiles=tuple(tiles))


def _steps(length: float, shown: float, overlap: float) -> tuple[int, float]:
    """How many sheets in a row, and from one's edge to the next one's."""
    if length <= shown:
        return 1, length
    count = math.ceil((length - overlap) / (shown - overlap) - 1e-9)
    return count, (length - shown) / (count - 1)
