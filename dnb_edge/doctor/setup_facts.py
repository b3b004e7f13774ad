"""Facts of the set-up: configuration, track, calibration, model, how fast the detector is, whether the camera has moved.

Knows the assembly and which files a configuration names. Knows no limit.
"""

from __future__ import annotations

import time
from datetime import datetime
from statistics import median

import cv2
import numpy as np

from dnb_edge.assembly import (
    Assembly,
    check_detector,
    check_display,
    check_source,
    detector_of,
    load_pairs,
    make_track,
)
from dnb_edge.assembly.pictures import calibrated_picture
from dnb_edge.capture.picture_health import PictureFault, PictureJudge
from dnb_edge.config.calibration_file import load_calibration
from dnb_edge.config.load import load_config
from dnb_edge.config.schema import Config, DetectorConfig
from dnb_edge.detect.onnx import default_model_path, load_model, open_model
from dnb_edge.doctor.box import Box
from dnb_edge.doctor.picture_rules import Place
from dnb_edge.doctor.setup_rules import CalibrationFound, ModelFound, Pace, RacePace, SetupState, TrackFound
from dnb_edge.doctor.verdict import CannotTell
from dnb_edge.errors import DnbEdgeError, InputError
from dnb_edge.values import BgrImage, SearchWindow
from dnb_edge.view.drift import TOO_LITTLE
from dnb_edge.view.drift_judge import DriftJudge, DriftSettings, Verdict, watched_track
from dnb_edge.view.drift_patches import grey
from dnb_edge.view.drift_reference import PlaceReference, median_of_five
from dnb_edge.view.fit import fit_keypoints

_LOOKS = 9
_PERIOD_NS = 66_000_000
_CAR_PX = 60.0
DRAFT_NAME = "draft.json"


def find_set_up(box: Box) -> SetupState:
    """Which configuration there is."""
    where = box.where
    draft = next(iter(sorted(where.setup.rglob(DRAFT_NAME))), None) if where.setup.is_dir() else None
    return SetupState(config=box.config_file, wanted=where.config, setup=where.setup, draft=draft)


def config_fault(box: Box) -> str | None:
    """What is wrong with the configuration; None where it is right."""
    if box.config_file is None:
        raise CannotTell("no configuration to look at")
    try:
        config = load_config(box.config_file, box.where.overrides)
        check_source(config.capture)
        check_detector(config.detector)
        check_display(config.display)
    except InputError as error:
        return str(error)
    return None


def find_track(box: Box) -> TrackFound:
    """What becomes of the track's files."""
    config = box.config
    try:
        track = make_track(config.track)
    except InputError as error:
        return TrackFound(fault=str(error), name=config.track.name, length_m=None)
    return TrackFound(fault=None, name=track.name, length_m=track.centreline.length_m)


def find_calibration(box: Box) -> CalibrationFound:
    """The calibration, for the frames of this camera."""
    config = box.config
    try:
        found = box.assembly
    except InputError as error:
        return CalibrationFound(fault=str(error))
    method = "keypoints" if config.view.calibration is None else load_calibration(config.view.calibration).method.value
    return CalibrationFound(
        fault=None,
        method=method,
        mean_m=found.calibration.mean_m,
        sigma_m=found.view_sigma_m,
        too_bad=found.setup.not_scored_because,
        doubt=_doubt(config, found),
        age_days=_age_days(config),
    )


def _doubt(config: Config, found: Assembly) -> str | None:
    """What the weighted fit has against the keypoints; the plain one that races takes any four of them."""
    if config.view.calibration is not None:
        return None
    ground, pairs = found.setup.ground, load_pairs(config.view)
    width_px, height_px = config.view.image_size_px or pairs.image_size_px or (ground.width_px, ground.height_px)
    try:
        fit_keypoints(pairs, ground.scale, width_px=width_px, height_px=height_px)
    except InputError as error:
        return str(error)
    return None


def _age_days(config: Config) -> float | None:
    """How long ago the calibration was made, or its keypoints' file changed last, days."""
    view = config.view
    if view.calibration is not None:
        made_at = load_calibration(view.calibration).made_at
        try:
            made = datetime.fromisoformat(made_at)
        except ValueError:
            return None
        return (time.time() - made.timestamp()) / 86_400.0
    points = view.keypoints if view.keypoints is not None else view.keypoints_camera
    return None if points is None else (time.time() - points.stat().st_mtime) / 86_400.0


