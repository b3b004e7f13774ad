"""Which detector a configuration means, and what it may not say."""

import dataclasses
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ultralytics_graph import metadata, write_constant

from dnb_edge.assembly import check_detector, make_detector
from dnb_edge.config.load import check_config
from dnb_edge.config.schema import Config, DetectorConfig, MarkersConfig
from dnb_edge.detect.centre import CentreDetector
from dnb_edge.detect.markers import MarkerDetector, MarkerSettings
from dnb_edge.detect.onnx import default_model_path
from dnb_edge.detect.ultralytics import UltralyticsDetector, UltralyticsSettings
from dnb_edge.errors import InputError


@pytest.fixture(scope="module")
def models(tmp_path_factory) -> Path:
    """`ours.onnx` with its card, `lost.onnx` without, `theirs.onnx` as Ultralytics exports one, and `other.onnx`."""
    folder = tmp_path_factory.mktemp("models")
    for suffix in (".onnx", ".json"):
        shutil.copy(default_model_path().with_suffix(suffix), folder / f"ours{suffix}")
    shutil.copy(default_model_path(), folder / "lost.onnx")
    answer = np.array([[[30], [40], [20], [10], [0.9], [0.1], [0.1]]], np.float32)
    write_constant(folder / "theirs.onnx", answer, metadata())
    write_constant(folder / "other.onnx", answer, {"author": "somebody"})
    return folder


def _config(models: Path, **detector: Any) -> Config:
    rest = {"track": {"file": "track.json"}, "view": {"keypoints": "points.yaml"}}
    return check_config(rest | {"detector": detector}, base=models)


@pytest.mark.parametrize(
    ("said", "kind"),
    [
        ({}, CentreDetector),
        ({"kind": "centre"}, CentreDetector),
        ({"model": "ours.onnx"}, CentreDetector),
        ({"model": "theirs.onnx"}, UltralyticsDetector),
        ({"kind": "ultralytics", "model": "theirs.onnx"}, UltralyticsDetector),
        ({"model": "theirs.onnx", "classes": ["car", 2], "shift_ratio": 0.3}, UltralyticsDetector),
        ({"kind": "markers"}, MarkerDetector),
        ({"kind": "markers", "markers": {"dictionary": "APRILTAG_36h11", "ids": [3]}}, MarkerDetector),
    ],
)
def test_the_model_file_tells_the_detector(models, said, kind):
    """A card beside it makes a model ours, Ultralytics' metadata one of theirs; without a model it is the built-in one."""
    assert type(make_detector(_config(models, **said))) is kind


@pytest.mark.parametrize(
    "said",
    [
        {"kind": "ultralytics"},
        {"kind": "markers", "model": "none.onnx"},
        {"kind": "markers", "markers": {"ids": [77]}},
        {"kind": "markers", "markers": {"dictionary": "9X9"}},
        {"kind": "centre", "model": "none.onnx", "classes": ["car"]},
        {"markers": {"ids": [1]}},
        {"iou": 0.3},
    ],
)
def test_a_contradiction_shows_without_the_models_file(models, said):
    """`config check` finds what contradicts itself, and asks for no file of a model."""
    with pytest.raises(InputError, match=r"detector\."):
        check_detector(_config(models, **said).detector)


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ({"model": "lost.onnx"}, r"lost\.onnx: neither one of our models \(its card lost\.json is not beside it\) nor"),
        ({"model": "other.onnx"}, r"other\.onnx: neither one of our models"),
        ({"model": "none.onnx"}, r"none\.onnx: the model cannot be read"),
        ({"kind": "ultralytics"}, r"detector\.model: the detector `ultralytics` needs a model"),
        ({"kind": "ultralytics", "model": "ours.onnx"}, r"ours\.onnx: its metadata does not say that Ultralytics"),
        ({"kind": "centre", "model": "theirs.onnx"}, r"theirs\.json: the model's card cannot be read"),
        ({"kind": "markers", "model": "ours.onnx"}, r"detector\.model: the detector `markers` uses no model"),
        ({"classes": ["car"]}, r"detector\.classes: only for a model that Ultralytics exported"),
        ({"model": "ours.onnx", "shift_ratio": 0.1}, r"detector\.shift_ratio: only for"),
        ({"kind": "markers", "iou": 0.3}, r"detector\.iou: only for"),
        ({"markers": {"ids": [1]}}, r"detector\.markers: only for the detector `markers`"),
        ({"kind": "markers", "markers": {"ids": [77]}}, r"detector\.markers\.ids: 77 is not a marker of 4X4_50"),
        ({"model": "theirs.onnx", "classes": ["lorry"]}, r"detector\.classes: 'lorry' is no class of"),
        ({"kind": "yolo"}, r"detector\.kind"),
        ({"min_confidence": 2}, r"detector\.min_confidence"),
    ],
)
def test_what_cannot_be_meant_is_refused(models, said, message):
    """Each contradiction is one line that names the file or the key."""
    with pytest.raises(InputError, match=message) as caught:
        make_detector(_config(models, **said))
    assert "\n" not in str(caught.value)


def test_settings_reach_the_detector(models):
    """What the configuration says is what the detector goes by."""
    said = {"classes": ["car", 2], "min_confidence": 0.4, "iou": 0.5, "shift_ratio": 0.25, "sigma_ratio": 0.1}
    detector = make_detector(_config(models, model="theirs.onnx", **said))
    assert isinstance(detector, UltralyticsDetector)
    assert detector._settings == UltralyticsSettings(**(said | {"classes": ("car", 2)}))


@pytest.mark.parametrize(
    ("section", "settings", "left_out"),
    [(DetectorConfig, UltralyticsSettings, {"most_detections"}), (MarkersConfig, MarkerSettings, set())],
)
def test_configuration_and_detector_agree_on_defaults(section, settings, left_out):
    """Keys that are written in both places have the same default in both."""
    defaults = {field.name: field.default for field in dataclasses.fields(settings) if field.name not in left_out}
    assert {name: section.model_fields[name].default for name in defaults} == defaults
