"""How the track's and the view's sections of a configuration become a track and a map from camera pixels to metres."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from dnb_edge.config.calibration_file import load_calibration
from dnb_edge.config.keypoints import load_yaml_pairs
from dnb_edge.config.schema import TrackConfig, ViewConfig
from dnb_edge.config.track_file import load_track
from dnb_edge.errors import InputError
from dnb_edge.track.build import TrackSettings, build_track
from dnb_edge.track.model import Track
from dnb_edge.track.scale import TwinScale
from dnb_edge.track.twin import Lane, LaneColour, load_twin
from dnb_edge.values import SourceInfo
from dnb_edge.view.calibration import Calibration, Covariance9
from dnb_edge.view.fit import fit_keypoints
from dnb_edge.view.ground import GroundMap
from dnb_edge.view.homography import CalibrationError, calibration_error, fit_ground_map
from dnb_edge.view.keypoints import KeypointPairs, load_npy_pairs


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
