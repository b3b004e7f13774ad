"""How a checked configuration and an opened source become the core's setup."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from pydantic import BaseModel

from dnb_edge.assembly.tracks import make_track, make_view
from dnb_edge.config.rules import load_rule_set
from dnb_edge.config.schema import Config, DetectorConfig
from dnb_edge.config.sections import to_settings
from dnb_edge.core import CoreSetup
from dnb_edge.core.setup import CameraView
from dnb_edge.errors import InputError
from dnb_edge.motion.settings import MotionSettings
from dnb_edge.race.crossing import CrossingSettings
from dnb_edge.race.rules import CarSetup, FormatRules, LapRules, PenaltyRules, StartRules
from dnb_edge.race.sectors import check_lines
from dnb_edge.record.channels import TrackScene
from dnb_edge.score.similarity import ScoreSettings
from dnb_edge.track.model import Track
from dnb_edge.values import SourceInfo
from dnb_edge.view.gate import ErrorLimit, check
from dnb_edge.view.homography import CalibrationError
from dnb_edge.view.pose import with_camera

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Assembly:
    """What a configuration means for one source."""

    setup: CoreSetup
    calibration: CalibrationError
    view_sigma_m: float | None
    """One sigma of the map's position where on the route it is greatest, metres; None where it is not known."""


def assemble(config: Config, info: SourceInfo, further: Sequence[SourceInfo] = ()) -> Assembly:
    """Builds track, view and the core's setup; `further` are the opened sources of the configuration's further cameras, none
    where only the first is asked about. Raises `InputError` where the configuration does not fit together.
    """
    track = make_track(config.track)
    check_lines(track)
    view = make_view(config.view, track.scale, info)
    ground = view.ground
    tallest_m = _tallest_m(config.detector)
    if tallest_m > 0.0:
        ground = with_camera(ground, height_m=config.view.camera_height_m, tallest_m=tallest_m)
    others = [_further(config, number, track, other) for number, other in enumerate(further)]
    limit = ErrorLimit(mean_px=config.view.max_mean_error_px, mean_m=config.view.max_mean_error_m)
    rules = load_rule_set(config.rules)
    setup = CoreSetup(
        track=track,
        ground=ground,
        motion=settings_of(MotionSettings, config.motion),
        crossing=settings_of(CrossingSettings, config.crossing),
        laps=settings_of(LapRules, config.race),
        score=settings_of(ScoreSettings, config.score),
        not_scored_because=next(
            (reason for error in (view.error, *(error for _, error in others)) if (reason := check(error, limit))), None
        ),
        further=tuple(seen for seen, _ in others),
        map_covariance=view.covariance,
        row_s=config.capture.row_us * 1e-6,
        start=settings_of(StartRules, config.start),
        format=settings_of(FormatRules, config.format),
        penalties=settings_of(PenaltyRules, config.penalties),
        rules=rules.name,
        rules_version=rules.version,
        cars=tuple(CarSetup(name=car.name, marker_id=car.marker, colour_bgr=car.colour) for car in config.cars),
    )
    sigma_m = None if view.calibration is None else view.calibration.greatest_sigma_m(track.centreline.points_m)
    return Assembly(setup=setup, calibration=view.error, view_sigma_m=sigma_m)


def _further(config: Config, number: int, track: Track, info: SourceInfo) -> tuple[CameraView, CalibrationError]:
    """What the core must know of the further camera of that number, and how wrong its map is."""
    camera = config.further_cameras[number]
    try:
        view = make_view(camera.view, track.scale, info)
        ground, tallest_m = view.ground, _tallest_m(config.detector)
        if tallest_m > 0.0:
            ground = with_camera(ground, height_m=camera.view.camera_height_m, tallest_m=tallest_m)
    except InputError as error:
        raise InputError(f"further_cameras.{number}: {error}") from error
    row_s = camera.capture.row_us * 1e-6
    return CameraView(ground=ground, map_covariance=view.covariance, row_s=row_s), view.error


def settings_of(kind: type[T], section: BaseModel) -> T:
    """The core's settings from their checked section. Raises `InputError` where the values contradict one another."""
    try:
        return to_settings(kind, section)
    except ValueError as error:
        raise InputError(f"configuration: {error}") from error


def _tallest_m(detector: DetectorConfig) -> float:
    """The greatest height above the floor at which the detector places what it sees, metres."""
    return detector.markers.marker_height_m if detector.kind == "markers" else detector.point_height_m


def make_scene(setup: CoreSetup) -> TrackScene:
    """The track as the recording's 3D view shows it."""
    track = setup.track
    return TrackScene(
        route_m=track.centreline.points_m,
        closed=track.centreline.closed,
        lines_m={line.name: (line.start_m, line.end_m) for line in track.lines},
    )
