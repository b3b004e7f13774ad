"""The drawing of a mount plan: side view and top view, one above the other, to one scale.

Both look along the camera's heading: metres ahead of the camera's foot run to the right in both. The track is shaded by how
many millimetres one px covers. Knows matplotlib and a plan; knows no file.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import matplotlib.patheffects as effects
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patches import Arc, Polygon
from matplotlib.ticker import FixedLocator, FuncFormatter, MultipleLocator

from dnb_edge.mount.plan import MountPlan, PointPlan
from dnb_edge.report.picture import PictureFormat, encoded
from dnb_edge.values import Points

_DPI = 100
_INK, _FAINT, _PAPER = "#1f2328", "#6e7781", "#ffffff"
_VIEW, _VIEW_EDGE = "#dbe9f6", "#4a7fb5"
_LOST = "#c0281c"
_SHADES = "YlOrBr"
_LABEL = {"facecolor": _PAPER, "edgecolor": "none", "alpha": 0.85, "pad": 2.0}
_HALO = [effects.withStroke(linewidth=3.0, foreground=_PAPER)]
_LEFT, _RIGHT, _TOP, _GAP, _BOTTOM = 0.75, 0.3, 0.85, 0.75, 1.35
"""Inches round and between the two views."""
_PAD, _BELOW, _ABOVE = 0.95, 0.75, 0.45
"""Inches inside a view: on its sides, below the floor for dimensions, and above the camera."""
_WIDTH, _NARROWEST, _TALLEST = 10.0, 8.4, 11.0
_GRID = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class _Sheet:
    """Extents in metres along the camera's heading (a), across it (l, to the left) and up, and inches a metre."""

    low_a: float
    high_a: float
    high_l: float
    low_l: float
    height: float
    scale: float

    def m(self, inches: float) -> float:
        """Metres that take so many inches on the sheet."""
        return inches / self.scale


def mount_picture(plan: MountPlan, *, picture_format: PictureFormat = "png") -> bytes:
    """The picture file of a plan."""
    sheet = _sheet(plan)
    width = max(_LEFT + _RIGHT + (sheet.high_a - sheet.low_a) * sheet.scale, _NARROWEST)
    side, top = sheet.height * sheet.scale + _BELOW + _ABOVE, (sheet.high_l - sheet.low_l) * sheet.scale
    height = _TOP + side + _GAP + top + _BOTTOM
    figure = Figure(figsize=(width, height), dpi=_DPI, facecolor=_PAPER)
    span = (sheet.high_a - sheet.low_a) * sheet.scale
    left = _LEFT + max(0.0, 0.5 * (width - _LEFT - _RIGHT - span))

    def axes(bottom: float, tall: float) -> Axes:
        made = figure.add_axes((left / width, bottom / height, span / width, tall / height))
        made.set_xlim(sheet.low_a, sheet.high_a)
        for spine in made.spines.values():
            spine.set_color("#d0d7de")
        made.tick_params(colors=_FAINT, labelsize=9)
        for ticks in (made.xaxis, made.yaxis):
            ticks.set_major_locator(MultipleLocator(_tick_m(sheet)))
            ticks.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.4g}".replace("-", "\N{MINUS SIGN}")))
        return made

    _draw_side(axes(_BOTTOM + top + _GAP, side), plan, sheet)
    shading = _draw_top(axes(_BOTTOM, top), plan, sheet)
    bar_axes = figure.add_axes((left / width, 0.55 / height, span / width, 0.14 / height))
    bar = figure.colorbar(shading, cax=bar_axes, orientation="horizontal")
    bar.set_label("mm of floor that one px covers, in the direction in which it is most", color=_INK, fontsize=10)
    bar.outline.set_edgecolor("#d0d7de")
    bar_axes.tick_params(colors=_FAINT, labelsize=9)
    _draw_title(figure, plan, 0.35 / width, height)
    _draw_key(figure, plan, left / width, (_BOTTOM + top + 0.08) / height)
    return encoded(figure, picture_format)


