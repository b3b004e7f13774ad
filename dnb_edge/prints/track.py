"""A track to print: sheets that are glued together, a map of them, and the twin's picture of the same floor.

Knows the floor's drawing and how it is shared out; knows no file and no printer.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch, Polygon, Rectangle
from matplotlib.path import Path
from numpy.typing import NDArray

from dnb_edge.prints.code import draw_code
from dnb_edge.prints.ground import BORDER_MM, TWIN_METRES_PER_PX, Ground
from dnb_edge.prints.paper import BAR_MM, FAINT, GREY, INK, PAPER_MM, Page, Paper, blank, draw_bar, write
from dnb_edge.prints.tiles import FOOT_MM, MARGIN_MM, Tile, Tiling
from dnb_edge.sim.circuit import lane_bgr
from dnb_edge.values import BgrImage, Points
from dnb_edge.view.markers import marker_cells

_BORDER_BGR = (70, 62, 58)
_CROSS_MM = 8.0
_MARK: dict[str, Any] = {"color": "#404040", "linewidth": 0.5}
_SUPERSAMPLE = 4
_STRIP_PX = 250


def track_pages(ground: Ground, tiling: Tiling, paper: Paper) -> Iterator[Page]:
    """The map, then every sheet, row by row."""
    if len(tiling.tiles) > 1:
        yield map_page(ground, tiling, paper)
    for number, tile in enumerate(tiling.tiles, start=1):
        yield tile_page(ground, tiling, tile, number)


def tile_page(ground: Ground, tiling: Tiling, tile: Tile, number: int) -> Page:
    """One sheet: its part of the floor, where to cut it, where the next ones lie, its name and the bar."""
    width, height = tiling.page_mm
    figure, axes = blank(width, height)
    box = tile.printed
    left, bottom = MARGIN_MM, height - MARGIN_MM - (box.top - box.bottom)
    window = Rectangle((left, bottom), box.right - box.left, box.top - box.bottom, facecolor="none", linewidth=0.0)
    axes.add_patch(window)
    draw_ground(axes, ground, scale=1.0, shift=(left - box.left, bottom - box.bottom), clip=window)
    _crosses(axes, tiling, tile, (left - box.left, bottom - box.bottom), window)
    _cuts(axes, tiling, tile, (left, bottom))
    _foot(axes, ground, tiling, tile, number)
    return Page(name=tile.name, figure=figure)


def map_page(ground: Ground, tiling: Tiling, paper: Paper) -> Page:
    """The whole floor, small, with every sheet's name in its place, and how they are put together."""
    width, height = PAPER_MM[paper]
    figure, axes = blank(width, height)
    write(axes, (MARGIN_MM, height - 20.0), f"{ground.name}: how the sheets lie", size=15)
    metres = " x ".join(f"{length / 1000.0:.2f} m" for length in ground.size_mm)
    said = (
        f"{metres}, one lap {ground.length_m:.2f} m, {len(tiling.tiles)} sheets of {paper.value.upper()} and this one"
    )
    write(axes, (MARGIN_MM, height - 27.0), said, size=9.5, color=GREY)
    scale = min((width - 2.0 * MARGIN_MM) / ground.size_mm[0], (height - 125.0) / ground.size_mm[1])
    shift = ((width - scale * ground.size_mm[0]) / 2.0, height - 34.0 - scale * ground.size_mm[1])
    draw_ground(axes, ground, scale=scale, shift=shift, clip=None)
    for tile in tiling.tiles:
        box = tile.in_sight
        at = (shift[0] + scale * box.left, shift[1] + scale * box.bottom)
        size = (scale * (box.right - box.left), scale * (box.top - box.bottom))
        axes.add_patch(Rectangle(at, *size, facecolor="none", edgecolor=INK, linewidth=0.7))
        corner = (at[0] + 1.2, at[1] + size[1] - 1.2)
        back = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0}
        write(axes, corner, tile.name, size=8, va="top", bbox=back, weight="bold")
    for one in ground.markers:
        x, y = (scale * ground.to_mm(np.array([one.at_m]))[0] + shift).tolist()
        below = y - scale * ground.marker_mm * 0.5 - 2.2
        write(axes, (x, below), f"marker {one.number}", size=6, ha="center", va="center", color=GREY)
    _steps(axes, ground, shift[1] - 10.0)
    draw_bar(axes, MARGIN_MM, 12.0)
    write(axes, (MARGIN_MM + BAR_MM + 3.0, 12.6), "100 mm", size=8)
    return Page(name="map", figure=figure)


