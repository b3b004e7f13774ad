"""How the detector's section of a configuration becomes a detector."""

from __future__ import annotations

from pathlib import Path

from dnb_edge.config.schema import Config, DetectorConfig, MarkersConfig
from dnb_edge.detect.centre import CentreDetector
from dnb_edge.detect.lean import LeanField
from dnb_edge.detect.markers import MarkerDetector, MarkerSettings
from dnb_edge.detect.onnx import OpenModel, default_model_path, load_model, open_model
from dnb_edge.detect.protocol import Detector
from dnb_edge.detect.ultralytics import UltralyticsDetector, UltralyticsSettings
from dnb_edge.detect.ultralytics_file import is_ultralytics
from dnb_edge.errors import InputError
from dnb_edge.view.ground import GroundMap
from dnb_edge.view.lean import floor_lean


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
