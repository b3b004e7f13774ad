"""From a twin's picture to a track: lane, route, scale and lines put together.

Knows the settings that a user gives for a twin, all in twin px. Knows no file: the picture comes loaded, and the settings
as plain values. `source` names the picture in errors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dnb_edge.errors import InputError
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.layout import NamedLine, foot_m, laid_out, straightest_m
from dnb_edge.track.line import DirectedLine, line_across
from dnb_edge.track.model import FINISH_LINE, START_LINE, Track
from dnb_edge.track.route import Route, find_route
from dnb_edge.track.scale import TwinScale
from dnb_edge.track.twin import Lane, default_close_gap_px, lane_mask
from dnb_edge.values import BgrImage, PointPx

LinePx = tuple[PointPx, PointPx]
"""A directed line from its first point to its second, twin px."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackSettings:
    """What a user says about a twin."""

    name: str
    lane_colour: Lane
    metres_per_px: float | None = None
    """Metres on the floor for one twin px; needed for a track, not for a route."""
    closed: bool = True
    """False for a route from the first waypoint to the last."""
    start_line_px: LinePx | None = None
    """Crossed forward by cars that drive to its left; None for one across the lane at `start_at_px`."""
    start_at_px: PointPx | None = None
    """A place near the route for the start line; None for the straightest place, or a little behind an open route's first
    end. A closed route without `start_line_px` is driven anticlockwise, or in the order of three waypoints or more."""
    finish_line_px: LinePx | None = None
    """Where a lap ends, in either direction."""
    finish_at_px: PointPx | None = None
    """A place near the route for the finish line instead. With neither, a closed route's is the start line, and an open
    route's a little before its last end."""
    sector_lines_px: tuple[LinePx, ...] = ()
    """In any order and direction: the track takes them in the order of a lap, forward along it."""
    sectors_at_px: tuple[PointPx, ...] = ()
    """Places near the route for more sector lines."""
    waypoints_px: tuple[PointPx, ...] = ()
    """Points on the lanes that the route takes, away from junctions, in the order in which it passes them; none for the only
    loop, or the outer one of several."""
    close_gap_px: float | None = None
    """The widest seam in the lane that is drawing and not road; None for 0.4 % of the picture's longest side."""


def build_route(image: BgrImage, settings: TrackSettings, *, source: str) -> Route:
    """The route through the picture, twin px. Raises `InputError` as `lane_mask` and `find_route` do."""
    gap_px = default_close_gap_px(image) if settings.close_gap_px is None else settings.close_gap_px
    mask = lane_mask(image, settings.lane_colour, source=source, close_gap_px=gap_px)
    return find_route(mask, waypoints_px=settings.waypoints_px, closed=settings.closed, source=source)


def build_track(image: BgrImage, settings: TrackSettings, *, source: str) -> Track:
    """The track in the picture. Raises `InputError` as `build_route` and `track_from_route` do, or without a scale."""
    if settings.metres_per_px is None:
        raise InputError(f"{source}: the twin's scale is not known: measure one length on the floor")
    scale = TwinScale(metres_per_px=settings.metres_per_px, height_px=float(image.shape[0]))
    return track_from_route(build_route(image, settings, source=source), scale, settings, source=source)


def track_from_route(route: Route, scale: TwinScale, settings: TrackSettings, *, source: str) -> Track:
    """The track along `route`, driven so that the start line is crossed forward, with s_m = 0 on it where it is closed.

    Raises `InputError` where a line does not cross the route exactly once, lies in the wrong order, or is given twice.
    """
    centreline = Centreline(
        points_m=scale.to_track_m(route.points_px),
        half_left_m=route.half_left_px * scale.metres_per_px,
        half_right_m=route.half_right_px * scale.metres_per_px,
        closed=route.closed,
    )
    undirected = route.closed and settings.start_line_px is None and len(settings.waypoints_px) < 3
    if undirected and _area_m2(centreline) < 0:
        centreline = centreline.reversed()
    return laid_out(
        centreline,
        name=settings.name,
        scale=scale,
        start=_start_line(centreline, settings, scale, source),
        finish=_finish_line(centreline, settings, scale, source),
        sectors=_sector_lines(centreline, settings, scale, source),
        source=source,
    )


def _line(name: str, line_px: LinePx, scale: TwinScale) -> DirectedLine:
    (x0, y0), (x1, y1) = scale.to_track_m(np.asarray(line_px, dtype=np.float64)).tolist()
    return DirectedLine(name=name, start_m=(x0, y0), end_m=(x1, y1))


def _line_at(name: str, at_px: PointPx, centreline: Centreline, scale: TwinScale, source: str) -> DirectedLine:
    return line_across(centreline, foot_m(centreline, at_px, name, scale, source), name=name)


def _one_of(name: str, line_px: LinePx | None, at_px: PointPx | None, source: str) -> None:
    if line_px is not None and at_px is not None:
        raise InputError(f"{source}: the {name} line is given by its ends and by a place: give one of the two")


def _start_line(centreline: Centreline, settings: TrackSettings, scale: TwinScale, source: str) -> DirectedLine:
    _one_of(START_LINE, settings.start_line_px, settings.start_at_px, source)
    if settings.start_line_px is not None:
        return _line(START_LINE, settings.start_line_px, scale)
    if settings.start_at_px is not None:
        return _line_at(START_LINE, settings.start_at_px, centreline, scale, source)
    s_m = straightest_m(centreline) if centreline.closed else _run_up_m(centreline)
    return line_across(centreline, s_m, name=START_LINE)


def _finish_line(centreline: Centreline, settings: TrackSettings, scale: TwinScale, source: str) -> DirectedLine | None:
    _one_of(FINISH_LINE, settings.finish_line_px, settings.finish_at_px, source)
    if settings.finish_line_px is not None:
        return _line(FINISH_LINE, settings.finish_line_px, scale)
    if settings.finish_at_px is not None:
        return _line_at(FINISH_LINE, settings.finish_at_px, centreline, scale, source)
    if centreline.closed:
        return None
    return line_across(centreline, centreline.length_m - _run_up_m(centreline), name=FINISH_LINE)


def _sector_lines(
    centreline: Centreline, settings: TrackSettings, scale: TwinScale, source: str
) -> tuple[NamedLine, ...]:
    """The sector lines as given; they get their names by their order."""
    drawn = [_line(f"sector {k}", line_px, scale) for k, line_px in enumerate(settings.sector_lines_px, start=1)]
    placed = [
        _line_at(f"sector {k}", at_px, centreline, scale, source)
        for k, at_px in enumerate(settings.sectors_at_px, start=len(drawn) + 1)
    ]
    return tuple(NamedLine(line=line, name=None) for line in (*drawn, *placed))


def _run_up_m(centreline: Centreline) -> float:
    """How far an open route goes on beyond its start and finish lines where nobody says: one lane's width."""
    width_m = 2 * float(np.median(centreline.half_left_m))
    return min(width_m, centreline.length_m / 10)


def _area_m2(centreline: Centreline) -> float:
    """Signed area that the route encloses, positive where it is driven anticlockwise."""
    x, y = centreline.points_m.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) / 2
