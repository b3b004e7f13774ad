"""Small patches of a still picture by which its place is told again: chosen where there is texture, found again to a fraction
of a pixel.

Knows pictures and camera px; knows no track, no time and no car. Pictures are compared by normalised correlation after a band
pass, so that neither brightness, contrast nor a slope of light across a patch matters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Self, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import Points

Picture: TypeAlias = NDArray[np.uint8]
"""Grey (h, w) or blue-green-red (h, w, 3)."""

Plane: TypeAlias = NDArray[np.float32]

CELLS = (8, 6)
"""Columns and rows of the grid that spreads the patches."""

MOST_PATCHES = 40

NOISE_LEVELS = 1.2
"""Noise assumed in a band-passed picture, levels."""

WORST_SIGMA_PX = 0.09
"""A patch whose texture cannot be placed more exactly than this under that noise is not used, px."""

SEEN_SCORE = 0.7
"""Correlation, -1..1, from which on a patch counts as seen."""

ALIKE_SCORE = 0.8
"""A patch that looks so much like its own neighbourhood could be mistaken for it and is not used."""

_REFERENCE_WIDTH_PX = 1280.0
_FAVOUR = 0.3
_PER_CELL = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class PatchSize:
    """Sizes for pictures of one width, px."""

    half_px: int
    """A patch reaches so far from its middle."""
    search_px: int
    """It is looked for so far around where it should be."""

    @classmethod
    def for_width(cls, width_px: int) -> Self:
        """31 px patches and a search of 12 px in pictures 1280 px wide, in proportion elsewhere."""
        share = width_px / _REFERENCE_WIDTH_PX
        return cls(half_px=max(7, round(15 * share)), search_px=max(6, round(12 * share)))

    @property
    def rim_px(self) -> int:
        """What the band pass needs round what it is to give."""
        return self.half_px // 2 + 1

    @property
    def margin_px(self) -> int:
        """A patch's middle must lie so far inside the picture, that its search fits."""
        return self.half_px + self.search_px + self.rim_px


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Patch:
    """One patch of the reference picture."""

    camera_px: tuple[int, int]
    """Its middle."""
    template: Plane
    """(2 half + 1, 2 half + 1), band-passed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Match:
    """Where a patch was found, and how alike it looked."""

    camera_px: tuple[float, float]
    score: float
    """Normalised correlation, -1..1."""
    inside: bool
    """False where the best place lay on the border of the search: the true one may be beyond."""

    @property
    def seen(self) -> bool:
        """Whether this is the patch, and not what hides it."""
        return self.inside and self.score >= SEEN_SCORE


def grey(picture: Picture) -> NDArray[np.uint8]:
    """The picture in grey, (h, w)."""
    if picture.ndim == 2:
        return picture
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), dtype=np.uint8)


def corner_points(picture: Picture, size: PatchSize, favoured_px: Points | None = None) -> list[tuple[int, int]]:
    """The most corner-like points of each cell, camera px: the best of all cells, best first, then the second ones.

    Points inside the convex hull of `favoured_px` (n, 2), where given, are taken before better ones outside: what lies on the
    floor is seldom carried away.
    """
    half = cv2.resize(grey(picture), None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    height, width = half.shape
    margin = size.margin_px // 2 + 1
    if height <= 2 * margin or width <= 2 * margin:
        return []
    smooth = cv2.GaussianBlur(half, (3, 3), 0.0)
    quality = np.asarray(cv2.cornerMinEigenVal(smooth, size.half_px | 1), dtype=np.float32)
    if favoured_px is not None and len(favoured_px) > 2:
        weight = np.full(half.shape, _FAVOUR, dtype=np.float32)
        hull = cv2.convexHull(np.asarray(np.clip(favoured_px / 2.0, -1e4, 1e4), dtype=np.float32))
        cv2.fillConvexPoly(weight, np.rint(hull).astype(np.int32), (1.0,))
        quality *= weight
    columns, rows = CELLS
    lefts = np.linspace(margin, width - margin, columns + 1).astype(int).tolist()
    tops = np.linspace(margin, height - margin, rows + 1).astype(int).tolist()
    found = []
    for top, bottom in pairwise(tops):
        for left, right in pairwise(lefts):
            cell = quality[top:bottom, left:right]
            for choice in range(_PER_CELL):
                _, best, _, (u, v) = cv2.minMaxLoc(cell)
                found.append((choice, -best, (2 * (left + u), 2 * (top + v))))
                near = size.half_px
                cell[max(0, v - near) : v + near, max(0, u - near) : u + near] = 0.0
    return [point for _, _, point in sorted(found)]


def make_patch(picture: Picture, camera_px: tuple[int, int], size: PatchSize) -> Patch | None:
    """The patch round a point of the reference picture; None where it has too little texture, or too much of a pattern."""
    window = _window(picture, camera_px, size)
    if window is None:
        return None
    search = size.search_px
    template = np.ascontiguousarray(window[search:-search, search:-search])
    if _sigma_px(template) > WORST_SIGMA_PX:
        return None
    scores = cv2.matchTemplate(window, template, cv2.TM_CCOEFF_NORMED)
    # Its own peak is as wide as its texture is coarse.
    near = max(3, size.half_px // 3)
    scores[search - near : search + near + 1, search - near : search + near + 1] = -1.0
    if float(scores.max()) > ALIKE_SCORE:
        return None
    return Patch(camera_px=camera_px, template=template)


def match(
    patch: Patch, picture: Picture, size: PatchSize, expected_px: tuple[float, float] | None = None
) -> Match | None:
    """Where the patch is in `picture`, looked for round `expected_px`, by default its old place; None beyond the picture."""
    u, v = patch.camera_px if expected_px is None else (round(expected_px[0]), round(expected_px[1]))
    window = _window(picture, (u, v), size)
    if window is None:
        return None
    du, dv, score, inside = best_place(window, patch.template)
    return Match(camera_px=(u + du - size.search_px, v + dv - size.search_px), score=score, inside=inside)


def best_place(window: Plane, template: Plane) -> tuple[float, float, float, bool]:
    """Where `template` fits `window` best: (u, v) of its top left corner to a fraction of a px, the score there, and whether
    that place lies inside the search, not on its border."""
    scores = cv2.matchTemplate(window, template, cv2.TM_CCOEFF_NORMED)
    _, score, _, (u, v) = cv2.minMaxLoc(scores)
    height, width = scores.shape
    if not (0 < u < width - 1 and 0 < v < height - 1):
        return float(u), float(v), float(score), False
    rows, columns = template.shape
    du, dv = _finer(np.ascontiguousarray(window[v : v + rows, u : u + columns]), template)
    return u + du, v + dv, float(score), True


def _finer(seen: Plane, template: Plane) -> tuple[float, float]:
    """By how much `seen` is shifted against `template`, px, each within one; they are alike but for that and contrast.

    One step of efficient second-order minimisation (Malis, ICRA 2004): seen = gain template + offset - shift . gradient, with
    the mean gradient of both, which is exact to the second order. The top of a parabola through the scores is not: it leans
    to whole px where texture is fine.
    """
    # Band-passed pictures have no mean to speak of: their norms compare like their contrasts, and cost less.
    both = cv2.addWeighted(template, 1.0, seen, cv2.norm(template) / max(cv2.norm(seen), 1e-6), 0.0)
    rows, columns = template.shape
    terms = np.empty((5, rows - 2, columns - 2), dtype=np.float32)
    terms[0] = both[1:-1, 2:]
    terms[0] -= both[1:-1, :-2]
    terms[1] = both[2:, 1:-1]
    terms[1] -= both[:-2, 1:-1]
    terms[2], terms[3], terms[4] = template[1:-1, 1:-1], 1.0, seen[1:-1, 1:-1]
    flat = terms.reshape(5, -1)
    products = (flat[:4] @ flat.T).astype(np.float64)
    try:
        # The differences are those of two px, of the sum of two pictures: four times the mean gradient.
        by_u_share, by_v_share, gain, _ = (
            np.linalg.solve(products[:, :4], products[:, 4]) * (4.0, 4.0, 1.0, 1.0)
        ).tolist()
    except np.linalg.LinAlgError:
        return 0.0, 0.0
    if gain <= 0.0:
        return 0.0, 0.0
    return min(max(-by_u_share / gain, -1.0), 1.0), min(max(-by_v_share / gain, -1.0), 1.0)


def band_passed(picture: NDArray[np.uint8], box_px: int) -> Plane:
    """A grey picture without its noise and without anything coarser than `box_px`, float32."""
    levels = picture.astype(np.float32)
    smooth = cv2.GaussianBlur(levels, (5, 5), 1.0)
    return np.asarray(cv2.subtract(smooth, cv2.blur(levels, (box_px, box_px))), dtype=np.float32)


def _window(picture: Picture, camera_px: tuple[int, int], size: PatchSize) -> Plane | None:
    """The band-passed surroundings in which a patch is looked for; None where they reach beyond the picture."""
    u, v = camera_px
    reach, rim = size.margin_px, size.rim_px
    height, width = picture.shape[:2]
    if not (reach <= u < width - reach and reach <= v < height - reach):
        return None
    crop: Any = picture[v - reach : v + reach + 1, u - reach : u + reach + 1]
    return band_passed(grey(crop), 2 * rim + 1)[rim:-rim, rim:-rim]


def _sigma_px(template: Plane) -> float:
    """One standard deviation of where the template can be placed, px, along its worst direction.

    The Cramer-Rao bound of a shift: the noise over the root of the smaller eigenvalue of the gradients' sums.
    """
    by_v, by_u = np.gradient(template.astype(np.float64))
    uu, uv, vv = float((by_u**2).sum()), float((by_u * by_v).sum()), float((by_v**2).sum())
    least = 0.5 * (uu + vv) - math.hypot(0.5 * (uu - vv), uv)
    return NOISE_LEVELS / math.sqrt(least) if least > 0.0 else math.inf
