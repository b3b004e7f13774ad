"""A track's lane in a photograph of it: the floor seen from straight above, the lane in it, and the route in twin px.

Knows one picture and its ground map. Knows no file and no line across the route: `track.build` lays those out. All that it says
is in the frame of reference of the ground map's twin, so that the map fits the track at once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from dnb_edge.errors import InputError
from dnb_edge.track.light import Mask, even_light
from dnb_edge.track.loop import Loop, SeveralLoops
from dnb_edge.track.route import Route, find_route
from dnb_edge.track.twin import Lane, LaneColour, colour_at, lane_mask
from dnb_edge.values import BgrImage, PointPx, Points
from dnb_edge.view.ground import GroundMap
from dnb_edge.view.rectify import (
    Extent,
    finest_metres_per_px,
    rectified,
    seen_mask,
    visible_extent_m,
)


class UnclearLane(InputError):
    """What was taken for the lane makes no route."""

    def __init__(self, text: str, picture: BgrImage) -> None:
        super().__init__(f"{text}; --overlay shows what was taken for lane")
        self.picture = picture
        """The floor from straight above with what was taken for lane in red."""


SEAM_M = 0.04
"""The widest thing across the lane, such as the start line's tape, that is no end of it, metres."""

_MOST_SIDE_PX = 2400
"""Longest side of the rectified picture in which the lane is sought."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Floor:
    """The floor as a photograph shows it, from straight above, its light made even."""

    bgr: BgrImage
    seen: Mask
    """(height, width), where the photograph shows it."""
    metres_per_px: float
    extent_m: Extent

    def to_px(self, track_m: Points) -> Points:
        """Points (n, 2), track m, as px (n, 2) of `bgr`."""
        points = np.asarray(track_m, dtype=np.float64).reshape(-1, 2)
        height = self.bgr.shape[0]
        u = (points[:, 0] - self.extent_m[0]) / self.metres_per_px
        return np.column_stack((u, height - (points[:, 1] - self.extent_m[1]) / self.metres_per_px))

    def to_track_m(self, points_px: Points) -> Points:
        """Px (n, 2) of `bgr` as points (n, 2), track m."""
        points = np.asarray(points_px, dtype=np.float64).reshape(-1, 2)
        height = self.bgr.shape[0]
        x = self.extent_m[0] + points[:, 0] * self.metres_per_px
        return np.column_stack((x, self.extent_m[1] + (height - points[:, 1]) * self.metres_per_px))


def floor_in(picture: BgrImage, ground: GroundMap, *, area_m: Extent | None = None) -> Floor:
    """The floor in `area_m`, or all that the camera sees well. Raises `InputError` as `rectified` does."""
    extent_m = visible_extent_m(ground) if area_m is None else area_m
    longest_m = max(extent_m[2] - extent_m[0], extent_m[3] - extent_m[1])
    metres_per_px = max(finest_metres_per_px(ground), longest_m / _MOST_SIDE_PX)
    bgr = rectified(picture, ground, metres_per_px=metres_per_px, extent_m=extent_m)
    seen = seen_mask(ground, metres_per_px=metres_per_px, extent_m=extent_m)
    clean = np.asarray(cv2.medianBlur(even_light(bgr, seen), 5), dtype=np.uint8)
    return Floor(bgr=clean, seen=seen, metres_per_px=metres_per_px, extent_m=extent_m)


def colour_in_photo(floor: Floor, ground: GroundMap, at_px: PointPx, *, source: str) -> LaneColour:
    """The lane's colour from the place `at_px`, camera px, of the photograph.

    Raises `InputError` where that shows no floor, or floor outside of the area.
    """
    at_m = ground.point_to_track_m(at_px)
    inside = 0 <= at_px[0] < ground.width_px and 0 <= at_px[1] < ground.height_px
    if at_m is None or not inside:
        raise InputError(f"{source}: the place ({at_px[0]:g}, {at_px[1]:g}) px for the lane's colour shows no floor: choose "
                         "one on the lane")  # fmt: skip
    ((u, v),) = floor.to_px(np.array([at_m])).tolist()
    return colour_at(floor.bgr, (u, v), source=source)


def route_in(
    floor: Floor,
    ground: GroundMap,
    lane: Lane,
    *,
    waypoints_px: Sequence[PointPx] = (),
    closed: bool = True,
    seam_m: float = SEAM_M,
    source: str,
) -> Route:
    """The route on the floor as twin px of `ground`'s twin, `waypoints_px` as well.

    Raises `InputError` as `lane_mask` does, `SeveralLoops`, and `UnclearLane` where what was found makes no route; it says so
    where the lane leaves the picture.
    """
    mask = lane_mask(floor.bgr, lane, source=source, close_gap_px=seam_m / floor.metres_per_px, seen=floor.seen)
    at_m = ground.scale.to_track_m(np.array(waypoints_px, dtype=np.float64))
    waypoints = tuple((u, v) for u, v in floor.to_px(at_m).tolist())
    try:
        found = find_route(mask, waypoints_px=waypoints, closed=closed, source=source)
    except SeveralLoops as error:
        raise SeveralLoops(source, tuple(_on_twin(loop, floor, ground) for loop in error.loops)) from error
    except InputError as error:
        cut = _cut_at_m(mask, floor)
        left = (
            "" if cut is None else f"; the lane leaves the picture near ({cut[0]:.2f}, {cut[1]:.2f}) m: show all of it"
        )
        # What the lane's graph calls twin px is, here, px of the floor's picture.
        text = str(error).replace("twin px", "px of the picture from above")
        raise UnclearLane(f"{text}{left}", _tinted(floor.bgr, mask)) from error
    smaller = floor.metres_per_px / ground.scale.metres_per_px
    return Route(
        points_px=ground.scale.to_twin_px(floor.to_track_m(found.points_px)),
        half_left_px=found.half_left_px * smaller,
        half_right_px=found.half_right_px * smaller,
        closed=found.closed,
    )


def twin_of(picture: BgrImage, ground: GroundMap, *, right_px: float) -> BgrImage:
    """The photograph as the twin of its map: as high as that, and as wide as to show the twin px up to `right_px`.

    What lies to the left of the twin's left edge, or above its top, cannot be in it.
    """
    scale = ground.scale
    width_px = max(1, math.ceil(right_px))
    extent_m = (0.0, 0.0, width_px * scale.metres_per_px, scale.height_px * scale.metres_per_px)
    return rectified(picture, ground, metres_per_px=scale.metres_per_px, extent_m=extent_m)


def _on_twin(loop: Loop, floor: Floor, ground: GroundMap) -> Loop:
    """The loop, known in px of the floor's picture, in twin px."""

    def moved(points_px: Points) -> Points:
        return ground.scale.to_twin_px(floor.to_track_m(points_px))

    return replace(
        loop,
        points_px=moved(loop.points_px),
        length_px=loop.length_px * floor.metres_per_px / ground.scale.metres_per_px,
        waypoints_px=tuple((u, v) for u, v in moved(np.array(loop.waypoints_px)).tolist()),
    )