def draw_ground(
    axes: Axes, ground: Ground, *, scale: float, shift: tuple[float, float], clip: Rectangle | None
) -> None:
    """The floor on a sheet: the drawing's mm times `scale`, then moved by `shift`, cut at `clip` where one is given."""

    def on_paper(points: Points) -> Points:
        return np.asarray(points * scale + shift)

    border, lane = ground.border_mm(), (ground.left_mm, ground.right_mm)
    near = None if clip is None else _near(ground, scale, shift, clip)
    blue, green, red = (part / 255.0 for part in lane_bgr())
    paint = (red, green, blue) if ground.filled else (1.0, 1.0, 1.0)
    ink = tuple(part / 255.0 for part in reversed(_BORDER_BGR))
    parts = [
        PathPatch(_band(*map(on_paper, border), closed=ground.closed, near=near), facecolor=ink, linewidth=0.0),
        PathPatch(
            _band(*map(on_paper, lane), closed=ground.closed, near=near),
            facecolor=paint,
            linewidth=0.0,
        ),
        *(Polygon(on_paper(flag), facecolor=ink, linewidth=0.0) for flag in ground.flags_mm),
    ]
    if ground.arrow_mm is not None:
        parts.append(Polygon(on_paper(ground.arrow_mm), facecolor=FAINT, linewidth=0.0))
    for part in parts:
        axes.add_patch(part)
        if clip is not None:
            part.set_clip_path(clip)
    side = scale * ground.marker_mm
    for one in ground.markers:
        x, y = on_paper(ground.to_mm(np.array([one.at_m])))[0].tolist()
        if clip is None or _touches(clip, x, y, side):
            draw_code(axes, marker_cells(ground.family, one.number), x - side / 2.0, y - side / 2.0, side, clip=clip)


def twin_picture(ground: Ground) -> BgrImage:
    """The same floor from straight above, without markers: `TWIN_METRES_PER_PX` a px, shape (height, width, 3)."""
    px_per_mm = 0.001 / TWIN_METRES_PER_PX
    width, height = (round(length * px_per_mm) for length in ground.size_mm)
    # In strips: the whole of a hall, four times as fine, would fill a small board's memory.
    strips = [_twin_strip(ground, top, min(_STRIP_PX, height - top), width) for top in range(0, height, _STRIP_PX)]
    return np.vstack(strips)


