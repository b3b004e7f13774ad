"""Where `track build` takes a track from, besides a drawing: photographs of the empty track, and recorded laps.

Knows the calibration that ties pictures to metres, and recordings. All that comes out is in the calibration's own twin px, so
that the calibration fits the new track at once.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

import numpy as np

from dnb_edge.archive.replayed import replay
from dnb_edge.assembly import make_source
from dnb_edge.capture.decode import decode_bgr
from dnb_edge.cli.photograph import read_photograph
from dnb_edge.cli.track_lane import LaneOptions
from dnb_edge.config.calibration_file import load_calibration
from dnb_edge.config.track_file import MadeOf
from dnb_edge.core import CoreSetup
from dnb_edge.errors import InputError
from dnb_edge.record.reader import iter_frames
from dnb_edge.track.build import LinePx, TrackSettings
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.driven import DrivenPath, DrivenRoute, driven_route, gate_of, laps_between, thinned
from dnb_edge.track.layout import foot_m
from dnb_edge.track.line import DirectedLine, line_across
from dnb_edge.track.loop import Loop, SeveralLoops
from dnb_edge.track.model import START_LINE
from dnb_edge.track.route import Route
from dnb_edge.track.scale import TwinScale
from dnb_edge.track.twin import LaneColour
from dnb_edge.values import BgrImage, Frame, Observation, PointPx, Points, path_points
from dnb_edge.view.ground import GroundMap
from dnb_edge.view.photograph import SEAM_M, colour_in_photo, floor_in, median_picture, route_in, twin_of
from dnb_edge.view.rectify import Extent

MOST_PICTURES = 25
"""So many pictures of a clip or a drive are enough for the median to forget what moves."""
_PICTURE_EVERY_S = 0.5
_LIVE_S = 12.0
_JITTER_M = 0.01
"""Steps shorter than this are the detector's noise."""


ShowLoops: TypeAlias = Callable[[BgrImage, tuple[Loop, ...]], None]
"""Is given a twin and the loops in it, where the user has to choose one."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Made:
    """A route and all that goes with it into a track file."""

    route: Route
    scale: TwinScale | None
    """None for a drawing of which nobody measured anything."""
    picture: BgrImage | None
    """The twin: the floor from straight above; None where there is no picture of it."""
    settings: TrackSettings
    made_of: MadeOf
    notes: tuple[str, ...] = ()
    """What a user should know of how it came about, sentences."""
    laps: int | None = None
    """Of how many laps it is the median; None where it is no driven route."""
    spread_m: float | None = None


def from_photos(
    photos: Sequence[tuple[str, BgrImage]],
    calibration: Path,
    lane: LaneOptions,
    settings: TrackSettings,
    *,
    area_m: Extent | None,
    made_of: MadeOf,
    show_loops: ShowLoops,
) -> Made:
    """The track in photographs (name, picture) of one size, taken from where the calibration was made.

    Raises `InputError` where they do not fit it, or no lane is found.
    """
    source = photos[0][0]
    height, width = photos[0][1].shape[:2]
    for name, photo in photos[1:]:
        if photo.shape[:2] != (height, width):
            raise InputError(f"{name}: {photo.shape[1]}x{photo.shape[0]} px, {source} has {width}x{height}: take all "
                             "photographs with one camera in one place")  # fmt: skip
    ground = ground_for(calibration, width, height, source)
    picture = median_picture([photo for _, photo in photos])
    floor = floor_in(picture, ground, area_m=area_m)
    if not floor.seen.any():
        raise InputError(f"{source}: the area is floor that the camera does not see: choose another (--area), track m")

    def colour_at(at_px: PointPx) -> LaneColour:
        return colour_in_photo(floor, ground, at_px, source=source)

    seam_m = SEAM_M if settings.close_gap_px is None else settings.close_gap_px * ground.scale.metres_per_px
    try:
        route = route_in(
            floor,
            ground,
            lane.lane(colour_at),
            waypoints_px=settings.waypoints_px,
            closed=settings.closed,
            seam_m=seam_m,
            source=source,
        )
    except SeveralLoops as error:
        right_px = max(float(loop.points_px[:, 0].max()) for loop in error.loops)
        show_loops(twin_of(picture, ground, right_px=right_px), error.loops)
        raise
    notes = () if _is_within(route, ground.scale) else (_BESIDE_TWIN,)
    twin = twin_of(picture, ground, right_px=_right_px(route))
    return Made(route=route, scale=ground.scale, picture=twin, settings=settings, made_of=made_of, notes=notes)


_BESIDE_TWIN = "Part of the route lies above or to the left of the calibration's twin: pictures of the track end there."


def _is_within(route: Route, scale: TwinScale) -> bool:
    return bool((route.points_px >= 0).all()) and bool((route.points_px[:, 1] <= scale.height_px).all())


def _right_px(route: Route) -> float:
    """Twin px up to which a picture shows the route, its lane and as much floor beside it."""
    return float(route.points_px[:, 0].max() + 1.5 * np.median(route.half_left_px + route.half_right_px))


def load_photos(paths: Sequence[Path]) -> list[tuple[str, BgrImage]]:
    """The photographs by name, and their pictures."""
    return [(str(path), read_photograph(path)) for path in paths]


def pictures_of(uri: str) -> list[tuple[str, BgrImage]]:
    """Pictures of a clip, spread over all of it, or of a live camera for a few seconds. Raises `InputError` for none."""
    source = make_source(uri, None)
    spread = SpreadOut()
    first_t_ns: int | None = None
    last_t_ns = 0
    try:
        for frame in source.frames():
            first_t_ns = frame.t_ns if first_t_ns is None else first_t_ns
            if source.info.live and frame.t_ns - first_t_ns > _LIVE_S * 1e9:
                break
            if spread.kept and frame.t_ns - last_t_ns < _PICTURE_EVERY_S * 1e9:
                continue
            picture = decode_bgr(frame)
            if picture is not None:
                spread.add(picture)
                last_t_ns = frame.t_ns
    finally:
        source.close()
    if not spread.kept:
        raise InputError(f"{uri}: no picture in it could be read: check it with another player")
    return [(uri, picture) for picture in spread.kept]


def made_of_files(paths: Sequence[Path], waypoints_px: tuple[PointPx, ...] = ()) -> MadeOf:
    """The files' names, and one SHA-256: the file's, or that of all of them in their order."""
    data = hashlib.sha256()
    for path in paths:
        data.update(path.read_bytes())
    return MadeOf(picture=", ".join(path.name for path in paths), sha256=data.hexdigest(), waypoints_px=waypoints_px)


def ground_for(calibration: Path, width_px: int, height_px: int, source: str) -> GroundMap:
    """The calibration's map for pictures of a size. Raises `InputError` for one of another shape."""
    ground = load_calibration(calibration).ground
    try:
        return ground.scaled_to(width_px, height_px)
    except InputError as error:
        raise InputError(
            f"{source}: {width_px}x{height_px} px, the calibration {calibration} is for {ground.width_px}x{ground.height_px}: "
            "take the picture with the calibrated camera in the same mode"
        ) from error


