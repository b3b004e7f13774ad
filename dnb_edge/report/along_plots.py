"""Laps along the route, one panel below the other: speed, lateral error, and time lost against the best lap.

Knows traces and matplotlib's objects. Pictures hold numbers and our own words, never a user's text. Knows no page.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from dnb_edge.report.along import LapAlong, lane_edges_m, lap_start_m, laps_along, sector_ends_m
from dnb_edge.report.lap_style import DPI, HALO, INK, LANE, PAPER, QUIET, lap_label, lap_name, legend, line_style
from dnb_edge.report.picture import PictureFormat, encoded
from dnb_edge.report.run import RunResult
from dnb_edge.score.profile import DeltaProfile, LapTrace, delta_profile, lateral_profile, speed_profile
from dnb_edge.track.model import Track

_SEEN_SPEEDS = 99.5
"""Percentile of the speeds that the panel has room for: a car that is lifted flies out of it."""

_LANE_WIDTHS = 2.5
"""The lateral panel ends so many half-widths of the lane from the centreline, at most."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Drawn:
    """A lap with its place among those that are drawn."""

    place: int
    along: LapAlong
    trace: LapTrace


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LapDelta:
    """A lap against the best valid one of its car."""

    along: LapAlong
    profile: DeltaProfile


def lap_deltas(laps: Sequence[LapAlong]) -> tuple[LapDelta, ...]:
    """Each lap against its car's best, the best ones too; none where no lap has another to be compared with."""
    best = {one.lap.car: one.trace for one in laps if one.best and one.trace is not None}
    found = tuple(
        LapDelta(along=one, profile=delta_profile(one.trace, best[one.lap.car]))
        for one in laps
        if one.trace is not None and one.lap.car in best
    )
    return found if any(not one.along.best for one in found) else ()


def compared(result: RunResult) -> bool:
    """Whether the picture has the panel of time lost."""
    return bool(lap_deltas(laps_along(result)))


def along_picture(result: RunResult, *, picture_format: PictureFormat = "png") -> bytes | None:
    """The panels; None where it is of no lap known when the car was where."""
    laps = laps_along(result)
    drawn = [_Drawn(place=i, along=one, trace=one.trace) for i, one in enumerate(laps) if one.trace is not None]
    if not drawn:
        return None
    deltas = lap_deltas(laps)
    several = result.several_cars
    panels: list[Callable[[Axes], None]] = [
        partial(_speeds, drawn, result.track, several),
        partial(_laterals, drawn, result.track, several),
    ]
    if deltas:
        panels.append(partial(_deltas, deltas, {one.along.index: one.place for one in drawn}, result.track))
    size = (9.0, 2.6 * len(panels) + 0.9)
    figure = Figure(figsize=size, dpi=DPI, facecolor=PAPER, layout="constrained")
    every = np.atleast_1d(figure.subplots(len(panels), 1, sharex=True))
    for panel, axes in zip(panels, every, strict=True):
        panel(axes)
        _frame(axes, result.track)
    _name_sectors(every[0], result.track)
    every[-1].set_xlabel("along the route, s (m)", color=INK)
    legend(figure, every[0])
    return encoded(figure, picture_format)


def _speeds(drawn: Sequence[_Drawn], track: Track, several: bool, axes: Axes) -> None:
    start_m = lap_start_m(track)
    greatest = 0.0
    for one in drawn:
        profile = speed_profile(one.trace)
        if profile.seen.any():
            greatest = max(greatest, float(np.percentile(profile.speed_mps[profile.seen], _SEEN_SPEEDS)))
        label = lap_label(one.along.lap, several=several, best=one.along.best)
        speeds = np.where(profile.seen, profile.speed_mps, np.nan)
        axes.plot(start_m + profile.way_m, speeds, **line_style(one.place, best=one.along.best), label=label)
    axes.set_ylim(0.0, 1.15 * greatest or 1.0)
    axes.set_ylabel("speed (m/s)", color=INK)


