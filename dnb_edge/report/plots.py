"""The pictures of a report: each lap's driven path on the twin, and the lap times with their uncertainty.

Knows matplotlib, by its objects only: no pyplot, no display, no state shared between figures. Pictures hold numbers and
our own words, never a user's text. Knows no page and no file.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import matplotlib.patheffects as effects
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from dnb_edge.report.picture import PictureFormat, encoded
from dnb_edge.report.run import RunResult
from dnb_edge.track.model import Track
from dnb_edge.values import BgrImage, Lap, Points

LAP_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#8c3b80", "#56a0d3", "#b58900", "#222222")
"""Told apart with any kind of colour vision (after Okabe and Ito, darkened to show on white)."""
LAP_STYLES: tuple[str | tuple[int, tuple[int, ...]], ...] = ("solid", (0, (6, 2)), (0, (2, 2)))
"""Beyond seven laps the colours come again in another dash."""

_DPI = 110
_INK = "#1f2328"
_LANE = "#d5dbe1"
_LANE_EDGE = "#8b949e"
_PAPER = "#ffffff"
_HALO = [effects.withStroke(linewidth=4.0, foreground=_PAPER)]
_LEGEND_LAPS = 14
_MARGIN = 0.06


def path_picture(result: RunResult, *, picture_format: PictureFormat = "png") -> bytes:
    """The driven path of each lap on the twin, or on the drawn lane where the result has no twin's picture."""
    track = result.track
    edges_px = _lane_edges_px(track)
    closed = track.centreline.closed
    paths_px = [track.scale.to_twin_px(path) for path in result.paths_m]
    start_px = track.scale.to_twin_px(np.array([track.start_line.start_m, track.start_line.end_m]))
    low, high = _frame_px([*edges_px, *paths_px, start_px])
    width_px, height_px = high - low
    figure = Figure(figsize=_figure_size(width_px / height_px), dpi=_DPI, facecolor=_PAPER, layout="constrained")
    axes = figure.subplots()
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(high[1], low[1])
    if result.twin is None:
        _draw_lane(axes, *edges_px, closed=closed)
    else:
        _draw_twin(axes, result.twin)
    centreline_px = _joined(track.scale.to_twin_px(track.centreline.points_m), closed=closed)
    axes.plot(*centreline_px.T, color=_INK, linewidth=0.9, linestyle=(0, (4, 4)), zorder=2, label="centreline")
    for i, (lap, path_px) in enumerate(zip(result.laps, paths_px, strict=True)):
        _draw_lap(axes, lap, path_px, i)
    _draw_start_line(axes, track, length_px=0.06 * float(max(width_px, height_px)))
    _draw_scale_bar(axes, track, low, high)
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        shown = min(len(handles), _LEGEND_LAPS)
        if shown < len(handles):
            labels[shown - 1] = f"and {len(handles) - shown + 1} more"
        figure.legend(
            handles[:shown], labels[:shown], loc="outside lower center", ncols=min(shown, 5), frameon=False, fontsize=10
        )
    return encoded(figure, picture_format)


def lap_times_picture(result: RunResult, *, picture_format: PictureFormat = "png") -> bytes:
    """Lap times as bars from zero, each with a whisker of one sigma and both figures in words."""
    laps = result.laps
    figure = Figure(figsize=(9.0, 1.0 + 0.4 * max(len(laps), 2)), dpi=_DPI, facecolor=_PAPER, layout="constrained")
    axes = figure.subplots()
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(colors=_INK, labelsize=10)
    axes.set_yticks(range(len(laps)), [f"lap {lap.number}" for lap in laps])
    axes.set_xlabel("lap time (s), whiskers one sigma", color=_INK)
    if not laps:
        axes.text(0.5, 0.5, "no complete lap", transform=axes.transAxes, ha="center", color=_INK)
        return encoded(figure, picture_format)
    axes.set_ylim(len(laps) - 0.4, -0.6)
    axes.set_xlim(0, 1.35 * max(lap.time_s + lap.sigma_s for lap in laps))
    for i, lap in enumerate(laps):
        colour = _colour(i)
        hatch = None if lap.valid else "///"
        axes.barh(i, lap.time_s, height=0.62, color=colour if lap.valid else _PAPER, edgecolor=colour, hatch=hatch)
        axes.errorbar(lap.time_s, i, xerr=lap.sigma_s, color=_INK, capsize=5, linewidth=1.4)
        note = f"{lap.time_s:.3f} \N{PLUS-MINUS SIGN} {lap.sigma_s:.3f} s{'' if lap.valid else ', not valid'}"
        axes.annotate(
            note,
            (lap.time_s + lap.sigma_s, i),
            (7, 0),
            textcoords="offset points",
            va="center",
            fontsize=10,
            color=_INK,
        )
    return encoded(figure, picture_format)


