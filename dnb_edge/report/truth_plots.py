"""The pictures of an accuracy certificate: errors, how far stated sigmas can be trusted, and errors over speed and rate.

Knows the certificate's figures as plain values and matplotlib by its objects; knows no page and no drive.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter

from dnb_edge.report.picture import PictureFormat, encoded

_DPI = 96
_INK = "#1f2328"
_FAINT = "#57606a"
_PAPER = "#ffffff"
_FAST, _RENDERED = "#0072b2", "#d55e00"
_RATES = ("#56a0d3", "#0072b2", "#14375e", "#8c3b80", "#d55e00")
_COLUMNS = 3

Shown = Sequence[Mapping[str, Any]]
"""Scenarios of a certificate."""


def errors_picture(scenarios: Shown, *, picture_format: PictureFormat = "svg") -> bytes:
    """A histogram of lap errors for each scenario; the outer bins hold what lies beyond."""
    rows = max(1, math.ceil(len(scenarios) / _COLUMNS))
    figure = Figure(figsize=(9.6, 0.3 + 1.75 * rows), dpi=_DPI, facecolor=_PAPER, layout="constrained")
    grid = figure.subplots(rows, _COLUMNS, squeeze=False)
    for axes in grid.flat:
        axes.set_visible(False)
    for axes, scenario in zip(grid.flat, scenarios, strict=False):
        axes.set_visible(True)
        _histogram(axes, scenario)
    return encoded(figure, picture_format)


def _histogram(axes: Axes, scenario: Mapping[str, Any]) -> None:
    figures, counts = scenario["figures"], scenario["figures"]["histogram"]["counts"]
    reach = figures["histogram"]["reach_ms"]
    _plain(axes)
    axes.set_yticks([])
    axes.set_title(scenario["name"], fontsize=9, color=_INK, loc="left")
    if counts:
        edges = np.linspace(-reach, reach, len(counts) + 1)
        axes.stairs(counts, edges, fill=True, color=_colour(scenario), alpha=0.85)
        axes.axvline(0.0, color=_INK, linewidth=0.7)
        axes.set_ylim(0.0, 1.5 * max(counts))
        note = f"{figures['told']} laps\np95 {figures['p95_ms']:.2f} ms"
        axes.text(0.98, 0.94, note, transform=axes.transAxes, ha="right", va="top", fontsize=8, color=_FAINT)
    axes.set_xlim(-reach, reach)
    axes.set_xlabel("lap error (ms)", fontsize=8, color=_FAINT)


def trust_picture(scenarios: Shown, levels: Sequence[float], *, picture_format: PictureFormat = "svg") -> bytes:
    """Left: how many errors lie within so many stated sigmas, and how many should. Right: stated sigma and what came of it."""
    figure = Figure(figsize=(9.6, 4.2), dpi=_DPI, facecolor=_PAPER, layout="constrained")
    left, right = figure.subplots(1, 2)
    for axes in (left, right):
        _plain(axes)
    normal = [math.erf(level / math.sqrt(2.0)) for level in levels]
    left.plot([0, *levels], [0, *(100 * share for share in normal)], color=_INK, linewidth=1.4, label="as stated")
    told = [scenario for scenario in scenarios if scenario["figures"]["reliability"]]
    for scenario in told:
        shares = [0.0, *(100 * share for share in scenario["figures"]["reliability"])]
        left.plot([0, *levels], shares, color=_colour(scenario), linewidth=0.9, alpha=0.6)
    left.axvline(1.96, color=_FAINT, linewidth=0.7, linestyle=(0, (4, 3)))
    left.set_xlabel("error, in stated sigmas", color=_INK)
    left.set_ylabel("laps within (%)", color=_INK)
    left.set_xlim(0, 3)
    left.set_ylim(0, 102)
    points = [
        (one["stated_ms"], one["rms_ms"], _colour(scenario))
        for scenario in told
        for one in scenario["figures"]["by_sigma"]
    ]
    for kind, colour in (("fast", _FAST), ("rendered", _RENDERED)):
        mine = [(stated, rms) for stated, rms, of in points if of == colour]
        if mine:
            right.scatter(*zip(*mine, strict=True), s=14, color=colour, alpha=0.7, label=kind, linewidths=0)
    if points:
        low = 0.7 * max(1e-3, min(min(stated, rms) for stated, rms, _ in points))
        high = 1.4 * max(max(stated, rms) for stated, rms, _ in points)
        right.plot((low, high), (low, high), color=_INK, linewidth=1.2)
        right.set_xscale("log")
        right.set_yscale("log")
        _plain_ticks(right)
        right.legend(frameon=False, fontsize=9, loc="upper left")
    right.set_xlabel("stated sigma of a lap (ms)", color=_INK)
    right.set_ylabel("error that came of it, rms (ms)", color=_INK)
    return encoded(figure, picture_format)


def sweep_picture(scenarios: Shown, *, picture_format: PictureFormat = "svg") -> bytes:
    """Error over speed, a line a rate: p95, and the stated 1.96 sigma dashed."""
    figure = Figure(figsize=(9.6, 4.0), dpi=_DPI, facecolor=_PAPER, layout="constrained")
    axes = figure.subplots()
    _plain(axes)
    rates = sorted({float(scenario["fps"]) for scenario in scenarios})
    for i, rate in enumerate(rates):
        mine = sorted(
            (float(one["name"].split("-")[1].removesuffix("mps")), one["figures"])
            for one in scenarios
            if one["fps"] == rate and one["figures"]["p95_ms"] is not None
        )
        speeds = [speed for speed, _ in mine]
        colour = _RATES[i % len(_RATES)]
        axes.plot(speeds, [figures["p95_ms"] for _, figures in mine], marker="o", color=colour, label=f"{rate:g} fps")
        stated = [1.96 * figures["stated_sigma_ms"] for _, figures in mine]
        axes.plot(speeds, stated, color=colour, linewidth=0.9, linestyle=(0, (4, 3)))
    if scenarios:
        axes.set_xscale("log")
        axes.set_yscale("log")
        ticks = sorted({float(one["name"].split("-")[1].removesuffix("mps")) for one in scenarios})
        _plain_ticks(axes)
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks], minor=False)
        axes.legend(frameon=False, fontsize=9)
    axes.set_xlabel("speed (m/s)", color=_INK)
    axes.set_ylabel("lap error, p95; dashed: 1.96 stated sigma (ms)", color=_INK)
    return encoded(figure, picture_format)


def memory_picture(scenarios: Shown, *, picture_format: PictureFormat = "svg") -> bytes:
    """How long the real detector's errors last: their autocorrelation over frames, along and across the way."""
    figure = Figure(figsize=(9.6, 3.6), dpi=_DPI, facecolor=_PAPER, layout="constrained")
    for axes, axis in zip(figure.subplots(1, 2), ("along", "across"), strict=True):
        _plain(axes)
        for i, scenario in enumerate(scenarios):
            values = scenario["figures"]["detector"][axis]["autocorrelation"]
            known = [(lag, value) for lag, value in enumerate(values) if value is not None]
            if known:
                axes.plot(
                    *zip(*known, strict=True), color=_RATES[i % len(_RATES)], label=scenario["name"], linewidth=1.2
                )
        axes.axhline(0.0, color=_INK, linewidth=0.7)
        axes.set_xlabel("frames later", color=_INK)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.set_ylabel(f"correlation of errors {axis} the way", color=_INK)
        axes.set_ylim(-0.4, 1.05)
    if scenarios:
        figure.axes[0].legend(frameon=False, fontsize=8)
    return encoded(figure, picture_format)


def _colour(scenario: Mapping[str, Any]) -> str:
    return _RENDERED if scenario["kind"] == "rendered" else _FAST


def _plain(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(colors=_FAINT, labelsize=8)


def _plain_ticks(axes: Axes) -> None:
    """Numbers as people write them on logarithmic axes, and none between the main ones."""
    for side in (axes.xaxis, axes.yaxis):
        side.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        side.set_minor_formatter(NullFormatter())
