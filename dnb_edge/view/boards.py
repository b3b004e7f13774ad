"""Calibration boards: their description in words, and their corners in a grey picture, to a fraction of a pixel.

Knows chessboards (counted by inner corners, where four squares meet) and ChArUco boards (counted by squares, as OpenCV
does), and where their corners are on the board. Knows no lens and no file. All that is used of OpenCV is in 4.9 and 5.0.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.values import Points

GreyImage = NDArray[np.uint8]
"""A picture, shape (height, width), uint8."""

BOARD_FORMS = (
    "chessboard:7x10:15mm (inner corners, side of a square) or charuco:5x7:30mm:22mm (squares, side, marker's side)"
)
DEFAULT_DICTIONARY = "DICT_5X5_100"

_LENGTH = re.compile(r"(\d+(?:\.\d*)?|\.\d+)(mm|cm|m)")
_COUNTS = re.compile(r"(\d{1,3})[xX](\d{1,3})")
_METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
_LARGEST_COUNT = 60
_FEWEST_CORNERS = 6
_LOOK_PX = 800
"""Longest side at which a quick look for a board is taken."""
_WIDEST_WINDOW_PX = 11
"""OpenCV's usual half-width of the window of `cornerSubPix`."""
_REFINE = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 60, 1e-3)


class BoardKind(StrEnum):
    """How a board's corners are found."""

    CHESSBOARD = "chessboard"
    CHARUCO = "charuco"


@dataclass(frozen=True, slots=True, kw_only=True)
class Board:
    """A flat board. *Board m*: x along a row of corners, y along a column, in the plane of the board, metres."""

    kind: BoardKind
    columns: int
    """Chessboard: inner corners in a row. ChArUco: squares in a row."""
    rows: int
    square_m: float
    marker_m: float | None = None
    """Side of a marker; ChArUco only."""
    dictionary: str | None = None
    """OpenCV's name of the markers' dictionary; ChArUco only."""

    @property
    def corners_across(self) -> tuple[int, int]:
        """How many inner corners there are in a row and in a column."""
        less = 1 if self.kind is BoardKind.CHARUCO else 0
        return self.columns - less, self.rows - less

    @property
    def points_m(self) -> Points:
        """(n, 2) all corners, board m, row by row: corner `id` of a sight is row `id` of this."""
        across, down = self.corners_across
        x, y = np.meshgrid(np.arange(across), np.arange(down))
        first = 1.0 if self.kind is BoardKind.CHARUCO else 0.0
        return np.asarray((np.column_stack((x.ravel(), y.ravel())) + first) * self.square_m, dtype=np.float64)

    def __str__(self) -> str:
        """The description that `parse_board` reads."""
        words = [self.kind.value, f"{self.columns}x{self.rows}", _millimetres(self.square_m)]
        if self.marker_m is not None:
            words += [_millimetres(self.marker_m), str(self.dictionary)]
        return ":".join(words)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BoardSight:
    """The corners of a board that one picture shows."""

    ids: NDArray[np.int64]
    """(n,) rows of `Board.points_m`, rising."""
    camera_px: Points
    """(n, 2) camera px."""


def parse_board(text: str) -> Board:
    """The board that `text` describes, such as `chessboard:7x10:15mm` or `charuco:5x7:30mm:22mm:DICT_4X4_50`.

    Raises `InputError` naming the part that is wrong.
    """
    kind, *words = text.strip().split(":")
    if kind == BoardKind.CHESSBOARD and len(words) == 2:
        columns, rows = _counts(text, words[0], fewest=3, what="inner corners")
        return Board(kind=BoardKind.CHESSBOARD, columns=columns, rows=rows, square_m=_length_m(text, words[1]))
    if kind == BoardKind.CHARUCO and len(words) in (3, 4):
        columns, rows = _counts(text, words[0], fewest=4, what="squares")
        square_m, marker_m = _length_m(text, words[1]), _length_m(text, words[2])
        if not marker_m < square_m:
            raise InputError(f"board {text}: the markers ({words[2]}) must be smaller than the squares ({words[1]})")
        dictionary = _dictionary(text, words[3] if len(words) == 4 else DEFAULT_DICTIONARY)
        held, needed = len(_markers(dictionary).bytesList), columns * rows // 2
        if needed > held:
            raise InputError(f"board {text}: needs {needed} markers, {dictionary} holds {held}: name a larger one")
        return Board(
            kind=BoardKind.CHARUCO,
            columns=columns,
            rows=rows,
            square_m=square_m,
            marker_m=marker_m,
            dictionary=dictionary,
        )
    raise InputError(f"board {text!r}: write {BOARD_FORMS}")


def find_board(board: Board, grey: GreyImage, *, quick: bool = False) -> BoardSight | None:
    """The corners of `board` in `grey`, to a fraction of a pixel; None where it is not seen.

    A chessboard must be seen whole; of a ChArUco board six corners in two rows and columns do. `quick` looks at a reduced
    picture first and gives up early: for live pictures, where the next one comes soon.
    """
    if board.kind is BoardKind.CHARUCO:
        return _find_charuco(board, grey)
    corners = _find_quickly(board, grey) if quick else _find_thoroughly(board, grey)
    if corners is None:
        return None
    return BoardSight(ids=np.arange(len(corners)), camera_px=_refined(board, grey, np.arange(len(corners)), corners))


