"""A drive as pictures, its bare floor, and what differs from it: the first half of labelling a drive by itself.

Knows pictures and pixels; nothing of cars' paths (`teach_paths`) and nothing of networks. It reads the drive more than once,
which the live detector cannot: the floor is the median over the whole drive, so a car that moves at all is not in it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.capture.decode import decode_bgr
from dnb_edge.capture.source import FrameSource
from dnb_edge.core import CoreSetup
from dnb_edge.detect.background import difference
from dnb_edge.errors import InputError
from dnb_edge.train.teach_labels import Box, shrunk
from dnb_edge.values import BgrImage

WORKING_SIDE_PX = 640
"""Longer side of the pictures in which motion is looked for."""
_MOST_KEPT = 64
"""Pictures in the median; when they are more, every other one goes."""
_LEVEL = 26
"""Difference, 0..255, above which something has changed."""
_LEAST_AREA_PX = 24
_LARGEST_SHARE = 0.06
_ALL_CHANGED_SHARE = 0.25
_MOST_REGIONS = 24
_LANE_MARGIN_M = 0.1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shot:
    """One picture of a drive."""

    number: int
    """Its place in the drive, from 0."""
    t_s: float
    """Seconds from the drive's first picture."""
    bgr: BgrImage


Drive: TypeAlias = Callable[[], Iterator[Shot]]
"""Gives the drive's pictures from its beginning, each time it is called."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Blob:
    """A connected region that differs from the floor, px of the picture."""

    box_px: Box
    area_px: float

    @property
    def length_px(self) -> float:
        """Longest side of the box."""
        return max(self.box_px[2] - self.box_px[0], self.box_px[3] - self.box_px[1])

    @property
    def centre_px(self) -> tuple[float, float]:
        """Centre of the box."""
        return (self.box_px[0] + self.box_px[2]) / 2.0, (self.box_px[1] + self.box_px[3]) / 2.0

    @property
    def foot_px(self) -> tuple[float, float]:
        """Where it probably stands: a fifth of its height above the middle of its lower edge."""
        return (self.box_px[0] + self.box_px[2]) / 2.0, self.box_px[3] - 0.2 * (self.box_px[3] - self.box_px[1])


def shots(open_source: Callable[[], FrameSource]) -> Iterator[Shot]:
    """The pictures of a source, opened anew and closed at the end; undecodable ones are left out."""
    source = open_source()
    first_ns: int | None = None
    try:
        for number, frame in enumerate(source.frames()):
            first_ns = frame.t_ns if first_ns is None else first_ns
            picture = decode_bgr(frame)
            if picture is not None:
                yield Shot(number=number, t_s=(frame.t_ns - first_ns) * 1e-9, bgr=shrunk(picture)[0])
    finally:
        source.close()


def median_floor(drive: Drive, name: str) -> tuple[BgrImage, float]:
    """The median over pictures spread evenly over the drive, and its length in seconds.

    Raises InputError where there are too few pictures to tell the floor from a car.
    """
    kept: list[BgrImage] = []
    stride, last_s = 1, 0.0
    for count, shot in enumerate(drive()):
        last_s = shot.t_s
        if count % stride:
            continue
        kept.append(shot.bgr)
        if len(kept) >= _MOST_KEPT:
            kept, stride = kept[::2], stride * 2
    if len(kept) < 8:
        raise InputError(f"{name}: only {len(kept)} pictures: record a drive of about a minute")
    out = np.empty_like(kept[0])
    for top in range(0, out.shape[0], 64):  # in strips: the median of all at once would need several GB
        out[top : top + 64] = np.median(np.stack([one[top : top + 64] for one in kept]), axis=0).astype(np.uint8)
    return out, last_s


def _levelled(floor: BgrImage, picture: BgrImage) -> BgrImage:
    """The floor as bright as the picture, by the median of each colour: a lamp switched on is no car."""
    gain = [
        float(np.clip((np.median(picture[::4, ::4, c]) + 8.0) / (np.median(floor[::4, ::4, c]) + 8.0), 0.6, 1.7))
        for c in range(3)
    ]
    return np.asarray(np.clip(floor * np.array(gain, dtype=np.float32) + 0.5, 0, 255), dtype=np.uint8)


class BlobFinder:
    """Finds what differs from a floor."""

    def __init__(self, floor: BgrImage) -> None:
        self._scale = min(1.0, WORKING_SIDE_PX / max(floor.shape[:2]))
        self._floor = self._reduced(floor)
        self._close = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (7, 7))

    def _reduced(self, picture: BgrImage) -> BgrImage:
        if self._scale >= 1.0:
            return picture
        return np.asarray(
            cv2.resize(picture, None, fx=self._scale, fy=self._scale, interpolation=cv2.INTER_AREA), dtype=np.uint8
        )

    def __call__(self, picture: BgrImage) -> tuple[Blob, ...]:
        """The regions of a picture that differ, largest first; none where half the view does."""
        reduced = self._reduced(picture)
        changed = difference(reduced, _levelled(self._floor, reduced))
        level = _LEVEL + float(np.median(changed[::4, ::4]))
        mask = np.asarray(changed > level, dtype=np.uint8)
        mask = np.asarray(cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((2, 2), np.uint8)), dtype=np.uint8)
        mask = np.asarray(cv2.morphologyEx(mask, cv2.MORPH_CLOSE, self._close), dtype=np.uint8)
        if float(mask.mean()) > _ALL_CHANGED_SHARE:
            return ()
        _, _, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
        limit = _LARGEST_SHARE * mask.size
        rows = [row for row in np.asarray(stats)[1:] if _LEAST_AREA_PX <= row[4] <= limit]
        if len(rows) > _MOST_REGIONS:
            return ()
        return tuple(self._blob(row) for row in sorted(rows, key=lambda row: (-int(row[4]), int(row[0]))))

    def _blob(self, row: NDArray[np.int32]) -> Blob:
        left, top, width, height, area = (float(value) for value in row)
        edges = (left, top, left + width, top + height)
        box = tuple(edge / self._scale - 0.5 for edge in edges)
        return Blob(box_px=(box[0], box[1], box[2], box[3]), area_px=area / self._scale**2)


def lane_mask(setup: CoreSetup, width_px: int, height_px: int) -> NDArray[np.bool_]:
    """Where the lane and a margin round it lie in a picture of the given size, (height, width)."""
    line = setup.track.centreline
    ground = setup.ground.scaled_to(width_px, height_px)
    ahead = np.roll(line.points_m, -1, axis=0) - np.roll(line.points_m, 1, axis=0)
    ahead /= np.maximum(np.hypot(ahead[:, 0], ahead[:, 1]), 1e-12)[:, None]
    to_left = np.column_stack((-ahead[:, 1], ahead[:, 0]))
    left = line.points_m + to_left * (line.half_left_m[:, None] + _LANE_MARGIN_M)
    right = line.points_m - to_left * (line.half_right_m[:, None] + _LANE_MARGIN_M)
    mask = np.zeros((height_px, width_px), dtype=np.uint8)
    count = len(left)
    step = max(1, count // 400)
    for first in range(0, count, step):
        second = (first + step) % count
        corners_m = np.array([left[first], left[second], right[second], right[first]])
        corners = [ground.point_to_camera_px((float(x), float(y))) for x, y in corners_m]
        seen = [corner for corner in corners if corner is not None]
        if len(seen) == 4:
            points = np.clip(np.array(seen).round(), -30000, 30000).astype(np.int32)
            cv2.fillConvexPoly(mask, cv2.convexHull(points), (1.0,))
    return np.asarray(mask > 0)
