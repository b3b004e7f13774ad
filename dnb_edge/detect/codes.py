"""Reading printed square codes in a grey picture: OpenCV's detector, and how well each code explains what is seen.

Knows families of codes, pixels and corners; nothing of cars. OpenCV finds the squares and reads the sharp ones; a square that
it found and could not read, as motion blurs it, is compared with every allowed code. The confidence of a reading is the share
of the variance of its cells' grey levels that the printed code explains (squared correlation): blur and glare lower it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

_CELL_PX = 4
_BLURRED_LEAST = 0.7
_BLURRED_MARGIN = 0.12
"""A blurred code counts only where no other code explains the square nearly as well."""

_SMALLEST_SIDE_PX = 9.0
_DARK_ENDS_PX = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """One family of codes."""

    index: int
    """OpenCV's number of it."""
    codes: int


def _families() -> dict[str, Family]:
    """Every family that this OpenCV knows, by name; of two spellings of an AprilTag family the one with a small h."""
    found = {}
    for name in dir(cv2.aruco):
        short = name.removeprefix("DICT_")
        if short == name or ("APRILTAG" in short and "H" in short):
            continue
        index = int(getattr(cv2.aruco, name))
        found[short] = Family(index=index, codes=len(cv2.aruco.getPredefinedDictionary(index).bytesList))
    return found


