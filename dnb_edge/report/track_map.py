"""The map under a driven path: twin or drawn lane, centreline, start, finish and sector lines, and a scale.

Knows a track and matplotlib's objects. Knows no lap and no page. All on twin px, v down.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from dnb_edge.report.lap_style import DPI, HALO, INK, LANE, PAPER, QUIET
from dnb_edge.track.line import DirectedLine
from dnb_edge.track.model import Track
from dnb_edge.values import BgrImage, Points

_MARGIN = 0.06


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrackMap:
    """A figure with the map, for paths to be drawn on from z-order 3."""

    figure: Figure
    axes: Axes


def track_map(
    track: Track, twin: BgrImage | None, paths_px: Sequence[Points], *, width_in: float | None = None
) -> TrackMap:
    """The map with room for `paths_px`, each (n, 2), twin px; `width_in` inches wide, or as fits a page."""
    edges_px = _lane_edges_px(track)
    closed = track.centreline.closed
    ends_px = [_ends_px(track, line) for line in track.lines]
    low, high = _frame_px([*edges_px, *paths_px, *ends_px])
    width_px, height_px = high - low
    figure = Figure(
        figsize=_figure_size(width_px / height_px, width_in), dpi=DPI, facecolor=PAPER, layout="constrained"
    )
    axes = figure.subplots()
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(high[1], low[1])
    if twin is None:
        _draw_lane(axes, *edges_px, closed=closed)
    else:
        _draw_twin(axes, twin)
    centreline_px = _joined(track.scale.to_twin_px(track.centreline.points_m), closed=closed)
    axes.plot(*centreline_px.T, color=INK, linewidth=0.9, linestyle=(0, (4, 4)), zorder=2, label="centreline")
    _draw_lines(axes, track, size_px=float(max(width_px, height_px)))
    _draw_scale_bar(axes, track, low, high)
    return TrackMap(figure=figure, axes=axes)


def round_length_m(length_m: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is not above `length_m`, which is positive."""
    power = 10.0 ** math.floor(math.log10(length_m))
    return max(step * power for step in (1, 2, 5) if step * power <= length_m * (1 + 1e-9))


def _figure_size(width_to_height: float, width_in: float | None) -> tuple[float, float]:
    """Inches: 9 wide where nothing else is wanted, or less for tall tracks, with room for the legend."""
    width = width_in or (9.0 if width_to_height > 0.9 else 7.0)
    return width, min(max(width / width_to_height, 2.5), 9.0) + 0.6


def _lane_edges_px(track: Track) -> tuple[Points, Points]:
    """The lane's left and right edge, each (n, 2), twin px, one point for each of the centreline's."""
    route = track.centreline
    points = route.points_m
    ahead = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0) if route.closed else np.gradient(points, axis=0)
    length = np.maximum(np.hypot(ahead[:, 0], ahead[:, 1]), np.finfo(np.float64).tiny)
    normals = np.column_stack((-ahead[:, 1], ahead[:, 0])) / length[:, None]
    left = track.scale.to_twin_px(route.points_m + normals * route.half_left_m[:, None])
    right = track.scale.to_twin_px(route.points_m - normals * route.half_right_m[:, None])
    return left, right


