"""How things that stand on the floor lean in the picture, as the network is told it.

Knows directions in pixels and their coding in bytes; nothing of calibration, which says how they come about. Seen from above,
a car's roof covers a part of the floor behind it: what is seen of a car lies off its ground point, by its height times the
lean. A small window round the car does not show how steeply the camera looks there, so the network is told.

The lean at a pixel is where a point just above the floor appears, against the floor point below it: (u, v) px a metre of
height, over the px a metre of floor across the line of sight. Its length is the cosine of the angle at which the ray meets
the floor: 0 straight below the camera, towards 1 at the horizon.
"""

from __future__ import annotations

from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.detect.looks import Look

UNKNOWN = 0
"""Both bytes where the lean is not known; known ones are 1..255, 128 being none."""
_MIDDLE = 128.0
_STEP = 80.0
_GRID_PX = 16


class LeanField(Protocol):
    """Tells the lean anywhere in a frame."""

    def __call__(self, camera_px: NDArray[np.float64]) -> NDArray[np.float64]:
        """Lean (n, 2) at camera px (n, 2)."""
        ...


def lean_bytes(lean: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Leans of any shape as bytes 1..255: up to 1.6 either way, which the corner of a wide lens comes near."""
    return np.asarray(np.clip(np.rint(_MIDDLE + _STEP * lean), 1.0, 255.0), dtype=np.uint8)


class LeanMap:
    """The lean all over a frame, ready for looks at parts of it. Not to be changed."""

    def __init__(self, field: LeanField, width_px: int, height_px: int) -> None:
        columns, rows = max(2, -(-width_px // _GRID_PX)), max(2, -(-height_px // _GRID_PX))
        self._step_px = (width_px / columns, height_px / rows)
        u, v = np.meshgrid((np.arange(columns) + 0.5) * self._step_px[0], (np.arange(rows) + 0.5) * self._step_px[1])
        leans = field(np.column_stack([u.ravel(), v.ravel()]))
        self._bytes = lean_bytes(leans).reshape(rows, columns, 2)
        self._planes: dict[Look, NDArray[np.uint8]] = {}
        self._flat: dict[tuple[int, ...], NDArray[np.uint8]] = {}

    def at_middle(self, look: Look) -> NDArray[np.uint8]:
        """Bytes (h, w, 2) for a small look: the lean at its middle everywhere, as the network has learnt it."""
        rows, columns, _ = self._bytes.shape
        column = int((look.left_px + look.width_px / 2) / self._step_px[0])
        row = int((look.top_px + look.height_px / 2) / self._step_px[1])
        told = self._bytes[min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)]
        key = (look.out_height_px, look.out_width_px, *told.tolist())
        if key not in self._flat:
            self._flat[key] = np.tile(told, (look.out_height_px, look.out_width_px, 1))
        return self._flat[key]

    def over(self, look: Look) -> NDArray[np.uint8]:
        """Bytes (h, w, 2) for a large look, each pixel with its own; kept, since large looks come again and again."""
        if look not in self._planes:
            step_u, step_v = self._step_px
            wide, high = look.width_px / look.out_width_px, look.height_px / look.out_height_px
            transform = np.array(
                [
                    [wide / step_u, 0.0, (look.left_px + wide / 2) / step_u - 0.5],
                    [0.0, high / step_v, (look.top_px + high / 2) / step_v - 0.5],
                ]
            )
            size = (look.out_width_px, look.out_height_px)
            flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
            planes = cv2.warpAffine(self._bytes, transform, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
            self._planes[look] = np.asarray(planes, dtype=np.uint8)
        return self._planes[look]
