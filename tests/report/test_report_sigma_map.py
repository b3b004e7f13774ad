"""The map of the position's sigma."""

import cv2
import numpy as np
import pytest

from dnb_edge.report.sigma_map import SigmaMap, sigma_map_picture
from dnb_edge.sim.circuit import TWIN_SCALE, demo_twin
from dnb_edge.sim.clicks import calibrated, clicked_places, scenes
from dnb_edge.view.keypoints import KeypointPairs

LOW, BENT = scenes()[1], scenes()[3]


def drawn(scene, **options):
    marks = clicked_places(12)
    clicks = scene.picture_px(marks) + np.random.default_rng(1).normal(0, 1.5, marks.shape)
    pairs = KeypointPairs.from_arrays(clicks, TWIN_SCALE.to_twin_px(marks), source="k")
    calibration = calibrated(scene, clicks, TWIN_SCALE.to_twin_px(marks)).calibration
    wanted = SigmaMap(calibration=calibration, pairs=pairs, **options)
    return cv2.imdecode(np.frombuffer(sigma_map_picture(wanted), np.uint8), cv2.IMREAD_COLOR), wanted


def share(picture, *, red):
    b, g, r = (picture[..., k].astype(int) for k in range(3))
    return float(((r > 150) & (b < 90) & (g < 90)).mean()) if red else float((picture.std(axis=2) > 12).mean())


@pytest.mark.parametrize("scene", [LOW, BENT], ids=["low", "lens"])
def test_over_twin_and_picture(scene):
    """A slanting camera with the horizon in its picture, and one with a lens: colours on both panels, none beyond the floor."""
    camera = np.full((720, 1280, 3), 128, np.uint8)
    both, _ = drawn(scene, twin=demo_twin(), picture=camera)
    one, _ = drawn(scene, twin=demo_twin())
    half = both.shape[1] // 2
    assert share(one, red=False) > 0.25
    assert share(both[:, :half], red=False) > 0.2
    assert 0.05 < share(both[:, half:], red=False) < 0.9


def test_wrong_keypoints_are_red():
    """Outliers stand out, sound keypoints are ink."""
    sound, _ = drawn(LOW)
    wrong, _ = drawn(LOW, wrong=("3",))
    assert share(sound, red=True) < 2e-5
    assert share(wrong, red=True) > 1e-4


def test_the_same_calibration_gives_the_same_file():
    """Neither date nor chance gets into it."""
    _, wanted = drawn(LOW, twin=demo_twin())
    for form in ("png", "svg"):
        assert sigma_map_picture(wanted, picture_format=form) == sigma_map_picture(wanted, picture_format=form)
