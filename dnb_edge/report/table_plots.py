"""The result table in pictures: boxes of every lap, a radar of each entry, and how sure each rank is.

Knows rows of the result table, laps and matplotlib's objects. Names of entries are drawn as they are, without control
characters and never as formulas. Knows no page and no file.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cbook import boxplot_stats
from matplotlib.figure import Figure

from dnb_edge.report.compare_plots import is_of, short_name
from dnb_edge.report.lap_style import DPI, INK, PAPER, QUIET, colour
from dnb_edge.report.picture import PictureFormat, encoded
from dnb_edge.report.table import EntryRow, ResultTable, Trial, official_percent, official_s
from dnb_edge.report.table_compare import FigureOrder

MOST_RADARS = 12
"""Entries, the first of the table, that have a radar: more are too small to read."""

_RADAR_COLUMNS = 4
_HALF_BOX = 0.26
_DARK = 0.6
"""Shares above this lie on a dark ground."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Spoke:
    """One axis of the radar: a share for each row, 1 the best that can be; None where nothing is known of a row."""

    name: str
    shares: tuple[float | None, ...]


def boxes_picture(table: ResultTable, trials: Sequence[Trial], *, picture_format: PictureFormat = "png") -> bytes:
    """A row an entry: boxes of its valid laps' official times and similarities, on the right its success rate with the 95 %
    confidence interval."""
    rows = table.rows
    figure = Figure(figsize=(11.0, 1.3 + 0.5 * max(len(rows), 2)), dpi=DPI, facecolor=PAPER, layout="constrained")
    panels = figure.subplots(1, 3, sharey=True)
    headings = ("lap time (s)", "path similarity (%)", "success rate (%)")
    for axes, heading in zip(panels, headings, strict=True):
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(colors=INK, labelsize=10)
        axes.set_xlabel(heading, color=INK)
    panels[0].set_yticks(range(len(rows)), [short_name(row.label) for row in rows], parse_math=False)
    panels[0].set_ylim(len(rows) - 0.4, -0.6)
    panels[2].set_xlim(-3, 103)
    for place, row in enumerate(rows):
        laps = [lap for trial in trials if is_of(trial, row) for lap in trial.laps if lap.valid]
        _box(panels[0], place, [official_s(lap) for lap in laps])
        _box(panels[1], place, [percent for lap in laps if (percent := official_percent(lap)) is not None])
        _success(panels[2], place, row)
        if not laps:
            panels[0].annotate("DNF", (0.02, place), xycoords=panels[0].get_yaxis_transform(), va="center", color=INK)
    return encoded(figure, picture_format)


def radar_picture(table: ResultTable, *, picture_format: PictureFormat = "png") -> bytes | None:
    """A radar an entry, further out is better, the other entries' in grey behind it; None where there is no entry."""
    shown = table.rows[:MOST_RADARS]
    if not shown:
        return None
    spokes = radar_spokes(shown)
    columns = min(len(shown), _RADAR_COLUMNS)
    lines = math.ceil(len(shown) / columns)
    figure = Figure(figsize=(2.9 * columns, 2.9 * lines), dpi=DPI, facecolor=PAPER, layout="constrained")
    angles = np.linspace(0.0, 2.0 * np.pi, len(spokes), endpoint=False)
    for place, row in enumerate(shown):
        axes: Any = figure.add_subplot(lines, columns, place + 1, projection="polar")
        axes.set_theta_offset(np.pi / 2)
        axes.set_theta_direction(-1)
        axes.set_ylim(0.0, 1.0)
        axes.set_yticks((0.25, 0.5, 0.75, 1.0), [""] * 4)
        axes.set_xticks(angles, [spoke.name for spoke in spokes], fontsize=8, color=INK)
        axes.set_title(short_name(row.label), fontsize=10, color=INK, parse_math=False)
        for other in range(len(shown)):
            if other != place:
                _polygon(axes, angles, spokes, other, color=QUIET, linewidth=0.6, alpha=0.5)
        _polygon(axes, angles, spokes, place, color=colour(place), linewidth=2.0, marker="o", markersize=4)
    return encoded(figure, picture_format)


def radar_spokes(rows: Sequence[EntryRow]) -> tuple[Spoke, ...]:
    """The axes that `rows` need. Pace and inference are the quickest's time for the own one; what an entry without a valid lap
    has of similarity and pace is 0."""
    quickest_s = min((row.completion_time_s for row in rows if row.completion_time_s), default=None)
    least_ms = min((row.inference_p95_ms for row in rows if row.inference_p95_ms), default=None)
    spokes = []
    if any(row.similarity_percent is not None for row in rows):
        similarity = (_percent_share(row) for row in rows)
        spokes.append(Spoke(name="similarity", shares=tuple(similarity)))
    spokes += [
        Spoke(name="success", shares=tuple(row.success_rate for row in rows)),
        Spoke(name="clean laps", shares=tuple(_of_attempted(row, row.clean_laps) for row in rows)),
        Spoke(name="pace", shares=tuple(_quickness(row.completion_time_s, quickest_s, none=0.0) for row in rows)),
    ]
    if least_ms is not None:
        speed = (_quickness(row.inference_p95_ms, least_ms, none=None) for row in rows)
        spokes.append(Spoke(name="inference", shares=tuple(speed)))
    return tuple(spokes)


