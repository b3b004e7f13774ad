"""What the floor looks like without the cars: a picture at reduced size that follows light and furniture, never a followed car.

Knows pixels and discs in which it must not learn; nothing of cars or networks. A pixel is learnt once it has kept its colour
over several looks: a ghost (a car that stood there in the first frame) goes so within about a second, a bump of the camera or a
change of light likewise, and something that drives through is never learnt. Inside the frozen discs nothing is learnt at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import BgrImage, PointPx


@dataclass(frozen=True, slots=True, kw_only=True)
class BackgroundSettings:
    """How fast the background learns."""

    every_frames: int = 4
    """It looks at every n-th frame."""
    stable_looks: int = 4
    """A pixel that kept its colour for as many looks is learnt."""
    stable_levels: int = 14
    """Largest change, in levels of 0..255, that still counts as the same colour."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Disc:
    """A place where nothing is learnt, camera px of the full frame."""

    centre_px: PointPx
    radius_px: float


class Background:
    """The background of one fixed camera."""

    def __init__(self, settings: BackgroundSettings | None = None) -> None:
        self._settings = settings or BackgroundSettings()
        self._picture: BgrImage | None = None
        self._last: BgrImage | None = None
        self._stable: NDArray[np.uint8] | None = None
        self._frames = 0

    @property
    def picture(self) -> BgrImage | None:
        """The background at the reduced size; None before the first frame. Not to be written to."""
        return self._picture

    def is_due(self) -> bool:
        """True where the coming frame should be handed to `update`; counts the frame as seen."""
        due = self._frames % self._settings.every_frames == 0
        self._frames += 1
        return due

    def update(self, reduced: BgrImage, *, scale: float, frozen: Sequence[Disc] = ()) -> None:
        """Learn from a frame at reduced size, `scale` times the full one, outside the `frozen` discs.

        The first frame, or one of another size, becomes the background as it is.
        """
        if self._picture is None or self._last is None or self._stable is None or self._picture.shape != reduced.shape:
            self._picture, self._last = reduced.copy(), reduced.copy()
            self._stable = np.zeros(reduced.shape[:2], dtype=np.uint8)
            return
        kept = difference(reduced, self._last) <= self._settings.stable_levels
        self._stable = (np.minimum(self._stable, 254) + np.uint8(1)) * kept.astype(np.uint8)
        for disc in frozen:
            centre = (round((disc.centre_px[0] + 0.5) * scale - 0.5), round((disc.centre_px[1] + 0.5) * scale - 0.5))
            cv2.circle(self._stable, centre, max(1, round(disc.radius_px * scale)), (0.0,), -1)
        ready = (self._stable >= self._settings.stable_looks).astype(np.uint8)
        mixed = cv2.addWeighted(self._picture, 0.5, reduced, 0.5, 0.0)
        self._picture = np.asarray(cv2.copyTo(mixed, ready, self._picture), dtype=np.uint8)
        self._last = reduced.copy()


def difference(image: BgrImage, background: BgrImage) -> NDArray[np.uint8]:
    """Largest absolute difference over blue, green and red, shape (h, w), of two pictures of one size."""
    blue, green, red = cv2.split(cv2.absdiff(image, background))
    return np.asarray(cv2.max(cv2.max(blue, green), red), dtype=np.uint8)
