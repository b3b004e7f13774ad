"""The picture of a refinement: the twin's lane edges over the photograph, before and after, with the places it changes most.

Knows matplotlib, the photograph and the refinement. Knows no file and decides nothing.
"""

from __future__ import annotations

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from dnb_edge.report.picture import PictureFormat, encoded
from dnb_edge.values import BgrImage, Points
from dnb_edge.view.refine import Refinement
from dnb_edge.view.refine_overlap import Agreement

_BEFORE_COLOUR = "#ff7f0e"
_AFTER_COLOUR = "#00c8ff"
_INK = "#1f2328"
_ZOOMS = 4
_ZOOM_SHARE = 0.11
"""Width of a zoomed place, as a share of the picture's."""

_ASPECT = 4.0 / 3.0


def refinement_picture(refinement: Refinement, picture: BgrImage, *, picture_format: PictureFormat = "png") -> bytes:
    """The picture file: the photograph with the twin's edges before (orange) and after (blue), and below it the places
    where they differ most. `picture` is the one that the refinement was made on.
    """
    before, after = _lines(refinement, refinement.edges_before_px), _lines(refinement, refinement.edges_after_px)
    figure = Figure(figsize=(12.0, 9.6), dpi=130, facecolor="white", layout="constrained")
    rows = figure.add_gridspec(2, _ZOOMS, height_ratios=(2.3, 1.0))
    whole = figure.add_subplot(rows[0, :])
    box = _around(refinement, picture)
    _draw(whole, picture, box, before, after, width=1.1)
    for k, middle in enumerate(_places(refinement, picture)):
        size = _ZOOM_SHARE * picture.shape[1]
        zoom = _inside(middle, (size, size / _ASPECT), picture)
        _draw(figure.add_subplot(rows[1, k]), picture, zoom, before, after, width=1.8)
        left, top, right, bottom = zoom
        whole.add_patch(
            Rectangle((left, top), right - left, bottom - top, fill=False, edgecolor="white", linewidth=1.2)
        )
        whole.annotate(
            "abcd"[k],
            (left, top),
            (4, -4),
            textcoords="offset points",
            color="white",
            va="top",
            fontsize=12,
            weight="bold",
        )
        figure.axes[-1].set_title("abcd"[k], color=_INK, fontsize=11)
    whole.set_title(_title(refinement.before, refinement.after), color=_INK, fontsize=12)
    handles = [Line2D([], [], color=colour, linewidth=2.5) for colour in (_BEFORE_COLOUR, _AFTER_COLOUR)]
    names = ["the twin's lane by the present calibration", "refined"]
    figure.legend(handles, names, loc="outside lower center", ncols=2, frameon=False, fontsize=11)
    return encoded(figure, picture_format)


def _title(before: Agreement, after: Agreement) -> str:
    return (
        f"overlap {before.overlap:.1%} before, {after.overlap:.1%} after; edges off by "
        f"{before.edge_median_m * 1000:.1f} mm and {after.edge_median_m * 1000:.1f} mm (median)"
    )


def _draw(
    axes: Axes,
    picture: BgrImage,
    box: tuple[float, float, float, float],
    before: list[NDArray[np.float64]],
    after: list[NDArray[np.float64]],
    *,
    width: float,
) -> None:
    """One part of the picture, camera px (left, top, right, bottom), with both lines."""
    left, top, right, bottom = box
    rows, columns = slice(int(top), int(np.ceil(bottom))), slice(int(left), int(np.ceil(right)))
    part = cv2.cvtColor(np.ascontiguousarray(picture[rows, columns]), cv2.COLOR_BGR2RGB)
    extent = (columns.start - 0.5, columns.stop - 0.5, rows.stop - 0.5, rows.start - 0.5)
    axes.imshow(part, extent=extent, interpolation="antialiased")
    for lines, colour in ((before, _BEFORE_COLOUR), (after, _AFTER_COLOUR)):
        axes.add_collection(LineCollection(lines, colors=colour, linewidths=width))
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    axes.set_xticks([])
    axes.set_yticks([])


def _lines(refinement: Refinement, points: Points) -> list[NDArray[np.float64]]:
    """The edges as polylines: points that are neighbours on the twin are joined."""
    step = np.linalg.norm(np.diff(refinement.edges_twin_px, axis=0), axis=1)
    cuts = np.flatnonzero(step > 3.0 * np.median(step)) + 1
    return [line for line in np.split(points, cuts) if len(line) > 1]


def _around(refinement: Refinement, picture: BgrImage) -> tuple[float, float, float, float]:
    """The part of the picture that holds the track, (left, top, right, bottom)."""
    height, width = picture.shape[:2]
    points = np.concatenate((refinement.edges_before_px, refinement.edges_after_px))
    low = np.maximum(points.min(axis=0) - 0.02 * width, 0.0)
    high = np.minimum(points.max(axis=0) + 0.02 * width, (width - 1.0, height - 1.0))
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _places(refinement: Refinement, picture: BgrImage) -> Points:
    """The middles of the zooms (k, 2): where the edges move most, apart from each other."""
    height, width = picture.shape[:2]
    middle = 0.5 * (refinement.edges_before_px + refinement.edges_after_px)
    moved = np.linalg.norm(refinement.edges_after_px - refinement.edges_before_px, axis=1)
    moved[((middle < 0) | (middle > (width - 1, height - 1))).any(axis=1)] = -1.0
    chosen: list[NDArray[np.float64]] = []
    for _ in range(_ZOOMS):
        best = int(np.argmax(moved))
        chosen.append(middle[best])
        moved[np.linalg.norm(middle - middle[best], axis=1) < 1.6 * _ZOOM_SHARE * width] = -1.0
    return np.array(chosen)


def _inside(
    middle: NDArray[np.float64], size: tuple[float, float], picture: BgrImage
) -> tuple[float, float, float, float]:
    """A box of `size` about `middle`, moved into the picture."""
    height, width = picture.shape[:2]
    left = float(np.clip(middle[0] - 0.5 * size[0], 0.0, max(0.0, width - 1.0 - size[0])))
    top = float(np.clip(middle[1] - 0.5 * size[1], 0.0, max(0.0, height - 1.0 - size[1])))
    return left, top, min(left + size[0], width - 1.0), min(top + size[1], height - 1.0)
