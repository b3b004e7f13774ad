"""The shipped model on real footage that it has never learnt from: figures to hold."""

import math

import cv2
import numpy as np
import pytest

from dnb_edge.detect.onnx import load_builtin_model
from dnb_edge.train.evaluate import clip_frames, clip_truth, find_in_photo, follow_clip


@pytest.mark.parametrize("clip", ["driven-lap", "driven-lap-disturbed"])
def test_the_driven_clip_is_carried(real_dir, clip):
    """Acquired within 8 frames, found in 98 % of all, within 14 px in 95 % of them, and never another thing."""
    folder = real_dir / "drivenetbench"
    frames, truth = clip_frames(folder / f"{clip}.mp4"), clip_truth(folder / f"{clip}.truth.json")
    result, chosen = follow_clip(load_builtin_model(), frames, truth)
    assert result.acquired_at is not None
    assert result.acquired_at <= 8
    assert result.found_fraction >= 0.98
    assert result.within_14px_fraction >= 0.95
    assert result.error_p95_px <= 9.0
    elsewhere = [number for number, one in enumerate(chosen) if one and math.dist(one.camera_px, truth[number]) > 40]
    assert len(elsewhere) <= 3


def test_the_robot_is_found_in_the_photograph(real_dir):
    """In one picture, with no background at all, the robot is the first detection, within 35 px at 3840 px width."""
    photo = cv2.imread(str(real_dir / "drivenetbench" / "photo.jpg"))
    found = find_in_photo(load_builtin_model(), np.asarray(photo, dtype=np.uint8))
    assert math.dist(found[0].camera_px, (2807.0, 645.0)) < 35.0
