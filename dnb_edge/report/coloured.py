"""Paths on the map in colours that say something: how fast, how far off, where time is lost.

Knows traces and matplotlib's objects. Pictures hold numbers and our own words, never a user's text. Knows no page.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.collections import LineCollection
from numpy.typing import NDArray

from dnb_edge.report.along import LapAlong
from dnb_edge.report.lap_style import HALO, INK, QUIET
from dnb_edge.report.picture import PictureFormat, encoded
from dnb_edge.report.run import RunResult
from dnb_edge.report.track_map import TrackMap, track_map
from dnb_edge.score.profile import UNSEEN_S, LapTrace, delta_profile, speeds_mps, stretch_ends

HALF_IN = 6.2
"""Width of a map that stands beside another, inches."""

SMOOTHED_M = 0.3
"""The rate at which time is lost is a mean over so much of the route: single fixes say nothing about it."""

_STRETCH_M = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Shade:
    """How values become colours, the same for all laps of a report."""

    words: str
    colours: str
    """Name of matplotlib's colour map."""
    low: float
    high: float


def speed_shade(traces: Sequence[LapTrace]) -> Shade:
    """From the least to the greatest speed in `traces`, but for a lifted or standing car's."""
    speeds = [np.percentile(speeds_mps(trace), (0.5, 99.5)) for trace in traces]
    low = max(0.0, min((float(low) for low, _ in speeds), default=0.0))
    high = max((float(high) for _, high in speeds), default=0.0)
    return Shade(words="speed (m/s)", colours="viridis", low=low, high=max(high, low + 0.01))


def lateral_shade(traces: Sequence[LapTrace]) -> Shade:
    """From the centreline to the greatest distance in `traces`."""
    greatest = max((float(np.abs(trace.d_m).max()) for trace in traces), default=0.0)
    return Shade(words="from the centreline (m)", colours="plasma_r", low=0.0, high=max(greatest, 1e-3))


def speed_picture(result: RunResult, trace: LapTrace, shade: Shade, *, picture_format: PictureFormat = "png") -> bytes:
    """The lap's path coloured by speed along the route, with a ring where it was slowest and where fastest."""
    base, path_px = _map(result, trace, width_in=HALF_IN)
    speeds = speeds_mps(trace)
    _paint(base, path_px, speeds, np.diff(trace.t_s) <= UNSEEN_S, shade)
    inside = speeds[1:-1] if len(speeds) > 2 else speeds
    for at, word in ((int(np.argmin(inside)), "slowest"), (int(np.argmax(inside)), "fastest")):
        place = min(at + 1, len(speeds) - 1)
        _ring(base, path_px[place], f"{word}, {speeds[place]:.2f} m/s")
    return encoded(base.figure, picture_format)


def lateral_picture(
    result: RunResult,
    trace: LapTrace,
    shade: Shade,
    *,
    width_in: float | None = HALF_IN,
    picture_format: PictureFormat = "png",
) -> bytes:
    """The lap's path coloured by its distance from the centreline, with a ring where that is greatest."""
    base, path_px = _map(result, trace, width_in=width_in)
    apart_m = np.abs(trace.d_m)
    _paint(base, path_px, apart_m, np.diff(trace.t_s) <= UNSEEN_S, shade)
    _ring(base, path_px[int(np.argmax(apart_m))], f"{apart_m.max():.3f} m")
    return encoded(base.figure, picture_format)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LossMap:
    """Where one car's laps lose time against its best one."""

    best: LapAlong
    laps: int
    """So many laps beside the best one: the figures are means over them."""
    ends_m: NDArray[np.float64]
    """(k + 1,), the stretches' ends, metres along the route since the lap's start."""
    rate_s_per_m: NDArray[np.float64]
    """(k,), time lost (positive) or won for each metre of the route."""

    @property
    def worst(self) -> int:
        """The stretch on which most is lost."""
        return int(np.argmax(self.rate_s_per_m))


