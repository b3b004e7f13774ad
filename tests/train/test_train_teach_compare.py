"""Before and after: what counts as found, and what counts as worse."""

from dataclasses import replace

import numpy as np
import pytest

from dnb_edge.detect.onnx import load_builtin_model
from dnb_edge.errors import InputError
from dnb_edge.train.teach import check_torch
from dnb_edge.train.teach_compare import Figures, HeldOutDrive, figures, worse
from dnb_edge.train.teach_compare import _matched as matched
from dnb_edge.train.teach_drive import Shot
from dnb_edge.train.teach_labels import CarLabel, LabelledPicture
from dnb_edge.values import Detection

GOOD = Figures(
    cars=100,
    recall=0.9,
    precision=0.9,
    recall_at_no_false=0.8,
    error_p50_px=3.0,
    error_p95_px=8.0,
    followed=0.98,
    follow_error_p50_px=2.0,
    follow_error_p95_px=5.0,
)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({}, None),
        ({"recall": 0.897}, None),
        ({"recall": 0.89}, "recall 0.900 -> 0.89"),
        ({"precision": 0.85}, "precision"),
        ({"recall_at_no_false": 0.7}, "recall_at_no_false"),
        ({"error_p95_px": 8.3}, None),
        ({"error_p95_px": 9.0}, "error_p95_px 8.00 -> 9.0"),
        ({"recall": 0.95, "error_p95_px": 9.0}, None),
        ({"recall": 0.95, "follow_error_p95_px": 9.0}, "follow_error_p95_px"),
        ({"followed": 0.9}, "followed"),
        ({"error_p50_px": None}, "error_p50_px 3.00 -> None"),
    ],
)
def test_what_is_worse(change, says):
    """Less recall or precision and larger errors are worse; a trifle is not, nor the errors of cars newly found."""
    reasons = worse(GOOD, replace(GOOD, **change))
    assert [reason.startswith(says) for reason in reasons] == ([] if says is None else [True])


def test_what_was_not_measured_before_is_not_worse():
    """Without drives nothing is said of following."""
    still = replace(GOOD, followed=None, follow_error_p50_px=None, follow_error_p95_px=None)
    assert worse(still, still) == []


def _find(u, confidence, v=10.0):
    return Detection(camera_px=(u, v), sigma_px=1.0, length_px=10.0, confidence=confidence)


def test_each_car_is_found_once_and_doubtful_ones_hide_theirs():
    """The surer of two finds on one car is right and the other false; one on a doubtful car is neither."""
    cars = (
        CarLabel(ground_px=(10.0, 10.0), length_px=10.0),
        CarLabel(ground_px=(50.0, 10.0), length_px=10.0, sure=False),
    )
    finds = matched([_find(12.0, 0.5), _find(11.0, 0.9), _find(52.0, 0.8), _find(90.0, 0.7)], cars)
    assert [(find.confidence, find.error_px) for find in finds] == [(0.9, pytest.approx(1.0)), (0.7, None), (0.5, None)]


def test_a_bare_picture_has_no_recall_and_no_error():
    """The shipped model on grey pictures and a grey drive: nothing found, nothing followed, no number made up."""
    grey = np.full((240, 320, 3), 120, np.uint8)
    car = (CarLabel(ground_px=(100.0, 100.0), length_px=30.0),)
    picture = LabelledPicture(name="grey", bgr=grey, background=None, cars=car)
    drive = HeldOutDrive(
        drive=lambda: (Shot(number=n, t_s=n / 30, bgr=grey) for n in range(4)), first=1, cars={2: car, 3: car}
    )
    found = figures(load_builtin_model(), [picture], [drive])
    assert (found.cars, found.recall, found.error_p50_px, found.followed) == (1, 0.0, None, 0.0)


@pytest.mark.parametrize("missing", ["torch", "onnx"])
def test_without_the_extra_one_line_says_what_to_install(monkeypatch, missing):
    """Without PyTorch or onnx the command that installs them is told."""
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == missing else object())
    with pytest.raises(InputError, match=rf"needs {missing}: pip install 'dnb-edge\[train\]'"):
        check_torch()