DICTIONARIES = _families()
"""Names of the families as the configuration takes them."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reading:
    """One code that was read."""

    number: int
    corners_px: NDArray[np.float64]
    """(4, 2) px of the picture, clockwise from the top left corner as printed."""
    confidence: float
    """0..1"""


class CodeBook:
    """Reads the codes of one family; of `numbers` only, where any are given."""

    def __init__(self, dictionary: str, numbers: tuple[int, ...], *, least_confidence: float) -> None:
        family = DICTIONARIES[dictionary]
        codes = cv2.aruco.getPredefinedDictionary(family.index)
        self._numbers = tuple(sorted(set(numbers))) if numbers else tuple(range(family.codes))
        self._least = least_confidence
        self._cells = int(codes.markerSize) + 2
        self._sharp = cv2.aruco.ArucoDetector(codes, _parameters(windows=(3, 23, 10), corrected=0.6))
        self._close = cv2.aruco.ArucoDetector(codes, _parameters(windows=(13, 33, 20), corrected=1.0))
        printed = [cv2.aruco.generateImageMarker(codes, number, self._cells) for number in self._numbers]
        # Row 4 k + r: code k turned r quarters clockwise, so that its first corner is corner r of the square.
        turned = [np.rot90(one, -r) for one in printed for r in range(4)]
        self._templates = np.array([_standardised(one) for one in turned])

    def read(self, grey: NDArray[np.uint8], *, closely: bool) -> list[Reading]:
        """The codes in `grey`, shape (h, w); `closely` compares the squares that OpenCV could not read as well."""
        detector = self._close if closely else self._sharp
        if min(grey.shape) < 2 * _SMALLEST_SIDE_PX:
            return []
        detector.setDetectorParameters(_with_smallest(detector.getDetectorParameters(), max(grey.shape)))
        squares, numbers, unread = detector.detectMarkers(grey)
        found = []
        for square, number in zip(squares, () if numbers is None else np.ravel(numbers).tolist(), strict=True):
            reading = self._sure(grey, _corners(square), int(number))
            if reading is not None:
                found.append(reading)
        if closely:
            for square in unread:
                corners = _corners(square)
                if any(_overlap(corners, reading.corners_px) for reading in found):
                    continue
                reading = self._blurred(grey, corners)
                if reading is not None:
                    found.append(reading)
        return found

    def _sure(self, grey: NDArray[np.uint8], corners: NDArray[np.float64], number: int) -> Reading | None:
        """OpenCV's reading with its confidence; None where that is too low or the number is not asked for."""
        if number not in self._numbers:
            return None
        correlation = float(self._templates[4 * self._numbers.index(number)] @ self._seen(grey, corners))
        confidence = max(0.0, correlation) ** 2
        return Reading(number=number, corners_px=corners, confidence=confidence) if confidence >= self._least else None

    def _blurred(self, grey: NDArray[np.uint8], corners: NDArray[np.float64]) -> Reading | None:
        """The code that explains an unread square best; None where none does, or two do."""
        if float(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).min()) < _SMALLEST_SIDE_PX:
            return None
        shares = np.maximum(0.0, self._templates @ self._seen(grey, corners)) ** 2
        best = int(np.argmax(shares))
        confidence = float(shares[best])
        shares[best] = 0.0
        if confidence < max(self._least, _BLURRED_LEAST) or confidence - float(shares.max()) < _BLURRED_MARGIN:
            return None
        return Reading(
            number=self._numbers[best // 4], corners_px=np.roll(corners, -(best % 4), axis=0), confidence=confidence
        )

    def _seen(self, grey: NDArray[np.uint8], corners: NDArray[np.float64]) -> NDArray[np.float64]:
        """The grey levels of the square's cells, (cells^2,), less their mean and of length 1; zeros where all are one."""
        side = self._cells * _CELL_PX
        flat = np.array(
            [[-0.5, -0.5], [side - 0.5, -0.5], [side - 0.5, side - 0.5], [-0.5, side - 0.5]], dtype=np.float32
        )
        matrix = cv2.getPerspectiveTransform(corners.astype(np.float32), flat)
        upright = cv2.warpPerspective(grey, matrix, (side, side), flags=cv2.INTER_LINEAR)
        cells = upright.reshape(self._cells, _CELL_PX, self._cells, _CELL_PX)[:, 1:-1, :, 1:-1]
        return _standardised(cells.mean(axis=(1, 3)))


def _parameters(*, windows: tuple[int, int, int], corrected: float) -> cv2.aruco.DetectorParameters:
    """OpenCV's settings: lines fitted to the square's edges give the corners, of its ways the most exact on small ones."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_CONTOUR
    parameters.adaptiveThreshWinSizeMin, parameters.adaptiveThreshWinSizeMax, parameters.adaptiveThreshWinSizeStep = (
        windows
    )
    parameters.errorCorrectionRate = corrected
    return parameters


def _with_smallest(parameters: cv2.aruco.DetectorParameters, longest_px: int) -> cv2.aruco.DetectorParameters:
    """The settings with the smallest square told as OpenCV wants it, as a share of the picture."""
    parameters.minMarkerPerimeterRate = 4.0 * _SMALLEST_SIDE_PX / longest_px
    return parameters


def _overlap(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Whether two squares' middles are nearer than the longer side: a marker's paper or a part of it is a square as well."""
    apart = float(np.linalg.norm(one.mean(axis=0) - other.mean(axis=0)))
    return apart < max(
        float(np.linalg.norm(square - np.roll(square, 1, axis=0), axis=1).max()) for square in (one, other)
    )


def _corners(square: NDArray[Any]) -> NDArray[np.float64]:
    """The square's corners (4, 2) with every side half a pixel further out.

    OpenCV fits its sides to the outermost dark pixels' centres; where dark ends is half a pixel beyond. That half is 4 % of a
    small marker, by which a point beside it would be misplaced.
    """
    corners = np.asarray(square, dtype=np.float64).reshape(4, 2)
    along = np.roll(corners, -1, axis=0) - corners
    lengths = np.linalg.norm(along, axis=1, keepdims=True)
    if float(lengths.min()) < 1.0:
        return corners
    out = np.column_stack((along[:, 1], -along[:, 0])) / lengths
    # A corner moves so that it lies half a pixel outside both sides that meet in it.
    before = np.roll(out, 1, axis=0)
    cross = before[:, 0] * out[:, 1] - before[:, 1] * out[:, 0]
    if float(np.abs(cross).min()) < 0.1:
        return corners
    step = np.column_stack((out[:, 1] - before[:, 1], before[:, 0] - out[:, 0])) * (_DARK_ENDS_PX / cross[:, None])
    return np.asarray(corners + step)


def _standardised(cells: NDArray[np.generic]) -> NDArray[np.float64]:
    values = np.asarray(cells, dtype=np.float64).ravel()
    values = values - values.mean()
    length = float(np.linalg.norm(values))
    return values / length if length > 1e-9 else np.zeros_like(values)
