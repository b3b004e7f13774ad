"""The map of the position's sigma: over the twin, and over the camera's picture too where there is one.

Knows matplotlib, a calibration and the pictures to draw on. Knows no file.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import matplotlib.patheffects as effects
import numpy as np
from matplotlib.axes import Axes
from matplotlib.contour import QuadContourSet
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from dnb_edge.report.picture import PictureFormat, encoded
from dnb_edge.track.model import Track
from dnb_edge.values import BgrImage, Points
from dnb_edge.view.calibration import Calibration
from dnb_edge.view.keypoints import KeypointPairs

_INK = "#1f2328"
_WRONG = "#c0281c"
_HALO: list[effects.AbstractPathEffect] = [effects.withStroke(linewidth=3.0, foreground="white")]
_CELLS = 200
_LEVELS = 9
_PALE = 0.6
_ARROW_SHARE = 0.1
"""The longest arrow of a sound keypoint is drawn about so long, as a share of the panel's width."""
_AROUND = 0.08
"""Without a twin's picture the panel reaches so far beyond track and keypoints, as a share of their extent."""
_MOST_PX = 1600


@dataclass(frozen=True, slots=True, kw_only=True)
class SigmaMap:
    """What is to be drawn."""

    calibration: Calibration
    pairs: KeypointPairs
    wrong: tuple[str, ...] = ()
    """Names of outliers and suspects, drawn in red."""
    track: Track | None = None
    twin: BgrImage | None = None
    picture: BgrImage | None = None
    """Of the camera, of any size of the calibration's aspect."""
    unit: str = "mm"
    per_metre: float = 1000.0
    """How many of the unit make one metre of the calibration's scale."""


def sigma_map_picture(wanted: SigmaMap, *, picture_format: PictureFormat = "png") -> bytes:
    """The picture file: sigma as colour and isolines, the lane's edges, keypoints with names and their errors as arrows."""
    panels = 1 if wanted.picture is None else 2
    low, high = _extent(wanted)
    across, down = (high - low).tolist()
    figure = Figure(
        figsize=(8.0 * panels, min(8.0, max(5.0, 7.0 * down / across + 1.2))),
        dpi=110,
        facecolor="white",
        layout="constrained",
    )
    grid = np.atleast_1d(figure.subplots(1, panels))
    levels = _levels(wanted)
    drawn = _draw_twin(grid[0], wanted, levels)
    if wanted.picture is not None:
        _draw_camera(grid[1], wanted, wanted.picture, levels)
    bar = figure.colorbar(drawn, ax=list(grid), shrink=0.8, pad=0.02)
    bar.set_label(f"one sigma of the position, {wanted.unit}", color=_INK, fontsize=12)
    return encoded(figure, picture_format)


def _draw_twin(axes: Axes, wanted: SigmaMap, levels: NDArray[np.float64]) -> QuadContourSet:
    low, high = _extent(wanted)
    u, v = _cells(low, high)
    twin_px = np.column_stack((u.ravel(), v.ravel()))
    camera_px, seen = _camera_px(wanted.calibration, twin_px)
    sigma = _sigma(wanted, camera_px, seen).reshape(u.shape)
    if wanted.twin is not None:
        axes.imshow(
            _pale(wanted.twin), extent=_frame(wanted.twin.shape[1], wanted.twin.shape[0]), cmap="gray", vmin=0, vmax=1
        )
    drawn = _contours(axes, u, v, sigma, levels)
    for line in _lane_lines(wanted):
        axes.plot(line[:, 0], line[:, 1], color=_INK, linewidth=1.0, alpha=0.7)
    given = wanted.pairs.twin_array()
    mapped = wanted.calibration.ground.scale.to_twin_px(
        wanted.calibration.ground.to_track_m(wanted.pairs.camera_array())
    )
    times = _draw_pairs(axes, wanted, given, mapped, width=high[0] - low[0])
    _finish(
        axes, low, high, f"on the twin\narrows: from each keypoint to where the map puts its click, {times}", "twin px"
    )
    return drawn


