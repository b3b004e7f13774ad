"""The plot of the homography's error against the number of keypoints, after the paper's figure on transformation error.

Knows matplotlib and the errors to draw. Knows no keypoints and no file.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.patheffects as effects
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter

from dnb_edge.report.picture import PictureFormat, encoded
from dnb_edge.view.homography import CountError

_SUM_COLOUR = "#1f4fa8"
_MEAN_COLOUR = "#c0281c"
_INK = "#1f2328"
_HALO = [effects.withStroke(linewidth=4.0, foreground="white")]
_LOG_RATIO = 20.0
"""Errors that differ by more than this factor are drawn on logarithmic axes, or the small ones could not be read."""


def error_by_count_picture(rows: Sequence[CountError], *, picture_format: PictureFormat = "png") -> bytes:
    """The picture file: accumulated error (blue, left axis) and mean error (red, right axis), twin px, against the
    number of keypoints behind the homography. `rows` holds at least one count.
    """
    figure = Figure(figsize=(8.0, 5.0), dpi=120, facecolor="white", layout="constrained")
    left = figure.subplots()
    right = left.twinx()
    counts = [row.points for row in rows]
    sums, means = [row.sum_px for row in rows], [row.mean_px for row in rows]
    _draw(left, counts, sums, _SUM_COLOUR, "o", "accumulated error, twin px")
    _draw(right, counts, means, _MEAN_COLOUR, "s", "mean error, twin px")
    if min(sums) > 0 and max(sums) > _LOG_RATIO * min(sums):
        _make_logarithmic(left, sums, below=4.0, above=2.2)
        _make_logarithmic(right, means, below=2.2, above=6.0)
    else:
        # The mean is the sum over one fixed number of points: more room on its axis keeps the lines apart.
        left.set_ylim(0, 1.15 * max(sums) or 1.0)
        right.set_ylim(0, 1.6 * max(means) or 1.0)
    left.set_xlabel("number of keypoints behind the homography", color=_INK, fontsize=12)
    left.xaxis.set_major_locator(FixedLocator([float(count) for count in counts]))
    left.set_title("Transformation error over all keypoints", color=_INK, fontsize=13)
    left.grid(visible=True, axis="both", color="#d8dee4", linewidth=0.7)
    left.set_axisbelow(True)
    left.margins(x=0.08)
    handles = [axes.get_lines()[0] for axes in (left, right)]
    names = ["accumulated (left axis)", "mean (right axis)"]
    figure.legend(handles, names, loc="outside lower center", ncols=2, frameon=False, fontsize=11)
    return encoded(figure, picture_format)


def _draw(axes: Axes, counts: list[int], errors: list[float], colour: str, marker: str, label: str) -> None:
    dashed = marker == "s"
    axes.plot(
        counts, errors, color=colour, marker=marker, markersize=7, linewidth=2.0, linestyle="--" if dashed else "-"
    )
    axes.set_ylabel(label, color=colour, fontsize=12)
    axes.tick_params(axis="y", colors=colour, labelsize=11)
    axes.tick_params(axis="x", labelsize=11)
    for count, error in zip(counts, errors, strict=True):
        axes.annotate(
            f"{error:,.1f}",
            (count, error),
            (0, -19 if dashed else 10),
            textcoords="offset points",
            ha="center",
            color=colour,
            fontsize=10,
            path_effects=_HALO,
        )


def _make_logarithmic(axes: Axes, errors: list[float], *, below: float, above: float) -> None:
    """Logarithmic axes with margins as factors; unlike ones keep two lines of the same shape apart."""
    axes.set_yscale("log")
    axes.set_ylim(min(errors) / below, max(errors) * above)
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}" if value >= 1 else f"{value:g}"))
