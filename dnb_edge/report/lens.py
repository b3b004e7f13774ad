"""The picture of a lens's fit: where in the camera's picture corners were seen, how far off each is, and which views are bad.

Knows matplotlib and the fit to draw. Knows no picture and no file.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dnb_edge.report.picture import PictureFormat, encoded
from dnb_edge.view.lens_fit import GRID, LensFit

_INK = "#1f2328"
_GOOD = "#1f4fa8"
_BAD = "#c0281c"
_GRID_LINE = "#d8dee4"
_ARROW_SHARE = 0.03
"""An error of the RMS is drawn so long, as a share of the picture's width."""


def lens_picture(fit: LensFit, *, picture_format: PictureFormat = "png") -> bytes:
    """The picture file: left every corner with its error as an enlarged arrow, and the number of views in each cell of the
    picture; right the RMS of every view, bad ones in red.
    """
    figure = Figure(
        figsize=(13.0, max(5.5, 1.5 + 0.24 * len(fit.views))), dpi=120, facecolor="white", layout="constrained"
    )
    left, right = figure.subplots(1, 2, width_ratios=(2.0, 1.0))
    _draw_corners(left, fit)
    _draw_views(right, fit)
    return encoded(figure, picture_format)


def _draw_corners(axes: Axes, fit: LensFit) -> None:
    width, height = fit.lens.width_px, fit.lens.height_px
    enlarged = max(1.0, float(f"{_ARROW_SHARE * width / max(fit.rms_px, 1e-6):.1g}"))
    for view in fit.views:
        colour = _BAD if view.bad else _GOOD
        axes.plot(*view.camera_px.T, ".", markersize=2.5, color=colour, zorder=2)
        # From where the corner was found to where the lens puts it.
        shafts = np.stack(
            (view.camera_px, view.camera_px + enlarged * view.off_px, np.full_like(view.off_px, np.nan)), 1
        )
        axes.plot(*shafts.reshape(-1, 2).T, color=colour, linewidth=0.8, alpha=0.7, zorder=3)
    for k in range(1, GRID):
        axes.axvline(k * width / GRID - 0.5, color=_GRID_LINE, linewidth=1.0, zorder=1)
        axes.axhline(k * height / GRID - 0.5, color=_GRID_LINE, linewidth=1.0, zorder=1)
    for (row, column), count in np.ndenumerate(fit.coverage.counts):
        at = ((column + 0.5) * width / GRID, (row + 0.12) * height / GRID)
        said = f"{count} views" if count else "no view"
        box = {"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "none", "alpha": 0.8}
        axes.text(*at, said, ha="center", va="center", fontsize=10, color=_INK if count else _BAD, bbox=box, zorder=4)
    axes.set_xlim(-0.5, width - 0.5)
    axes.set_ylim(height - 0.5, -0.5)
    axes.set_aspect("equal")
    axes.set_title(f"Corners and their errors, {enlarged:g} times enlarged", color=_INK, fontsize=12)
    axes.set_xlabel("camera px")
    axes.set_ylabel("camera px")


def _draw_views(axes: Axes, fit: LensFit) -> None:
    places = np.arange(len(fit.views))
    colours = [_BAD if view.bad else _GOOD for view in fit.views]
    axes.barh(places, [view.rms_px for view in fit.views], color=colours, height=0.7)
    axes.axvline(fit.rms_px, color=_INK, linestyle="--", linewidth=1.2)
    names = [f"{view.name}, {view.tilt_deg:.0f}°" for view in fit.views]
    axes.set_yticks(places, names, fontsize=9)
    for label, view in zip(axes.get_yticklabels(), fit.views, strict=True):
        label.set_color(_BAD if view.bad else _INK)
        label.set_parse_math(False)
    axes.invert_yaxis()
    axes.set_xlabel("RMS of the view, camera px (dashed: of all)")
    axes.set_title(f"{len(fit.views)} views (tilt), RMS {fit.rms_px:.2f} px", color=_INK, fontsize=12)
    axes.grid(visible=True, axis="x", color=_GRID_LINE, linewidth=0.7)
    axes.set_axisbelow(True)