def median_picture(pictures: Sequence[BgrImage]) -> BgrImage:
    """The median of pictures of one size, px by px: what moves from one to the next is gone. Raises `ValueError` for none."""
    if len(pictures) == 1:
        return pictures[0]
    if not pictures:
        raise ValueError("the median of no picture")
    rows = [np.median(np.stack([picture[row] for picture in pictures]), axis=0) for row in range(pictures[0].shape[0])]
    return np.asarray(np.stack(rows) + 0.5, dtype=np.uint8)


def _tinted(picture: BgrImage, mask: Mask) -> BgrImage:
    tinted = picture.copy()
    tinted[mask] = tinted[mask] // 2 + np.array([0, 0, 127], dtype=np.uint8)
    return tinted


def _cut_at_m(mask: Mask, floor: Floor) -> tuple[float, float] | None:
    """A place, track m, where the lane meets the edge of what the photograph shows; None where it does not."""
    unseen = np.pad(~floor.seen, 1, constant_values=True)
    beside = unseen[:-2, 1:-1] | unseen[2:, 1:-1] | unseen[1:-1, :-2] | unseen[1:-1, 2:]
    rows, columns = np.nonzero(mask & beside)
    if not len(rows):
        return None
    ((x, y),) = floor.to_track_m(np.array([[float(np.median(columns)), float(np.median(rows))]])).tolist()
    return x, y