def charuco_board(board: Board) -> Any:
    """OpenCV's own ChArUco board, of `board`'s size in metres."""
    assert board.marker_m is not None
    assert board.dictionary is not None
    size = (board.columns, board.rows)
    return cv2.aruco.CharucoBoard(size, board.square_m, board.marker_m, _markers(board.dictionary))


def _find_quickly(board: Board, grey: GreyImage) -> Points | None:
    ratio = min(1.0, _LOOK_PX / max(grey.shape))
    small = grey if ratio == 1.0 else cv2.resize(grey, None, fx=ratio, fy=ratio, interpolation=cv2.INTER_AREA)
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK
    found, corners = cv2.findChessboardCorners(small, board.corners_across, flags=flags)
    if not found:
        return None
    scale = np.array([grey.shape[1] / small.shape[1], grey.shape[0] / small.shape[0]])
    return np.asarray((corners.reshape(-1, 2) + 0.5) * scale - 0.5, dtype=np.float64)


def _find_thoroughly(board: Board, grey: GreyImage) -> Points | None:
    """Two ways to find a chessboard, since each misses some: by its squares, then by its corners (slower)."""
    size = board.corners_across
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    found, corners = cv2.findChessboardCorners(grey, size, flags=flags)
    if not found:
        flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY
        found, corners = cv2.findChessboardCornersSB(grey, size, flags=flags)
    return np.asarray(corners, dtype=np.float64).reshape(-1, 2) if found else None


def _find_charuco(board: Board, grey: GreyImage) -> BoardSight | None:
    corners, ids, _, _ = _charuco_detector(board).detectBoard(grey)
    if ids is None or len(ids) < _FEWEST_CORNERS:
        return None
    order = np.argsort(ids.ravel())
    kept = ids.ravel()[order].astype(np.int64)
    rows, columns = np.divmod(kept, board.corners_across[0])
    if len(set(rows.tolist())) < 2 or len(set(columns.tolist())) < 2:
        return None
    found = np.asarray(corners, dtype=np.float64).reshape(-1, 2)[order]
    return BoardSight(ids=kept, camera_px=_refined(board, grey, kept, found))


def _refined(board: Board, grey: GreyImage, ids: NDArray[np.int64], corners: Points) -> Points:
    """Corners (n, 2) to a fraction of a pixel, camera px. The window keeps clear of neighbouring corners and markers."""
    clear = 0.45 if board.marker_m is None else 0.5 * (1.0 - board.marker_m / board.square_m)
    half = int(max(2.0, min(_WIDEST_WINDOW_PX, clear * _spacing_px(board, ids, corners))))
    start = np.ascontiguousarray(corners, dtype=np.float32).reshape(-1, 1, 2)
    inside = np.all((corners > half + 1) & (corners < np.array(grey.shape[::-1]) - half - 2), axis=1)
    fine = cv2.cornerSubPix(grey, start.copy(), (half, half), (-1, -1), _REFINE)
    return np.where(inside[:, None], fine.reshape(-1, 2), corners).astype(np.float64)


def _spacing_px(board: Board, ids: NDArray[np.int64], corners: Points) -> float:
    """Least distance between corners that are neighbours on the board, camera px."""
    places = board.points_m[ids]
    apart_m = np.linalg.norm(places[:, None] - places[None], axis=2)
    apart_px = np.linalg.norm(corners[:, None] - corners[None], axis=2)
    return float(np.min(apart_px[(apart_m > 0) & (apart_m < 1.2 * board.square_m)], initial=np.inf))


@cache
def _charuco_detector(board: Board) -> Any:
    return cv2.aruco.CharucoDetector(charuco_board(board))


@cache
def _markers(dictionary: str) -> Any:
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))


def _counts(text: str, word: str, *, fewest: int, what: str) -> tuple[int, int]:
    matched = _COUNTS.fullmatch(word)
    if matched is None:
        raise InputError(f"board {text}: {word!r} is no count of {what}: write {BOARD_FORMS}")
    columns, rows = int(matched[1]), int(matched[2])
    if not (fewest <= columns <= _LARGEST_COUNT and fewest <= rows <= _LARGEST_COUNT):
        raise InputError(f"board {text}: must have {fewest} to {_LARGEST_COUNT} {what} either way, not {word}")
    return columns, rows


def _length_m(text: str, word: str) -> float:
    matched = _LENGTH.fullmatch(word)
    length_m = 0.0 if matched is None else float(matched[1]) * _METRES[matched[2]]
    if not 0.0005 <= length_m <= 5.0:
        raise InputError(f"board {text}: {word!r} is no length of 0.5 mm to 5 m: write it with its unit, such as 15mm")
    return length_m


def _dictionary(text: str, word: str) -> str:
    name = word.upper() if word.upper().startswith("DICT_") else f"DICT_{word.upper()}"
    if not isinstance(getattr(cv2.aruco, name, None), int):
        raise InputError(f"board {text}: there is no dictionary {word}: name one of OpenCV's, such as DICT_4X4_50")
    return name


def _millimetres(length_m: float) -> str:
    return f"{round(length_m * 1000, 6):g}mm"