def _figure_size(width_to_height: float) -> tuple[float, float]:
    """Inches: 9 wide, or less for tall tracks, with room for the legend."""
    width = 9.0 if width_to_height > 0.9 else 7.0
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
    inner, outer = _joined(left, closed=closed), _joined(right, closed=closed)
    quads = [np.array([a, b, d, c]) for (a, b), (c, d) in zip(pairwise(inner), pairwise(outer), strict=True)]
    axes.add_collection(PolyCollection(quads, facecolors=_LANE, edgecolors=_LANE, linewidths=0.6, zorder=0))
    for edge in (inner, outer):
        axes.plot(*edge.T, color=_LANE_EDGE, linewidth=0.8, zorder=1)


def _draw_twin(axes: Axes, twin: BgrImage) -> None:
    """The twin's picture, paled so that the paths stand out; pixel centres at whole numbers."""
    height_px, width_px = twin.shape[:2]
    extent = (-0.5, width_px - 0.5, height_px - 0.5, -0.5)
    limits = axes.axis()
    axes.imshow(twin[:, :, ::-1], extent=extent, alpha=0.55, interpolation="antialiased", zorder=0)
    axes.axis(limits)


def _colour(index: int) -> str:
    return LAP_COLOURS[index % len(LAP_COLOURS)]


def _draw_lap(axes: Axes, lap: Lap, path_px: Points, index: int) -> None:
    label = f"lap {lap.number}: {lap.time_s:.3f} s{'' if lap.valid else ', not valid'}"
    style = LAP_STYLES[index // len(LAP_COLOURS) % len(LAP_STYLES)]
    axes.plot(*path_px.T, color=_colour(index), linestyle=style, linewidth=1.8, label=label, zorder=3)


def _draw_start_line(axes: Axes, track: Track, *, length_px: float) -> None:
    """The start line in black and white, and an arrow in the direction of a forward crossing, `length_px` long."""
    line = track.start_line
    ends = track.scale.to_twin_px(np.array([line.start_m, line.end_m]))
    axes.plot(*ends.T, color=_INK, linewidth=5.0, solid_capstyle="butt", zorder=4)
    axes.plot(*ends.T, color=_PAPER, linewidth=3.2, linestyle=(0, (1.2, 1.2)), dash_capstyle="butt", zorder=4)
    forward = np.array([line.forward[0], -line.forward[1]])
    outward = (ends[0] - ends[1]) / np.hypot(*(ends[0] - ends[1]))
    tail = ends[0] + outward * 0.3 * length_px
    axes.annotate(
        "",
        xy=tuple(tail + forward * length_px),
        xytext=tuple(tail),
        arrowprops={"arrowstyle": "-|>", "color": _INK, "linewidth": 1.8, "mutation_scale": 16},
        zorder=5,
    )
    u, v = tail + outward * 0.35 * length_px
    axes.text(u, v, "start", ha="center", va="center", fontsize=10, color=_INK, path_effects=_HALO, zorder=5)


def _draw_scale_bar(axes: Axes, track: Track, low: NDArray[np.float64], high: NDArray[np.float64]) -> None:
    """A bar of a round number of metres, about a sixth of the picture wide, in the lower left corner."""
    width_px, height_px = high - low
    length_m = round_length_m(float(width_px) * track.scale.metres_per_px / 6)
    length_px = length_m / track.scale.metres_per_px
    u, v = low[0] + 0.02 * width_px, high[1] - 0.025 * height_px
    axes.plot(
        (u, u + length_px), (v, v), color=_INK, linewidth=3.0, solid_capstyle="butt", zorder=5, path_effects=_HALO
    )
    text = f"{length_m:g} m" if length_m >= 1 else f"{length_m * 100:g} cm"
    axes.text(
        u + length_px / 2,
        v - 0.012 * height_px,
        text,
        ha="center",
        va="bottom",
        fontsize=10,
        color=_INK,
        path_effects=_HALO,
        zorder=5,
    )


def round_length_m(length_m: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is not above `length_m`, which is positive."""
    power = 10.0 ** math.floor(math.log10(length_m))
    return max(step * power for step in (1, 2, 5) if step * power <= length_m * (1 + 1e-9))