def ranks_picture(table: ResultTable, *, picture_format: PictureFormat = "png") -> bytes | None:
    """For each figure by which entries are ranked: how often each entry has each rank in resamples of its runs; None where
    nothing is ranked."""
    orders = [order for order in table.orders if order.ranking.order_share is not None]
    if not orders:
        return None
    count = len(table.rows)
    width = 2.2 + len(orders) * max(2.4, 0.5 * count)
    figure = Figure(figsize=(width, 1.6 + 0.42 * max(count, 2)), dpi=DPI, facecolor=PAPER, layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, len(orders), sharey=True))
    for axes, order in zip(panels, orders, strict=True):
        _ranks(axes, order, count)
    panels[0].set_yticks(range(count), [short_name(row.label) for row in table.rows], parse_math=False)
    return encoded(figure, picture_format)


def _box(axes: Axes, place: int, values: Sequence[float]) -> None:
    """Quartiles as a box, the median in it, whiskers to the farthest within 1.5 of its width, every lap as a dot."""
    if not values:
        return
    ink = colour(place)
    lines: dict[str, Any] = {"color": INK, "linewidth": 1.2}
    stats = boxplot_stats(np.asarray(values))
    axes.bxp(
        stats,
        positions=[place],
        widths=2 * _HALF_BOX,
        orientation="horizontal",
        manage_ticks=False,
        showfliers=False,
        patch_artist=True,
        boxprops={"facecolor": ink, "alpha": 0.3, "edgecolor": ink},
        medianprops={"color": INK, "linewidth": 2.0},
        whiskerprops=lines,
        capprops=lines,
    )
    heights = place + np.linspace(-0.6 * _HALF_BOX, 0.6 * _HALF_BOX, len(values)) if len(values) > 1 else [place]
    axes.plot(values, heights, "o", markersize=3.0, color=ink, alpha=0.7, markeredgewidth=0)


def _success(axes: Axes, place: int, row: EntryRow) -> None:
    if row.success_rate is None or row.success_ci95_low is None or row.success_ci95_high is None:
        return
    ends = [100 * row.success_ci95_low, 100 * row.success_ci95_high]
    axes.plot(ends, [place, place], color=INK, linewidth=1.8, solid_capstyle="butt")
    axes.plot(100 * row.success_rate, place, "D", markersize=6.0, markerfacecolor=PAPER, markeredgecolor=INK, zorder=5)


def _polygon(axes: Any, angles: Any, spokes: Sequence[Spoke], row: int, **style: Any) -> None:
    """The row's shares joined round the radar; a spoke of which nothing is known is a gap."""
    shares = [np.nan if (share := spoke.shares[row]) is None else share for spoke in spokes]
    axes.plot([*angles, angles[0]], [*shares, shares[0]], clip_on=False, **style)


def _percent_share(row: EntryRow) -> float | None:
    if row.similarity_percent is not None:
        return row.similarity_percent / 100
    return None if row.finished else 0.0


def _of_attempted(row: EntryRow, laps: int) -> float | None:
    return laps / row.attempted_laps if row.attempted_laps else None


def _quickness(own: float | None, least: float | None, *, none: float | None) -> float | None:
    return none if own is None or least is None or own <= 0.0 else least / own


def _ranks(axes: Axes, order: FigureOrder, count: int) -> None:
    shares = np.full((count, max((len(place.shares) for place in order.places if place), default=1)), np.nan)
    for row, place in enumerate(order.places):
        if place is not None:
            shares[row] = place.shares
            ink = PAPER if place.share > _DARK else INK
            axes.plot(place.rank - 1, row, "D", markersize=5.0, markerfacecolor="none", markeredgecolor=ink)
    axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    for row, rank in zip(*np.nonzero(shares >= 0.05), strict=True):
        ink = PAPER if shares[row, rank] > _DARK else INK
        axes.annotate(f"{100 * shares[row, rank]:.0f}", (rank, row), (0, -9), textcoords="offset points", fontsize=8,
                      ha="center", va="center", color=ink)  # fmt: skip
    axes.set_xticks(range(shares.shape[1]), [str(rank + 1) for rank in range(shares.shape[1])])
    axes.tick_params(colors=INK, labelsize=10, length=0)
    axes.set_title(order.figure, fontsize=10, color=INK)
    axes.set_xlabel("rank, % of resamples", color=INK, fontsize=9)
