"""The twin's picture and the lane in it.

Knows pictures and colours: which pixels of the twin are lane, given the lane's colour or shade (the latter by `lane_shade`).
Knows no route and no metres.
Colours are HSV as drawing programs show them: hue 0..360 degrees, saturation and value 0..100 percent.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.track.lane_shade import LaneShade, lane_piece, shade_mask
from dnb_edge.values import BgrImage, PointPx

Mask = NDArray[np.bool_]
"""Shape (height, width), True on the lane."""

_LEAST_LANE_SHARE = 1e-3
"""A lane that covers less of the picture is taken for stray pixels of its colour."""
_WIDEST_SEAM = 0.25
"""Of the picture's longest side."""
_LOOK = 0.002
"""A colour is taken from a square of so many times the picture's longest side about its place, in each direction."""
_GREY_SATURATION_PERCENT = 10.0
_DARK_VALUE_PERCENT = 15.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneColour:
    """The lane's colour in the twin and how far a pixel may differ from it."""

    hue_deg: float
    saturation_percent: float
    value_percent: float
    hue_tolerance_deg: float = 20.0
    saturation_tolerance_percent: float = 14.0
    value_tolerance_percent: float = 20.0

    def __post_init__(self) -> None:
        """Raises `InputError` where a number is outside its range."""
        for name, most in (("hue_deg", 360.0), ("saturation_percent", 100.0), ("value_percent", 100.0)):
            value = getattr(self, name)
            if not (math.isfinite(value) and 0 <= value <= most):
                raise InputError(f"lane colour: {name} must lie between 0 and {most:g}, not {value!r}")
        for name in ("hue_tolerance_deg", "saturation_tolerance_percent", "value_tolerance_percent"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"lane colour: {name} must be positive, not {value!r}")

    def __str__(self) -> str:
        """The colour and its tolerances, as errors name it."""
        return (
            f"hue {self.hue_deg:g} +- {self.hue_tolerance_deg:g} deg, "
            f"saturation {self.saturation_percent:g} +- {self.saturation_tolerance_percent:g} %, "
            f"value {self.value_percent:g} +- {self.value_tolerance_percent:g} %"
        )


Lane: TypeAlias = LaneColour | LaneShade
"""What tells the lane from the floor: its colour, or that it is darker, lighter, or between lines."""


def load_twin(path: Path) -> BgrImage:
    """The picture at `path`. Raises `InputError` where there is none or it cannot be read."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot read the twin's image ({error.strerror}): check the path") from error
    image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_COLOR) if data else None
    if image is None:
        raise InputError(f"{path}: not an image that OpenCV can read: save the twin as PNG or JPEG")
    return np.asarray(image, dtype=np.uint8)


def lane_mask(image: BgrImage, lane: Lane, *, source: str, close_gap_px: float, seen: Mask | None = None) -> Mask:
    """The lane's pixels, with seams and holes up to about `close_gap_px` wide closed and stray specks removed.

    `seen` (height, width) is given for photographs: False where the picture shows nothing, as in a rectified one's corners.
    `source` names the picture in errors. Raises `InputError` where the lane is not in the picture, or a seam that wide would
    be a good part of it.
    """
    most_px = _WIDEST_SEAM * max(image.shape[:2])
    if not 0 < close_gap_px <= most_px:
        raise InputError(f"{source}: the widest gap that is closed (close_gap_px, --close-gap-px) must lie between 0 and "
                         f"{most_px:g} twin px, a quarter of the picture, not {close_gap_px:g}")  # fmt: skip
    if isinstance(lane, LaneShade):
        found = _closed(shade_mask(image, lane, source=source, seen=seen), close_gap_px)
        # On a drawing, what looks as much like a lane is one, too, and the route has to be chosen.
        return _without_specks(lane_piece(found, alike=seen is None), close_gap_px)
    hsv = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2HSV), dtype=np.uint8)
    mask = _within(hsv, lane)
    if seen is not None:
        mask[~seen] = 0
    if np.count_nonzero(mask) < _LEAST_LANE_SHARE * mask.size:
        found_px = np.count_nonzero(mask)
        raise InputError(
            f"{source}: {'no pixel' if found_px == 0 else f'only {found_px} pixels'} of the picture within {lane}; "
            f"its most common colours are {', '.join(_common_colours(hsv))}: set the lane colour to the lane's"
        )
    closed = _closed(mask, close_gap_px)
    # A photograph shows other things of that colour; on a drawing all of it is lane.
    return _without_specks(closed if seen is None else lane_piece(closed), close_gap_px)


def colour_of(blue: float, green: float, red: float) -> LaneColour:
    """The lane's colour, with the usual tolerances, from blue, green and red, 0..255 each."""
    pixel = np.array([[[blue, green, red]]], dtype=np.float32) / np.float32(255.0)
    hue_deg, saturation, value = (float(part) for part in cv2.cvtColor(pixel, cv2.COLOR_BGR2HSV)[0, 0])
    return LaneColour(
        hue_deg=min(hue_deg, 360.0),
        saturation_percent=min(100.0 * saturation, 100.0),
        value_percent=min(100.0 * value, 100.0),
    )


