"""Hard places: where the network, half-way through its training, sees cars that are none.

Knows how to look for them in samples and bare photographs; changes no weights. Rare things that look like cars (the castors
of a chair, a controller) are in a few samples of thousands: later windows are cut round what is mistaken, to be seen often.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from dnb_edge.detect.background import difference
from dnb_edge.train.network import INPUT_CHANNELS, CentreNet, to_input
from dnb_edge.train.scene import SCENE_PX

_LEAST_CONFIDENCE = 0.2
_A_SAMPLE = 3
"""At most so many places of one sample."""
_AT_ONCE = 32
MOST_PLACES = 6000
"""Only the worst mistakes are shown again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HardPlace:
    """A place in a sample, or in a crop of a photograph, at which there is no car and the network sees one."""

    shard: int | None
    """Number of the shard; None for a photograph."""
    row: int
    """The sample's row in the shard, or the number of the photograph's crop."""
    centre_px: tuple[float, float]
    """In the sample, px."""
    confidence: float


def as_input(pictures: NDArray[np.uint8], *, with_difference: bool) -> NDArray[np.uint8]:
    """A sample's pictures (2, 192, 192, 3) as an input (192, 192, 6) of unknown lean."""
    out = np.zeros((SCENE_PX, SCENE_PX, INPUT_CHANNELS), dtype=np.uint8)
    out[:, :, :3] = pictures[0]
    if with_difference:
        out[:, :, 3] = difference(pictures[0], pictures[1])
    return out


def mistakes(heat: NDArray[np.float32], labels: NDArray[np.float32]) -> list[tuple[tuple[float, float], float]]:
    """Places (u, v) px and confidences of peaks of the heat (rows, columns), logits, well away from all labels (k, 6)."""
    padded = np.pad(heat, 1, constant_values=-np.inf)
    around = np.max([padded[i : i + heat.shape[0], j : j + heat.shape[1]] for i in range(3) for j in range(3)], axis=0)
    least = math.log(_LEAST_CONFIDENCE / (1.0 - _LEAST_CONFIDENCE))
    found = []
    for row, column in np.argwhere((heat >= around) & (heat >= least)):
        at = (4.0 * float(column) + 1.5, 4.0 * float(row) + 1.5)
        cars = labels[labels[:, 2] > 0]
        if all(math.dist(at, (float(u), float(v))) > 0.7 * float(length) for u, v, length in cars[:, :3]):
            found.append((at, 1.0 / (1.0 + math.exp(-float(heat[row, column])))))
    return sorted(found, key=lambda one: -one[1])[:_A_SAMPLE]


def mine(
    network: CentreNet, samples: Iterator[tuple[int | None, int, NDArray[np.uint8], NDArray[np.float32]]]
) -> list[HardPlace]:
    """The network's worst mistakes in `samples`, surest first; a sample is (shard or None, row, pictures, labels)."""
    training = network.training
    network.eval()
    places: list[HardPlace] = []
    waiting: list[tuple[int | None, int, NDArray[np.uint8], NDArray[np.float32]]] = []

    def look() -> None:
        # every other one without its background, which is how static clutter is met at first
        inputs = np.stack([as_input(one[2], with_difference=one[1] % 2 == 1) for one in waiting])
        with torch.no_grad(), torch.autocast("cpu", torch.bfloat16):
            pixels = to_input(torch.from_numpy(inputs)).contiguous(memory_format=torch.channels_last)
            heats = network(pixels)[0].float().numpy()[:, 0]
        for (shard, row, _, labels), heat in zip(waiting, heats, strict=True):
            places.extend(
                HardPlace(shard=shard, row=row, centre_px=at, confidence=confidence)
                for at, confidence in mistakes(heat, labels)
            )
        waiting.clear()

    for sample in samples:
        waiting.append(sample)
        if len(waiting) == _AT_ONCE:
            look()
    if waiting:
        look()
    network.train(training)
    return sorted(places, key=lambda place: -place.confidence)[:MOST_PLACES]