def from_recordings(paths: Sequence[Path], settings: TrackSettings, *, lane_width_m: float | None) -> Made:
    """The median path of the laps in recordings made under one calibration.

    Laps go from start line to start line where the recordings' track has its line on the path, else round by round. Raises
    `InputError` where there is no lap, the laps do not agree, or the recordings have different calibrations.
    """
    laps: list[DrivenPath] = []
    first: CoreSetup | None = None
    line: DirectedLine | None = None
    for path in paths:
        run = replay(path)
        if first is None:
            first = run.setup
        elif run.setup.ground != first.ground:
            raise InputError(f"{path}: recorded under another calibration than {paths[0]}: take recordings of one")
        seen: dict[int, list[tuple[float, float]]] = {}
        for event in run.events:
            if isinstance(event, Observation):
                # With one car in the race, every target is that car.
                who = 0 if run.setup.motion.cars == 1 else event.target_id or 0
                seen.setdefault(who, []).append(event.track_m)
        ways = [path_points(way) for way in seen.values()]
        if line is None:
            line = _line_on(ways, run.setup.track.start_line)
        if line is not None:
            laps += _named_laps(ways, line, path.name, straight=line is not run.setup.track.start_line)
    source = ", ".join(str(path) for path in paths)
    given = settings.start_line_px is not None or settings.start_at_px is not None
    if first is not None and line is first.track.start_line and not given:
        settings = replace(settings, start_line_px=_line_px(line, first.ground.scale))
    assert first is not None, "there is at least one recording"
    pictures = spread_out(picture for path in paths for picture in _pictures(path, first))
    made_of = made_of_files(paths)
    return from_laps(laps, first.ground, settings, pictures, source, lane_width_m=lane_width_m, made_of=made_of)