def loss_map(laps: Sequence[LapAlong], car: int) -> LossMap | None:
    """Where the valid ones of `laps` of `car` lose time against its best one, or all of them where no other is valid; None
    where there is nothing to compare."""
    best = next((one for one in laps if one.lap.car == car and one.best and one.trace is not None), None)
    if best is None or best.trace is None:
        return None
    mine = [one for one in laps if one.lap.car == car and one is not best and one.trace is not None]
    others = [one.trace for one in ([one for one in mine if one.lap.valid] or mine) if one.trace is not None]
    if not others:
        return None
    lost_s = np.mean([delta_profile(one, best.trace, bin_m=_STRETCH_M).lost_s for one in others], axis=0)
    ends_m = stretch_ends(best.trace.length_m, bin_m=_STRETCH_M)
    return LossMap(best=best, laps=len(others), ends_m=ends_m, rate_s_per_m=_smooth(_smooth(lost_s / np.diff(ends_m))))


def loss_picture(result: RunResult, loss: LossMap, *, picture_format: PictureFormat = "png") -> bytes:
    """The best lap's path coloured by how much time the other laps lose there, with a ring where that is most."""
    trace = loss.best.trace
    assert trace is not None, "a loss map is of a lap with a trace"
    points_m = trace.place_m(trace.arrivals_s(loss.ends_m))
    points_px = result.track.scale.to_twin_px(points_m)
    base = track_map(result.track, result.twin, [points_px])
    rate_ms = 1e3 * loss.rate_s_per_m
    most = max(float(np.abs(rate_ms).max()), 1.0)
    shade = Shade(words="time lost (ms for each metre of the route)", colours="PuOr_r", low=-most, high=most)
    steps = np.stack([points_px[:-1], points_px[1:]], axis=1)
    _lay(base, steps, rate_ms, shade)
    at = loss.worst
    if rate_ms[at] > 0:
        _ring(base, 0.5 * (points_px[at] + points_px[at + 1]), f"{rate_ms[at]:.0f} ms/m")
    return encoded(base.figure, picture_format)


def _smooth(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Running means over `SMOOTHED_M` of stretches, over less at both ends."""
    wide = min(max(1, round(SMOOTHED_M / _STRETCH_M)), len(values))
    ones = np.ones(wide)
    return np.asarray(np.convolve(values, ones, mode="same") / np.convolve(np.ones(len(values)), ones, mode="same"))


def _map(result: RunResult, trace: LapTrace, *, width_in: float | None) -> tuple[TrackMap, NDArray[np.float64]]:
    path_px = result.track.scale.to_twin_px(trace.track_m)
    return track_map(result.track, result.twin, [path_px], width_in=width_in), path_px


def _paint(
    base: TrackMap, path_px: NDArray[np.float64], values: NDArray[np.float64], seen: NDArray[np.bool_], shade: Shade
) -> None:
    """The path with a value at each point; steps that were not seen are dotted."""
    steps = np.stack([path_px[:-1], path_px[1:]], axis=1)
    base.axes.add_collection(LineCollection(list(steps[~seen]), colors=QUIET, linestyles="dotted", zorder=3))
    _lay(base, steps[seen], 0.5 * (values[:-1] + values[1:])[seen], shade)


def _lay(base: TrackMap, steps: NDArray[np.float64], values: NDArray[np.float64], shade: Shade) -> None:
    """Steps (n, 2, 2), twin px, in the colours of their values (n,), on a dark casing, and what the colours mean."""
    base.axes.add_collection(LineCollection(list(steps), colors=INK, linewidths=5.2, capstyle="round", zorder=3.1))
    lines = LineCollection(list(steps), cmap=shade.colours, linewidths=4.0, capstyle="round", zorder=3.2)
    lines.set_array(values)
    lines.set_clim(shade.low, shade.high)
    base.axes.add_collection(lines)
    base.figure.colorbar(lines, ax=base.axes, location="bottom", shrink=0.5, aspect=40, pad=0.01, label=shade.words)


def _ring(base: TrackMap, at_px: NDArray[np.float64], words: str) -> None:
    """A ring round a place, and words beside it, on the side where there is room."""
    low, high = base.axes.get_xlim()
    is_right = at_px[0] > 0.5 * (low + high)
    base.axes.plot(
        *at_px, "o", markersize=13, markerfacecolor="none", markeredgecolor=INK, markeredgewidth=1.6, zorder=5
    )
    base.axes.annotate(
        words,
        (float(at_px[0]), float(at_px[1])),
        (-12 if is_right else 12, 12),
        textcoords="offset points",
        ha="right" if is_right else "left",
        fontsize=10,
        color=INK,
        path_effects=HALO,
        zorder=5,
    )
