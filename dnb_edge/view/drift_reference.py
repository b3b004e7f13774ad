"""What a camera's picture looked like when it stood where it was calibrated, and where that is found in a later picture.

Knows pictures in camera px and the patches of one of them; knows no track and no time. Two searches: each patch near where it
should be, to a fraction of a pixel; and, where that fails, a few large patches over the whole of a reduced picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import Points
from dnb_edge.view.drift_motion import Motion, common_motion
from dnb_edge.view.drift_patches import (
    MOST_PATCHES,
    Match,
    Patch,
    PatchSize,
    Picture,
    Plane,
    band_passed,
    best_place,
    corner_points,
    grey,
    make_patch,
    match,
)

COARSE_WIDTH_PX = 240
_COARSE_HALF_PX = 10
_COARSE_BOX_PX = 21
_COARSE_CELLS = (4, 3)
_COARSE_SEEN = 0.6
_COARSE_TOLERANCE_PX = 1.2
_COARSE_FEWEST = 4
_FAINT = 0.35
"""A part of a picture with less than this share of the reference's contrast shows nothing: it is dark, or hidden by a hand."""

_LIVELY = 0.5
"""Where fewer than this share of its parts show something, a picture does not show another place."""

FEWEST_PATCHES = 10
_NINTHS = 3
FEWEST_PARTS = 4
"""Of nine parts of the picture so many must hold patches."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Coarse:
    """The reduced reference picture's large patches."""

    camera_px: Points
    """(n, 2) middles, px of the reduced picture."""
    templates: tuple[Plane, ...]
    contrast: float
    """Mean over the parts of the picture, levels."""

    @classmethod
    def of(cls, picture: Picture) -> Self:
        """At most twelve, spread over the picture."""
        plane = coarse_plane(picture)
        height, width = plane.shape
        half = _COARSE_HALF_PX
        columns, rows = _COARSE_CELLS
        quality = cv2.cornerMinEigenVal(plane, 2 * half + 1)
        lefts = np.linspace(half, width - half, columns + 1).astype(int)
        tops = np.linspace(half, height - half, rows + 1).astype(int)
        points = []
        for top, bottom in pairwise(tops.tolist()):
            for left, right in pairwise(lefts.tolist()):
                _, _, _, (u, v) = cv2.minMaxLoc(quality[top:bottom, left:right])
                points.append((left + u, top + v))
        templates = tuple(plane[v - half : v + half + 1, u - half : u + half + 1].copy() for u, v in points)
        contrast = float(np.mean(_contrasts(plane)))
        return cls(camera_px=np.array(points, dtype=np.float64), templates=templates, contrast=contrast)