def from_laps(
    laps: Sequence[DrivenPath],
    ground: GroundMap,
    settings: TrackSettings,
    pictures: Sequence[BgrImage],
    source: str,
    *,
    lane_width_m: float | None,
    made_of: MadeOf,
) -> Made:
    """The median path of laps that begin and end at one line; `pictures` are of the ground map's size."""
    driven = driven_route(laps, lane_width_m=lane_width_m, source=source)
    scale = ground.scale
    route = Route(
        points_px=scale.to_twin_px(driven.points_m),
        half_left_px=driven.half_left_m / scale.metres_per_px,
        half_right_px=driven.half_right_m / scale.metres_per_px,
    )
    if settings.start_line_px is None:
        settings = replace(settings, start_line_px=_start_px(driven, scale, settings.start_at_px, source))
        settings = replace(settings, start_at_px=None)
    notes = [f"Left out: {text}." for text in driven.left_out]
    if len(driven.kept) == 1:
        notes.append("One lap only: its own faults are the route's; three or more make a better one.")
    if not _is_within(route, scale):
        notes.append(_BESIDE_TWIN)
    picture = None
    if pictures:
        picture = twin_of(median_picture(pictures), ground, right_px=_right_px(route))
    return Made(
        route=route,
        scale=scale,
        picture=picture,
        settings=settings,
        made_of=made_of,
        notes=tuple(notes),
        laps=len(driven.kept),
        spread_m=driven.spread_m,
    )


def rounds_of(ways: Sequence[Points], name: str) -> tuple[list[DrivenPath], DirectedLine | None]:
    """The rounds of a drive of which no start line is known, and the line at which they were told apart; none where the
    drive comes by no place twice.
    """
    gates = [gate for way in ways if (gate := gate_of(way)) is not None]
    if not gates:
        return [], None
    gate = max(gates, key=lambda one: _crossed(ways, one, straight=True))
    return _named_laps(ways, gate, name, straight=True), gate


class SpreadOut:
    """Keeps at most `MOST_PICTURES` of the pictures that it is given, evenly spread, however many those turn out to be."""

    def __init__(self) -> None:
        self.kept: list[BgrImage] = []
        self._every, self._given = 1, 0

    def add(self, picture: BgrImage) -> None:
        """Takes one more picture."""
        if self._given % self._every == 0:
            self.kept.append(picture)
        self._given += 1
        if len(self.kept) > MOST_PICTURES:
            self.kept, self._every = self.kept[::2], 2 * self._every


def spread_out(pictures: Iterator[BgrImage]) -> list[BgrImage]:
    """At most `MOST_PICTURES` of the pictures, evenly spread."""
    spread = SpreadOut()
    for picture in pictures:
        spread.add(picture)
    return spread.kept


def decoded(frames: Iterator[Frame]) -> Iterator[BgrImage]:
    """The frames' pictures, without those that cannot be decoded."""
    return (picture for frame in frames if (picture := decode_bgr(frame)) is not None)


def _pictures(path: Path, setup: CoreSetup) -> Iterator[BgrImage]:
    """The recording's pictures of the size of its map; smaller copies of the frames would blur the twin."""
    size = (setup.ground.height_px, setup.ground.width_px)
    return (picture for picture in decoded(iter_frames(path)) if picture.shape[:2] == size)


def _line_on(ways: Sequence[Points], start_line: DirectedLine) -> DirectedLine | None:
    """The track's start line where the drive crosses it twice; else a line across the drive; None where nothing repeats."""
    if _crossed(ways, start_line, straight=False) > 0:
        return start_line
    return rounds_of(ways, "")[1]


def _crossed(ways: Sequence[Points], line: DirectedLine, *, straight: bool) -> int:
    """How many laps the line makes of the ways."""
    return sum(len(laps_between(way, line, straight=straight)) for way in ways if len(way) > 1)


def _named_laps(ways: Sequence[Points], line: DirectedLine, name: str, *, straight: bool) -> list[DrivenPath]:
    laps = [lap for way in ways if len(way) > 1 for lap in laps_between(way, line, straight=straight)]
    return [
        DrivenPath(name=f"{name} lap {k}" if name else f"lap {k}", points_m=thinned(lap, _JITTER_M))
        for k, lap in enumerate(laps, start=1)
    ]


def _start_px(driven: DrivenRoute, scale: TwinScale, at_px: PointPx | None, source: str) -> LinePx:
    """The start line in twin px, across the lane in the direction of driving: at the wanted place, or where the laps begin."""
    route = Centreline(points_m=driven.points_m, half_left_m=driven.half_left_m, half_right_m=driven.half_right_m)
    s_m = 0.0 if at_px is None else foot_m(route, at_px, START_LINE, scale, source)
    return _line_px(line_across(route, s_m, name=START_LINE), scale)


def _line_px(line: DirectedLine, scale: TwinScale) -> LinePx:
    start, end = scale.to_twin_px(np.array([line.start_m, line.end_m])).tolist()
    return (start[0], start[1]), (end[0], end[1])
