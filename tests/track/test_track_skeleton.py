"""Thinning keeps what counts: the lanes' loops and branches."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from twin_pictures import figure_eight, ring, theta

from dnb_edge.track.skeleton import thin

MASKS = hnp.arrays(bool, st.tuples(st.integers(1, 14), st.integers(1, 14)), elements=st.booleans())


def pieces(mask, connectivity):
    return cv2.connectedComponents(np.pad(mask, 1).astype(np.uint8), connectivity=connectivity)[0]


@given(MASKS)
def test_thinning_keeps_pieces_and_holes(mask):
    """No shape loses a piece or a hole, gains one, or grows a pixel."""
    skeleton = thin(mask)
    assert not (skeleton & ~mask).any()
    assert pieces(skeleton, 8) == pieces(mask, 8)
    assert pieces(~np.pad(skeleton, 1), 4) == pieces(~np.pad(mask, 1), 4)


@given(MASKS)
def test_a_skeleton_is_its_own_skeleton(mask):
    """Thinning ends only when there is nothing left to take."""
    skeleton = thin(mask)
    assert np.array_equal(thin(skeleton), skeleton)


@pytest.mark.parametrize("draw", [ring, theta, figure_eight])
def test_a_lane_thins_to_a_line_in_its_middle(draw):
    """Away from forks the skeleton is one pixel wide and half a lane from the edge."""
    mask = draw()
    skeleton = thin(mask)
    radius = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 5)
    blocks = cv2.filter2D(skeleton.astype(np.uint8), -1, np.ones((2, 2)), borderType=cv2.BORDER_CONSTANT)
    assert np.count_nonzero(blocks == 4) <= 4
    usual = np.median(radius[skeleton])
    assert np.mean(abs(radius[skeleton] - usual) < 1.6) > 0.8


def test_a_lane_at_the_pictures_edge_thins_like_any_other():
    """What lies beyond the picture is not lane."""
    assert np.count_nonzero(thin(np.ones((30, 9), dtype=bool))) < 40
