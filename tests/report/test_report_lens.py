"""The picture of a calibrated lens."""

import cv2
import numpy as np

from dnb_edge.report.lens import lens_picture
from dnb_edge.view.boards import BoardSight, parse_board
from dnb_edge.view.lens_fit import LensView, fit_lens


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