def _twin_strip(ground: Ground, top: int, rows: int, columns: int) -> BgrImage:
    """The twin's picture from row `top` on, (rows, columns, 3)."""
    px_per_mm = 0.001 / TWIN_METRES_PER_PX
    canvas = np.full((rows * _SUPERSAMPLE, columns * _SUPERSAMPLE, 3), 255, dtype=np.uint8)

    def on_canvas(points: Points) -> np.ndarray[tuple[int, ...], np.dtype[np.int32]]:
        # A px's middle is its coordinate: twin px u lies at supersample * (u + 0.5) - 0.5 on the enlarged canvas.
        twin = points * (px_per_mm, -px_per_mm) + (0.0, round(ground.size_mm[1] * px_per_mm) - top)
        return np.asarray(np.rint((twin + 0.5) * _SUPERSAMPLE - 0.5), dtype=np.int32)

    for edges, colour in ((ground.border_mm(), _BORDER_BGR), ((ground.left_mm, ground.right_mm), lane_bgr())):
        for quad in _quads(*edges, closed=ground.closed):
            cv2.fillConvexPoly(canvas, on_canvas(quad), colour)
    for flag in ground.flags_mm:
        cv2.fillConvexPoly(canvas, on_canvas(flag), _BORDER_BGR)
    return np.asarray(cv2.resize(canvas, (columns, rows), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _band(left: Points, right: Points, *, closed: bool, near: NDArray[np.bool_] | None = None) -> Path:
    """What lies between two edges, filled by winding: so a lane that crosses itself has no hole there.

    `near` says of each point whether that part of the band is wanted; the rest is left out, which keeps a sheet's file small.
    """
    if near is None or near.all():
        if closed:
            return _rings([left, right[::-1]])
        near = np.ones(len(left), dtype=bool)
    elif closed:
        # Begin where nothing is wanted, so that no stretch is cut in two.
        first = -int(np.flatnonzero(~near)[0])
        left, right, near = np.roll(left, first, axis=0), np.roll(right, first, axis=0), np.roll(near, first)
    ends = np.flatnonzero(np.diff(np.concatenate(([False], near, [False])).astype(np.int8))).reshape(-1, 2)
    return _rings([np.vstack((left[a:b], right[a:b][::-1])) for a, b in ends.tolist()])


def _rings(rings: list[Points]) -> Path:
    closed = [np.vstack((ring, ring[:1])) for ring in rings]
    codes = [code for ring in closed for code in (Path.MOVETO, *([Path.LINETO] * (len(ring) - 2)), Path.CLOSEPOLY)]
    return Path(np.vstack([np.empty((0, 2)), *closed]), codes or None)


def _near(ground: Ground, scale: float, shift: tuple[float, float], clip: Rectangle) -> NDArray[np.bool_]:
    """(n,) whether a point of the lane is so near to the clip that its part of the lane may be seen in it."""
    low = (np.array(clip.get_xy()) - shift) / scale
    high = low + np.array((clip.get_width(), clip.get_height())) / scale
    half = np.maximum(*(np.linalg.norm(edge - ground.middle_mm, axis=1) for edge in (ground.left_mm, ground.right_mm)))
    steps = np.linalg.norm(np.diff(ground.middle_mm, axis=0), axis=1)
    reach = (half + BORDER_MM + 2.0 * float(steps.max()))[:, None]
    return np.asarray(np.all((ground.middle_mm > low - reach) & (ground.middle_mm < high + reach), axis=1))


def _quads(left: Points, right: Points, *, closed: bool) -> Iterator[Points]:
    count = len(left)
    for k in range(count if closed else count - 1):
        after = (k + 1) % count
        yield np.array((left[k], left[after], right[after], right[k]))


def _touches(clip: Rectangle, x: float, y: float, side: float) -> bool:
    left, bottom, width, height = clip.get_x(), clip.get_y(), clip.get_width(), clip.get_height()
    reach = side / 2.0
    return bool(left - reach < x < left + width + reach and bottom - reach < y < bottom + height + reach)


def _crosses(axes: Axes, tiling: Tiling, tile: Tile, shift: tuple[float, float], clip: Rectangle) -> None:
    """A thin cross wherever sheets' edges meet: a sheet that is cut at its own lies right where it covers the other's."""
    across = sorted({one.in_sight.left for one in tiling.tiles if one.column > 0})
    up = sorted({one.in_sight.top for one in tiling.tiles if one.row > 0})
    box = tile.printed
    nodes = {(x, y) for x in across for y in (*up, box.top - _CROSS_MM, box.bottom + _CROSS_MM)}
    nodes |= {(x, y) for y in up for x in (box.left + _CROSS_MM, box.right - _CROSS_MM)}
    for x, y in sorted(nodes):
        if not (box.left <= x <= box.right and box.bottom <= y <= box.top):
            continue
        for dx, dy in ((_CROSS_MM / 2.0, 0.0), (0.0, _CROSS_MM / 2.0)):
            at = (x + shift[0], y + shift[1])
            (line,) = axes.plot((at[0] - dx, at[0] + dx), (at[1] - dy, at[1] + dy), **_MARK)
            line.set_clip_path(clip)


def _cuts(axes: Axes, tiling: Tiling, tile: Tile, at: tuple[float, float]) -> None:
    """Lines to cut along, on the left and above, where there is a sheet to be laid over; else a faint outline."""
    (left, bottom), box = at, tile.printed
    right, top = left + box.right - box.left, bottom + box.top - box.bottom
    cut: dict[str, Any] = {"color": "black", "linewidth": 0.4, "linestyle": (0, (8, 4))}
    if tiling.used(tile.column - 1, tile.row):
        axes.plot((left, left), (bottom - 4.0, top + 4.0), **cut)
        write(axes, (left - 1.5, top + 4.5), "\N{BLACK SCISSORS}", size=11, ha="center", rotation=270)
    if tiling.used(tile.column, tile.row - 1):
        axes.plot((left - 4.0, right + 4.0), (top, top), **cut)
        write(axes, (left - 8.0, top - 1.3), "\N{BLACK SCISSORS}", size=11)


def _foot(axes: Axes, ground: Ground, tiling: Tiling, tile: Tile, number: int) -> None:
    bottom = MARGIN_MM
    draw_bar(axes, MARGIN_MM, bottom)
    words = f"100 mm; print at 100 %   {ground.name}, sheet {number} of {len(tiling.tiles)}"
    write(axes, (MARGIN_MM, bottom + 6.0), words, size=7, color=GREY)
    over = [
        f"over {Tile(column=column, row=row, printed=tile.printed, in_sight=tile.in_sight).name}"
        for column, row in ((tile.column - 1, tile.row), (tile.column, tile.row - 1))
        if tiling.used(column, row)
    ]
    said = (
        f"cut, then lay {' and '.join(over)}" if over else "cut nothing; begin here" if number == 1 else "cut nothing"
    )
    write(axes, (MARGIN_MM + BAR_MM + 4.0, bottom + 0.8), said, size=7, color=GREY)
    at = (tiling.page_mm[0] - MARGIN_MM, bottom)
    write(axes, at, tile.name, size=24, ha="right", weight="bold", color=GREY)
    assert FOOT_MM > 10.0, "the words and the bar fit below the drawing"


def _steps(axes: Axes, ground: Ground, top: float) -> None:
    lines = [
        "1  Print at 100 %, not fitted to the page. The bar on each sheet must measure 100 mm; 99 mm is a track 1 % too small.",
        "2  Cut each sheet along its dashed lines, on the left and above. Leave the other two sides as they are.",
        "3  Glue the sheets of a row from left to right, then the rows from top to bottom: each cut edge goes onto the thin",
        "    crosses of the sheet before, so that cross lies on cross. Begin with the first sheet; work on a flat floor.",
        f"4  {_checked(ground)}Glue or tape it to the table.",
    ]
    if ground.markers:
        lines.append(
            "5  The camera finds the markers: dnb-edge calibrate markers --layout ... (the file beside this one has all of it)."
        )
    for k, line in enumerate(lines):
        write(axes, (MARGIN_MM, top - 5.4 * k), line, size=8.2)


def _checked(ground: Ground) -> str:
    """What to measure across the glued sheets: two ways between markers, as far from one another as markers are."""
    if len(ground.markers) < 4:
        return ""
    ways = (
        f"{one.number} to {other.number} is {math.dist(one.at_m, other.at_m):.3f} m"
        for one, other in zip(ground.markers[:2], ground.markers[2:4], strict=True)
    )
    return f"Measure the markers from middle to middle: {', '.join(ways)}. "
