"""A still picture is looked at as the appliance looks at a still scene."""

import math

import numpy as np
import pytest

from dnb_edge.detect.centre import CentreDetector, CentreDetectorSettings
from dnb_edge.detect.onnx import load_builtin_model
from dnb_edge.detect.still import frames_of_a_round, look_at_still
from dnb_edge.sim.rig import Rig


@pytest.mark.parametrize(("size", "frames"), [((320, 240), 1), ((640, 480), 6), ((1280, 720), 15), ((3840, 2160), 15)])
def test_a_round_looks_at_every_fine_tile(size, frames):
    """As many frames as there are tiles; beyond the fine width they depend on the picture's shape, not on its resolution."""
    settings = CentreDetectorSettings(tile_px=(320, 256), fine_width_px=1280, overlap_px=16)
    assert frames_of_a_round(*size, settings) == frames


def test_nothing_that_the_detector_reports_is_lost():
    """Each detection of each frame of a round is among the finds or beside a better one, and the same twice."""
    rig = Rig(seed=1, laps=1)
    image = rig.frame(30).bgr[:360, :640]
    network, settings = load_builtin_model(), CentreDetectorSettings(acquire_confidence=0.05)
    finds = look_at_still(network, image, settings)
    detector = CentreDetector(network, settings)
    for turn in range(frames_of_a_round(640, 360, settings)):
        for one in detector.detect(image, sequence=turn, t_ns=turn, windows=()).detections:
            near = [find for find in finds if math.dist(find.camera_px, one.camera_px) <= 0.4 * find.length_px]
            assert one in finds or near
    assert finds == look_at_still(network, np.array(image), settings)