def coarse_plane(picture: Picture) -> Plane:
    """The picture reduced to a width of `COARSE_WIDTH_PX` and band-passed."""
    height, width = picture.shape[:2]
    size = (COARSE_WIDTH_PX, max(3 * _COARSE_HALF_PX, round(height * COARSE_WIDTH_PX / width)))
    return band_passed(grey(np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))), _COARSE_BOX_PX)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaceReference:
    """The picture of a camera in its place, as patches."""

    size_px: tuple[int, int]
    """(width, height) of the pictures that it is compared with."""
    patch_size: PatchSize
    patches: tuple[Patch, ...]
    coarse: Coarse

    @classmethod
    def of(cls, picture: Picture, favoured_px: Points | None = None) -> Self:
        """The reference from one picture; `favoured_px` as in `corner_points`."""
        size = PatchSize.for_width(picture.shape[1])
        made = (make_patch(picture, point, size) for point in corner_points(picture, size, favoured_px))
        return cls.from_patches(picture, [patch for patch in made if patch is not None])

    @classmethod
    def from_patches(cls, picture: Picture, patches: Sequence[Patch]) -> Self:
        """The reference from the patches that were made of `picture`."""
        height, width = picture.shape[:2]
        return cls(
            size_px=(width, height),
            patch_size=PatchSize.for_width(width),
            patches=tuple(patches[:MOST_PATCHES]),
            coarse=Coarse.of(picture),
        )

    @property
    def enough(self) -> bool:
        """Whether there are patches enough, in parts of the picture enough, to tell where it is."""
        return len(self.patches) >= FEWEST_PATCHES and self.parts(np.ones(len(self.patches), bool)) >= FEWEST_PARTS

    @property
    def tolerance_px(self) -> float:
        """How far patches of one motion may lie from it."""
        return max(0.4, 0.6 * self.size_px[0] / 1280.0)

    def parts(self, chosen: NDArray[np.bool_]) -> int:
        """In how many ninths of the picture the chosen patches (n,) lie."""
        width, height = self.size_px
        ninths = {
            (patch.camera_px[0] * _NINTHS // width, patch.camera_px[1] * _NINTHS // height)
            for patch, one in zip(self.patches, chosen, strict=True)
            if one
        }
        return len(ninths)

    def find(self, index: int, picture: Picture, expected: Motion | None = None) -> Match | None:
        """Patch `index` in `picture`, round where `expected` puts it; None where that is beyond the picture."""
        patch = self.patches[index]
        if expected is None:
            return match(patch, picture, self.patch_size)
        before = np.array([patch.camera_px], dtype=np.float64)
        ((u, v),) = (before + expected.shift_px(before)).tolist()
        return match(patch, picture, self.patch_size, (u, v))

    def motion(self, matches: Sequence[Match | None], expected: Motion | None = None) -> Motion | None:
        """What the seen ones of the matches, one a patch, agree on; its `agreeing` is of all patches."""
        seen = np.array([one is not None and one.seen for one in matches], dtype=bool)
        before = np.array([patch.camera_px for patch in self.patches], dtype=np.float64).reshape(-1, 2)
        after = before.copy()
        after[seen] = [one.camera_px for one in matches if one is not None and one.seen] or np.empty((0, 2))
        tolerance_px = self.tolerance_px
        if expected is not None:
            # The field is that of small motions: the larger, the less exactly it holds.
            tolerance_px += 0.03 * float(np.abs(expected.numbers[:2]).max())
        motion = common_motion(before[seen], (after - before)[seen], self.size_px, tolerance_px=tolerance_px)
        if motion is None:
            return None
        agreeing = seen.copy()
        agreeing[seen] = motion.agreeing
        return Motion(numbers=motion.numbers, covariance=motion.covariance, agreeing=agreeing, size_px=motion.size_px)

    def search(self, picture: Picture) -> tuple[Motion | None, bool]:
        """A whole `Search` of `picture` at once."""
        search = Search(self, picture)
        search.step_to(1.0)
        return search.result()


class Search:
    """Looks for the reference all over one picture, a few of its large patches at a time."""

    def __init__(self, reference: PlaceReference, picture: Picture) -> None:
        self._reference = reference
        self._plane = coarse_plane(picture)
        self._found: list[tuple[float, float, float, bool]] = []

    def step_to(self, share: float) -> bool:
        """Looks for one more patch, and for more until `share`, 0..1, of them have been looked for; True with the last one."""
        templates = self._reference.coarse.templates
        due = max(len(self._found) + 1, round(share * len(templates)))
        for template in templates[len(self._found) : due]:
            self._found.append(best_place(self._plane, template))
        return len(self._found) == len(templates)

    def result(self) -> tuple[Motion | None, bool]:
        """The motion that the large patches agree on, None where they do not; and whether the picture shows enough that it
        would have been found."""
        coarse = self._reference.coarse
        clear = float(np.mean(_contrasts(self._plane) >= _FAINT * coarse.contrast)) >= _LIVELY
        seen = np.array([inside and score >= _COARSE_SEEN for _, _, score, inside in self._found], dtype=bool)
        if seen.sum() < _COARSE_FEWEST:
            return None, clear
        before = coarse.camera_px[seen]
        after = np.array([(u + _COARSE_HALF_PX, v + _COARSE_HALF_PX) for u, v, _, _ in self._found])[seen]
        height, width = self._plane.shape
        motion = common_motion(before, after - before, (width, height), tolerance_px=_COARSE_TOLERANCE_PX)
        if motion is None or motion.agreeing.sum() < max(_COARSE_FEWEST, 0.5 * seen.sum()):
            return None, clear
        still = ~motion.agreeing & (np.linalg.norm(after - before, axis=1) <= _COARSE_TOLERANCE_PX)
        if still.sum() >= 2:
            # What moved is something in the picture: all of it cannot both move and stay.
            return None, clear
        size_px = self._reference.size_px
        scale = size_px[0] / width
        # Perspective of a few large patches is mostly noise.
        numbers = np.concatenate((motion.numbers[:4], np.zeros(4))) * scale
        covariance = motion.covariance * scale**2
        return Motion(numbers=numbers, covariance=covariance, agreeing=motion.agreeing, size_px=size_px), clear


def _contrasts(plane: Plane) -> NDArray[np.float64]:
    """Standard deviation, levels, of each part of a reduced picture."""
    columns, rows = _COARSE_CELLS
    return np.array(
        [part.std() for row in np.array_split(plane, rows) for part in np.array_split(row, columns, axis=1)]
    )


def median_of_five(pictures: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """The median, pixel by pixel, of five grey pictures (h, w): what moves in two of them at most is not in it."""
    a, b, c, d, e = pictures
    low = cv2.max(cv2.min(a, b), cv2.min(c, d))
    high = cv2.min(cv2.max(a, b), cv2.max(c, d))
    # Of five, neither the least nor the greatest of four is the median: it is that of the other two and the fifth.
    low, high = cv2.min(low, high), cv2.max(low, high)
    return np.asarray(cv2.max(low, cv2.min(high, e)), dtype=np.uint8)
