"""Turns a checked configuration and an opened source into the rooms of one run.

The only place that knows both the configuration and the rooms: the daemon and every command that needs a track, a view or
a core build them here, so that all of them build the same.
"""

from __future__ import annotations

import hashlib
import json
import math
import time
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel

from dnb_edge import wire
from dnb_edge.capture.recording import RecordingSource
from dnb_edge.capture.settings import CaptureSettings
from dnb_edge.capture.source import FrameSource, check_uri, open_source
from dnb_edge.config.calibration_file import load_calibration
from dnb_edge.config.devices import CaptureConfig
from dnb_edge.config.keypoints import load_yaml_pairs
from dnb_edge.config.paths import names_a_file
from dnb_edge.config.rules import load_rule_set
from dnb_edge.config.schema import Config, DetectorConfig, MarkersConfig, TrackConfig, ViewConfig
from dnb_edge.config.sections import to_settings
from dnb_edge.config.track_file import load_track
from dnb_edge.core import CoreSetup
from dnb_edge.detect.centre import CentreDetector
from dnb_edge.detect.lean import LeanField
from dnb_edge.detect.markers import MarkerDetector, MarkerSettings
from dnb_edge.detect.onnx import OpenModel, default_model_path, load_model, open_model
from dnb_edge.detect.protocol import Detector
from dnb_edge.detect.ultralytics import UltralyticsDetector, UltralyticsSettings
from dnb_edge.detect.ultralytics_file import is_ultralytics
from dnb_edge.errors import InputError
from dnb_edge.motion.settings import MotionSettings
from dnb_edge.race.crossing import CrossingSettings
from dnb_edge.race.rules import CarSetup, FormatRules, LapRules, PenaltyRules, StartRules
from dnb_edge.race.sectors import check_lines
from dnb_edge.record.channels import TrackScene
from dnb_edge.record.header import RunHeader, software_versions
from dnb_edge.record.identity import identity_of
from dnb_edge.record.reader import iter_frames, read_run
from dnb_edge.score.similarity import ScoreSettings
from dnb_edge.track.build import TrackSettings, build_track
from dnb_edge.track.model import Track
from dnb_edge.track.scale import TwinScale
from dnb_edge.track.twin import Lane, LaneColour, load_twin
from dnb_edge.values import Clock, EntryInfo, SourceInfo
from dnb_edge.view.calibration import Calibration, Covariance9
from dnb_edge.view.fit import fit_keypoints
from dnb_edge.view.gate import ErrorLimit, check
from dnb_edge.view.ground import GroundMap
from dnb_edge.view.homography import CalibrationError, calibration_error, fit_ground_map
from dnb_edge.view.keypoints import KeypointPairs, load_npy_pairs
from dnb_edge.view.lean import floor_lean
from dnb_edge.view.pose import with_camera

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Assembly:
    """What a configuration means for one source."""

    setup: CoreSetup
    calibration: CalibrationError
    view_sigma_m: float | None
    """One sigma of the map's position where on the route it is greatest, metres; None where it is not known."""


