"""A calibration board as a sheet to print, to scale, with a bar of 100 mm to check it by.

Knows paper and the board to draw. Knows no file and no camera.
"""

from __future__ import annotations

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from dnb_edge.errors import InputError
from dnb_edge.prints.paper import PAPER_MM, Page, Paper, blank, draw_bar, write
from dnb_edge.view.boards import Board, BoardKind, charuco_board

_MARGIN_MM = 8.0
_FOOT_MM = 16.0


def board_page(board: Board, paper: Paper) -> Page:
    """The sheet, upright or lying, whichever the board fits. Raises `InputError` where it fits neither."""
    width_mm, height_mm = _page_mm(board, paper)
    figure, axes = blank(width_mm, height_mm)
    board_width_mm, board_height_mm = _board_mm(board)
    left = 0.5 * (width_mm - board_width_mm)
    top = height_mm - _MARGIN_MM - 0.5 * (height_mm - _FOOT_MM - 2 * _MARGIN_MM - board_height_mm)
    for x, y, side in _black_mm(board):
        # Board: y down from its top left corner; paper: y up.
        axes.add_patch(Rectangle((left + x, top - y - side), side, side, facecolor="black", edgecolor="none"))
    _foot(axes, board)
    return Page(name="board", figure=figure)


def _black_mm(board: Board) -> list[tuple[float, float, float]]:
    """The black squares: left, top and side, mm from the board's top left corner."""
    side = 1000.0 * board.square_m
    across, down = board.corners_across
    even = board.kind is BoardKind.CHESSBOARD
    if board.kind is BoardKind.CHARUCO:
        even = _charuco_starts_black(board)
    squares = [
        (column * side, row * side, side)
        for row in range(down + 1)
        for column in range(across + 1)
        if ((row + column) % 2 == 0) is even
    ]
    return squares if board.kind is BoardKind.CHESSBOARD else squares + _marker_cells_mm(board)


def _charuco_starts_black(board: Board) -> bool:
    """Whether the top left square is a black one, as OpenCV prints the board."""
    drawn = charuco_board(board).generateImage((board.columns * 20, board.rows * 20), marginSize=0)
    return bool(np.mean(drawn[:3, :3]) < 128)


def _marker_cells_mm(board: Board) -> list[tuple[float, float, float]]:
    printed, cells = charuco_board(board), []
    codes = printed.getDictionary()
    count = int(codes.markerSize) + 2
    side = 1000.0 * float(board.marker_m or 0.0) / count
    for number, corners in zip(np.ravel(printed.getIds()).tolist(), printed.getObjPoints(), strict=True):
        left, top = (1000.0 * np.asarray(corners)[:, :2].min(axis=0)).tolist()
        dark = np.argwhere(cv2.aruco.generateImageMarker(codes, number, count) < 128)
        cells += [(left + column * side, top + row * side, side) for row, column in dark.tolist()]
    return cells


def _foot(axes: Axes, board: Board) -> None:
    draw_bar(axes, _MARGIN_MM, _MARGIN_MM)
    lines = (
        "100 mm: measure it; print at 100 %, not fitted to the",
        "page, and glue it to something flat and stiff.",
    )
    for k, line in enumerate(lines):
        write(axes, (_MARGIN_MM + 104.0, _MARGIN_MM + 3.4 - 3.4 * k), line, size=6.5, va="center")
    write(axes, (_MARGIN_MM, _MARGIN_MM - 3.4), f"--board {board}", size=6.5)


def _page_mm(board: Board, paper: Paper) -> tuple[float, float]:
    width, height = _board_mm(board)
    for page in (PAPER_MM[paper], PAPER_MM[paper][::-1]):
        if width + 2 * _MARGIN_MM <= page[0] and height + 2 * _MARGIN_MM + _FOOT_MM <= page[1]:
            return page
    raise InputError(
        f"board {board}: {width:.0f} x {height:.0f} mm do not fit on {paper.value} paper with a margin of {_MARGIN_MM:.0f} mm "
        "and the check bar: make it of fewer or smaller squares"
    )


def _board_mm(board: Board) -> tuple[float, float]:
    across, down = board.corners_across
    return 1000.0 * board.square_m * (across + 1), 1000.0 * board.square_m * (down + 1)