def _sheet(plan: MountPlan) -> _Sheet:
    """Room for the track, the camera and a good part of the floor in the picture."""
    stand, margin = plan.camera.stand, plan.request.limits.margin_m
    track = plan.camera.ahead_m(plan.request.track.corners_m(margin))
    around = 0.25 * float(np.ptp(track, axis=0).max())
    low, high = np.minimum(track.min(axis=0), 0.0) - around, np.maximum(track.max(axis=0), 0.0) + around
    box = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    seen = plan.camera.ahead_m(plan.camera.seen_part(plan.camera.to_plan_m(box)))
    shown = np.vstack((track, np.zeros((1, 2)), seen))
    low_a, high_a = float(shown[:, 1].min()), float(shown[:, 1].max())
    low_l, high_l = -float(shown[:, 0].max()), -float(shown[:, 0].min())
    tall_m = stand.height_m + high_l - low_l
    by_height = (_TALLEST - _TOP - _GAP - _BOTTOM - _BELOW - _ABOVE - 2 * 0.2) / tall_m
    scale = min((_WIDTH - _LEFT - _RIGHT - 2 * _PAD) / (high_a - low_a), by_height)
    return _Sheet(
        low_a=low_a - _PAD / scale,
        high_a=high_a + _PAD / scale,
        low_l=low_l - 0.2 / scale,
        high_l=high_l + 0.2 / scale,
        height=stand.height_m,
        scale=scale,
    )


def _tick_m(sheet: _Sheet) -> float:
    """Metres between ticks: at least 0.45 inches."""
    return next((step for step in (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0) if step * sheet.scale >= 0.45), 20.0)


def _draw_title(figure: Figure, plan: MountPlan, left: float, height: float) -> None:
    stand, optics, request = plan.camera.stand, plan.request.optics, plan.request
    figure.text(
        left,
        1.0 - 0.28 / height,
        f"Camera {stand.height_m:.2f} m up, {stand.pitch_deg:g}\N{DEGREE SIGN} down; track "
        f"{request.track.width_m:g} \N{MULTIPLICATION SIGN} {request.track.depth_m:g} m, "
        f"{100.0 * plan.coverage.share:.1f} % in the picture",
        fontsize=13,
        color=_INK,
        va="center",
    )
    sigmas = sorted({f"{1e3 * point.crossing_sigma_s:.1f}" for point in (plan.near, plan.worst)}, key=float)
    figure.text(
        left,
        1.0 - 0.56 / height,
        f"{optics.width_px} \N{MULTIPLICATION SIGN} {optics.height_px} px, {optics.hfov_deg:g}\N{DEGREE SIGN} "
        f"\N{MULTIPLICATION SIGN} {optics.vfov_deg:.0f}\N{DEGREE SIGN}, {request.rate.fps:g} fps; at "
        f"{request.car.speed_mps:g} m/s: blur {1e3 * plan.blur_m:.1f} mm, sigma of a crossing {' to '.join(sigmas)} ms",
        fontsize=10,
        color=_FAINT,
        va="center",
    )


def _draw_key(figure: Figure, plan: MountPlan, left: float, bottom: float) -> None:
    """What the colours and lines of the top view mean, in the gap above it."""
    parts = ["blue: the floor in the picture", f"dashed: the margin of {plan.request.limits.margin_m:g} m"]
    if plan.coverage.share < 1.0 - 1e-9:
        parts.append("hatched: track outside the picture")
    figure.text(left, bottom, "; ".join(parts), fontsize=9, color=_FAINT, va="bottom")


def _draw_side(axes: Axes, plan: MountPlan, sheet: _Sheet) -> None:
    """Camera, its angle of view and the floor, seen from the camera's right."""
    stand, optics = plan.camera.stand, plan.request.optics
    axes.set_ylim(-sheet.m(_BELOW), stand.height_m + sheet.m(_ABOVE))
    axes.set_ylabel("height (m)", color=_INK, fontsize=10)
    step = _tick_m(sheet)
    axes.yaxis.set_major_locator(FixedLocator([k * step for k in range(int(stand.height_m / step) + 1)]))
    here = (0.0, stand.height_m)
    rays = [math.radians(stand.pitch_deg + side * 0.5 * optics.vfov_deg) for side in (1, 0, -1)]
    lower, axis, upper = (_ray_end(stand.height_m, ray, sheet) for ray in rays)
    axes.add_patch(Polygon([here, lower, *_floor_corner(lower, upper, sheet), upper], facecolor=_VIEW, zorder=0))
    for end in (lower, upper):
        axes.plot(*zip(here, end, strict=True), color=_VIEW_EDGE, linewidth=1.2, zorder=2)
    axes.plot(*zip(here, axis, strict=True), color=_VIEW_EDGE, linewidth=1.2, linestyle=(0, (7, 3, 1, 3)), zorder=2)
    axes.axhline(0.0, color=_INK, linewidth=1.0, zorder=3)
    ahead = plan.camera.ahead_m(plan.request.track.corners_m())[:, 1]
    near, far = float(ahead.min()), float(ahead.max())
    axes.plot((near, far), (0, 0), color=_INK, linewidth=5.0, solid_capstyle="butt", zorder=4)
    axes.plot(*here, marker="s", markersize=9, color=_INK, zorder=5)
    _pitch_arc(axes, stand.pitch_deg, optics.vfov_deg, stand.height_m, sheet)
    beside = min(0.0, near, max(lower[0], sheet.low_a + sheet.m(_PAD))) - sheet.m(0.18)
    _dimension(axes, (beside, 0.0), (beside, stand.height_m), f"{stand.height_m:.2f} m")
    axes.plot((beside, 0.0), (stand.height_m,) * 2, color=_FAINT, linewidth=0.7, linestyle=(0, (2, 3)), zorder=1)
    _dimension(axes, (near, -sheet.m(0.2)), (far, -sheet.m(0.2)), f"track {far - near:.2f} m")
    if abs(near) * sheet.scale > 0.05:
        words = "to the track" if near > 0 else "over the track"
        _dimension(axes, (0.0, -sheet.m(0.55)), (near, -sheet.m(0.55)), f"{abs(near):.2f} m {words}", beside=True)
    for low, high in ((0.0, stand.height_m), (-sheet.m(0.65), -sheet.m(0.48))):
        axes.plot((0, 0), (low, high), color=_FAINT, linewidth=0.7, linestyle=(0, (2, 3)), zorder=1)