def _laterals(drawn: Sequence[_Drawn], track: Track, several: bool, axes: Axes) -> None:
    start_m = lap_start_m(track)
    ways_m = np.linspace(0.0, sector_ends_m(track)[-1], 400)
    left_m, right_m = lane_edges_m(track, ways_m)
    for edge_m, outside in ((left_m, 1e3), (right_m, -1e3)):
        axes.fill_between(start_m + ways_m, edge_m, outside, color=LANE, linewidth=0, zorder=0)
        axes.plot(start_m + ways_m, edge_m, color=QUIET, linewidth=0.9, zorder=1)
    axes.axhline(0.0, color=INK, linewidth=0.9, linestyle=(0, (4, 4)), zorder=2)
    for one in drawn:
        profile = lateral_profile(one.trace)
        d_m = np.where(profile.seen, profile.mean_m, np.nan)
        axes.plot(start_m + profile.way_m, d_m, **line_style(one.place, best=one.along.best))
    worst = max(drawn, key=lambda one: float(np.abs(one.trace.d_m).max()))
    at = int(np.argmax(np.abs(worst.trace.d_m)))
    way_m, off_m = float(worst.trace.way_m[at]), float(worst.trace.d_m[at])
    lane_m = max(float(left_m.max()), float(-right_m.min()))
    room_m = min(max(1.3 * abs(off_m), 1.25 * lane_m), _LANE_WIDTHS * lane_m)
    axes.set_ylim(-room_m, room_m)
    axes.set_ylabel("to the left (m)", color=INK)
    _mark(axes, start_m + way_m, off_m, room_m, f"{abs(off_m):.3f} m, {lap_name(worst.along.lap, several=several)}")


def _mark(axes: Axes, s_m: float, off_m: float, room_m: float, words: str) -> None:
    """A ring round the greatest excursion, at the panel's edge where it lies beyond, and the words off the lines."""
    low_m, high_m = axes.dataLim.intervalx
    shown_m = float(np.clip(off_m, -0.95 * room_m, 0.95 * room_m))
    axes.plot(s_m, shown_m, "o", markersize=10, markerfacecolor="none", markeredgecolor=INK, zorder=5)
    is_left = s_m < 0.5 * (low_m + high_m)
    is_up = (shown_m > 0) == (abs(shown_m) < 0.7 * room_m)
    axes.annotate(
        words,
        (s_m, shown_m),
        (9 if is_left else -9, 11 if is_up else -11),
        textcoords="offset points",
        ha="left" if is_left else "right",
        va="center",
        fontsize=9.5,
        color=INK,
        path_effects=HALO,
        zorder=6,
    )


def _deltas(deltas: Sequence[LapDelta], places: dict[int, int], track: Track, axes: Axes) -> None:
    start_m = lap_start_m(track)
    for one in deltas:
        style = line_style(places[one.along.index], best=one.along.best)
        axes.plot(start_m + one.profile.way_m, one.profile.delta_s, **style)
    axes.set_ylabel("behind the best lap (s)", color=INK)


def _frame(axes: Axes, track: Track) -> None:
    """What all panels have: no box, the whole lap, and a line where each sector ends."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(colors=INK, labelsize=10)
    start_m, ends_m = lap_start_m(track), sector_ends_m(track)
    axes.set_xlim(start_m, start_m + ends_m[-1])
    for end_m in ends_m[:-1]:
        axes.axvline(start_m + end_m, color=INK, linewidth=1.0, zorder=2)


def _name_sectors(axes: Axes, track: Track) -> None:
    """The sectors' numbers above the panel, each over its stretch; nothing where there is but one."""
    ends_m: NDArray[np.float64] = np.array((0.0, *sector_ends_m(track)))
    if len(ends_m) == 2:
        return
    middles_m = lap_start_m(track) + 0.5 * (ends_m[1:] + ends_m[:-1])
    wide = np.diff(ends_m).min() > 0.12 * ends_m[-1]
    for number, middle_m in enumerate(middles_m.tolist(), start=1):
        axes.annotate(
            f"sector {number}" if wide else str(number),
            (middle_m, 1.0),
            (0, 4),
            xycoords=axes.get_xaxis_transform(),
            textcoords="offset points",
            ha="center",
            fontsize=10,
            color=INK,
        )
