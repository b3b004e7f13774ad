"""From a twin's picture to a track: lane, route, scale and lines put together.

Knows the settings that a user gives for a twin, all in twin px. Knows no file: the picture comes loaded, and the settings
as plain values. `source` names the picture in errors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dnb_edge.errors import InputError
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.line import DirectedLine, line_across
from dnb_edge.track.model import START_LINE, Track, crossings_of
from dnb_edge.track.route import Route, find_route
from dnb_edge.track.scale import TwinScale
from dnb_edge.track.twin import LaneColour, default_close_gap_px, lane_mask
from dnb_edge.values import BgrImage, PointPx

LinePx = tuple[PointPx, PointPx]
"""A directed line from its first point to its second, twin px."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackSettings:
    """What a user says about a twin."""

    name: str
    lane_colour: LaneColour
    metres_per_px: float | None = None
    """Metres on the floor for one twin px; needed for a track, not for a route."""
    start_line_px: LinePx | None = None
    """Crossed forward by cars that drive to its left; None for one across the route's straightest place, driven
    anticlockwise."""
    sector_lines_px: tuple[LinePx, ...] = ()
    """In any order and direction: the track takes them in the order of a lap, forward along it."""
    waypoints_px: tuple[PointPx, ...] = ()
    """Points on the lanes that the route takes, away from junctions; none for the outer loop."""
    close_gap_px: float | None = None
    """The widest seam in the lane that is drawing and not road; None for 0.4 % of the picture's longest side."""


def build_route(image: BgrImage, settings: TrackSettings, *, source: str) -> Route:
    """The route through the picture, twin px. Raises `InputError` as `lane_mask` and `find_route` do."""
    gap_px = default_close_gap_px(image) if settings.close_gap_px is None else settings.close_gap_px
    mask = lane_mask(image, settings.lane_colour, source=source, close_gap_px=gap_px)
    return find_route(mask, waypoints_px=settings.waypoints_px, source=source)


def build_track(image: BgrImage, settings: TrackSettings, *, source: str) -> Track:
    """The track in the picture. Raises `InputError` as `build_route` and `track_from_route` do, or without a scale."""
    if settings.metres_per_px is None:
        raise InputError(f"{source}: the twin's scale is not known: measure one length on the floor")
    scale = TwinScale(metres_per_px=settings.metres_per_px, height_px=float(image.shape[0]))
    return track_from_route(build_route(image, settings, source=source), scale, settings, source=source)


def track_from_route(route: Route, scale: TwinScale, settings: TrackSettings, *, source: str) -> Track:
    """The track along `route`, driven so that the start line is crossed forward, with s_m = 0 on it.

    Raises `InputError` where the start line or a sector line does not cross the route exactly once.
    """
    centreline = Centreline(
        points_m=scale.to_track_m(route.points_px),
        half_left_m=route.half_left_px * scale.metres_per_px,
        half_right_m=route.half_right_px * scale.metres_per_px,
    )
    if settings.start_line_px is None:
        if _area_m2(centreline) < 0:
            centreline = centreline.reversed()
        start = line_across(centreline, _straightest_m(centreline), name=START_LINE)
    else:
        start = _line(START_LINE, settings.start_line_px, scale)
    s_m, forward = _only_crossing(centreline, start, scale, source)
    if not forward:
        centreline = centreline.reversed()
        s_m, _ = _only_crossing(centreline, start, scale, source)
    centreline = _started_at(centreline, s_m)
    return Track(
        name=settings.name,
        scale=scale,
        centreline=centreline,
        start_line=start,
        sector_lines=_sector_lines(centreline, settings.sector_lines_px, scale, source),
    )


def _line(name: str, line_px: LinePx, scale: TwinScale) -> DirectedLine:
    (x0, y0), (x1, y1) = scale.to_track_m(np.asarray(line_px, dtype=np.float64)).tolist()
    return DirectedLine(name=name, start_m=(x0, y0), end_m=(x1, y1))


def _only_crossing(centreline: Centreline, line: DirectedLine, scale: TwinScale, source: str) -> tuple[float, bool]:
    crossings = crossings_of(centreline, line)
    if len(crossings) == 1:
        return crossings[0]
    ends = scale.to_twin_px(np.array([line.start_m, line.end_m]))
    line_text = " to ".join(f"({u:.0f}, {v:.0f})" for u, v in ends)
    places = scale.to_twin_px(centreline.points_at(np.array([s for s, _ in crossings])))
    where = ", at " + " and ".join(f"({u:.0f}, {v:.0f})" for u, v in places) if len(places) else ""
    raise InputError(
        f"{source}: the line {line.name!r} from {line_text} twin px crosses the route {len(crossings)} times{where}: "
        "draw it across the route's lane once"
    )


def _sector_lines(
    centreline: Centreline, lines_px: tuple[LinePx, ...], scale: TwinScale, source: str
) -> tuple[DirectedLine, ...]:
    """The sector lines in the order of a lap, named by it, each turned so that the route crosses it forward."""
    placed: list[tuple[float, LinePx]] = []
    for k, (start, end) in enumerate(lines_px, start=1):
        s_m, forward = _only_crossing(centreline, _line(f"sector {k}", (start, end), scale), scale, source)
        placed.append((s_m, (start, end) if forward else (end, start)))
    return tuple(_line(f"sector {k}", line_px, scale) for k, (_, line_px) in enumerate(sorted(placed), start=1))


def _area_m2(centreline: Centreline) -> float:
    """Signed area that the route encloses, positive where it is driven anticlockwise."""
    x, y = centreline.points_m.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) / 2


def _straightest_m(centreline: Centreline) -> float:
    """The s_m about which the route turns least, over about four lane widths."""
    n = len(centreline.points_m)
    steps = np.roll(centreline.points_m, -1, axis=0) - centreline.points_m
    heading = np.arctan2(steps[:, 1], steps[:, 0])
    turn = abs((np.diff(heading, append=heading[:1]) + np.pi) % (2 * np.pi) - np.pi)
    width = 2 * float(np.median(centreline.half_left_m))
    reach = int(np.clip(2 * width / centreline.length_m * n, 1, n // 8))
    turned = sum(np.roll(turn, k) for k in range(-reach, reach + 1))
    return float(centreline.s_m[int(np.argmin(turned))])


def _started_at(centreline: Centreline, s_m: float) -> Centreline:
    """The same route, evenly resampled from `s_m` on, with the half-widths that hold there."""
    n = len(centreline.points_m)
    at = s_m + np.arange(n, dtype=np.float64) * (centreline.length_m / n)
    widths = np.array([centreline.half_widths_at(s) for s in at.tolist()])
    return Centreline(
        points_m=centreline.points_at(np.asarray(at, dtype=np.float64)),
        half_left_m=widths[:, 0],
        half_right_m=widths[:, 1],
    )