def _ray_end(height_m: float, down_rad: float, sheet: _Sheet) -> tuple[float, float]:
    """Where a ray, so far below the horizon, meets the floor or leaves the sheet's far end."""
    ahead, up = math.cos(down_rad), -math.sin(down_rad)
    reach = height_m / -up if up < 0 else math.inf
    if ahead > 0:
        reach = min(reach, sheet.high_a / ahead)
    elif ahead < 0:
        reach = min(reach, sheet.low_a / ahead)
    return ahead * reach, height_m + up * reach


def _floor_corner(lower: tuple[float, float], upper: tuple[float, float], sheet: _Sheet) -> list[tuple[float, float]]:
    """The floor's ends of the sheet where a ray leaves it before it meets the floor."""
    return [(end, 0.0) for end, ray in ((sheet.low_a, lower), (sheet.high_a, upper)) if ray[1] > 1e-9]


def _pitch_arc(axes: Axes, pitch_deg: float, vfov_deg: float, height_m: float, sheet: _Sheet) -> None:
    """The angle between the horizon and the line of sight, with its figure above it."""
    radius = min(sheet.m(0.75), 0.75 * height_m)
    axes.plot((0, 1.25 * radius), (height_m, height_m), color=_FAINT, linewidth=0.7, linestyle=(0, (2, 3)), zorder=3)
    arc = Arc((0.0, height_m), 2 * radius, 2 * radius, theta1=-pitch_deg, theta2=0.0, color=_INK, linewidth=1.0)
    axes.add_patch(arc)
    axes.annotate(
        f"{pitch_deg:g}\N{DEGREE SIGN} down, the picture\n{vfov_deg:.0f}\N{DEGREE SIGN} from top to bottom",
        (0.0, height_m),
        (12, 4),
        textcoords="offset points",
        ha="left",
        va="bottom",
        fontsize=9,
        color=_INK,
        path_effects=_HALO,
        zorder=6,
    )


def _dimension(
    axes: Axes, start: tuple[float, float], end: tuple[float, float], text: str, *, beside: bool = False
) -> None:
    """A double arrow with its figure at its middle, or after its right end."""
    style: dict[str, Any] = {"arrowstyle": "<|-|>", "color": _INK, "linewidth": 0.9, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", xy=end, xytext=start, arrowprops=style | {"mutation_scale": 9}, zorder=5)
    upright = start[0] == end[0]
    middle = (0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1]))
    axes.annotate(
        text,
        (max(start[0], end[0]), start[1]) if beside else middle,
        (6, 0) if beside else (-5, 0) if upright else (0, -2),
        textcoords="offset points",
        ha="left" if beside else "right" if upright else "center",
        va="center" if beside or upright else "top",
        fontsize=10,
        color=_INK,
        path_effects=_HALO,
        zorder=6,
    )