def find_model(box: Box) -> ModelFound:
    """What becomes of the detector's model. Raises `CannotTell` where the detector has none."""
    config = box.readable_config
    wanted = None if config is None else config.detector
    if wanted is not None and wanted.kind == "markers":
        raise CannotTell("the detector `markers` has no model")
    path = default_model_path() if wanted is None or wanted.model is None else wanted.model
    ours = path.with_suffix(".json").exists() and (wanted is None or wanted.kind != "ultralytics")
    try:
        if ours or wanted is None or wanted.kind == "centre":
            load_model(path)
        else:
            open_model(path)
    except InputError as error:
        return ModelFound(fault=str(error), name=path.name, is_ours=ours)
    return ModelFound(fault=None, name=path.name, is_ours=ours)


def find_pace(box: Box) -> Pace | RacePace:
    """How long a frame takes: as the running race says, else measured on this camera's picture, or on noise of its size."""
    config = box.readable_config
    service = box.service
    if service is not None and service.health is not None:
        health = service.health
        lost = sum(one.frames for one in health.lost if one.reason == "queue")
        return RacePace(latency_ms=health.latency_p95_ms, lost_share=lost / max(1, lost + health.frames))
    picture = _picture(box)
    box.say("Timing the detector")
    detector = detector_of(DetectorConfig() if config is None else config.detector)
    height, width = picture.shape[:2]
    window = SearchWindow(target_id=1, camera_px=(width / 2, height / 2), length_px=_CAR_PX)
    _, jpeg = cv2.imencode(".jpg", picture)
    decode_ms, window_ms, whole_ms = [], [], []
    for number in range(_LOOKS):
        began_s = time.perf_counter()
        cv2.imdecode(jpeg, cv2.IMREAD_COLOR)
        decoded_s = time.perf_counter()
        detector.detect(picture, sequence=2 * number, t_ns=number * _PERIOD_NS, windows=(window,))
        followed_s = time.perf_counter()
        detector.detect(picture, sequence=2 * number + 1, t_ns=number * _PERIOD_NS + _PERIOD_NS // 2, windows=())
        decode_ms.append(1e3 * (decoded_s - began_s))
        window_ms.append(1e3 * (followed_s - decoded_s))
        whole_ms.append(1e3 * (time.perf_counter() - followed_s))
    decoding_ms = median(decode_ms)
    return Pace(
        fps=30.0 if config is None else config.capture.fps,
        window_ms=decoding_ms + median(window_ms),
        whole_ms=decoding_ms + median(whole_ms),
    )


def _picture(box: Box) -> BgrImage:
    """One of the camera's, else noise of the size that is asked for."""
    try:
        if box.footage.stills:
            return box.footage.stills[0]
    except (CannotTell, DnbEdgeError, OSError):
        box.say("There is no picture: timing the detector on noise")
    config = box.readable_config
    size = (720, 1280) if config is None else (config.capture.height_px, config.capture.width_px)
    return np.random.default_rng(0).integers(0, 256, (*size, 3), dtype=np.uint8)


def picture_fault(box: Box) -> PictureFault | None:
    """What is wrong with the pictures. Raises `CannotTell` where there are none."""
    footage = box.footage
    if not footage.stills:
        raise CannotTell("none of the pictures could be decoded")
    judge = PictureJudge(live=footage.info.live)
    # Each of the few pictures counts for as long as a fault must last.
    for number, picture in enumerate(footage.stills):
        judge.look(picture, number * 500_000_000)
    return judge.fault


def find_place(box: Box) -> Place:
    """Where the camera is, by the race that says it moved, else by comparing with the calibration's own picture."""
    service = box.service
    config = box.config
    if service is not None and service.health is not None and service.health.view_moved_m is not None:
        # A race that says nothing need not have looked.
        return Place(moved_m=service.health.view_moved_m, is_sure=True, limit_m=0.0)
    footage = box.footage
    reference = calibrated_picture(config.view, footage.info)
    if reference is None:
        raise CannotTell("the calibration kept no picture to compare with: calibrate with `--picture`, or under Set up")
    if not footage.stills:
        raise CannotTell("none of the pictures could be decoded")
    setup = box.assembly.setup
    watched = watched_track(setup.ground, setup.track.centreline.points_m)
    made = PlaceReference.of(reference, watched.camera_px)
    if not made.enough:
        raise CannotTell(TOO_LITTLE)
    settings = DriftSettings()
    still = median_of_five(([grey(picture) for picture in footage.stills] * 5)[:5])
    look = DriftJudge(reference=made, watched=watched, settings=settings).look_at(still)
    return Place(
        moved_m=look.moved_m, is_sure=look.verdict is not Verdict.UNSURE, limit_m=settings.moved_share * watched.span_m
    )
