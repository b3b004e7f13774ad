"""How sharp and how well exposed a camera's picture is, for whoever turns the lens.

Knows one picture. Sharpness is the variance of the Laplacian of a part of the picture over that part's own variance of light:
it grows with focus and hardly with the light; it says nothing across scenes, only which way to turn.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.capture.picture_health import PictureFault, PictureJudge
from dnb_edge.values import BgrImage

_PART = 0.3
"""Side of each part that is looked at, as a share of the picture's."""
_PARTS = {
    "top left": (0.0, 0.0),
    "top right": (1.0, 0.0),
    "middle": (0.5, 0.5),
    "bottom left": (0.0, 1.0),
    "bottom right": (1.0, 1.0),
}
_DARK, _BRIGHT = 8, 250
_MUCH = 0.05
_LASTING_NS = 1_000_000_000

_FAULTS = {
    PictureFault.BLACK: "the picture is black: take the lens cap off, put the light on",
    PictureFault.OVEREXPOSED: "most of the picture has no shade left: less light, or a shorter exposure",
    PictureFault.COVERED: "the picture shows nothing: is the lens covered, or the camera far out of focus?",
    PictureFault.FROZEN: "the camera repeats one picture: unplug it and plug it in again",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureLook:
    """What one picture tells."""

    sharpness: dict[str, float]
    """By part of the picture; 0 where a part has nothing to be sharp."""
    dark_share: float
    bright_share: float
    fault: str | None


def look_at(picture: BgrImage) -> PictureLook:
    """Looks at a picture (h, w, 3)."""
    grey = np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
    height, width = grey.shape
    rows, columns = max(8, round(_PART * height)), max(8, round(_PART * width))
    sharpness = {}
    for name, (across, down) in _PARTS.items():
        left, top = round(across * max(0, width - columns)), round(down * max(0, height - rows))
        sharpness[name] = round(_sharpness(grey[top : top + rows, left : left + columns]), 1)
    dark = float(np.count_nonzero(grey <= _DARK)) / grey.size
    bright = float(np.count_nonzero(picture.min(axis=2) >= _BRIGHT)) / grey.size
    return PictureLook(
        sharpness=sharpness,
        dark_share=round(dark, 4),
        bright_share=round(bright, 4),
        fault=fault_of(picture) or _clipped(dark, bright),
    )


def fault_of(picture: BgrImage) -> str | None:
    """Why nothing could be seen in the picture, as the daemon would judge it; None where it is good."""
    judge = PictureJudge(live=False)
    judge.look(picture, 0)
    # A fault counts once it has lasted: a picture that stays as it is.
    judge.look(picture, _LASTING_NS)
    return None if judge.fault is None else _FAULTS[judge.fault]


def _clipped(dark: float, bright: float) -> str | None:
    if bright > _MUCH:
        return f"{100 * bright:.0f} % of the picture has no shade left: shorten the exposure, or turn lamps away from the floor"
    if dark > 4 * _MUCH:
        return f"{100 * dark:.0f} % of the picture is black: more light, or a longer exposure"
    return None


def _sharpness(grey: NDArray[np.uint8]) -> float:
    light = float(grey.astype(np.float64).var())
    if light < 4.0:
        return 0.0
    return 1000.0 * float(cv2.Laplacian(grey, cv2.CV_64F).var()) / light
