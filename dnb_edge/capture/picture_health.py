"""Whether a camera's picture shows anything: black, overexposed, covered or blurred to nothing, frozen.

Knows pixels and stamps; knows no detector and no clock. Looks at a few thin strips of the picture, several times a second by
the stamps, and speaks of a fault only once it has lasted, so that a flash or a hand passing by says nothing.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from enum import StrEnum

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import BgrImage


class PictureFault(StrEnum):
    """What may be wrong with a picture."""

    BLACK = "black"
    OVEREXPOSED = "overexposed"
    COVERED = "covered"
    FROZEN = "frozen"


REMEDIES = {
    PictureFault.BLACK: "picture black: lens cap on, or lights off?",
    PictureFault.OVEREXPOSED: "picture overexposed: lower the exposure or the light",
    PictureFault.COVERED: "picture shows nothing: lens covered or out of focus?",
    PictureFault.FROZEN: "picture frozen: the camera repeats one picture; plug it in anew",
}
"""Each fault in words, short enough for a line of the serial display."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureLimits:
    """From where on a picture is bad; the second of a pair is where it is good again."""

    look_every_s: float = 0.16
    """Shortest time between two looks, seconds of the stamps."""
    lasting_s: float = 0.4
    """For how long a fault must last, or be gone, before it counts."""
    frozen_s: float = 1.0
    """For how long a camera must repeat itself."""
    black_level: tuple[float, float] = (16.0, 24.0)
    """Level, 0..255, below which all but the brightest 2 % of a black picture lie."""
    saturated_share: tuple[float, float] = (0.5, 0.4)
    """Share of pixels without any shade left in an overexposed picture."""
    detail_levels: tuple[float, float] = (6.0, 9.0)
    """Difference between neighbouring places, levels, that in a covered picture only 2 % exceed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Look:
    """What one look at a picture tells."""

    level: float
    saturated: float
    detail: float
    checksum: int


class PictureJudge:
    """Looks at one source's pictures, in order. The same pictures and stamps give the same verdicts."""

    def __init__(self, *, live: bool, limits: PictureLimits | None = None) -> None:
        """`live`: a camera, which has noise in every picture and so never repeats one. A file that pauses is not frozen."""
        self._live = live
        self._limits = limits or PictureLimits()
        self._fault: PictureFault | None = None
        self._verdict: PictureFault | None = None
        self._verdict_t_ns = 0
        self._look_t_ns: int | None = None
        self._checksum: int | None = None
        self._changed_t_ns = 0
        self._repeats = 0
        self._lasted_ns: dict[PictureFault, int] = {}

    @property
    def fault(self) -> PictureFault | None:
        """What has been wrong with the picture for a while; None where it is good."""
        return self._fault

    @property
    def shows_something(self) -> bool:
        """False where a car in the latest picture would be a phantom. By the latest look alone: a picture that is good again
        is worth searching at once, while `fault` waits until that has lasted.
        """
        return self._verdict is None

    @property
    def lasted_s(self) -> dict[PictureFault, float]:
        """For how long each fault has held in all, seconds."""
        return {fault: ns * 1e-9 for fault, ns in self._lasted_ns.items()}

    def look(self, image: BgrImage, t_ns: int) -> bool:
        """Looks at `image`, (h, w, 3), stamped `t_ns`, where a look is due; True where `fault` has changed by it."""
        if self._look_t_ns is not None and t_ns - self._look_t_ns < self._limits.look_every_s * 1e9:
            return False
        since_ns = 0 if self._look_t_ns is None else t_ns - self._look_t_ns
        if self._fault is not None:
            self._lasted_ns[self._fault] = self._lasted_ns.get(self._fault, 0) + since_ns
        self._look_t_ns = t_ns
        verdict = self._judge(_look(image), t_ns)
        if verdict is not self._verdict:
            self._verdict, self._verdict_t_ns = verdict, t_ns
        # A frozen picture has lasted already when it is told from a still one.
        lasted = verdict is PictureFault.FROZEN or t_ns - self._verdict_t_ns >= self._limits.lasting_s * 1e9
        if verdict is self._fault or not lasted:
            return False
        self._fault = verdict
        return True

    def _judge(self, seen: _Look, t_ns: int) -> PictureFault | None:
        limits = self._limits
        if seen.checksum != self._checksum:
            self._checksum, self._changed_t_ns, self._repeats = seen.checksum, t_ns, 0
        else:
            self._repeats += 1
        if seen.level < limits.black_level[self._fault is PictureFault.BLACK]:
            return PictureFault.BLACK
        if seen.saturated > limits.saturated_share[self._fault is PictureFault.OVEREXPOSED]:
            return PictureFault.OVEREXPOSED
        if seen.detail < limits.detail_levels[self._fault is PictureFault.COVERED]:
            return PictureFault.COVERED
        # Several looks, since a gap between two alike frames proves nothing.
        if self._live and self._repeats >= _REPEATS and t_ns - self._changed_t_ns > limits.frozen_s * 1e9:
            return PictureFault.FROZEN
        return None


_REPEATS = 4
_STRIPS = 10
_STRIP_PX = 4
_PLACES = 160
_SATURATED, _WHITE = (250.0, 250.0, 250.0), (255.0, 255.0, 255.0)


def _look(image: BgrImage) -> _Look:
    """The picture by `_STRIPS` strips across it, each `_STRIP_PX` rows high, averaged to `_PLACES` places along.

    Means of places are nearly free of the sensor's noise; saturation and the checksum are of the pixels themselves.
    """
    height, width = image.shape[:2]
    rows = min(_STRIP_PX, height)
    tops = np.linspace(0, height - rows, min(_STRIPS, max(1, height // rows))).astype(int)
    strips = np.concatenate([image[top : top + rows] for top in tops.tolist()])
    means = cv2.resize(strips, (min(_PLACES, width), len(tops)), interpolation=cv2.INTER_AREA)
    grey = cv2.cvtColor(means, cv2.COLOR_BGR2GRAY).astype(np.int16)
    lines = np.ascontiguousarray(strips[::rows])
    return _Look(
        level=_percentile(grey, 98.0),
        saturated=cv2.countNonZero(cv2.inRange(lines, _SATURATED, _WHITE)) / lines[:, :, 0].size,
        detail=_percentile(np.abs(grey[:, 2:] - grey[:, :-2]), 98.0) if grey.shape[1] > 2 else 255.0,
        checksum=zlib.crc32(lines.tobytes()),
    )


def _percentile(values: NDArray[np.int16], percent: float) -> float:
    flat = values.ravel()
    place = min(flat.size - 1, int(percent / 100.0 * flat.size))
    return float(np.partition(flat, place)[place])
