"""The appliance that held-out footage is judged with: its map and its track are those of the clip."""

import dataclasses

import numpy as np
import pytest

from dnb_edge.detect.onnx import load_builtin_model
from dnb_edge.train.footage import Conditions, film
from dnb_edge.train.held_out import ground_of, race_footage, setup_of

CONDITIONS = Conditions(camera_height_m=2.15, movers=0.0)


@pytest.fixture(scope="module")
def clip():
    """Twelve frames of a clip."""
    return list(film(3, frames=12, conditions=CONDITIONS))


def test_the_map_places_the_truth_where_it_is(clip):
    """The appliance's homography and the camera that filmed agree to a tenth of a millimetre, and the car is on the lane."""
    for frame in (clip[0], clip[-1]):
        setup = setup_of(frame)
        seen = ground_of(frame.view).point_to_track_m(frame.ground_px)
        assert seen is not None
        assert np.array(seen) - 50.0 == pytest.approx(frame.ground_m, abs=1e-4)
        _, d_m = setup.track.centreline.locate(np.array([seen]))
        assert abs(d_m[0]) < 0.01


def test_figures_tell_a_car_that_is_found_from_one_that_is_not(clip):
    """The true clip is found and nothing else; against a truth moved aside by two lengths, all of it is false."""
    good = race_footage(load_builtin_model(), [clip])
    assert good.recall_after_first > 0.8
    assert good.false_per_1000 == 0.0
    moved = [
        dataclasses.replace(one, ground_px=(one.ground_px[0] + 2 * one.length_px, one.ground_px[1])) for one in clip
    ]
    bad = race_footage(load_builtin_model(), [moved])
    assert bad.recall == 0.0
    assert bad.false_per_1000 > 800.0
    assert bad.error_p95_mm is None
