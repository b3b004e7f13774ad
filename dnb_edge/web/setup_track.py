"""What the draft's twin, lane, waypoints, scale and lines come to: a route, a track, and what is wrong with either.

Knows the draft and `track`'s rooms. Knows no request and no page. The route through a picture is kept for the next question,
since finding it takes a second or more; pictures lie under names with their content's hash, so that a name stands for one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from dnb_edge.errors import InputError
from dnb_edge.track.build import TrackSettings, build_route, track_from_route
from dnb_edge.track.layout import foot_m
from dnb_edge.track.line import line_across
from dnb_edge.track.loop import Loop, SeveralLoops
from dnb_edge.track.model import Track
from dnb_edge.track.route import Route
from dnb_edge.track.scale import TwinScale
from dnb_edge.track.twin import Lane, LaneColour, colour_at, load_twin
from dnb_edge.values import BgrImage, PointPx
from dnb_edge.view.homography import fit_ground_map
from dnb_edge.view.keypoints import KeypointPairs
from dnb_edge.view.rectify import finest_metres_per_px, rectified, visible_extent_m
from dnb_edge.web.setup_draft import Draft, EndsPx, LaneChoice, RouteChoice
from dnb_edge.web.setup_upload import Upload

TWIN = "the twin"
"""How errors name the picture."""
_MOST_FLAT_PX = 2400
"""Longest side of a twin that is made of a photograph."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RouteFound:
    """The route through the twin, or why there is none."""

    route: Route | None = None
    fault: str | None = None
    loops: tuple[Loop, ...] = ()
    """Among which the user has to choose."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrackFound:
    """As much of the track as the draft makes, and what is wrong with each part of it."""

    found: RouteFound
    scale: TwinScale | None = None
    """None where nothing was measured: then `track` is laid out at 1 m a px, for its picture only."""
    track: Track | None = None
    """With those of the lines that lie well."""
    line_fault: str | None = None
    sector_fault: str | None = None


def track_of(draft: Draft, twin: Path | None) -> TrackFound:
    """The track that the draft makes of the twin at `twin`."""
    if draft.twin is None or twin is None or draft.lane is None:
        return TrackFound(found=RouteFound(), scale=scale_of(draft, None))
    found = _route(twin, draft.lane, draft.route)
    if found.route is None:
        return TrackFound(found=found, scale=scale_of(draft, None))
    scale = scale_of(draft, found.route)
    settings = settings_of(draft, scale)
    laid_out_in = scale or TwinScale(metres_per_px=1.0, height_px=float(draft.twin.height_px))
    bare = replace(settings, start_line_px=None, finish_line_px=None, sector_lines_px=())
    lined = replace(settings, sector_lines_px=())
    # All of it where it fits together; else as much as does, and what is wrong with the rest.
    faults: list[str] = []
    for part in (settings, lined, bare):
        try:
            track = track_from_route(found.route, laid_out_in, part, source=TWIN)
        except InputError as error:
            faults.append(str(error))
            continue
        line_fault = faults[1] if len(faults) == 2 else None
        sector_fault = faults[0] if len(faults) == 1 else None
        return TrackFound(found=found, scale=scale, track=track, line_fault=line_fault, sector_fault=sector_fault)
    return TrackFound(found=replace(found, fault=faults[-1]), scale=scale)


def settings_of(draft: Draft, scale: TwinScale | None) -> TrackSettings:
    """The draft as `track.build` wants it. The draft has a lane."""
    assert draft.lane is not None, "asked for with a lane only"
    return TrackSettings(
        name=draft.name,
        lane_colour=lane_of(draft.lane),
        metres_per_px=None if scale is None else scale.metres_per_px,
        closed=draft.route.closed,
        start_line_px=draft.lines.start_px,
        finish_line_px=draft.lines.finish_px,
        sector_lines_px=draft.lines.sectors_px,
        waypoints_px=draft.route.waypoints_px,
        close_gap_px=draft.route.close_gap_px,
    )


def lane_of(choice: LaneChoice) -> Lane:
    """The lane's colour or shade."""
    if choice.hsv is not None:
        hue, saturation, value = choice.hsv
        return LaneColour(hue_deg=hue, saturation_percent=saturation, value_percent=value)
    assert choice.shade is not None, "a choice has one of the two"
    return choice.shade


def lane_at(twin: Path, at_px: PointPx) -> LaneChoice:
    """The lane by the twin's colour at a place, rounded as people write it. Raises `InputError` outside of the picture."""
    colour = colour_at(load_twin(twin), at_px, source=TWIN)
    hsv = round(colour.hue_deg, 1), round(colour.saturation_percent, 1), round(colour.value_percent, 1)
    return LaneChoice(at_px=at_px, hsv=hsv)


