"""The pictures of a report: each lap's driven path on the twin, the lap that was farthest off, and the lap times.

Knows matplotlib, by its objects only: no pyplot, no display, no state shared between figures. Pictures hold numbers and
our own words, never a user's text. Knows no page and no file. What is drawn along the route is `along_plots`.
"""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from dnb_edge.report.along import LapAlong, drawn_laps, laps_along
from dnb_edge.report.coloured import lateral_picture, lateral_shade
from dnb_edge.report.lap_style import DPI, INK, PAPER, QUIET, colour, lap_label, lap_name, legend, line_style
from dnb_edge.report.picture import PictureFormat, encoded
from dnb_edge.report.run import RunResult
from dnb_edge.report.track_map import track_map

TIMED_LAPS = 40
"""So many bars of lap times fit on a screen."""


def path_picture(result: RunResult, *, picture_format: PictureFormat = "png") -> bytes:
    """The driven path of each lap that is drawn on the twin, or on the drawn lane where the result has no twin's picture."""
    drawn = laps_along(result)
    paths_px = [result.track.scale.to_twin_px(result.paths_m[one.index]) for one in drawn]
    base = track_map(result.track, result.twin, paths_px)
    several = result.several_cars
    for place, (one, path_px) in enumerate(zip(drawn, paths_px, strict=True)):
        label = lap_label(one.lap, several=several, best=one.best)
        base.axes.plot(*path_px.T, **line_style(place, best=one.best), label=label)
    legend(base.figure, base.axes)
    return encoded(base.figure, picture_format)


def farthest_off(result: RunResult) -> LapAlong | None:
    """The drawn lap that was farthest from the centreline; None where it is not known of any."""
    traced = [(one, one.trace) for one in laps_along(result) if one.trace is not None]
    return max(traced, key=lambda pair: float(np.abs(pair[1].d_m).max()), default=(None,))[0]


def off_picture(result: RunResult, *, picture_format: PictureFormat = "png") -> bytes | None:
    """The path of `farthest_off` coloured by its distance from the centreline; None where there is none."""
    worst = farthest_off(result)
    if worst is None or worst.trace is None:
        return None
    shade = lateral_shade([worst.trace])
    return lateral_picture(result, worst.trace, shade, width_in=None, picture_format=picture_format)


def lap_times_picture(result: RunResult, *, picture_format: PictureFormat = "png") -> bytes:
    """Lap times as bars from zero, penalties hatched behind them, each with a whisker of one sigma and the figures in words.

    Bars have the laps' colours of the other pictures; laps that are not drawn there are grey.
    """
    shown = drawn_laps(result.laps, TIMED_LAPS)
    figure = Figure(figsize=(9.0, 1.0 + 0.4 * max(len(shown), 2)), dpi=DPI, facecolor=PAPER, layout="constrained")
    axes = figure.subplots()
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(colors=INK, labelsize=10)
    laps = [result.laps[i] for i in shown]
    axes.set_yticks(range(len(laps)), [lap_name(lap, several=result.several_cars) for lap in laps])
    axes.set_xlabel("lap time (s), whiskers one sigma", color=INK)
    if not laps:
        axes.text(0.5, 0.5, "no complete lap", transform=axes.transAxes, ha="center", color=INK)
        return encoded(figure, picture_format)
    axes.set_ylim(len(laps) - 0.4, -0.6)
    axes.set_xlim(0, 1.4 * max(lap.time_s + lap.penalty_s + lap.sigma_s for lap in laps))
    places = {index: place for place, index in enumerate(drawn_laps(result.laps))}
    for row, (index, lap) in enumerate(zip(shown, laps, strict=True)):
        ink = colour(places[index]) if index in places else QUIET
        face, hatch = (ink, None) if lap.valid else (PAPER, "///")
        axes.barh(row, lap.time_s, height=0.62, color=face, edgecolor=ink, hatch=hatch)
        if lap.penalty_s > 0:
            axes.barh(row, lap.penalty_s, left=lap.time_s, height=0.62, color=PAPER, edgecolor=ink, hatch="...")
        axes.errorbar(lap.time_s, row, xerr=lap.sigma_s, color=INK, capsize=5, linewidth=1.4)
        note = f"{lap.time_s:.3f} \N{PLUS-MINUS SIGN} {lap.sigma_s:.3f} s"
        note += f" + {lap.penalty_s:.3f} s" if lap.penalty_s > 0 else ""
        axes.annotate(
            note if lap.valid else f"{note}, not valid",
            (lap.time_s + max(lap.sigma_s, lap.penalty_s), row),
            (7, 0),
            textcoords="offset points",
            va="center",
            fontsize=10,
            color=INK,
        )
    return encoded(figure, picture_format)
