"""One look at a part of the frame: pixels to the network, its peaks to detections in the frame.

Knows the network, the cut and the background's difference; nothing of which places are worth a look, of targets or of time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.detect.background import MOVED_LEVEL, Background
from dnb_edge.detect.decode import Peak, peaks
from dnb_edge.detect.lean import LeanMap
from dnb_edge.detect.looks import Look, look_pixels, whole_pixels
from dnb_edge.detect.onnx import CentreNetwork
from dnb_edge.values import BgrImage, Detection

SMALL_PX = 192
"""A look up to so wide is a window, and is told one lean for all of it."""
MOVING_SHARE = 0.25
"""Share of the car's inner pixels that must differ from the background in a car that counts as moving."""
MOST_MOVED = 0.6
"""Where more than this share of a look has moved the light has changed, and the difference tells nothing."""


class Sight:
    """Looks at parts of one frame with one network, against one background."""

    def __init__(
        self,
        network: CentreNetwork,
        image: BgrImage,
        background: Background,
        *,
        most: int,
        lean: LeanMap | None = None,
    ) -> None:
        self._lean = lean if network.takes_lean else None
        self._network = network
        self._image = image
        self._background = background
        self._most = most

    def look(self, looks: Sequence[Look], *, least_confidence: float) -> list[list[Detection]]:
        """What is seen in each of `looks`, which all have one size for the network; strongest first."""
        if not looks:
            return []
        background = self._background.picture if self._background.settled else None
        pixels = [
            look_pixels(self._image, background, look, self._background.scale, most_moved=MOST_MOVED) for look in looks
        ]
        return self._seen(pixels, looks, least_confidence)

    def whole(
        self, reduced: BgrImage, moved: NDArray[np.uint8], look: Look, *, least_confidence: float
    ) -> list[Detection]:
        """What is seen in the whole frame, from its reduced picture and that picture's difference from the background."""
        known = moved if self._background.settled else np.zeros_like(moved)
        return self._seen([whole_pixels(reduced, known, look)], [look], least_confidence)[0]

    def _seen(self, pixels: list[NDArray[np.uint8]], looks: Sequence[Look], least: float) -> list[list[Detection]]:
        lean = self._lean
        leans = (
            None if lean is None else [_lean_of(look, lean, like=one) for look, one in zip(looks, pixels, strict=True)]
        )
        answers = self._network.many(_stacked(pixels), leans=None if leans is None else _stacked(leans))
        found = [peaks(maps, least_confidence=least, most=self._most) for maps in answers]
        return [
            [
                _detection(peak, seen, look)
                for peak in some
                if peak.u_px < look.out_width_px and peak.v_px < look.out_height_px
            ]
            for some, seen, look in zip(found, pixels, looks, strict=True)
        ]


def _stacked(parts: list[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """(n, h, w, c) of n (h, w, c), without a copy where there is one."""
    return parts[0][None] if len(parts) == 1 else np.stack(parts)


def _lean_of(look: Look, lean: LeanMap, *, like: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The lean's bytes for a look, of the size of its padded pixels."""
    planes = lean.at_middle(look) if look.out_width_px <= SMALL_PX else lean.over(look)
    below, right = like.shape[0] - planes.shape[0], like.shape[1] - planes.shape[1]
    if not below and not right:
        return planes
    return np.asarray(cv2.copyMakeBorder(planes, 0, below, 0, right, cv2.BORDER_REPLICATE), dtype=np.uint8)


def _detection(peak: Peak, pixels: NDArray[np.uint8], look: Look) -> Detection:
    # the car's middle lies a little above its ground point
    reach = max(2.0, 0.3 * peak.length_px)
    top, bottom = max(0, round(peak.v_px - 1.3 * reach)), max(1, round(peak.v_px + 0.5 * reach) + 1)
    left, right = max(0, round(peak.u_px - reach)), max(1, round(peak.u_px + reach) + 1)
    middle = pixels[top:bottom, left:right]
    _, moved = cv2.threshold(cv2.extractChannel(middle, 3), MOVED_LEVEL, 255.0, cv2.THRESH_BINARY)
    moving = cv2.countNonZero(moved) >= MOVING_SHARE * moved.size
    blue, green, red, _ = cv2.mean(middle, mask=moved if moving else None)
    return Detection(
        camera_px=look.to_frame(peak.u_px, peak.v_px),
        sigma_px=peak.sigma_px / look.scale,
        length_px=peak.length_px / look.scale,
        confidence=peak.confidence,
        heading_rad=peak.heading_rad,
        moving=moving,
        colour_bgr=(blue, green, red),
    )


def rank(found: Detection) -> float:
    """What has moved goes before what has not, unless that is much surer."""
    return found.confidence + (0.3 if found.moving else 0.0)


def merged(found: Sequence[Detection], most: int) -> tuple[Detection, ...]:
    """At most `most` of the detections, by rank, without those within 0.4 lengths of a better one."""
    kept: list[Detection] = []
    for detection in sorted(found, key=lambda one: (-rank(one), one.camera_px)):
        if all(math.dist(detection.camera_px, other.camera_px) > 0.4 * other.length_px for other in kept):
            kept.append(detection)
    return tuple(kept[:most])
