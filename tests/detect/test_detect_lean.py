"""The lean as bytes for looks: the right place of the frame, whatever the look's size."""

import numpy as np
import pytest

from dnb_edge.detect.lean import LeanMap, lean_bytes
from dnb_edge.detect.looks import whole_look, window_look


def _field(points):
    """Leans from -0.5 at the left to 0.5 at the right, and from -0.8 at the top to 0 at the bottom, of 1280x720."""
    return np.column_stack([points[:, 0] / 1280 - 0.5, 0.8 * points[:, 1] / 720 - 0.8])


@pytest.mark.parametrize("lean", [-1.6, -0.5, 0.0, 0.01, 1.2, 1.6])
def test_known_leans_are_never_the_byte_of_the_unknown(lean):
    """Every lean gets a byte from 1 to 255 that tells it to a hundredth; zero is kept for not known."""
    byte = int(lean_bytes(np.array(lean)))
    assert 1 <= byte <= 255
    assert (byte - 128) / 80 == pytest.approx(lean, abs=0.0126)


@pytest.mark.parametrize("centre", [(100.0, 100.0), (640.0, 360.0), (1270.0, 715.0)])
def test_a_window_is_told_the_lean_at_its_middle(centre):
    """One lean all over, that of the frame's place, also where the window sticks out."""
    look = window_look(centre, 60.0, window_px=128, window_length_px=44.0)
    told = LeanMap(_field, 1280, 720).at_middle(look)
    assert told.shape == (128, 128, 2)
    assert (told == told[0, 0]).all()
    assert np.abs(told[0, 0].astype(int) - lean_bytes(_field(np.array([centre]))[0]).astype(int)).max() <= 2


def test_the_whole_frame_is_told_the_lean_of_each_place():
    """The large look's planes follow the field across the frame, and a second asking gives the same object."""
    lean_map = LeanMap(_field, 1280, 720)
    look = whole_look(1280, 720, 448)
    told = lean_map.over(look)
    assert told.shape == (252, 448, 2)
    for u, v in ((20, 20), (224, 126), (430, 240)):
        wanted = lean_bytes(_field(np.array([look.to_frame(u, v)]))[0]).astype(int)
        assert np.abs(told[v, u].astype(int) - wanted).max() <= 2
    assert lean_map.over(look) is told
