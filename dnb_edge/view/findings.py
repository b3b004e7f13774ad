"""All that clicked keypoints tell: the map, its errors, its sigma where it matters, what is wrong and what to do next.

Knows pairs, the twin's scale and, where there is one, the track. Knows no file and no layout: the command line's tables and
the set-up page's answers are both made of what is found here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.track.model import Track
from dnb_edge.track.scale import TwinScale
from dnb_edge.view.advice import advise, hull_px, lane_px
from dnb_edge.view.fit import CLICK_SIGMA_PX, TWIN_SIGMA_PX, KeypointFit, fit_keypoints
from dnb_edge.view.homography import CalibrationError, CountError, calibration_error, error_by_count, ideal_pairs
from dnb_edge.view.keypoints import KeypointPairs
from dnb_edge.view.lens import Lens


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """All that is to be told."""

    fit: KeypointFit
    plain: CalibrationError
    """Of plain least squares, as the paper has it."""
    by_count: tuple[CountError, ...]
    sigmas_m: NDArray[np.float64]
    """Of the position, over the places that matter..."""
    over: str
    """...which are these, in words."""
    notes: tuple[str, ...]
    advice: tuple[str, ...]


def find(
    pairs: KeypointPairs,
    scale: TwinScale,
    *,
    size_px: tuple[int, int],
    say: Callable[[float], str],
    lens: Lens | None = None,
    track: Track | None = None,
    metres_per_px: float | None = None,
    sigmas_px: tuple[float, float] = (CLICK_SIGMA_PX, TWIN_SIGMA_PX),
) -> Found:
    """What the pairs, clicked on a picture of `size_px`, tell of the map to a twin of `scale`.

    `say` puts a length of `scale` into words. `metres_per_px`: the scale for errors in metres; None where it is not known and
    that of `scale` is made up. `sigmas_px`: of a click and of a twin's point. Raises `InputError` as `fit_keypoints` does, and
    where the picture shows nothing of the track.
    """
    fit = fit_keypoints(
        pairs,
        scale,
        width_px=size_px[0],
        height_px=size_px[1],
        lens=lens,
        click_sigma_px=sigmas_px[0],
        twin_sigma_px=sigmas_px[1],
    )
    plain = ideal_pairs(pairs, lens)
    clicked = pairs.camera_array()
    places = hull_px(clicked) if track is None else lane_px(fit.calibration.ground, track)
    if not len(places):
        raise InputError(f"{pairs.source}: the picture shows nothing of the track: check the image size and the twin")
    return Found(
        fit=fit,
        plain=calibration_error(plain, metres_per_px=metres_per_px),
        by_count=error_by_count(plain),
        sigmas_m=fit.calibration.sigma_m(places),
        over="the lane" if track is not None else "the area between the keypoints",
        notes=fit.calibration.notes,
        advice=advise(fit, clicked, places, say),
    )