def colour_at(image: BgrImage, at_px: PointPx, *, source: str) -> LaneColour:
    """The colour round the place `at_px` of the picture, as the lane's. Raises `InputError` where that is outside of it."""
    height, width = image.shape[:2]
    u, v = (round(part) for part in at_px)
    if not (0 <= u < width and 0 <= v < height):
        raise InputError(
            f"{source}: the place ({at_px[0]:g}, {at_px[1]:g}) px for the lane's colour is outside of the picture of "
            f"{width}x{height} px: choose one on the lane"
        )
    reach = max(1, round(_LOOK * max(height, width)))
    near = image[max(0, v - reach) : v + reach + 1, max(0, u - reach) : u + reach + 1].reshape(-1, 3)
    blue, green, red = (float(part) for part in np.median(near, axis=0))
    return colour_of(blue, green, red)


def default_close_gap_px(image: BgrImage) -> float:
    """The widest seam that is closed where nobody says otherwise: 0.4 % of the picture's longest side."""
    height, width = image.shape[:2]
    return float(max(2.0, 0.004 * max(height, width)))


def _within(hsv: NDArray[np.uint8], colour: LaneColour) -> NDArray[np.uint8]:
    """255 where the pixel has the colour. Grey has no hue, and near black even saturation means nothing."""
    dark = colour.value_percent < _DARK_VALUE_PERCENT
    grey = dark or colour.saturation_percent < _GREY_SATURATION_PERCENT
    low, high = [0.0, 0.0, 0.0], [180.0, 255.0, 255.0]
    for channel, centre, tolerance, ignored in (
        (1, colour.saturation_percent, colour.saturation_tolerance_percent, dark),
        (2, colour.value_percent, colour.value_tolerance_percent, False),
    ):
        if not ignored:
            low[channel], high[channel] = (centre - tolerance) * 2.55, (centre + tolerance) * 2.55
    mask = np.zeros(hsv.shape[:2], dtype=np.uint8)
    turns = (0.0,) if grey else (-180.0, 0.0, 180.0)
    for turn in turns:
        if not grey:
            low[0] = (colour.hue_deg - colour.hue_tolerance_deg) / 2 + turn
            high[0] = (colour.hue_deg + colour.hue_tolerance_deg) / 2 + turn
        mask |= np.asarray(cv2.inRange(hsv, np.array(low), np.array(high)), dtype=np.uint8)
    return mask


def _closed(mask: NDArray[np.uint8], gap_px: float) -> NDArray[np.uint8]:
    """Morphological closing by a disc; the border is background, so that lanes at the picture's edge stay open there."""
    radius = max(1, math.ceil(gap_px / 2))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    padded = cv2.copyMakeBorder(mask, radius, radius, radius, radius, cv2.BORDER_CONSTANT, value=0)
    closed = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, disc)
    return np.asarray(closed[radius:-radius, radius:-radius], dtype=np.uint8)


def _without_specks(mask: NDArray[np.uint8], gap_px: float) -> Mask:
    """Drops pieces of lane below 1 % of the largest and fills holes of a few gaps' width."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    areas = stats[:, cv2.CC_STAT_AREA]
    keep = np.zeros(count, dtype=bool)
    keep[1:] = areas[1:] >= 0.01 * areas[1:].max()
    lane = keep[labels]
    outside = cv2.copyMakeBorder((~lane).astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=1)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(outside, connectivity=4)
    small = stats[:, cv2.CC_STAT_AREA] < (4 * gap_px) ** 2
    small[0] = False
    return np.asarray(lane | small[labels[1:-1, 1:-1]], dtype=bool)


def _common_colours(hsv: NDArray[np.uint8], most: int = 4) -> list[str]:
    """The picture's most common colours in coarse steps, as text with their share of the picture."""
    thinned = hsv[:: max(1, hsv.shape[0] // 400), :: max(1, hsv.shape[1] // 400)].reshape(-1, 3).astype(np.int64)
    steps = np.column_stack((thinned[:, 0] // 10, thinned[:, 1] // 26, thinned[:, 2] // 26))
    steps[steps[:, 1] == 0, 0] = 0  # grey has no hue
    kinds, inverse, counts = np.unique(steps, axis=0, return_inverse=True, return_counts=True)
    texts = []
    for kind in np.argsort(-counts)[:most]:
        members = thinned[inverse.reshape(-1) == kind]
        hue, saturation, value = np.median(members, axis=0) * (2.0, 1 / 2.55, 1 / 2.55)
        hue_text = "grey or white" if kinds[kind, 1] == 0 else f"hue {hue:.0f} deg"
        texts.append(f"{hue_text} saturation {saturation:.0f} % value {value:.0f} % ({counts[kind] / len(steps):.0%})")
    return texts
