"""What `calibrate refine` works on, from a configuration or from files: a calibration, its keypoints, the twin's lane."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dnb_edge.archive.coordinates import numbers
from dnb_edge.assembly import load_pairs, make_track
from dnb_edge.cli.calibration_out import input_file
from dnb_edge.config.calibration_file import load_calibration
from dnb_edge.config.keypoints import load_yaml_pairs
from dnb_edge.config.load import load_config
from dnb_edge.config.schema import Config
from dnb_edge.config.track_file import load_track
from dnb_edge.errors import InputError
from dnb_edge.track.lane_shade import LaneShade
from dnb_edge.track.model import Track
from dnb_edge.track.scale import TwinScale
from dnb_edge.track.twin import Lane, LaneColour, default_close_gap_px, lane_mask, load_twin
from dnb_edge.view.calibration import Calibration, CalibrationMethod
from dnb_edge.view.homography import calibration_error, fit_ground_map
from dnb_edge.view.keypoints import KeypointPairs, load_npy_pairs
from dnb_edge.view.refine_edges import LaneEdges, lane_edges, strip_mask


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RefineOptions:
    """The files and numbers that the command line names."""

    config: Path | None = None
    overrides: tuple[str, ...] = ()
    calibration: Path | None = None
    keypoints: Path | None = None
    """A YAML file of pairs."""
    camera: Path | None = None
    twin: Path | None = None
    """Pairs as two .npy files."""
    track: Path | None = None
    twin_image: Path | None = None
    lane_hsv: str | None = None
    lane: LaneShade | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RefineInputs:
    """A calibration to refine, with the files that it and the twin come from among its `inputs`."""

    calibration: Calibration
    pairs: KeypointPairs | None
    """Camera px of the calibration's size of picture."""
    edges: LaneEdges


def refine_inputs(options: RefineOptions, size_px: tuple[int, int]) -> RefineInputs:
    """All of it, from the configuration, or from the files where no configuration is given.

    `size_px` is the picture's width and height: the clicks' where nothing else says it. Raises `InputError` naming the option
    or file at fault.
    """
    if (options.config is None) == (options.calibration is None):
        raise InputError(
            "calibrate refine: give --config, or --calibration with --twin-image and --lane-hsv, or --track"
        )
    if options.config is not None:
        return _from_config(options, load_config(options.config, options.overrides), size_px)
    assert options.calibration is not None
    if options.overrides:
        raise InputError("--set: changes a configuration; give --config")
    given = load_calibration(options.calibration)
    edges, files = _edges(options, given.ground.scale)
    pairs = _pairs(options)
    used = [options.calibration, *files, *_given(options.keypoints, options.camera, options.twin)]
    return _checked(given, None if pairs is None else _on(pairs, given), edges, used)


def _from_config(options: RefineOptions, config: Config, size_px: tuple[int, int]) -> RefineInputs:
    drawn = (options.track, options.twin_image, options.lane_hsv, options.lane)
    other = _given(options.keypoints, options.camera, options.twin, *drawn)
    view = config.view
    if other and view.calibration is None:
        raise InputError(f"--config: names the keypoints and the twin; leave {other[0]} out")
    track = make_track(config.track)
    edges, files = _edges_of_config(config, track)
    if view.calibration is not None:
        given = load_calibration(view.calibration)
        if given.ground.scale.height_px != track.scale.height_px:
            raise InputError(f"{view.calibration}: made for another twin: calibrate again with this track's")
        pairs = _pairs(options)
        used = [view.calibration, *files, *_given(options.keypoints, options.camera, options.twin)]
        return _checked(given, None if pairs is None else _on(pairs, given), edges, used)
    pairs = load_pairs(view)
    width_px, height_px = view.image_size_px or pairs.image_size_px or size_px
    ground = fit_ground_map(pairs, track.scale, width_px=width_px, height_px=height_px)
    given = Calibration(
        ground=ground,
        covariance=None,
        error=calibration_error(pairs, metres_per_px=track.scale.metres_per_px),
        method=CalibrationMethod.KEYPOINTS,
    )
    used = [*files, *_given(view.keypoints, view.keypoints_camera, view.keypoints_twin)]
    return _checked(given, pairs, edges, used)


def _checked(given: Calibration, pairs: KeypointPairs | None, edges: LaneEdges, used: list[Path]) -> RefineInputs:
    if pairs is None and given.method is CalibrationMethod.REFINED:
        raise InputError(
            f"{used[0]}: is refined already, the same edges would count twice: give the calibration that it was made of, or "
            "its keypoints too"
        )
    kept = {one.sha256: one for one in (*given.inputs, *map(input_file, used))}
    return RefineInputs(calibration=replace(given, inputs=tuple(kept.values())), pairs=pairs, edges=edges)


