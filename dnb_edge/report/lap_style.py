"""How laps look in all pictures of a report: colours, dashes, names and the legend.

Knows laps and matplotlib's objects; pictures hold numbers and our own words, never a user's text. Knows no run.
"""

from __future__ import annotations

from typing import Any

import matplotlib.patheffects as effects
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dnb_edge.values import Lap

LAP_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#8c3b80", "#56a0d3", "#b58900", "#222222")
"""Told apart with any kind of colour vision (after Okabe and Ito, darkened to show on white)."""
LAP_DASHES: tuple[str | tuple[int, tuple[int, ...]], ...] = ("solid", (0, (6, 2)), (0, (2, 2)))
"""Beyond seven laps the colours come again in another dash."""

DPI = 110
INK = "#1f2328"
QUIET = "#8b949e"
"""Of edges and of what is not in front."""
LANE = "#d5dbe1"
PAPER = "#ffffff"
HALO = (effects.withStroke(linewidth=4.0, foreground=PAPER),)
"""Behind text that lies on something."""

_LETTER_PX = 7.4
"""Width of a letter or figure in a legend, at most."""

_BESIDE_PX = 70.0
"""Width of what is beside a name in a legend: its line and the space to the next column."""


def colour(place: int) -> str:
    """The colour of the lap that is drawn in this place, from 0."""
    return LAP_COLOURS[place % len(LAP_COLOURS)]


def line_style(place: int, *, best: bool) -> dict[str, Any]:
    """Keywords of a line for the lap that is drawn in this place; the best one is bold and lies on top."""
    return {
        "color": colour(place),
        "linestyle": LAP_DASHES[place // len(LAP_COLOURS) % len(LAP_DASHES)],
        "linewidth": 2.8 if best else 1.4,
        "zorder": 3.5 if best else 3.0,
    }


def lap_name(lap: Lap, *, several: bool) -> str:
    """`lap 3`, or `car 2, lap 3` where there are several cars."""
    return f"car {lap.car}, lap {lap.number}" if several else f"lap {lap.number}"


def lap_label(lap: Lap, *, several: bool, best: bool) -> str:
    """The legend's words."""
    note = ", best" if best else "" if lap.valid else ", not valid"
    return f"{lap_name(lap, several=several)}: {time_words(lap)}{note}"


def time_words(lap: Lap) -> str:
    """`8.123 s`, or `8.123 + 5.000 s` with penalties."""
    return f"{lap.time_s:.3f} + {lap.penalty_s:.3f} s" if lap.penalty_s > 0 else f"{lap.time_s:.3f} s"


def legend(figure: Figure, axes: Axes) -> None:
    """What is named in `axes`, below the whole figure, in as many columns as fit; nothing where nothing is."""
    handles, labels = axes.get_legend_handles_labels()
    if not handles:
        return
    widest_px = max(map(len, labels)) * _LETTER_PX + _BESIDE_PX
    shown = figure.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=max(1, min(len(handles), int(figure.get_figwidth() * DPI / widest_px))),
        frameon=False,
        fontsize=9.5,
        columnspacing=1.4,
        handlelength=2.4,
    )
    for words in shown.get_texts():
        # An entry may be called $x^2$.
        words.set_parse_math(False)
