"""The appliance's health over a run, one panel below the other: frames lost, their rate, latency, heat, disk.

Knows a `HealthHistory` and matplotlib's objects. A panel without figures is left out. Knows no page.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from dnb_edge.report.health import HealthHistory, HealthSlot
from dnb_edge.report.lap_style import DPI, INK, LAP_COLOURS, PAPER, QUIET, legend
from dnb_edge.report.picture import PictureFormat, encoded

_REASON_COLOURS = (*LAP_COLOURS[1:], LAP_COLOURS[0])
_AWAY = "#f3c6cc"
"""Behind a time in which no frame came."""
_MINUTES_FROM_S = 300.0
_HOURS_FROM_S = 3.0 * 3600.0
_NARROWEST = 0.002
"""An interruption is drawn at least so wide, as a share of the whole time."""


def health_picture(health: HealthHistory, *, picture_format: PictureFormat = "png") -> bytes:
    """The panels that have something to show, with interruptions shaded across all of them."""
    unit_s, unit = time_unit(health.end_s)
    panels = _panels(health, unit_s)
    size = (9.0, 1.7 * len(panels) + 0.9)
    figure = Figure(figsize=size, dpi=DPI, facecolor=PAPER, layout="constrained")
    every = np.atleast_1d(figure.subplots(len(panels), 1, sharex=True))
    end = max(health.end_s, health.slots[-1].start_s, 1e-3)
    for panel, axes in zip(panels, every, strict=True):
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(colors=INK, labelsize=10)
        axes.set_xlim(0.0, end / unit_s)
        for one in health.interruptions:
            until_s = max(one.end_s, one.start_s + _NARROWEST * end)
            axes.axvspan(one.start_s / unit_s, until_s / unit_s, color=_AWAY, linewidth=0, zorder=0)
        panel(axes)
    every[-1].set_xlabel(f"since the first frame ({unit})", color=INK)
    legend(figure, every[0])
    return encoded(figure, picture_format)


def time_unit(end_s: float) -> tuple[float, str]:
    """The unit in which a time axis up to `end_s` is read best: its seconds and its name."""
    if end_s >= _HOURS_FROM_S:
        return 3600.0, "h"
    return (60.0, "min") if end_s >= _MINUTES_FROM_S else (1.0, "s")


def _panels(health: HealthHistory, unit_s: float) -> list[Callable[[Axes], None]]:
    slots = health.slots
    panels: list[Callable[[Axes], None]] = [partial(_lost, health, unit_s)]
    lines: tuple[tuple[str, Callable[[HealthSlot], float | None], str], ...] = (
        ("frames each second,\nlowest", lambda slot: slot.fps, LAP_COLOURS[0]),
        ("latency (ms),\nhighest median", lambda slot: slot.latency_ms, LAP_COLOURS[1]),
        ("temperature (\N{DEGREE SIGN}C),\nhighest", lambda slot: slot.temperature_c, LAP_COLOURS[3]),
        ("room on the disk\n(GB), lowest", _gigabytes, LAP_COLOURS[2]),
    )
    for words, pick, colour in lines:
        if any(pick(slot) is not None for slot in slots):
            panels.append(partial(_line, slots, unit_s, words, pick, colour))
    return panels


def _gigabytes(slot: HealthSlot) -> float | None:
    return None if slot.disk_free_bytes is None else slot.disk_free_bytes / 1e9


def _lost(health: HealthHistory, unit_s: float, axes: Axes) -> None:
    """Of the frames of each slot, the share that was lost, by reason, one upon the other."""
    slots = health.slots
    starts = np.array([slot.start_s for slot in slots]) / unit_s
    wide = health.slot_s / unit_s
    whole = np.array([max(1, slot.frames + sum(slot.lost.values())) for slot in slots])
    below: NDArray[np.float64] = np.zeros(len(slots))
    for place, reason in enumerate(health.lost):
        share = 100.0 * np.array([slot.lost.get(reason, 0) for slot in slots]) / whole
        colour = _REASON_COLOURS[place % len(_REASON_COLOURS)]
        axes.bar(starts, share, wide, bottom=below, align="edge", color=colour, linewidth=0, label=f"lost: {reason}")
        below += share
    worst = 100.0 * np.repeat([slot.lost_share for slot in slots], 2)
    if health.lost:
        edges = np.array([(slot.start_s, slot.end_s) for slot in slots]).ravel() / unit_s
        axes.plot(edges, worst, color=INK, linewidth=0.9, label="worst second")
    axes.set_ylim(0.0, max(1.0, 1.15 * float(worst.max())))
    axes.set_ylabel("frames lost (%)", color=INK)
    if not health.lost:
        axes.text(0.5, 0.5, "no frame was lost", transform=axes.transAxes, ha="center", va="center", color=INK)


def _line(
    slots: Sequence[HealthSlot],
    unit_s: float,
    words: str,
    pick: Callable[[HealthSlot], float | None],
    colour: str,
    axes: Axes,
) -> None:
    """One figure over time, a step a slot; nothing where it was not told."""
    places, heights = [], []
    for slot in slots:
        value = pick(slot)
        places += [slot.start_s / unit_s, slot.end_s / unit_s]
        heights += [np.nan if value is None else value] * 2
    axes.plot(places, heights, color=colour, linewidth=1.5)
    low, high = float(np.nanmin(heights)), float(np.nanmax(heights))
    axes.set_ylim(0.0 if low < 0.7 * high else low - 0.25 * (high - low) - 0.02 * abs(high) - 1e-6, high * 1.12 + 1e-6)
    axes.set_ylabel(words, color=INK, fontsize=9.5)
    throttled = [slot for slot in slots if slot.throttled]
    if "temperature" in words and throttled:
        for slot in throttled:
            axes.axvspan(slot.start_s / unit_s, slot.end_s / unit_s, color=QUIET, alpha=0.4, linewidth=0, zorder=0)