def scale_of(draft: Draft, route: Route | None) -> TwinScale | None:
    """The twin's scale; None where it is not known yet."""
    if draft.scale is None or draft.twin is None:
        return None
    height_px = float(draft.twin.height_px)
    if draft.scale.measured is not None:
        return TwinScale.from_measured_length(**draft.scale.measured.model_dump(), height_px=height_px)
    if draft.scale.metres_per_px is not None:
        return TwinScale(metres_per_px=draft.scale.metres_per_px, height_px=height_px)
    lap_m = draft.scale.lap_m
    return (
        None
        if lap_m is None or route is None
        else TwinScale(metres_per_px=lap_m / route.length_px, height_px=height_px)
    )


def snapped(found: TrackFound, at_px: PointPx, *, name: str, flipped: bool) -> EndsPx:
    """The line across the lane at the route's place nearest to `at_px`, twin px, to one hundredth.

    Crossed forward in the track's present direction, or against it where `flipped`. Raises `InputError` where there is no
    route, or `at_px` is too far from it.
    """
    if found.track is None:
        raise InputError(f"{TWIN}: there is no route yet to draw a line across: finish the route first")
    track = found.track
    s_m = foot_m(track.centreline, at_px, name, track.scale, TWIN)
    line = line_across(track.centreline, s_m, name=name)
    start, end = np.round(track.scale.to_twin_px(np.array([line.start_m, line.end_m])), 2).tolist()
    ends = (start[0], start[1]), (end[0], end[1])
    return (ends[1], ends[0]) if flipped else ends


def default_start(found: TrackFound) -> EndsPx | None:
    """Where the start line lies well if nobody says; None without a route."""
    if found.track is None:
        return None
    line = found.track.start_line
    start, end = np.round(found.track.scale.to_twin_px(np.array([line.start_m, line.end_m])), 2).tolist()
    return (start[0], start[1]), (end[0], end[1])


def flattened(
    photo: BgrImage, corners_px: tuple[PointPx, PointPx, PointPx, PointPx], width_m: float, height_m: float
) -> tuple[Upload, float, tuple[PointPx, ...]]:
    """A twin made of a photograph: (the picture, its metres per px, where the corners lie in it).

    `corners_px`, camera px: those of a rectangle on the floor of `width_m` x `height_m`, from its top left clockwise. Raises
    `InputError` where they make none, or the floor would fill no picture.
    """
    rows, columns = photo.shape[:2]
    unit = TwinScale(metres_per_px=1.0, height_px=height_m)
    pairs = KeypointPairs(
        camera_px=corners_px,
        twin_px=((0.0, 0.0), (width_m, 0.0), (width_m, height_m), (0.0, height_m)),
        names=("top left", "top right", "bottom right", "bottom left"),
        source="the rectangle's corners",
    )
    ground = fit_ground_map(pairs, unit, width_px=columns, height_px=rows)
    if np.linalg.det(np.array(ground.camera_to_twin).reshape(3, 3)) <= 0:
        raise InputError(
            "the rectangle's corners go round the other way: tap top left, top right, bottom right, bottom left"
        )
    extent_m = visible_extent_m(ground)
    x0, y0, x1, y1 = extent_m
    longest_m = max(x1 - x0, y1 - y0)
    metres_per_px = max(finest_metres_per_px(ground), longest_m / _MOST_FLAT_PX)
    picture = rectified(photo, ground, metres_per_px=metres_per_px, extent_m=extent_m)
    ok, data = cv2.imencode(".png", picture)
    assert ok, "OpenCV encodes any 8-bit picture as PNG"
    corners_m = unit.to_track_m(np.array(pairs.twin_px))
    height_px = picture.shape[0]
    on_twin = tuple(
        (round((x - x0) / metres_per_px, 3), round(height_px - (y - y0) / metres_per_px, 3))
        for x, y in corners_m.tolist()
    )
    upload = Upload(data=data.tobytes(), suffix=".png", width_px=picture.shape[1], height_px=height_px)
    return upload, metres_per_px, on_twin


@lru_cache(maxsize=4)
def _route(twin: Path, lane: LaneChoice, route: RouteChoice) -> RouteFound:
    settings = TrackSettings(
        name="track",
        lane_colour=lane_of(lane),
        closed=route.closed,
        waypoints_px=route.waypoints_px,
        close_gap_px=route.close_gap_px,
    )
    try:
        if not route.closed and len(route.waypoints_px) < 2:
            raise InputError("a route from point to point needs waypoints: tap its first and its last place")
        return RouteFound(route=build_route(load_twin(twin), settings, source=TWIN))
    except SeveralLoops as error:
        letters = ", ".join(loop.letter for loop in error.loops)
        text = f"the lanes form {len(error.loops)} loops ({letters}): tap the one that is driven"
        return RouteFound(fault=text, loops=error.loops)
    except InputError as error:
        return RouteFound(fault=_for_pages(str(error)))


def _for_pages(text: str) -> str:
    """An error's line without the command line's options."""
    for option, instead in _OPTIONS.items():
        text = text.replace(option, instead)
    return text


_OPTIONS = {
    " (close_gap_px, --close-gap-px)": " below",
    " (closed: false, --open)": " (no closed loop)",
    " (--waypoint u,v, waypoints_px)": "",
    "; --overlay draws the loops": "",
}
"""What the command line calls things, and the page."""