def _draw_camera(axes: Axes, wanted: SigmaMap, picture: BgrImage, levels: NDArray[np.float64]) -> None:
    ground = wanted.calibration.ground
    low, high = np.array([-0.5, -0.5]), np.array([ground.width_px - 0.5, ground.height_px - 0.5])
    u, v = _cells(low, high)
    camera_px = np.column_stack((u.ravel(), v.ravel()))
    seen = np.asarray(ground.sees_ground(camera_px))
    twin_px = np.full_like(camera_px, np.nan)
    twin_px[seen] = ground.scale.to_twin_px(ground.to_track_m(camera_px[seen]))
    least, most = _extent(wanted)
    with np.errstate(invalid="ignore"):
        seen &= ((twin_px >= least) & (twin_px <= most)).all(axis=1)
    sigma = _sigma(wanted, camera_px, seen).reshape(u.shape)
    axes.imshow(_pale(picture), extent=_frame(ground.width_px, ground.height_px), cmap="gray", vmin=0, vmax=1)
    _contours(axes, u, v, sigma, levels)
    for line in _lane_lines(wanted):
        at, inside = _camera_px(wanted.calibration, line)
        at[~inside] = np.nan
        axes.plot(at[:, 0], at[:, 1], color=_INK, linewidth=1.0, alpha=0.7)
    clicked = wanted.pairs.camera_array()
    put, ahead = _camera_px(wanted.calibration, wanted.pairs.twin_array(), anywhere=True)
    times = _draw_pairs(axes, wanted, clicked, np.where(ahead[:, None], put, clicked), width=high[0] - low[0])
    _finish(
        axes,
        low,
        high,
        f"in the picture\narrows: from each click to where the map puts its keypoint, {times}",
        "camera px",
    )


