"""A printed code as a camera of some blur would show it: what the edges of small cells do to one another.

Knows the code, its corners and a blur; knows no picture.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_CELL_PX = 8
"""Size of a cell in the drawing that is warped."""
_SURROUND = 2
"""Cells of white paper around."""
_FINER = 4
"""Steps a pixel, each way, in which the warped drawing is blurred."""
_LIGHT = 200.0


def marker_patch(
    cells: NDArray[np.bool_], corners_px: FloatArray, blur_px: float
) -> tuple[NDArray[np.float32], FloatArray]:
    """The patch of a picture that shows the code `cells` with its corners at `corners_px` (4, 2), blurred by a Gaussian of
    `blur_px`, and the px (2,) of the patch's first pixel."""
    count = len(cells)
    low = np.floor(corners_px.min(axis=0) - 4.0 * max(blur_px, 1.0))
    width, height = (np.ceil(corners_px.max(axis=0) + 4.0 * max(blur_px, 1.0)) - low).astype(int).tolist()
    drawing = np.pad(cells, _SURROUND, constant_values=True).astype(np.float32) * _LIGHT
    drawing = drawing.repeat(_CELL_PX, axis=0).repeat(_CELL_PX, axis=1)
    rim = float(_SURROUND * _CELL_PX)
    end = rim + count * _CELL_PX
    square = np.array([[rim, rim], [end, rim], [end, end], [rim, end]]) - 0.5
    # The middle of fine px k is px (k + 0.5) / _FINER - 0.5.
    fine = (corners_px - low + 0.5) * _FINER - 0.5
    matrix = cv2.getPerspectiveTransform(square.astype(np.float32), fine.astype(np.float32))
    warped = cv2.warpPerspective(
        drawing, matrix, (width * _FINER, height * _FINER), flags=cv2.INTER_LINEAR, borderValue=(_LIGHT,)
    )
    blurred = cv2.GaussianBlur(warped, (0, 0), max(blur_px * _FINER, 0.3))
    patch = cv2.resize(blurred, (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(patch, dtype=np.float32), low
