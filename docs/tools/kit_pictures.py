"""Pictures of what is printed and where cameras hang: `python docs/tools/kit_pictures.py` writes them.

Knows the product's own drawings and docs/pictures/kit. PNG, since the sheets as SVG are large; a test draws them anew and
compares what is seen.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import mount_places
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from dnb_edge.mount.plan import MountPlan
from dnb_edge.prints.board import board_page
from dnb_edge.prints.floor import FloorSettings, floor_pages, placed, plan_page
from dnb_edge.prints.ground import circuit_size_m, circuit_track, ground_of, with_markers
from dnb_edge.prints.paper import Page, Paper
from dnb_edge.prints.roof import RoofSettings, roof_pages
from dnb_edge.prints.tiles import tilings
from dnb_edge.prints.track import map_page, tile_page
from dnb_edge.report.mount import mount_picture
from dnb_edge.sim.places import table_oval
from dnb_edge.view.boards import parse_board

FOLDER = Path(__file__).resolve().parents[1] / "pictures" / "kit"
_INK, _FAINT, _VIEW = "#1f2328", "#6e7781", "#dbe9f6"
_PANEL = (3.0, 2.6)
_GREY = (128, 120, 112)


def _row(pages: list[Page], *, dpi: float) -> bytes:
    """The sheets side by side, each with a thin rim, to one scale."""
    pictures = [
        cv2.copyMakeBorder(_drawn(page.figure, dpi), 2, 2, 2, 2, cv2.BORDER_CONSTANT, value=_GREY) for page in pages
    ]
    tall = max(len(picture) for picture in pictures)
    spread = [
        cv2.copyMakeBorder(picture, 0, tall - len(picture), 6, 6, cv2.BORDER_CONSTANT, value=(255, 255, 255))
        for picture in pictures
    ]
    return _png(np.hstack(spread))


def _drawn(figure: Figure, dpi: float) -> np.ndarray[Any, np.dtype[np.uint8]]:
    figure.set_dpi(dpi)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]
    seen = canvas.buffer_rgba()  # type: ignore[no-untyped-call]
    return np.asarray(seen, dtype=np.uint8)[..., 2::-1].copy()


def _png(picture: np.ndarray[Any, Any]) -> bytes:
    encoded, data = cv2.imencode(".png", picture)
    assert encoded, "OpenCV encodes any 8-bit picture as PNG"
    return data.tobytes()


def track_sheets() -> bytes:
    """The printed oval: its map, and two of its sheets."""
    circuit = table_oval()
    ground = ground_of(circuit_track(circuit), size_m=circuit_size_m(circuit), family="4X4_50", marker_mm=100.0)
    plan = min(tilings(ground.size_mm, Paper.A4, overlap_mm=10.0), key=lambda one: len(one.only(ground.needs).tiles))
    ground = with_markers(ground, plan, cells=6, numbers=tuple(range(40, 46)))
    plan = plan.only(ground.needs)
    numbered = [(tile, number) for number, tile in enumerate(plan.tiles, start=1) if tile.name in {"A1", "B2"}]
    return _row(
        [map_page(ground, plan, Paper.A4), *(tile_page(ground, plan, tile, number) for tile, number in numbered)],
        dpi=60.0,
    )


def markers_and_boards() -> bytes:
    """A sheet of roof markers, a floor marker, the plan of the floor markers, a board."""
    floor = FloorSettings(family="4X4_50", numbers=tuple(range(6)), size_mm=150.0, paper=Paper.A4)
    roof = RoofSettings(family="4X4_50", numbers=(1, 2, 3, 4), size_mm=70.0, paper=Paper.A4)
    pages = [
        next(iter(roof_pages(roof))),
        next(iter(floor_pages(floor))),
        plan_page(floor, placed(floor.numbers, (2.0, 1.5)), (2.0, 1.5)),
        board_page(parse_board("charuco:5x7:30mm:22mm"), Paper.A4),
    ]
    return _row(pages, dpi=46.0)


def mount_plan(ground: mount_places.Ground) -> bytes:
    """Side and top view of the pictured camera over a track."""
    plan = (
        mount_places.planned(ground, mount_places.PAPER, mount_places.PAPERS)
        if ground.pictured == "paper"
        else mount_places.planned(ground, mount_places.SHOWN[ground.pictured])
    )
    assert plan is not None, "its camera sees the track"
    return mount_picture(plan)


def mount_cameras(ground: mount_places.Ground) -> bytes:
    """Each camera over a track, from the side, to one scale."""
    plans = [(camera.title, mount_places.planned(ground, camera)) for camera in mount_places.SHOWN.values()]
    columns, rows = 4, math.ceil(len(plans) / 4)
    behind = max([0.3, *(plan.camera.stand.distance_m + 0.25 for _, plan in plans if plan is not None)])
    figure = Figure(figsize=(_PANEL[0] * columns, _PANEL[1] * rows), dpi=80, facecolor="white")
    for k, (title, plan) in enumerate(plans):
        row, column = divmod(k, columns)
        axes = figure.add_axes((column / columns, 1.0 - (row + 1) / rows, 1.0 / columns, 1.0 / rows))
        _side(axes, ground, title, plan, behind)
    return _png(_drawn(figure, 80.0))


def _side(axes: Axes, ground: mount_places.Ground, title: str, plan: MountPlan | None, behind_m: float) -> None:
    """Floor, track, camera and what it sees; metres from the track's near edge to the right."""
    low, high, top = -behind_m - 0.1, ground.depth_m + 0.35, ground.highest_m
    across, up = high - low, 1.75 * top
    scale = max(across / _PANEL[0], up / _PANEL[1])
    middle = 0.5 * (low + high)
    axes.set_xlim(middle - 0.5 * scale * _PANEL[0], middle + 0.5 * scale * _PANEL[0])
    axes.set_ylim(1.45 * top - scale * _PANEL[1], 1.45 * top)
    axes.set_axis_off()
    axes.text(
        middle, 1.32 * top, title.replace("Raspberry Pi ", ""), fontsize=9.5, color=_INK, ha="center", va="bottom"
    )
    axes.plot((low, high), (0.0, 0.0), color=_FAINT, linewidth=0.8)
    axes.plot((low, high), (top, top), color=_FAINT, linewidth=0.6, linestyle=(0, (4, 4)))
    axes.plot((0.0, ground.depth_m), (0.0, 0.0), color=_INK, linewidth=4.0, solid_capstyle="butt")
    if plan is None:
        needed = mount_places.height_needed_m(ground, next(c for c in mount_places.SHOWN.values() if c.title == title))
        words = "does not see all of it" if needed is None else f"from {needed:.1f} m up only"
        axes.text(middle, 0.5 * top, words, ha="center", va="center", fontsize=9, color="#c0281c")
        return
    stand, optics = plan.camera.stand, plan.request.optics
    at = (-stand.distance_m, stand.height_m)
    rays = [math.radians(stand.pitch_deg + side * 0.5 * optics.vfov_deg) for side in (1, -1)]
    ends = [
        (at[0] + length * math.cos(ray), at[1] - length * math.sin(ray))
        for ray in rays
        for length in (min(at[1] / max(math.sin(ray), 1e-6), 30.0),)
    ]
    axes.add_patch(Polygon([at, *ends], facecolor=_VIEW, edgecolor="#4a7fb5", linewidth=0.9, zorder=0))
    axes.plot(*at, marker="s", markersize=6, color=_INK)
    said = f"{stand.height_m:.2f} m, {stand.pitch_deg:g}\N{DEGREE SIGN}"
    beside = min(max(at[0], low + 0.25 * across), high - 0.25 * across)
    axes.text(beside, at[1] + 0.06 * top, said, ha="center", va="bottom", fontsize=9, color=_INK)
    edge = (
        f"{stand.distance_m:.2f} m before the edge"
        if stand.distance_m >= 0
        else f"{-stand.distance_m:.2f} m over the track"
    )
    worst = f"{edge}; px {plan.worst.resolution.worst_mm:.1f} mm"
    axes.text(middle, -0.07 * top, worst, ha="center", va="top", fontsize=8, color=_FAINT)


PICTURES: dict[str, Callable[[], bytes]] = {
    "track-sheets.png": track_sheets,
    "markers-and-boards.png": markers_and_boards,
    **{f"mount-{ground.name}.png": partial(mount_plan, ground) for ground in mount_places.GROUNDS},
    **{f"mount-{ground.name}-cameras.png": partial(mount_cameras, ground) for ground in mount_places.GROUNDS},
}
"""Each picture's file in docs/pictures/kit, and what draws it."""


def main() -> int:
    """Write all pictures."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, draw in PICTURES.items():
        (FOLDER / name).write_bytes(draw())
        sys.stdout.write(f"{FOLDER / name}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