def _draw_pairs(axes: Axes, wanted: SigmaMap, at: Points, other: Points, *, width: float) -> str:
    """Dots, names and enlarged arrows; the enlargement in words."""
    names = wanted.pairs.names
    sound = np.array([name not in wanted.wrong for name in names])
    lengths = np.hypot(*(other - at).T)
    longest = float(lengths[sound].max()) if sound.any() else float(lengths.max())
    times = _round(_ARROW_SHARE * width / max(longest, 1e-9))
    tips = at + (other - at) * np.where(sound, times, 1)[:, None]
    for name, tail, tip, good in zip(names, at, tips, sound, strict=True):
        colour = _INK if good else _WRONG
        axes.annotate(
            "", xy=tuple(tip), xytext=tuple(tail), annotation_clip=False,
            arrowprops={"arrowstyle": "-|>", "color": colour, "linewidth": 1.6, "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip
        axes.plot(*tail, "o", markersize=6, markerfacecolor="white", markeredgecolor=colour, markeredgewidth=1.6)
        axes.annotate(
            name, tuple(tail), (6, 6), textcoords="offset points", color=colour, fontsize=11, weight="bold",
            path_effects=_HALO, parse_math=False,
        )  # fmt: skip
    if times == 1:
        return "to scale"
    return f"{times:,} times enlarged" + ("" if sound.all() else " (red: to scale)")


def _contours(
    axes: Axes, u: NDArray[np.float64], v: NDArray[np.float64], sigma: NDArray[np.float64], levels: NDArray[np.float64]
) -> QuadContourSet:
    hidden = np.ma.masked_invalid(sigma)
    drawn = axes.contourf(u, v, hidden, levels=levels, cmap="viridis", alpha=0.55, extend="both")
    lines = axes.contour(u, v, hidden, levels=levels, colors=_INK, linewidths=0.7, alpha=0.8)
    for text in axes.clabel(lines, fmt="%g", fontsize=9):
        text.set_path_effects(_HALO)
    return drawn


def _levels(wanted: SigmaMap) -> NDArray[np.float64]:
    """Round values from the least to well over the greatest sigma on the lane, or at the keypoints."""
    lines = [*_lane_lines(wanted), wanted.pairs.twin_array()]
    camera_px, seen = _camera_px(wanted.calibration, np.vstack(lines))
    sigma = _sigma(wanted, camera_px, seen)
    if not np.isfinite(sigma).any():
        return np.array([0.0, 1.0])
    low, high = float(np.nanmin(sigma)), float(np.nanmax(sigma))
    ticks: NDArray[np.float64] = np.asarray(
        MaxNLocator(_LEVELS, steps=[1, 2, 2.5, 5, 10]).tick_values(0.8 * low, max(1.3 * high, 1.2 * low + 1e-9))
    )
    positive = ticks[ticks > 0]
    return positive if len(positive) > 1 else ticks


def _sigma(wanted: SigmaMap, camera_px: Points, seen: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(n,) in the unit to be drawn; NaN (not drawn) where the camera does not see the place."""
    sigma = np.full(len(camera_px), np.nan)
    if seen.any():
        sigma[seen] = wanted.calibration.sigma_m(camera_px[seen]) * wanted.per_metre
    return sigma


def _camera_px(
    calibration: Calibration, twin_px: Points, *, anywhere: bool = False
) -> tuple[Points, NDArray[np.bool_]]:
    """Camera px (n, 2) of twin px (n, 2), and which of them lie in the picture (`anywhere`: ahead of the camera)."""
    ground = calibration.ground
    back = np.linalg.inv(np.array(ground.camera_to_twin).reshape(3, 3))
    ahead = np.asarray((np.column_stack((twin_px, np.ones(len(twin_px)))) @ back.T)[:, 2] > 0)
    camera_px = np.zeros_like(twin_px)
    camera_px[ahead] = ground.to_camera_px(ground.scale.to_track_m(twin_px[ahead]))
    if anywhere:
        return camera_px, ahead
    inside = ((camera_px >= -0.5) & (camera_px <= (ground.width_px - 0.5, ground.height_px - 0.5))).all(axis=1)
    return camera_px, ahead & inside


def _lane_lines(wanted: SigmaMap) -> Sequence[Points]:
    """The lane's edges, twin px."""
    if wanted.track is None:
        return ()
    line = wanted.track.centreline
    ahead = np.gradient(line.points_m, axis=0)
    ahead /= np.maximum(np.hypot(*ahead.T), 1e-12)[:, None]
    left = np.column_stack((-ahead[:, 1], ahead[:, 0]))
    edges = [line.points_m + left * line.half_left_m[:, None], line.points_m - left * line.half_right_m[:, None]]
    return [wanted.calibration.ground.scale.to_twin_px(_joined(edge) if line.closed else edge) for edge in edges]


def _joined(edge: Points) -> Points:
    return np.vstack((edge, edge[:1]))


def _extent(wanted: SigmaMap) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The twin's corners, twin px."""
    if wanted.twin is not None:
        height, width = wanted.twin.shape[:2]
        return np.array([-0.5, -0.5]), np.array([width - 0.5, height - 0.5])
    everything = np.vstack([*_lane_lines(wanted), wanted.pairs.twin_array()])
    low, high = everything.min(axis=0), everything.max(axis=0)
    around = _AROUND * float((high - low).max())
    return low - around, high + around


def _cells(low: NDArray[np.float64], high: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    step = float((high - low).max()) / _CELLS
    u, v = (np.linspace(a, b, max(2, round((b - a) / step))) for a, b in zip(low, high, strict=True))
    across, down = np.meshgrid(u, v)
    return across, down


def _finish(axes: Axes, low: NDArray[np.float64], high: NDArray[np.float64], title: str, label: str) -> None:
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(high[1], low[1])
    axes.set_aspect("equal")
    axes.set_title(title, color=_INK, fontsize=10)
    axes.set_xlabel(f"u, {label}", color=_INK)
    axes.set_ylabel(f"v, {label}", color=_INK)


def _frame(width: int, height: int) -> tuple[float, float, float, float]:
    return -0.5, width - 0.5, height - 0.5, -0.5


def _pale(image: BgrImage) -> NDArray[np.float64]:
    """Grey and pale, 0..1, so that colours on it can be read; large pictures thinned out."""
    step = max(1, max(image.shape[:2]) // _MOST_PX)
    grey = image[::step, ::step].mean(axis=2) / 255.0
    return np.asarray(1.0 - _PALE + _PALE * grey)


def _round(times: float) -> int:
    """The nearest smaller of 1, 2, 5, 10, 20, ...; at least 1."""
    if times < 1:
        return 1
    ten = 10 ** math.floor(math.log10(times))
    return int(max(step * ten for step in (1, 2, 5) if step * ten <= times))
