"""Clutter: it stands on the floor, is closed and wound outwards, and is the same for a seed."""

import numpy as np
import pytest

from dnb_edge.train.clutter import MOVING, STATIC, any_mover, any_static
from dnb_edge.train.clutter_shapes import grounded

KINDS = sorted({make for make, _ in STATIC + MOVING}, key=lambda make: make.__name__)


@pytest.mark.parametrize("make", KINDS, ids=lambda make: make.__name__)
def test_a_thing_is_finite_closed_wound_outwards_and_near_the_origin(make):
    """Every face of every solid looks away from its middle (else it is not drawn); sizes fit rooms."""
    for seed in range(12):
        thing = grounded(make(np.random.default_rng(seed)))
        for solid in thing:
            assert np.isfinite(solid.vertices_m).all()
            assert np.abs(solid.vertices_m).max() < 2.5
            assert solid.vertices_m[:, 2].min() > -1e-9
            middle = solid.vertices_m.mean(axis=0)
            for face in solid.faces:
                a, b, c = solid.vertices_m[list(face[:3])]
                assert np.cross(b - a, c - a) @ (a - middle) > -1e-12
            for colour in (solid.colour, *(solid.face_colours or ())):
                assert min(colour) >= 0
                assert max(colour) <= 255


@pytest.mark.parametrize("make", [any_static, any_mover])
def test_things_stand_on_the_floor_and_repeat_by_seed(make):
    """Whatever is picked has no corner below z = 0 and is the same for the same seed."""
    for seed in range(60):
        thing, again = make(np.random.default_rng([seed])), make(np.random.default_rng([seed]))
        assert min(solid.vertices_m[:, 2].min() for solid in thing) > -1e-9
        assert len(thing) == len(again)
        for one, other in zip(thing, again, strict=True):
            assert np.array_equal(one.vertices_m, other.vertices_m)
            assert (one.colour, one.face_colours) == (other.colour, other.face_colours)