def _frame_px(parts: Sequence[Points]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lowest and highest (u, v) over all parts with a margin, twin px."""
    every = np.concatenate(parts)
    low, high = every.min(axis=0), every.max(axis=0)
    margin = _MARGIN * float((high - low).max())
    return low - margin, high + margin


def _joined(points: Points, *, closed: bool) -> Points:
    """The points, with the first again behind the last where the line is closed."""
    return np.concatenate((points, points[:1])) if closed else points


def _draw_lane(axes: Axes, left: Points, right: Points, *, closed: bool) -> None:
    """The lane as one quadrilateral a step, which stays right where the route crosses itself."""
    outer, inner = _joined(right, closed=closed), _joined(left, closed=closed)
    quads = [np.array([a, b, d, c]) for (a, b), (c, d) in zip(pairwise(inner), pairwise(outer), strict=True)]
    axes.add_collection(PolyCollection(quads, facecolors=LANE, edgecolors=LANE, linewidths=0.6, zorder=0))
    for edge in (inner, outer):
        axes.plot(*edge.T, color=QUIET, linewidth=0.8, zorder=1)


def _draw_twin(axes: Axes, twin: BgrImage) -> None:
    """The twin's picture, paled so that the paths stand out; pixel centres at whole numbers."""
    height_px, width_px = twin.shape[:2]
    extent = (-0.5, width_px - 0.5, height_px - 0.5, -0.5)
    limits = axes.axis()
    axes.imshow(twin[:, :, ::-1], extent=extent, alpha=0.55, interpolation="antialiased", zorder=0)
    axes.axis(limits)


def _ends_px(track: Track, line: DirectedLine) -> Points:
    return track.scale.to_twin_px(np.array([line.start_m, line.end_m]))


def _draw_lines(axes: Axes, track: Track, *, size_px: float) -> None:
    """Start and finish line in black and white, sector lines plain, all named by our own words on a picture of `size_px`."""
    for number, line in enumerate(track.sector_lines, start=1):
        ends = _ends_px(track, line)
        axes.plot(*ends.T, color=PAPER, linewidth=4.0, solid_capstyle="butt", zorder=3.9)
        axes.plot(*ends.T, color=INK, linewidth=2.0, solid_capstyle="butt", zorder=4)
        _name_line(axes, ends, f"S{number}", away_px=0.018 * size_px)
    if track.finish_line is not None:
        ends = _ends_px(track, track.finish_line)
        _draw_chequered(axes, ends)
        _name_line(axes, ends, "finish", away_px=0.022 * size_px)
    ends = _ends_px(track, track.start_line)
    _draw_chequered(axes, ends)
    _draw_start_arrow(axes, track.start_line, ends, length_px=0.06 * size_px)


def _draw_chequered(axes: Axes, ends: Points) -> None:
    axes.plot(*ends.T, color=INK, linewidth=5.0, solid_capstyle="butt", zorder=4)
    axes.plot(*ends.T, color=PAPER, linewidth=3.2, linestyle=(0, (1.2, 1.2)), dash_capstyle="butt", zorder=4)


def _name_line(axes: Axes, ends: Points, name: str, *, away_px: float) -> None:
    """The name beyond the line's first end."""
    u, v = ends[0] + away_px * _outward(ends)
    axes.text(u, v, name, ha="center", va="center", fontsize=10, color=INK, path_effects=HALO, zorder=5)


def _outward(ends: Points) -> NDArray[np.float64]:
    """Unit vector along the line, away from it at its first end."""
    return np.asarray((ends[0] - ends[1]) / np.hypot(*(ends[0] - ends[1])))


def _draw_start_arrow(axes: Axes, line: DirectedLine, ends: Points, *, length_px: float) -> None:
    """An arrow in the direction of a forward crossing, `length_px` long, and the line's name."""
    forward = np.array([line.forward[0], -line.forward[1]])
    tail = ends[0] + _outward(ends) * 0.3 * length_px
    axes.annotate(
        "",
        xy=tuple(tail + forward * length_px),
        xytext=tuple(tail),
        arrowprops={"arrowstyle": "-|>", "color": INK, "linewidth": 1.8, "mutation_scale": 16},
        zorder=5,
    )
    _name_line(axes, ends, "start", away_px=0.65 * length_px)


def _draw_scale_bar(axes: Axes, track: Track, low: NDArray[np.float64], high: NDArray[np.float64]) -> None:
    """A bar of a round number of metres, about a sixth of the picture wide, in the lower left corner."""
    width_px, height_px = high - low
    length_m = round_length_m(float(width_px) * track.scale.metres_per_px / 6)
    length_px = length_m / track.scale.metres_per_px
    u, v = low[0] + 0.02 * width_px, high[1] - 0.025 * height_px
    axes.plot((u, u + length_px), (v, v), color=INK, linewidth=3.0, solid_capstyle="butt", zorder=5, path_effects=HALO)
    axes.text(
        u + length_px / 2,
        v - 0.012 * height_px,
        f"{length_m:g} m" if length_m >= 1 else f"{length_m * 100:g} cm",
        ha="center",
        va="bottom",
        fontsize=10,
        color=INK,
        path_effects=HALO,
        zorder=5,
    )
