"""Which of a moving board's pictures to keep for the lens: still ones, each unlike those kept before.

Knows corners in pictures, in the order in which they come. Knows no clock, no file and no camera.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import Points
from dnb_edge.view.boards import Board, BoardSight
from dnb_edge.view.lens import LensModel
from dnb_edge.view.lens_fit import GRID, cells_of
from dnb_edge.view.lens_solve import Seen, pose_of

_STILL = 0.0025
"""Share of the picture's width by which a still board's corners move from one look to the next: half of it is blur."""
_NEW = 0.05
"""Share of the picture's width by which a new view's board lies elsewhere than in any kept one, mean of its four corners."""


class ViewPicker:
    """Picks views one by one. The same sights in the same order give the same picks."""

    def __init__(self, board: Board, size_px: tuple[int, int]) -> None:
        """`size_px`: width, height of the pictures."""
        self._board, self._size_px = board, size_px
        self._last: BoardSight | None = None
        self._places: list[Points] = []
        self.counts: NDArray[np.int64] = np.zeros((GRID, GRID), dtype=np.int64)
        """(GRID, GRID) kept views with a corner in the cell; rows from the top."""
        self.tilts_deg: list[float] = []
        """Of the kept views, roughly: the lens is not known yet."""

    def picks(self, sight: BoardSight | None) -> bool:
        """Whether to keep the view with this sight; None: the picture shows no board."""
        before, self._last = self._last, sight
        if sight is None or before is None or not self._still(before, sight):
            return False
        place = self._place(sight)
        if any(_apart(place, kept) < _NEW * self._size_px[0] for kept in self._places):
            return False
        self._places.append(place)
        self.counts += cells_of(sight.camera_px, self._size_px)
        self.tilts_deg.append(self._tilt_deg(sight))
        return True

    def best(self, wanted: int) -> list[int]:
        """Numbers (from 0, rising) of `wanted` kept views that are spread widest: each next one farthest from those before."""
        if len(self._places) <= wanted:
            return list(range(len(self._places)))
        chosen = [0]
        nearest = np.array([_apart(self._places[0], place) for place in self._places])
        while len(chosen) < wanted:
            chosen.append(int(nearest.argmax()))
            nearest = np.minimum(nearest, [_apart(self._places[chosen[-1]], place) for place in self._places])
        return sorted(chosen)

    def _still(self, before: BoardSight, now: BoardSight) -> bool:
        _, one, two = np.intersect1d(before.ids, now.ids, return_indices=True)
        if len(one) < len(now.ids) // 2 or len(one) == 0:
            return False
        moved = np.linalg.norm(before.camera_px[one] - now.camera_px[two], axis=1)
        return float(moved.mean()) <= _STILL * self._size_px[0]

    def _place(self, sight: BoardSight) -> Points:
        """(4, 2) camera px of the board's outermost corners in turn, hidden ones included."""
        points = self._board.points_m
        to_camera, _ = cv2.findHomography(points[sight.ids], sight.camera_px)
        across, down = self._board.corners_across
        ends = points[[0, across - 1, across * down - 1, across * (down - 1)]]
        return np.asarray(cv2.perspectiveTransform(ends.reshape(-1, 1, 2), to_camera), dtype=np.float64).reshape(4, 2)

    def _tilt_deg(self, sight: BoardSight) -> float:
        width, height = self._size_px
        usual = np.array([width, width, (width - 1) / 2, (height - 1) / 2])
        pose = pose_of(
            Seen(board_m=self._board.points_m[sight.ids], camera_px=sight.camera_px), usual, LensModel.PINHOLE
        )
        normal = np.asarray(cv2.Rodrigues(pose[:3])[0], dtype=np.float64)[:, 2]
        return math.degrees(math.acos(min(1.0, abs(float(normal[2])))))


def _apart(one: Points, two: Points) -> float:
    """Mean distance of the four corners, px. A chessboard looks the same turned by half, so both ways count."""
    ways: Sequence[Points] = (two, np.roll(two, 2, axis=0))
    return min(float(np.linalg.norm(one - way, axis=1).mean()) for way in ways)
