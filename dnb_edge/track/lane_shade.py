"""The lane by its shade: dark on a light floor, light on a dark one, or the way between two lines.

Knows masks, and which of them looks like a lane. Knows no colour (see `twin`), no route and no metres.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.track.light import BRIGHTEST, THIN, Mask, Plane, against_floor, brightness, disc, even_light, reduced_size
from dnb_edge.values import BgrImage

_LEAST_CONTRAST = 0.08
"""Difference of lane and floor, as a share of the floor's brightness, below which there is no lane."""
_PLAIN_CONTRAST = 0.3
"""The same difference above which it counts for no more."""
_FAINT_SCORE = 0.06
"""A loop that scores less is taken only where the other shade does not stand out half as much again."""
_ALIKE_SCORE = 0.4
_ALIKE_WIDTH = 1.6
"""A piece is a lane, too, if it scores this share of the best one's, and is so many times as wide at most, or as narrow."""
_PIECES = 8
"""So many of the largest pieces are looked at for the lane."""
_LEAST_HOLE = 0.01
"""A lane goes round at least this share of the picture."""
_LEVELS = tuple(level / 100 for level in range(20, 95, 3))
"""Brightness against the floor at which lanes are tried to be told from it."""


class LaneShade(StrEnum):
    """What marks the lane."""

    DARK = "dark"
    """The lane is darker than the floor."""
    LIGHT = "light"
    """The lane is lighter than the floor."""
    AUTO = "auto"
    """Dark or light, whichever makes a loop of even width."""
    BETWEEN_LINES = "between-lines"
    """The lane lies between two lines of tape or paint, dark or light."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Candidate:
    """One way to tell lane from floor."""

    mask: NDArray[np.uint8]
    """(height, width), 255 on the lane."""
    score: float
    """How much it looks like one lane that goes round, greater is better; 0 where nothing goes round."""
    apart: float = 0.0
    """How much of the floor's scatter Otsu's parting explains, as a standard deviation in shares of its brightness."""


_WHAT = {LaneShade.DARK: "darker", LaneShade.LIGHT: "lighter", LaneShade.AUTO: "darker or lighter"}


def shade_mask(image: BgrImage, shade: LaneShade, *, source: str, seen: Mask | None = None) -> NDArray[np.uint8]:
    """255 on the lane, 0 elsewhere, shape (height, width); specks and seams are still in it.

    `seen` (height, width) is True where the picture shows something (a rectified one has empty corners); None for everywhere.
    `source` names the picture in errors. Raises `InputError` where nothing stands out from the floor, or no line closes.
    """
    grey = brightness(even_light(image, seen), seen)
    if shade is LaneShade.BETWEEN_LINES:
        found = [lane for light in (True, False) for lane in _between_lines(grey, seen, light=light)]
        best = max(found, key=lambda candidate: candidate.score, default=None)
        if best is None or best.score == 0.0:
            raise InputError(
                f"{source}: no two closed lines with a lane between them: close their gaps, and keep the outer one inside "
                "the picture"
            )
        return best.mask
    ways = (False, True) if shade is LaneShade.AUTO else (shade is LaneShade.LIGHT,)
    bands = [band for light in ways if (band := _band(grey, seen, light=light)) is not None]
    # Where the floor's estimate overshoots, a lane that stands out well has a faint rim that goes round it.
    clearest = max((band.apart for band in bands), default=0.0)
    bands = [band for band in bands if band.score >= _FAINT_SCORE or 1.5 * band.apart >= clearest]
    if not bands:
        raise InputError(
            f"{source}: nothing in it is {_WHAT[shade]} than the floor around it: name the lane's colour instead, or check "
            "the picture"
        )
    return max(bands, key=lambda candidate: candidate.score).mask


def _band(grey: Plane, seen: Mask | None, *, light: bool) -> _Candidate | None:
    """What is lighter or darker than the floor near it, at the threshold that gives the most lane-like loop.

    Where nothing goes round, what Otsu's threshold gives; None where nothing stands out.
    """
    share = against_floor(grey, seen, light=light, thin=False)
    otsu = _otsu(share[seen] if seen is not None else share)
    if otsu is None:
        return None
    cut, apart = otsu
    size = reduced_size(share.shape)
    small = np.asarray(cv2.resize(share, size, interpolation=cv2.INTER_AREA), dtype=np.float32)
    scores = [_lane_likeness((small < level).astype(np.uint8)) for level in _LEVELS]
    score, level = max(zip(scores, _LEVELS, strict=True))
    if score == 0.0:
        return _Candidate(mask=_below(share, cut), score=0.0, apart=apart)
    inner, outer = _levels_about(small, level)
    halfway = (inner + outer) / 2
    if _lane_likeness((small < halfway).astype(np.uint8)) >= 0.9 * score:
        level = halfway
    score *= min(1.0, max(0.0, outer - inner) / _PLAIN_CONTRAST)
    return _Candidate(mask=_below(share, level), score=score, apart=apart)


def _levels_about(share: Plane, level: float) -> tuple[float, float]:
    """What is below `level`, and what lies round it, by their medians: halfway between them a blurred edge has its place."""
    lane = (share < level).astype(np.uint8)
    ring = (np.asarray(cv2.dilate(lane, disc(12))) > 0) & (np.asarray(cv2.dilate(lane, disc(4))) == 0)
    inner = np.asarray(cv2.erode(lane, disc(2))) > 0
    if not ring.any() or not inner.any():
        return level, level
    return float(np.median(share[inner])), float(np.median(share[ring]))


def _below(share: Plane, level: float) -> NDArray[np.uint8]:
    return (share < level).astype(np.uint8) * np.uint8(255)


def _otsu(values: Plane) -> tuple[float, float] | None:
    """The level at which brightness against the floor falls into two parts, and the scatter (a standard deviation) that their
    difference makes; None where they hardly differ.

    N. Otsu, "A threshold selection method from gray-level histograms", IEEE Trans. SMC 9, 1979.
    """
    counts, edges = np.histogram(values, bins=128, range=(0.0, BRIGHTEST))
    middles = (edges[1:] + edges[:-1]) / 2
    weight, moment = np.cumsum(counts), np.cumsum(counts * middles)
    below, above = weight[:-1], weight[-1] - weight[:-1]
    apart = (moment[-1] - moment[:-1]) / np.maximum(above, 1) - moment[:-1] / np.maximum(below, 1)
    apart = np.where((below > 0) & (above > 0), apart, 0.0)
    between = below * above * apart**2
    best = int(np.argmax(between))
    if apart[best] < _LEAST_CONTRAST:
        return None
    return float(edges[best + 1]), math.sqrt(float(between[best])) / float(weight[-1])


def _lane_likeness(mask: NDArray[np.uint8]) -> float:
    """How much a loop of the reduced mask (0 or more) looks like a lane: of even width, large, and inside the picture.

    0 where nothing goes round.
    """
    small = np.asarray(cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((5, 5), dtype=np.uint8)))
    best = 0.0
    count, labels, stats, _ = cv2.connectedComponentsWithStats(small, connectivity=8)
    for label in range(1, count):
        area = int(stats[label, cv2.CC_STAT_AREA])
        if area < 1e-3 * small.size:
            continue
        piece = (labels == label).astype(np.uint8)
        hole = _enclosed(piece) - area
        if hole < _LEAST_HOLE * small.size:
            continue
        ridge = _ridge(np.pad(piece, 1))
        even = float(np.percentile(ridge, 25) / np.percentile(ridge, 95))
        inside = 1.0 if _is_inside(stats[label], small.shape) else 0.3
        best = max(best, even**2 * inside * math.sqrt(area / small.size))
    return best


def lane_piece(mask: NDArray[np.uint8], *, alike: bool = False) -> NDArray[np.uint8]:
    """The one connected piece of the mask (255, else 0) that looks most like a lane; the largest where none goes round.

    With `alike` come the other pieces that go round as evenly and are about as wide: a drawing's other lanes.
    """
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    if count < 2:
        return mask
    largest = 1 + np.argsort(-stats[1:, cv2.CC_STAT_AREA])[:_PIECES]

    def likeness(label: int) -> tuple[float, int]:
        piece = (labels == label).astype(np.uint8) * np.uint8(255)
        small = np.asarray(cv2.resize(piece, reduced_size(mask.shape), interpolation=cv2.INTER_AREA))
        return _lane_likeness((small > 127).astype(np.uint8)), int(stats[label, cv2.CC_STAT_AREA])

    likely = {int(label): likeness(int(label)) for label in largest}
    best = max(likely, key=lambda label: likely[label])
    kept = np.zeros(count, dtype=bool)
    kept[best] = True
    if alike and likely[best][0] > 0:
        wide = _width(labels == best)
        for label, (score, _) in likely.items():
            if score >= _ALIKE_SCORE * likely[best][0]:
                kept[label] |= 1 / _ALIKE_WIDTH <= _width(labels == label) / wide <= _ALIKE_WIDTH
    return np.asarray(kept[labels].astype(np.uint8) * np.uint8(255))


def _width(piece: NDArray[np.bool_]) -> float:
    """Usual half-width of what is drawn, px."""
    return float(np.median(_ridge(np.pad(piece.astype(np.uint8), 1))))


def _enclosed(piece: NDArray[np.uint8]) -> int:
    """Px of the piece and of all that it encloses."""
    outside = np.pad(1 - piece, 1, constant_values=1).astype(np.uint8)
    _, labels = cv2.connectedComponents(outside, connectivity=4)
    return int(outside.size - np.count_nonzero(labels == labels[0, 0]))


def _is_inside(stats: NDArray[np.int32], shape: tuple[int, ...]) -> bool:
    left, top = int(stats[cv2.CC_STAT_LEFT]), int(stats[cv2.CC_STAT_TOP])
    right, bottom = left + int(stats[cv2.CC_STAT_WIDTH]), top + int(stats[cv2.CC_STAT_HEIGHT])
    return left > 0 and top > 0 and right < shape[1] and bottom < shape[0]


def _between_lines(grey: Plane, seen: Mask | None, *, light: bool) -> list[_Candidate]:
    """The lane between lines that are lighter or darker than the floor, or nothing."""
    share = against_floor(grey, seen, light=light, thin=True)
    otsu = _otsu(share[seen] if seen is not None else share)
    if otsu is None:
        return []
    level = otsu[0]
    # Lines cover little of the floor, so that Otsu may cut the floor itself: a stricter level goes along.
    lanes = [_between((share < one).astype(np.uint8)) for one in sorted({level, 0.5 * (level + float(share.min()))})]
    return [lane for lane in lanes if lane is not None]


def _between(lines: NDArray[np.uint8]) -> _Candidate | None:
    """The lane between the `lines` (1, else 0): what is enclosed by them and lies right behind the outermost.

    Lines across the lane, such as the start line, cut it to pieces; each lies behind the outer line, the infield does not.
    """
    thick = 2 * float(np.percentile(_ridge(lines), 90)) if lines.any() else 0.0
    if not 0.0 < thick < THIN * min(lines.shape):
        return None
    drawn = np.asarray(cv2.morphologyEx(lines, cv2.MORPH_CLOSE, disc(thick)), dtype=np.uint8)
    free = np.pad(1 - drawn, 1, constant_values=1).astype(np.uint8)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(free, connectivity=4)
    outside = (labels == labels[0, 0]).astype(np.uint8)
    near_outside = np.asarray(cv2.dilate(outside, disc(2 * (2 * thick + 2)))) > 0
    touching = np.bincount(labels[near_outside], minlength=count)
    keep = (touching > 0) & (stats[:, cv2.CC_STAT_AREA] > (3 * thick) ** 2)
    keep[[0, int(labels[0, 0])]] = False  # 0 are the lines themselves
    lane = keep[labels].astype(np.uint8)
    lane = np.asarray(cv2.morphologyEx(lane, cv2.MORPH_CLOSE, disc(2.5 * thick + 2)), dtype=np.uint8)[1:-1, 1:-1]
    small = cv2.resize(lane * np.uint8(255), reduced_size(lane.shape), interpolation=cv2.INTER_AREA)
    score = _lane_likeness((np.asarray(small) > 127).astype(np.uint8))
    return _Candidate(mask=np.asarray(lane * np.uint8(255)), score=score)


def _ridge(drawn: NDArray[np.uint8]) -> Plane:
    """Half-widths, px, along the middles of what is drawn."""
    distance = np.asarray(cv2.distanceTransform(drawn, cv2.DIST_L2, 5), dtype=np.float32)
    top = np.asarray(cv2.dilate(distance, np.ones((3, 3), dtype=np.uint8)))
    return np.asarray(distance[(distance > 0) & (distance >= top)], dtype=np.float32)
