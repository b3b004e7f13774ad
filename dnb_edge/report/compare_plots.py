"""Entries side by side: every lap's time and similarity with the means, and the best laps along the route.

Knows rows of the result table, laps, traces and matplotlib's objects. Names of entries are drawn as they are, without control
characters and never as formulas. Knows no page.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dnb_edge.report.along import DRAWN_LAPS, lap_start_m, sector_ends_m
from dnb_edge.report.lap_style import DPI, INK, PAPER, colour, legend, line_style
from dnb_edge.report.picture import PictureFormat, encoded
from dnb_edge.report.table import EntryRow, Trial, official_percent, official_s, printable
from dnb_edge.score.profile import LapTrace, delta_profile, speed_profile
from dnb_edge.track.model import Track
from dnb_edge.values import Lap

_LONGEST_NAME = 28
_LEAST_S = 0.01
"""Half the height of the panel of time lost, at least."""
_SPREAD = 0.28
"""Laps of a row are drawn so far apart at most, as a share of the row."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BestLap:
    """The best valid lap of a car in a run."""

    name: str
    """Of the entry."""
    run: str
    """Name of the recording."""
    lap: Lap
    trace: LapTrace | None


def entries_picture(
    rows: Sequence[EntryRow], trials: Sequence[Trial], *, picture_format: PictureFormat = "png"
) -> bytes:
    """A row an entry: its valid laps' official times as dots, on the right their similarities, and each mean with its 95 %
    confidence interval."""
    figure = Figure(figsize=(9.0, 1.3 + 0.5 * max(len(rows), 2)), dpi=DPI, facecolor=PAPER, layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for axes in (left, right):
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(colors=INK, labelsize=10)
    left.set_yticks(range(len(rows)), [short_name(row.label) for row in rows], parse_math=False)
    left.set_ylim(len(rows) - 0.4, -0.6)
    left.set_xlabel("lap time (s)", color=INK)
    right.set_xlabel("path similarity (%)", color=INK)
    for place, row in enumerate(rows):
        laps = [lap for trial in trials if is_of(trial, row) for lap in trial.laps if lap.valid]
        _dots(left, place, [official_s(lap) for lap in laps])
        _mean(left, place, row.completion_time_s, row.completion_time_ci95_low_s, row.completion_time_ci95_high_s)
        _dots(right, place, [percent for lap in laps if (percent := official_percent(lap)) is not None])
        _mean(right, place, row.similarity_percent, row.similarity_ci95_low_percent, row.similarity_ci95_high_percent)
        if not laps:
            left.annotate("DNF", (0.02, place), xycoords=left.get_yaxis_transform(), va="center", color=INK)
    return encoded(figure, picture_format)


def best_laps_picture(best: Sequence[BestLap], track: Track, *, picture_format: PictureFormat = "png") -> bytes | None:
    """The best laps along the route: their speeds, and how far each is behind the best of all at the same place; None where
    there are no two to compare."""
    drawn = [(one, one.trace) for one in quickest(best) if one.trace is not None]
    if len(drawn) < 2:
        return None
    figure = Figure(figsize=(9.0, 6.4), dpi=DPI, facecolor=PAPER, layout="constrained")
    speeds, deltas = figure.subplots(2, 1, sharex=True)
    start_m, end_m = lap_start_m(track), sector_ends_m(track)[-1]
    first, most_s = drawn[0][1], 0.0
    for place, (one, trace) in enumerate(drawn):
        style = line_style(place, best=place == 0)
        profile = speed_profile(trace)
        label = f"{place + 1}. {short_name(one.name)}, {short_name(one.run)}: {official_s(one.lap):.3f} s"
        seen = np.where(profile.seen, profile.speed_mps, np.nan)
        speeds.plot(start_m + profile.way_m, seen, label=label, **style)
        behind = delta_profile(trace, first)
        deltas.plot(start_m + behind.way_m, behind.delta_s, **style)
        most_s = max(most_s, float(np.abs(behind.delta_s).max()))
    for axes in (speeds, deltas):
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(colors=INK, labelsize=10)
        axes.set_xlim(start_m, start_m + end_m)
    speeds.set_ylim(bottom=0.0)
    if most_s < _LEAST_S:
        deltas.set_ylim(-_LEAST_S, _LEAST_S)
    speeds.set_ylabel("speed (m/s)", color=INK)
    deltas.set_ylabel("behind the first (s)", color=INK)
    deltas.set_xlabel("along the route, s (m)", color=INK)
    legend(figure, speeds)
    return encoded(figure, picture_format)


def quickest(best: Sequence[BestLap], most: int = DRAWN_LAPS) -> list[BestLap]:
    """The best laps that the picture shows, the quickest first."""
    return sorted(best, key=lambda one: (official_s(one.lap), one.run, one.lap.car))[:most]


def short_name(name: str) -> str:
    """An entry's name as pictures have room for it."""
    plain = printable(name)
    return plain if len(plain) <= _LONGEST_NAME else f"{plain[: _LONGEST_NAME - 3]}..."


def is_of(trial: Trial, row: EntryRow) -> bool:
    """Whether `trial` is among those that `row` is made of."""
    entrant = (row.entry, row.version, row.checkpoint_sha256, row.simulated)
    return trial.entrant.key == entrant and row.run in {None, trial.run}


def _dots(axes: Axes, place: int, values: Sequence[float]) -> None:
    """Laps in their order from the row's top to its bottom."""
    heights = place + np.linspace(-_SPREAD, _SPREAD, len(values)) if len(values) > 1 else [place] * len(values)
    axes.plot(values, heights, "o", markersize=4.0, color=colour(place), alpha=0.75, markeredgewidth=0)


def _mean(axes: Axes, place: int, mean: float | None, low: float | None, high: float | None) -> None:
    if mean is None:
        return
    if low is not None and high is not None:
        axes.plot([low, high], [place, place], color=INK, linewidth=1.8, solid_capstyle="butt", zorder=4)
    axes.plot(mean, place, "D", markersize=6.0, markerfacecolor=PAPER, markeredgecolor=INK, zorder=5)
