"""What a network sees when the detector watches footage: inputs to calibrate with, and others to compare on.

Knows detectors and frames; nothing of quantisation and of files.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dnb_edge.detect.centre import CentreDetector
from dnb_edge.detect.onnx import CentreMaps, CentreNetwork
from dnb_edge.train.evaluate import Follower
from dnb_edge.values import BgrImage

Pixels: TypeAlias = NDArray[np.uint8]
"""One input of the centre network, (h, w, channels)."""

HELD_OUT_EVERY = 5
"""One input in so many is kept for the comparison."""


class Listening(CentreNetwork):
    """A centre network that remembers what it was shown, at most `most` inputs of each shape, evenly spread."""

    def __init__(self, network: CentreNetwork, most: int) -> None:
        vars(self).update(vars(network))
        self._most = most
        self._seen: dict[tuple[int, ...], list[Pixels]] = {}
        self._every: dict[tuple[int, ...], int] = {}
        self._count: dict[tuple[int, ...], int] = {}

    def many(self, pixels: Pixels, *, leans: Pixels | None = None) -> list[CentreMaps]:
        """As the network itself."""
        for one in pixels:
            self._remember(one)
        return super().many(pixels, leans=leans)

    def _remember(self, one: Pixels) -> None:
        """Keeps every n-th of a shape; where there are too many, half of them go and n doubles."""
        seen, every = self._seen.setdefault(one.shape, []), self._every.setdefault(one.shape, 1)
        number = self._count.get(one.shape, 0)
        self._count[one.shape] = number + 1
        if number % every:
            return
        seen.append(one.copy())
        if len(seen) > self._most:
            self._seen[one.shape], self._every[one.shape] = seen[::2], 2 * every

    def inputs(self) -> list[Pixels]:
        """What it remembers, shape by shape in the order of their first sight."""
        return [one for some in self._seen.values() for one in some]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Seen:
    """Inputs of the network from one piece of footage."""

    calibration: list[Pixels]
    held_out: list[Pixels]


def watch(network: CentreNetwork, images: Iterable[BgrImage], *, stills: bool, most: int) -> Seen:
    """What the network is shown while the detector follows a car through `images`; `stills` are no film: each is new to it."""
    listening = Listening(network, most)
    detector, follower = CentreDetector(listening), Follower()
    for number, image in enumerate(images):
        if stills:
            detector, follower = CentreDetector(listening), Follower()
        found = detector.detect(image, sequence=number, t_ns=number * 33_333_333, windows=follower.windows())
        follower.take(found.detections)
    inputs = listening.inputs()
    held_out = inputs[HELD_OUT_EVERY - 1 :: HELD_OUT_EVERY]
    calibration = [one for number, one in enumerate(inputs, 1) if number % HELD_OUT_EVERY]
    return Seen(calibration=calibration, held_out=held_out)


def as_float(pixels: Pixels, lean: tuple[int, int] | None = None) -> NDArray[np.float32]:
    """The input (1, channels, h, w) float32, 0..1, of our float networks, for `pixels` (h, w, 4).

    With `lean`, its two bytes are the last channels, alike all over, for a network that takes them.
    """
    picture = pixels.transpose(2, 0, 1)[None]
    if lean is not None:
        planes = [np.full((1, 1, *pixels.shape[:2]), value, dtype=np.uint8) for value in lean]
        picture = np.concatenate([picture, *planes], axis=1)
    return np.ascontiguousarray(picture, dtype=np.float32) / np.float32(255.0)


def leans(count: int, seed: int) -> list[tuple[int, int]]:
    """A lean's two bytes for each of `count` inputs: every other not known (0, 0), the others of all kinds.

    Footage without a calibrated camera does not tell its lean, and the network must do with any.
    """
    rng = np.random.default_rng([seed, 41])
    told = rng.integers(1, 256, (count, 2)).tolist()
    return [(0, 0) if number % 2 else (told[number][0], told[number][1]) for number in range(count)]