def _pairs(options: RefineOptions) -> KeypointPairs | None:
    if options.keypoints is not None:
        if options.camera is not None or options.twin is not None:
            raise InputError("--keypoints: give it or --camera and --twin, not both")
        return load_yaml_pairs(options.keypoints)
    if options.camera is None and options.twin is None:
        return None
    if options.camera is None or options.twin is None:
        raise InputError("--camera, --twin: give both (.npy), or --keypoints (.yaml)")
    return load_npy_pairs(options.camera, options.twin)


def _on(pairs: KeypointPairs, calibration: Calibration) -> KeypointPairs:
    """The pairs in camera px of the calibration's size of picture; where they say none, they are."""
    ground = calibration.ground
    if pairs.image_size_px is None:
        return pairs
    width_px, height_px = pairs.image_size_px
    across, down = ground.width_px / width_px, ground.height_px / height_px
    if abs(across / down - 1.0) > 0.01:
        raise InputError(
            f"{pairs.source}: clicked on {width_px}x{height_px}, the calibration is for {ground.width_px}x{ground.height_px}: "
            "give the keypoints that it was made from"
        )
    points = (pairs.camera_array() * (across, down)).tolist()
    return replace(
        pairs,
        camera_px=tuple((u, v) for u, v in points),
        image_size_px=(ground.width_px, ground.height_px),
    )


def _edges(options: RefineOptions, scale: TwinScale) -> tuple[LaneEdges, list[Path]]:
    if options.track is not None:
        if _given(options.twin_image, options.lane_hsv, options.lane):
            raise InputError("--track: give it or --twin-image with --lane-hsv or --lane, not both")
        track = load_track(options.track)
        if track.scale.height_px != scale.height_px:
            raise InputError(f"{options.track}: another twin than the calibration's: calibrate again with this track's")
        return _edges_of_track(track, options.track), [options.track]
    if options.twin_image is None or (options.lane_hsv is None) == (options.lane is None):
        raise InputError(
            "calibrate refine: give --twin-image with --lane-hsv or --lane, or --track: the lane as it is drawn"
        )
    lane: Lane
    if options.lane is not None:
        lane = options.lane
    else:
        assert options.lane_hsv is not None
        lane = _colour(numbers("--lane-hsv", options.lane_hsv, 3))
    return _edges_of_image(options.twin_image, lane, None, scale), [options.twin_image]


def _edges_of_config(config: Config, track: Track) -> tuple[LaneEdges, list[Path]]:
    wanted = config.track
    if wanted.file is not None:
        return _edges_of_track(track, wanted.file), [wanted.file]
    assert wanted.image is not None, "the schema wants it"
    if wanted.lane is not None:
        return _edges_of_image(wanted.image, wanted.lane, wanted.close_gap_px, track.scale), [wanted.image]
    assert wanted.lane_hsv is not None, "the schema wants one of the two"
    return _edges_of_image(wanted.image, _colour(wanted.lane_hsv), wanted.close_gap_px, track.scale), [wanted.image]


def _colour(hsv: tuple[float, ...]) -> LaneColour:
    hue, saturation, value = hsv
    return LaneColour(hue_deg=hue, saturation_percent=saturation, value_percent=value)


def _edges_of_image(path: Path, lane: Lane, close_gap_px: float | None, scale: TwinScale) -> LaneEdges:
    image = load_twin(path)
    if image.shape[0] != scale.height_px:
        raise InputError(
            f"{path}: {image.shape[0]} px high, the calibration's twin is {scale.height_px:g}: give the twin it was made with"
        )
    gap_px = default_close_gap_px(image) if close_gap_px is None else close_gap_px
    return lane_edges(lane_mask(image, lane, source=str(path), close_gap_px=gap_px), source=str(path))


def _edges_of_track(track: Track, path: Path) -> LaneEdges:
    line = track.centreline
    points = line.points_m
    around = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    along = around if line.closed else np.gradient(points, axis=0)
    left = np.column_stack((-along[:, 1], along[:, 0])) / np.linalg.norm(along, axis=1)[:, None]
    mask = strip_mask(
        points + line.half_left_m[:, None] * left,
        points - line.half_right_m[:, None] * left,
        track.scale,
        closed=line.closed,
    )
    return lane_edges(mask, source=str(path))


def _given(*items: Path | str | None) -> list[Path]:
    return [Path(item) for item in items if item is not None]
