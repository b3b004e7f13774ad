"""Whether lamps flicker in the camera's pictures, told from those that a page looks at while the camera is aimed.

Keeps the brightness of some seconds of pictures, a few a second; what a beat is the doctor knows. Knows pictures and words;
knows no request.
"""

from __future__ import annotations

import threading
from collections import deque

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.doctor.picture_rules import judge_flicker
from dnb_edge.doctor.sight import LAMP_HZ, lamp_beats
from dnb_edge.doctor.verdict import Status
from dnb_edge.live.messages import Picture
from dnb_edge.values import BgrImage

FEWEST = 12
MOST = 40
"""Pictures that are remembered."""
_LONGEST_GAP_NS = 3_000_000_000
"""After so long it is another view, or other settings."""
_ROWS = 90
_SAME_PHASE = 0.4
"""Where the pictures' moments see a lamp so nearly at one phase (1: all of them), its beat looks like light that stays."""


class FlickerWatch:
    """The pictures of the last seconds. For several threads."""

    def __init__(self) -> None:
        self._seen: deque[tuple[int, int, NDArray[np.float64]]] = deque(maxlen=MOST)
        """Stamp in ns, the frame's number, the rows' brightness."""
        self._lock = threading.Lock()

    def look(self, picture: Picture, image: BgrImage) -> str | None:
        """What is to be said of the flicker by now, a sentence; None where nothing shows, or too little was seen yet.

        `image` is the picture's, (h, w, 3).
        """
        narrow = cv2.resize(image, (1, _ROWS), interpolation=cv2.INTER_AREA).reshape(_ROWS, 3)
        rows = narrow.mean(axis=1, dtype=np.float64)
        with self._lock:
            self._keep(picture, rows)
            return self._said()

    def _keep(self, picture: Picture, rows: NDArray[np.float64]) -> None:
        """Two pages may look at one picture, or at an older one; what comes after a gap is another view."""
        if self._seen and not 0 < picture.t_ns - self._seen[-1][0] < _LONGEST_GAP_NS:
            if 0 <= self._seen[-1][0] - picture.t_ns < _LONGEST_GAP_NS:
                return
            self._seen.clear()
        self._seen.append((picture.t_ns, picture.frame, rows))

    def _said(self) -> str | None:
        if len(self._seen) < FEWEST:
            return None
        (first_ns, first, _), (last_ns, last, _) = self._seen[0], self._seen[-1]
        fps = (last - first) / ((last_ns - first_ns) * 1e-9)
        beats = [
            beat
            for beat in lamp_beats([(t_ns, rows) for t_ns, _, rows in self._seen], fps)
            if not self._at_one_phase(LAMP_HZ[beat.mains_hz])
        ]
        verdict = judge_flicker(beats)
        if verdict.status not in (Status.WARN, Status.FAIL):
            return None
        mains_hz = max(beats, key=lambda beat: beat.share or 0.0).mains_hz
        return (
            f"Lamps flicker: {verdict.found}. Under Camera settings choose {mains_hz} Hz, or an exposure of "
            f"{round(1e6 / LAMP_HZ[mains_hz], -2):.0f} µs or twice that, or use lamps that do not flicker."
        )

    def _at_one_phase(self, lamp_hz: float) -> bool:
        t_s = np.array([t_ns - self._seen[0][0] for t_ns, _, _ in self._seen]) * 1e-9
        return bool(np.abs(np.exp(-2j * np.pi * lamp_hz * t_s).mean()) > _SAME_PHASE)
