"""What every detector is: a frame and the places to look in, in; detections, out.

Knows no detector. A detector may keep state between frames (a background), only inside the object, and gives the same answers
for the same frames and windows in the same order.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from dnb_edge.values import BgrImage, FrameDetections, SearchWindow


class Detector(Protocol):
    """Finds cars in frames, one frame after the other."""

    def detect(self, image: BgrImage, *, sequence: int, t_ns: int, windows: Sequence[SearchWindow]) -> FrameDetections:
        """Cars in `image`, shape (h, w, 3): in the search windows, or in the whole picture where there are none."""
        ...
