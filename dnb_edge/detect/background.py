"""What the floor looks like without the cars: a picture at reduced size that follows light and furniture, never a followed car.

Knows pixels and discs in which it must not learn; nothing of cars or networks. It looks at one band of rows every few
frames, all bands in turn. A pixel is learnt once it has kept its colour over several looks: a ghost (a car that stood there
in the first frame) goes so within a second or two, furniture likewise, and something that drives through is never learnt.
Inside the frozen discs nothing is learnt at all, nor for a while after a disc has gone: a car that stands still and is lost
for a moment does not sink in.

A bumped camera or a light switched on changes the picture everywhere at once. The background is then *unsettled*: what
differs from it tells nothing of cars, and it looks at every band of every frame until it has caught up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import BgrImage, PointPx

CELL_PX = 4
"""Side of the cells in which movement is summed up, background px."""

MOVED_LEVEL = 22
"""Difference from the background, 0..255, above which something counts as moved."""

_BLOCKS = (8, 8)
"""Columns and rows of the blocks by which a change everywhere is told from one in some places."""
_SUSPICIOUS = 0.01
"""Where less than this share of the cells has moved nothing has happened everywhere."""
_LEAST_EDGES = 0.005
"""Fewer cells with edges than this share tell nothing of a bump."""
_EDGES_LAST = 250
"""Judgements for which the background's edges are taken as known."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BackgroundSettings:
    """How fast the background learns."""

    bands: int = 4
    """A frame is looked at in as many bands of rows, one at a time."""
    every_frames: int = 3
    """One band is looked at every n-th frame: the others cost nothing."""
    stable_looks: int = 3
    """A pixel that kept its colour for as many looks is learnt."""
    stable_levels: int = 14
    """Largest change, in levels of 0..255, that still counts as the same colour."""
    hold_looks: int = 3
    """As many looks more a pixel waits that was in a frozen disc."""
    unsettled_share: float = 0.5
    """The background is unsettled where more than this share of the picture's blocks, or of its edges, has moved ..."""
    settled_share: float = 0.2
    """... until no more than this share has."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Disc:
    """A place where nothing is learnt, camera px of the full frame."""

    centre_px: PointPx
    radius_px: float


class Background:
    """The background of one fixed camera, from its first frame at reduced size, `scale` times the full one."""

    def __init__(self, reduced: BgrImage, *, scale: float, settings: BackgroundSettings | None = None) -> None:
        self.settings = settings or BackgroundSettings()
        self.scale = scale
        self.picture: BgrImage = reduced.copy()
        """The floor at the reduced size. Not to be written to."""
        self.settled = True
        """False while the picture has changed everywhere and is not learnt yet."""
        height, width = reduced.shape[:2]
        self.moved_cells: NDArray[np.uint8] = np.zeros((max(1, height // CELL_PX), max(1, width // CELL_PX)), np.uint8)
        """Mean difference in each cell when its band was looked at last. Not to be written to."""
        self._last: BgrImage = reduced.copy()
        self._ones: NDArray[np.uint8] = np.ones((height, width), np.uint8)
        self._holds: NDArray[np.uint8] = np.full((height, width), self.settings.hold_looks, np.uint8)
        self._looks: NDArray[np.uint8] = self._holds.copy()
        self._rows = max(CELL_PX, -(-height // (self.settings.bands * CELL_PX)) * CELL_PX)
        self._next = 0
        self._edges: tuple[NDArray[np.uint8], NDArray[np.uint8]] | None = None
        self._edges_age = 0

    def is_due(self, number: int) -> bool:
        """Whether it wants to look at frame `number`, counted from 0."""
        return not self.settled or number % self.settings.every_frames == 0

    def rows(self) -> slice:
        """The rows to look at next: one band; all of them where the background is unsettled."""
        height = self.picture.shape[0]
        if not self.settled:
            return slice(0, height)
        return slice(self._next, min(height, self._next + self._rows))

    def compare(self, reduced: BgrImage, rows: slice) -> NDArray[np.uint8]:
        """Difference of `reduced`, those rows of a frame at reduced size, from the background; (h, w)."""
        moved = difference(reduced, self.picture[rows])
        height, width = (side // CELL_PX for side in moved.shape)
        if height and width:
            first = rows.start // CELL_PX
            self.moved_cells[first : first + height, :width] = _cells(moved)
            self._judge()
        return moved

    def learn(self, reduced: BgrImage, rows: slice, *, frozen: Sequence[Disc] = ()) -> None:
        """Learn from those rows of a frame, outside the `frozen` discs."""
        settings = self.settings
        _, changed = cv2.threshold(
            difference(reduced, self._last[rows]), settings.stable_levels, 255.0, cv2.THRESH_BINARY
        )
        # one look more; what has changed falls back to `hold_looks`, what is frozen to none
        looks = cv2.min(
            cv2.add(self._looks[rows], self._ones[rows]), cv2.max(cv2.bitwise_not(changed), self._holds[rows])
        )
        for disc in frozen:
            u, v = ((at + 0.5) * self.scale - 0.5 for at in disc.centre_px)
            cv2.circle(looks, (round(u), round(v) - rows.start), max(1, round(disc.radius_px * self.scale)), (0.0,), -1)
        self._looks[rows] = looks
        self._last[rows] = reduced
        _, ready = cv2.threshold(looks, settings.hold_looks + settings.stable_looks - 1, 255.0, cv2.THRESH_BINARY)
        picture = self.picture[rows]
        fresh = cv2.addWeighted(picture, 0.5, reduced, 0.5, 0.0) if self.settled else reduced
        cv2.copyTo(fresh, ready, picture)
        self._next = rows.stop if rows.stop < self.picture.shape[0] else 0

    def _judge(self) -> None:
        """Tells a change everywhere, by light or by a bump, from one in some places."""
        moved = _over(self.moved_cells)
        if self.settled and cv2.countNonZero(moved) < _SUSPICIOUS * moved.size:
            return
        share = max(_share_of_blocks(moved), self._share_of_edges(moved))
        self.settled = share <= (self.settings.unsettled_share if self.settled else self.settings.settled_share)

    def _share_of_edges(self, moved: NDArray[np.uint8]) -> float:
        """Share of the cells with upright, or level, edges that have moved: a bump moves all edges across it, a car its own."""
        if self._edges is None or self._edges_age > _EDGES_LAST:
            self._edges, self._edges_age = (_edge_cells(self.picture, 1), _edge_cells(self.picture, 0)), 0
        self._edges_age += 1
        shares = [0.0]
        for edges in self._edges:
            count = cv2.countNonZero(edges)
            if count >= _LEAST_EDGES * edges.size:
                shares.append(cv2.countNonZero(cv2.bitwise_and(edges, moved)) / count)
        return max(shares)


def _over(levels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """255 where the difference counts as moved, else 0."""
    return np.asarray(cv2.threshold(levels, MOVED_LEVEL, 255.0, cv2.THRESH_BINARY)[1], dtype=np.uint8)


def _share_of_blocks(moved: NDArray[np.uint8]) -> float:
    """Share of the picture's blocks in which at least a tenth of the cells has moved."""
    blocks = cv2.resize(moved, _BLOCKS, interpolation=cv2.INTER_AREA)
    return cv2.countNonZero(cv2.threshold(blocks, 25.0, 255.0, cv2.THRESH_BINARY)[1]) / blocks.size


def _cells(levels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Mean of each cell; what is left over at the right and below falls away."""
    height, width = (side // CELL_PX for side in levels.shape)
    whole = levels[: height * CELL_PX, : width * CELL_PX]
    return np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _edge_cells(picture: BgrImage, axis: int) -> NDArray[np.uint8]:
    """255 in cells that would count as moved if the picture moved by a pixel along `axis` (0: down, 1: to the right)."""
    return _over(_cells(difference(np.roll(picture, 1, axis=axis), picture)))


def difference(image: BgrImage, background: BgrImage) -> NDArray[np.uint8]:
    """Largest absolute difference over blue, green and red, shape (h, w), of two pictures of one size."""
    blue, green, red = cv2.split(cv2.absdiff(image, background))
    return np.asarray(cv2.max(cv2.max(blue, green), red), dtype=np.uint8)
