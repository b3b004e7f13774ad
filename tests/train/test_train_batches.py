"""Training windows: labels move with the picture, and targets mark what they should."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.detect.lean import lean_bytes
from dnb_edge.train.batches import CELL_PX, GRID, WINDOW_PX, make_window, moved_labels, targets_for
from dnb_edge.train.scene import SCENE_PX


@given(scale=st.floats(0.5, 2), turn=st.floats(-3, 3), mirror=st.booleans(), heading=st.floats(-3, 3))
def test_labels_move_as_the_picture_moves(scale, turn, mirror, heading):
    """A point ahead of the car stays ahead of it under scale, turn and mirror, and lengths scale."""
    flip = np.diag([-1.0 if mirror else 1.0, 1.0])
    linear = scale * np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]) @ flip
    transform = np.column_stack([linear, [5.0, -3.0]])
    label = np.array([[60.0, 70.0, 30.0, math.cos(heading), math.sin(heading), 1.0]], dtype=np.float32)
    out = moved_labels(label, transform)[0]
    ahead = linear @ (np.array([60.0, 70.0]) + 10 * np.array([math.cos(heading), -math.sin(heading)])) + transform[:, 2]
    assert out[:2] + 10 * scale * np.array([out[3], -out[4]]) == pytest.approx(ahead, abs=1e-3)
    assert out[2] == pytest.approx(30.0 * scale, rel=1e-5)


def test_a_window_shows_the_car_where_its_label_says():
    """A white disc on black, labelled: in every window the target's peak lies on the disc."""
    picture = np.zeros((2, SCENE_PX, SCENE_PX, 3), np.uint8)
    rows, columns = np.mgrid[0:SCENE_PX, 0:SCENE_PX]
    picture[0][np.hypot(columns - 110, rows - 90) < 6] = 255
    labels = np.array([[110.0, 90.0, 30.0, 1.0, 0.0, 1.0]], dtype=np.float32)
    seen = 0
    for seed in range(40):
        window, targets = make_window(picture, labels, np.random.default_rng(seed))
        peaks = np.argwhere(targets[0] >= 0.999)
        for row, column in peaks:
            u = (column + 0.5 + targets[2, row, column]) * CELL_PX - 0.5
            v = (row + 0.5 + targets[3, row, column]) * CELL_PX - 0.5
            bright = np.argwhere(window[:, :, :3].max(axis=2) > 140)
            if len(bright) and 8 < u < WINDOW_PX - 8 and 8 < v < WINDOW_PX - 8:
                assert (u, v) == pytest.approx(tuple(bright.mean(axis=0)[::-1]), abs=1.0)
                seen += 1
    assert seen > 20


def test_a_hidden_car_is_neither_asked_for_nor_punished():
    """A label of weight 0 makes no peak and takes its surroundings out of the loss."""
    targets = targets_for(np.array([[64.0, 64.0, 40.0, 1.0, 0.0, 0.0]], dtype=np.float32))
    assert targets[0].max() == 0.0
    assert targets[9, GRID // 2, GRID // 2] == 0.0
    assert targets[9, 0, 0] == 1.0


def test_the_difference_is_absent_in_part_of_the_windows():
    """In between a tenth and a half of the windows the fourth channel is all zero, so that the network can do without."""
    rng = np.random.default_rng(1)
    pictures = rng.integers(0, 255, (2, SCENE_PX, SCENE_PX, 3), dtype=np.uint8)
    labels = np.zeros((1, 6), np.float32)
    absent = sum(
        not make_window(pictures, labels, np.random.default_rng(seed))[0][:, :, 3].any() for seed in range(150)
    )
    assert 15 < absent < 75


@pytest.mark.parametrize("heading", [0.0, 0.7, -2.9])
def test_the_heading_is_told_as_axis_and_as_sense(heading):
    """The targets hold the doubled angle, which nose and tail share, and the angle itself, which tells them apart."""
    label = np.array([[64.0, 64.0, 40.0, math.cos(heading), math.sin(heading), 1.0]], dtype=np.float32)
    targets = targets_for(label)
    row, column = np.argwhere(targets[0] >= 0.999)[0]
    told = targets[5:9, row, column]
    wanted = (math.cos(2 * heading), math.sin(2 * heading), math.cos(heading), math.sin(heading))
    assert tuple(told) == pytest.approx(wanted, abs=1e-5)


def test_the_lean_turns_with_the_window():
    """What leans to the left in the sample leans to the right in a mirrored window, and up stays up; else it is not known."""
    pictures = np.zeros((2, SCENE_PX, SCENE_PX, 3), dtype=np.uint8)
    pictures[0, :, : SCENE_PX // 2] = 200  # bright on the left tells a mirrored window
    labels = np.zeros((1, 6), np.float32)
    lean = np.array([[0.0, 0.0, -0.6], [0.0, 0.0, -0.5]], dtype=np.float32)
    unknown = 0
    for seed in range(80):
        window, _ = make_window(pictures, labels, np.random.default_rng(seed), lean=lean)
        told = window[64, 64, 4:6].astype(int)
        if not told.any():
            unknown += 1
            continue
        bright = window[:, :, :3].max(axis=2).astype(float).mean(axis=0)
        if bright[:20].mean() == pytest.approx(bright[-20:].mean(), abs=5):
            continue
        mirrored = bright[:20].mean() < bright[-20:].mean()
        wanted = lean_bytes(np.array([0.6 if mirrored else -0.6, -0.5])).astype(int)
        assert np.abs(told - wanted).max() < 45  # windows are turned a little, and the lean is told a little wrong
    assert 10 < unknown < 50
