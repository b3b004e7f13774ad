"""The printed board: to scale on paper, and found by the same code that will look for it in photographs."""

import io

import cv2
import numpy as np
import pytest

from dnb_edge.errors import InputError
from dnb_edge.report.lens import lens_picture
from dnb_edge.report.lens_sheet import board_figure, board_sheet
from dnb_edge.view.boards import BoardSight, find_board, parse_board
from dnb_edge.view.lens_fit import LensView, fit_lens

DPI = 150


def scanned(board, paper):
    """The page as a scanner would see it, grey."""
    stream = io.BytesIO()
    board_figure(board, paper).savefig(stream, format="png", dpi=DPI)
    return cv2.imdecode(np.frombuffer(stream.getvalue(), dtype=np.uint8), cv2.IMREAD_GRAYSCALE)


@pytest.mark.parametrize("paper", ["a4", "letter"])
@pytest.mark.parametrize(
    "text", ["chessboard:7x10:18mm", "chessboard:8x5:20mm", "charuco:5x7:30mm:22mm", "charuco:6x8:25mm:18mm:4X4_50"]
)
def test_a_printed_board_is_found_to_scale(text, paper):
    """Every corner of the scanned page is found, as far from the next as the board says, to the scan's pixel (0.17 mm)."""
    board = parse_board(text)
    sight = find_board(board, scanned(board, paper))
    assert len(sight.ids) == len(board.points_m)
    found_mm = sight.camera_px / DPI * 25.4
    truth_mm = 1000 * board.points_m
    for a, b in ((0, -1), (0, board.corners_across[0] - 1)):
        apart = np.linalg.norm(found_mm[a] - found_mm[b])
        assert apart == pytest.approx(np.linalg.norm(truth_mm[a] - truth_mm[b]), abs=0.2)


def test_the_same_board_gives_the_same_file():
    """A PDF, the same bytes each time; what does not fit on the paper is refused."""
    board = parse_board("chessboard:7x10:15mm")
    assert board_sheet(board, "a4").startswith(b"%PDF")
    assert board_sheet(board, "a4") == board_sheet(board, "a4")
    with pytest.raises(InputError, match="240 x 330 mm do not fit on a4 paper"):
        board_sheet(parse_board("chessboard:7x10:30mm"), "a4")


def test_the_check_bar_is_100_mm():
    """The bar at the foot of the page is 100 mm long on the scanned page."""
    page = scanned(parse_board("chessboard:7x10:15mm"), "a4")
    row = page[page.shape[0] - round(8.0 / 25.4 * DPI)]
    dark = np.flatnonzero(row < 200)
    assert np.ptp(dark) / DPI * 25.4 == pytest.approx(100.0, abs=0.5)


def test_views_names_are_words_and_no_formulas():
    """Files may be called as they like: signs of TeX in a name are drawn as they stand."""
    board, random = parse_board("chessboard:7x10:15mm"), np.random.default_rng(3)
    matrix, ids = np.array([[900.0, 0, 640], [0, 900, 360], [0, 0, 1]]), np.arange(len(board.points_m))
    solid = np.column_stack((board.points_m, np.zeros(len(ids))))
    views = []
    for k in range(8):
        turn, shift = random.uniform(-0.5, 0.5, 3), (*random.uniform(-0.15, 0.05, 2), 0.45)
        seen = cv2.projectPoints(solid, turn, np.array(shift), matrix, np.zeros(5))[0].reshape(-1, 2)
        sight = BoardSight(ids=ids, camera_px=seen + random.normal(0, 0.2, seen.shape))
        views.append(LensView(name=f"$x^{{{k}$.jpg", sight=sight))
    assert lens_picture(fit_lens(board, views, size_px=(1280, 720))).startswith(b"\x89PNG")
