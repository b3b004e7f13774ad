"""Calibration boards: their descriptions, and corners found in drawn pictures."""

import numpy as np
import pytest
from board_pictures import Studio, poses

from dnb_edge.errors import InputError
from dnb_edge.view.boards import BoardKind, find_board, parse_board

MATRIX = [[500.0, 0, 322], [0, 501.0, 238], [0, 0, 1]]
BENT = [-0.2, 0.05, 0.0, 0.0, 0.0]
SIZE = (640, 480)


@pytest.mark.parametrize(
    ("text", "kind", "corners", "square_m", "marker_m", "again"),
    [
        ("chessboard:7x10:15mm", "chessboard", (7, 10), 0.015, None, "chessboard:7x10:15mm"),
        ("chessboard:9X6:2.5cm", "chessboard", (9, 6), 0.025, None, "chessboard:9x6:25mm"),
        ("charuco:5x7:30mm:22mm", "charuco", (4, 6), 0.03, 0.022, "charuco:5x7:30mm:22mm:DICT_5X5_100"),
        ("charuco:8x5:0.04m:.03m:4x4_50", "charuco", (7, 4), 0.04, 0.03, "charuco:8x5:40mm:30mm:DICT_4X4_50"),
    ],
)
def test_a_board_in_words(text, kind, corners, square_m, marker_m, again):
    """Each description gives the board, and the board its description; lengths are in any unit."""
    board = parse_board(text)
    assert board.kind is BoardKind(kind)
    assert board.corners_across == corners
    assert (board.square_m, board.marker_m) == pytest.approx((square_m, marker_m))
    assert str(board) == again
    assert parse_board(again) == board
    assert board.points_m.shape == (corners[0] * corners[1], 2)
    assert np.linalg.norm(board.points_m[1] - board.points_m[0]) == pytest.approx(square_m)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "write chessboard:7x10:15mm"),
        ("chess:7x10:15mm", "write chessboard:7x10:15mm"),
        ("chessboard:7x10", "write chessboard:7x10:15mm"),
        ("chessboard:7x10:15mm:22mm", "write chessboard:7x10:15mm"),
        ("charuco:5x7:30mm", "or charuco:5x7:30mm:22mm"),
        ("chessboard:7:15mm", "'7' is no count of inner corners"),
        ("chessboard:2x10:15mm", "must have 3 to 60 inner corners either way"),
        ("chessboard:7x99:15mm", "must have 3 to 60 inner corners either way"),
        ("chessboard:7x10:15", "'15' is no length"),
        ("chessboard:7x10:0mm", "'0mm' is no length"),
        ("chessboard:7x10:15in", "write it with its unit"),
        ("charuco:5x7:30mm:30mm", "must be smaller than the squares"),
        ("charuco:5x7:30mm:22mm:DICT_9X9", "there is no dictionary DICT_9X9"),
        ("charuco:20x20:30mm:22mm:4X4_50", "needs 200 markers, DICT_4X4_50 holds 50"),
    ],
)
def test_boards_that_are_none(text, message):
    """Every mistake in a description is named, in one line."""
    with pytest.raises(InputError) as caught:
        parse_board(text)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["chessboard:7x10:15mm", "charuco:5x7:30mm:22mm", "charuco:6x8:25mm:18mm:4X4_50"])
def test_corners_to_a_fraction_of_a_pixel(text):
    """In drawn pictures with noise, corners are within 0.2 px of the truth and a twentieth of a pixel on average."""
    board = parse_board(text)
    studio = Studio(board, MATRIX, BENT, SIZE)
    found = 0
    for seed, pose in enumerate(poses(board, 4, distance_m=0.42, aside=0.15)):
        truth = studio.project(board.points_m, *pose)
        sight = find_board(board, studio.picture(*pose, seed=seed))
        if sight is None:
            continue
        found += 1
        ways = (
            (truth, truth[::-1]) if board.kind is BoardKind.CHESSBOARD else (truth,)
        )  # turned by half it looks the same
        off = min((np.linalg.norm(sight.camera_px - way[sight.ids], axis=1) for way in ways), key=np.max)
        assert off.max() < 0.2
        assert off.mean() < 0.06
    assert found >= 3


def test_a_quick_look_finds_the_same_corners():
    """`quick` searches a reduced picture and gives the corners of the whole one."""
    board = parse_board("chessboard:7x5:25mm")
    studio = Studio(board, [[1000.0, 0, 645], [0, 1003.0, 352], [0, 0, 1]], BENT, (1280, 720))
    (pose,) = poses(board, 1, distance_m=0.4, aside=0.1)
    picture = studio.picture(*pose)
    slow, quick = find_board(board, picture), find_board(board, picture, quick=True)
    assert np.abs(slow.camera_px - quick.camera_px).max() < 0.02


def test_a_charuco_board_half_hidden():
    """A hand over part of the board takes those corners away; the others keep their numbers and places."""
    board = parse_board("charuco:5x7:30mm:22mm")
    studio = Studio(board, MATRIX, BENT, SIZE)
    (pose,) = poses(board, 1, distance_m=0.42, aside=0.0)
    picture = studio.picture(*pose)
    truth = studio.project(board.points_m, *pose)
    hidden = truth[:, 1] > np.median(truth[:, 1])
    picture[int(truth[hidden, 1].min()) - 5 :] = 140
    sight = find_board(board, picture)
    assert 6 <= len(sight.ids) <= 16
    assert np.linalg.norm(sight.camera_px - truth[sight.ids], axis=1).max() < 0.3


def test_no_board_is_no_board():
    """An empty picture, another board and too few corners give none."""
    board, charuco = parse_board("chessboard:7x10:15mm"), parse_board("charuco:5x7:30mm:22mm")
    empty = np.full((480, 640), 128, dtype=np.uint8)
    assert find_board(board, empty) is find_board(charuco, empty) is None
    (pose,) = poses(charuco, 1, distance_m=0.42, aside=0.0)
    picture = Studio(charuco, MATRIX, BENT, SIZE).picture(*pose)
    assert find_board(board, picture) is None
    truth = Studio(charuco, MATRIX, BENT, SIZE).project(charuco.points_m, *pose)
    picture[int(truth[:, 1].min()) + 25 :] = 140
    assert find_board(charuco, picture) is None