def assemble(config: Config, info: SourceInfo) -> Assembly:
    """Builds track, view and the core's setup. Raises `InputError` where the configuration does not fit together."""
    track = make_track(config.track)
    check_lines(track)
    view = make_view(config.view, track.scale, info)
    ground = view.ground
    tallest_m = _tallest_m(config.detector)
    if tallest_m > 0.0:
        ground = with_camera(ground, height_m=config.view.camera_height_m, tallest_m=tallest_m)
    limit = ErrorLimit(mean_px=config.view.max_mean_error_px, mean_m=config.view.max_mean_error_m)
    rules = load_rule_set(config.rules)
    setup = CoreSetup(
        track=track,
        ground=ground,
        motion=settings_of(MotionSettings, config.motion),
        crossing=settings_of(CrossingSettings, config.crossing),
        laps=settings_of(LapRules, config.race),
        score=settings_of(ScoreSettings, config.score),
        not_scored_because=check(view.error, limit),
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


def settings_of(kind: type[T], section: BaseModel) -> T:
    """The core's settings from their checked section. Raises `InputError` where the values contradict one another."""
    try:
        return to_settings(kind, section)
    except ValueError as error:
        raise InputError(f"configuration: {error}") from error


def make_track(config: TrackConfig) -> Track:
    """The track that the configuration describes. Raises `InputError` naming the twin's or the track's file."""
    if config.file is not None:
        return load_track(config.file)
    assert config.image is not None, "the schema wants it"
    image = load_twin(config.image)
    settings = TrackSettings(
        name=config.name,
        lane_colour=_lane(config),
        metres_per_px=_metres_per_px(config, height_px=float(image.shape[0])),
        closed=config.closed,
        start_line_px=config.start_line_px,
        start_at_px=config.start_at_px,
        finish_line_px=config.finish_line_px,
        finish_at_px=config.finish_at_px,
        sector_lines_px=config.sector_lines_px,
        sectors_at_px=config.sectors_at_px,
        waypoints_px=config.waypoints_px,
        close_gap_px=config.close_gap_px,
    )
    return build_track(image, settings, source=str(config.image))


def _lane(config: TrackConfig) -> Lane:
    if config.lane is not None:
        return config.lane
    assert config.lane_hsv is not None, "the schema wants one of the two"
    hue_deg, saturation_percent, value_percent = config.lane_hsv
    return LaneColour(hue_deg=hue_deg, saturation_percent=saturation_percent, value_percent=value_percent)


def _metres_per_px(config: TrackConfig, *, height_px: float) -> float:
    if config.metres_per_px is not None:
        return config.metres_per_px
    measured = config.measured
    assert measured is not None, "the schema wants one of the two"
    return TwinScale.from_measured_length(
        from_px=measured.from_px, to_px=measured.to_px, length_m=measured.length_m, height_px=height_px
    ).metres_per_px


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """How a source's frames show the track."""

    ground: GroundMap
    error: CalibrationError
    calibration: Calibration | None
    """The calibration that it comes from, for the size of picture on which it was made; None where it comes of keypoints."""
    covariance: Covariance9 | None
    """Covariance of `ground.camera_to_twin`, in its scale (see `Calibration`); None where it is not known."""


def make_view(config: ViewConfig, scale: TwinScale, info: SourceInfo) -> View:
    """The view of the source's frames. Raises `InputError` where they do not fit the calibration."""
    if config.calibration is not None:
        return _calibrated_view(config.calibration, scale, info)
    pairs = load_pairs(config)
    width_px, height_px = config.image_size_px or pairs.image_size_px or (info.width_px, info.height_px)
    ground = fit_ground_map(pairs, scale, width_px=width_px, height_px=height_px)
    error = calibration_error(pairs, metres_per_px=scale.metres_per_px)
    ground = ground.scaled_to(info.width_px, info.height_px)
    return View(
        ground=ground,
        error=error,
        calibration=None,
        covariance=_keypoint_covariance(pairs, ground, picture_px=(width_px, height_px)),
    )


def _keypoint_covariance(pairs: KeypointPairs, ground: GroundMap, *, picture_px: tuple[int, int]) -> Covariance9 | None:
    """The covariance of a plain map of keypoints: that of the weighted fit to the same points, which scatter about as far from
    either. None where that fit refuses them (swapped, mirrored): no sigma describes such a fault, and the gate judges it.
    """
    width_px, height_px = picture_px
    try:
        fitted = fit_keypoints(pairs, ground.scale, width_px=width_px, height_px=height_px).calibration
    except InputError:
        return None
    fitted = fitted.scaled_to(ground.width_px, ground.height_px)
    # A homography has no scale of its own: the covariance goes by that of its nine numbers, here by the depth at the middle.
    own, other = (_middle_depth(one) for one in (ground, fitted.ground))
    assert fitted.covariance is not None, "a weighted fit always has one"
    return tuple(tuple(number * (own / other) ** 2 for number in row) for row in fitted.covariance)


def _middle_depth(ground: GroundMap) -> float:
    g, h, i = ground.camera_to_twin[6:]
    return g * ground.width_px / 2 + h * ground.height_px / 2 + i


def _calibrated_view(path: Path, scale: TwinScale, info: SourceInfo) -> View:
    calibration = load_calibration(path)
    made_for = calibration.ground.scale
    remedy = "calibrate again with this track's twin"
    # A scale comes from a division of measured numbers, and goes through files.
    if made_for.height_px != scale.height_px or not math.isclose(
        made_for.metres_per_px, scale.metres_per_px, rel_tol=1e-6
    ):
        raise InputError(
            f"{path}: made for a twin {made_for.height_px:g} px high at {made_for.metres_per_px * 1000:g} mm a px, the track's "
            f"is {scale.height_px:g} px at {scale.metres_per_px * 1000:g} mm: {remedy}"
        )
    try:
        ground = calibration.for_camera(width_px=info.width_px, height_px=info.height_px, camera_id=info.camera_id)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    covariance = calibration.scaled_to(info.width_px, info.height_px).covariance
    return View(ground=ground, error=calibration.error, calibration=calibration, covariance=covariance)


def _tallest_m(detector: DetectorConfig) -> float:
    """The greatest height above the floor at which the detector places what it sees, metres."""
    return detector.markers.marker_height_m if detector.kind == "markers" else detector.point_height_m


def load_pairs(config: ViewConfig) -> KeypointPairs:
    """The keypoint pairs that the configuration names. Raises `InputError` where it names a calibration instead."""
    if config.calibration is not None:
        raise InputError(
            f"view.calibration: {config.calibration} holds a finished map, no keypoints: name the keypoints' file"
        )
    if config.keypoints is not None:
        return load_yaml_pairs(config.keypoints)
    camera, twin = config.keypoints_camera, config.keypoints_twin
    assert camera is not None, "the schema wants both files"
    assert twin is not None, "the schema wants both files"
    return load_npy_pairs(camera, twin)


def make_detector(config: Config, ground: GroundMap | None = None) -> Detector:
    """The detector that the configuration names, ready to look. Raises `InputError` for a model that cannot be used.

    `ground` is the map of the frames to come, where there is one: it tells the network how things lean in them.
    """
    lean = None if ground is None else floor_lean(ground, height_m=config.view.camera_height_m)
    return detector_of(config.detector, lean)


def detector_of(wanted: DetectorConfig, lean: LeanField | None = None) -> Detector:
    """As `make_detector`, from the detector's section alone."""
    check_detector(wanted)
    if wanted.kind == "markers":
        return MarkerDetector(_marker_settings(wanted))
    opened = _ultralytics_model(wanted)
    if opened is not None:
        return UltralyticsDetector(opened, _box_settings(wanted))
    _without_box_settings(wanted)
    path = wanted.model if wanted.model is not None else default_model_path()
    return CentreDetector(load_model(path, threads=wanted.threads), lean=lean)


def check_source(wanted: CaptureConfig) -> None:
    """Raises `InputError` where the source's URI is none, as far as that shows without looking for the device or file."""
    if wanted.source is None:
        return
    try:
        check_uri(wanted.source)
    except InputError as error:
        raise InputError(f"capture.source: {error}") from error


def check_detector(wanted: DetectorConfig) -> None:
    """Raises `InputError` where the detector's section contradicts itself, as far as that shows without its model's file."""
    if wanted.kind == "markers":
        if wanted.model is not None:
            raise InputError(
                "detector.model: the detector `markers` uses no model; leave it out, or choose another detector.kind"
            )
        _without_box_settings(wanted)
        _marker_settings(wanted)
        return
    if wanted.markers != MarkersConfig():
        raise InputError(
            "detector.markers: only for the detector `markers`; set detector.kind to it, or leave this out"
        )
    if wanted.kind == "ultralytics" and wanted.model is None:
        raise InputError("detector.model: the detector `ultralytics` needs a model; give the path of a .onnx file")
    if wanted.kind == "centre" or wanted.model is None:
        _without_box_settings(wanted)


_BOX_KEYS = ("classes", "min_confidence", "iou", "shift_ratio", "point_height_m", "sigma_ratio")
"""Keys of the detector's section that only an Ultralytics model understands."""


def _ultralytics_model(wanted: DetectorConfig) -> OpenModel | None:
    """The model where it is one of Ultralytics' (told so, or by its metadata); None where it is one of ours."""
    path = wanted.model
    if path is None or wanted.kind == "centre" or (wanted.kind == "auto" and _has_card(path)):
        return None
    opened = open_model(path, threads=wanted.threads)
    if wanted.kind == "auto" and not is_ultralytics(opened.metadata):
        raise InputError(
            f"{path}: neither one of our models (its card {path.with_suffix('.json').name} is not beside it) "
            "nor exported by Ultralytics (its metadata does not say so); put the card there or choose another model"
        )
    return opened


def _has_card(model: Path) -> bool:
    """Whether a card lies beside the model; a path without a name, such as `/`, is no model."""
    return bool(model.name) and model.with_suffix(".json").exists()


def _box_settings(wanted: DetectorConfig) -> UltralyticsSettings:
    return UltralyticsSettings(**{name: getattr(wanted, name) for name in _BOX_KEYS})


def _without_box_settings(wanted: DetectorConfig) -> None:
    """Raises `InputError` where a key is set that the chosen detector would not heed."""
    for name in _BOX_KEYS:
        if getattr(wanted, name) != DetectorConfig.model_fields[name].default:
            raise InputError(f"detector.{name}: only for a model that Ultralytics exported; leave it out")


def _marker_settings(wanted: DetectorConfig) -> MarkerSettings:
    try:
        return MarkerSettings(**{name: getattr(wanted.markers, name) for name in MarkersConfig.model_fields})
    except ValueError as error:
        raise InputError(f"detector.markers.{error}") from error


def make_source(uri: str, config: Config | None) -> FrameSource:
    """The source at `uri`, open; a camera is asked for what the configuration says."""
    return source_of(uri, None if config is None else config.capture)


def source_of(uri: str, asked: CaptureConfig | None) -> FrameSource:
    """As `make_source`, from the camera's section alone."""
    settings = None
    if asked is not None:
        keys = {choice.name for choice in fields(CaptureSettings)} & set(type(asked).model_fields)
        settings = CaptureSettings(**{key: getattr(asked, key) for key in keys})
    return open_source(uri, settings, open_recording=open_recording)


def open_recording(uri: str, path: Path) -> FrameSource:
    """The pictures of the recording at `path` as a source. Raises `InputError` where it holds none."""
    run = read_run(path)
    first = next(iter(iter_frames(path)), None)
    if first is None:
        raise InputError(f"{path}: this recording holds no pictures: score it with `dnb-edge score {path}`")
    recorded = run.header.source
    info = SourceInfo(
        uri=uri,
        width_px=first.width_px,
        height_px=first.height_px,
        nominal_fps=recorded.nominal_fps,
        clock=recorded.clock,
        live=False,
        camera_id=recorded.camera_id,
    )
    return RecordingSource(uri, info, iter_frames(path))


def make_header(config: Config, assembly: Assembly, info: SourceInfo) -> RunHeader:
    """What the recording says about itself: all that is needed to score it again, and where it came from."""
    monotonic = info.clock is Clock.MONOTONIC
    entry = make_entry(config)
    return RunHeader(
        name=entry.name,
        entry=entry,
        session=config.session,
        identity=identity_of(assembly.setup).to_dict(),
        setup={
            "core": assembly.setup.to_dict(),
            "calibration": wire.to_dict(assembly.calibration) | {"sigma_m": assembly.view_sigma_m},
            "sha256": {path.name: _sha256(path) for path in _inputs(config)},
        },
        config=plain_config(config),
        source=info,
        versions=software_versions(),
        wall_offset_ns=time.time_ns() - time.monotonic_ns() if monotonic else None,
    )


def make_entry(config: Config) -> EntryInfo:
    """Who drives, with the hash of the checkpoint. Raises `InputError` naming the file where that cannot be read."""
    path = config.entry.checkpoint
    if path is None:
        return config.driver
    check_checkpoint(config)
    try:
        return replace(config.driver, checkpoint_sha256=_sha256(path))
    except OSError as error:
        raise InputError(f"entry.checkpoint: {path} cannot be read: {error.strerror}") from error


def check_checkpoint(config: Config) -> None:
    """Raises `InputError` where the entry's checkpoint is no file: found out before a run, recorded or not, begins."""
    path = config.entry.checkpoint
    if path is not None and not path.is_file():
        raise InputError(f"entry.checkpoint: there is no file {path}: give the network's weights, or leave it out")


def _inputs(config: Config) -> list[Path]:
    """The files that decide what the run measures."""
    view = config.view
    model = config.detector.model
    if model is None and config.detector.kind != "markers":
        model = default_model_path()
    pairs = (view.keypoints, view.keypoints_camera, view.keypoints_twin)
    rules = Path(config.rules) if names_a_file(config.rules) else None
    paths = (config.track.file, config.track.image, view.calibration, *pairs, model, rules)
    return [path for path in paths if path is not None]


def _sha256(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def plain_config(config: Config) -> dict[str, Any]:
    """The configuration in force as plain JSON types."""
    plain: dict[str, Any] = json.loads(config.model_dump_json())
    return plain


def make_scene(setup: CoreSetup) -> TrackScene:
    """The track as the recording's 3D view shows it."""
    track = setup.track
    return TrackScene(
        route_m=track.centreline.points_m,
        closed=track.centreline.closed,
        lines_m={line.name: (line.start_m, line.end_m) for line in track.lines},
    )