def _draw_top(axes: Axes, plan: MountPlan, sheet: _Sheet) -> AxesImage:
    """Camera's foot, the floor in the picture, and the track shaded by mm a px, seen from above."""
    camera, track = plan.camera, plan.request.track
    axes.set_ylim(sheet.low_l, sheet.high_l)
    axes.set_xlabel("ahead of the camera (m)", color=_INK, fontsize=10)
    axes.set_ylabel("to its left (m)", color=_INK, fontsize=10)
    box = [(-sheet.high_l, sheet.low_a), (-sheet.low_l, sheet.low_a), (-sheet.low_l, sheet.high_a)]
    box.append((-sheet.high_l, sheet.high_a))
    floor = camera.seen_part(camera.to_plan_m(np.array(box)))
    if len(floor):
        axes.add_patch(Polygon(_drawn(plan, floor), facecolor=_VIEW, edgecolor=_VIEW_EDGE, linewidth=1.2, zorder=0))
    outline = _drawn(plan, track.corners_m())
    if plan.coverage.share < 1.0 - 1e-9:
        axes.add_patch(Polygon(outline, facecolor=_PAPER, edgecolor=_LOST, hatch="////", linewidth=0.0, zorder=1))
    shading = _shading(axes, plan)
    axes.add_patch(Polygon(outline, facecolor="none", edgecolor=_INK, linewidth=1.6, zorder=3))
    margin_m = plan.request.limits.margin_m
    if margin_m * sheet.scale > 0.03:
        margin = _drawn(plan, track.corners_m(margin_m))
        axes.add_patch(
            Polygon(margin, facecolor="none", edgecolor=_FAINT, linewidth=0.9, linestyle=(0, (4, 3)), zorder=3)
        )
    axes.plot(0, 0, marker="s", markersize=9, color=_INK, zorder=5)
    axes.annotate(
        f"camera,\n{plan.request.optics.hfov_deg:g}\N{DEGREE SIGN} wide", (0, 0), (-9, 0), textcoords="offset points",
        ha="right", va="center", fontsize=9, color=_INK, bbox=_LABEL, zorder=6,
    )  # fmt: skip
    for point, side in ((plan.near, "left"), (plan.far, "right")):
        _label_resolution(axes, plan, sheet, point, side)
    return shading


def _drawn(plan: MountPlan, plan_m: Points) -> Points:
    """Plan m (n, 2) as the top view draws them: (ahead, to the left)."""
    ahead = plan.camera.ahead_m(plan_m)
    return np.column_stack((ahead[:, 1], -ahead[:, 0]))


def _shading(axes: Axes, plan: MountPlan) -> AxesImage:
    """The part of the track that is seen, shaded; it keeps to its outline."""
    seen = np.array(plan.coverage.seen_m)
    outline = _drawn(plan, seen)
    (low_a, low_l), (high_a, high_l) = outline.min(axis=0), outline.max(axis=0)
    ahead, left = np.meshgrid(np.linspace(low_a, high_a, _GRID), np.linspace(low_l, high_l, _GRID))
    points = plan.camera.to_plan_m(np.column_stack((-left.ravel(), ahead.ravel())))
    # Beyond the outline there may be no floor ahead of the camera: nothing of it is drawn.
    safe = np.where((plan.camera.depth_m(points) > 1e-3)[:, None], points, seen.mean(axis=0))
    worst = 1000.0 * np.linalg.svd(plan.camera.floor_per_px_m(safe), compute_uv=False)[:, 0]
    low = min(plan.near.resolution.worst_mm, plan.far.resolution.worst_mm)
    high = max(plan.worst.resolution.worst_mm, 1.1 * low)
    image = axes.imshow(
        worst.reshape(ahead.shape), origin="lower", extent=(low_a, high_a, low_l, high_l), cmap=_SHADES,
        vmin=low, vmax=high, aspect="auto", interpolation="none", zorder=2,
    )  # fmt: skip
    axes.set_autoscale_on(False)
    patch = Polygon(outline, facecolor="none", edgecolor="none", transform=axes.transData)
    axes.add_patch(patch)
    image.set_clip_path(patch)
    return image


def _label_resolution(axes: Axes, plan: MountPlan, sheet: _Sheet, point: PointPlan, side: str) -> None:
    """What a px covers at the near or the far end of the line of sight, inside the track or, if it is thin, beside it."""
    lefts = _drawn(plan, plan.request.track.corners_m())[:, 1]
    room_pt = 72.0 * sheet.scale * float(min(lefts.max(), -lefts.min()))
    off_pt = 34.0 if not 0.0 < room_pt < 68.0 else room_pt + 12.0
    ((ahead, left),) = _drawn(plan, np.array([point.resolution.at_m]))
    axes.plot(ahead, left, marker="o", markersize=5, color=_INK, zorder=5)
    resolution = point.resolution
    axes.annotate(
        f"1 px = {resolution.across_mm:.2f} mm across,\n{resolution.along_mm:.2f} mm along",
        (ahead, left),
        (10, off_pt) if side == "left" else (-10, -off_pt),
        textcoords="offset points",
        ha=side,
        va="bottom" if side == "left" else "top",
        fontsize=9,
        color=_INK,
        bbox=_LABEL,
        arrowprops={
            "arrowstyle": "-",
            "color": _INK,
            "linewidth": 0.7,
            "relpos": (0.0, 0.0) if side == "left" else (1.0, 1.0),
        },
        zorder=6,
    )
