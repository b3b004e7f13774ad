"""One printed square code, in rectangles.

Knows cells and millimetres of paper. Knows no family of codes.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch, Rectangle
from numpy.typing import NDArray


def draw_code(
    axes: Axes,
    cells: NDArray[np.bool_],
    left_mm: float,
    bottom_mm: float,
    size_mm: float,
    *,
    clip: Patch | None = None,
) -> None:
    """The black square and its white cells, cut at the patch `clip` where one is given.

    White cells are drawn as runs along rows and columns: two white neighbours then have no seam between them in which a viewer
    could show the black below.
    """
    count = len(cells)
    cell = size_mm / count
    parts = [Rectangle((left_mm, bottom_mm), size_mm, size_mm, facecolor="black", linewidth=0.0)]
    for row, first, last in _runs(cells):
        at = (left_mm + first * cell, bottom_mm + (count - 1 - row) * cell)
        parts.append(Rectangle(at, (last - first) * cell, cell, facecolor="white", linewidth=0.0))
    for column, first, last in _runs(cells.T):
        at = (left_mm + column * cell, bottom_mm + (count - last) * cell)
        parts.append(Rectangle(at, cell, (last - first) * cell, facecolor="white", linewidth=0.0))
    for part in parts:
        axes.add_patch(part)
        if clip is not None:
            part.set_clip_path(clip)


def _runs(cells: NDArray[np.bool_]) -> list[tuple[int, int, int]]:
    """Row, first and one past the last column of every run of white cells."""
    found = []
    for row, line in enumerate(cells):
        edges = np.flatnonzero(np.diff(np.concatenate(([False], line, [False])).astype(np.int8)))
        found += [(row, int(first), int(last)) for first, last in edges.reshape(-1, 2)]
    return found
