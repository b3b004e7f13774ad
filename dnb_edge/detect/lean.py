"""How things that stand on the floor lean in the picture, as the network is told it.

Knows directions in pixels and their coding in bytes; nothing of calibration, which says how they come about. Seen from above,
a car's roof covers a part of the floor behind it: what is seen of a car lies off its ground point, by its height times the
lean. A small window round the car does not show how steeply the camera looks there, so the network is told.

The lean at a pixel is where a point just above the floor appears, against the floor point below it: (u, v) px a metre of height,
over the px a metre of floor across the line of sight. Its length is the cosine of the angle at which the ray meets the floor:
0 straight below the camera, towards 1 at the horizon.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

UNKNOWN = 0
"""Both bytes where the lean is not known; known ones are 1..255, 128 being none."""
_MIDDLE = 128.0
_STEP = 80.0


class LeanField(Protocol):
    """Tells the lean anywhere in a frame."""

    def __call__(self, camera_px: NDArray[np.float64]) -> NDArray[np.float64]:
        """Lean (n, 2) at camera px (n, 2)."""
        ...


def lean_bytes(lean: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Leans of any shape as bytes 1..255: up to 1.6 either way, which the corner of a wide lens comes near."""
    return np.asarray(np.clip(np.rint(_MIDDLE + _STEP * lean), 1.0, 255.0), dtype=np.uint8)
