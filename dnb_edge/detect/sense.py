"""Which way along its axis a thing drives, for detectors that see only the axis. Knows pixels and earlier detections.

A rotated box is the same turned by half a turn. The sense comes from movement: once a thing has moved by a good part of its
length along its axis, that is forward, and it stays so while the thing can be recognised from frame to frame.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from dnb_edge.values import PointPx

MOVED_LENGTHS = 0.25
"""A thing that moved by as many lengths shows its sense."""
SAME_LENGTHS = 1.0
"""A thing within as many lengths of where one was in the last frame is that one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisSeen:
    """One thing in one frame."""

    camera_px: PointPx
    length_px: float
    axis_rad: float | None
    """Direction of the axis in the picture, atan2 of (-v, u), either way round; None where it has none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Known:
    camera_px: PointPx
    since_px: PointPx
    """Where it was when its sense was last told."""
    heading_rad: float | None


class AxisSense:
    """Remembers the things of the last frame, and so tells their senses in the next."""

    def __init__(self) -> None:
        self._known: list[_Known] = []

    def headings(self, seen: Sequence[AxisSeen]) -> list[float | None]:
        """Direction of travel of each thing in the new frame, -pi..pi; None where it has not moved yet."""
        now = [_next(one, self._nearest(one)) for one in seen]
        self._known = now
        return [one.heading_rad for one in now]

    def _nearest(self, one: AxisSeen) -> _Known | None:
        near = min(self._known, key=lambda known: math.dist(known.camera_px, one.camera_px), default=None)
        if near is None or math.dist(near.camera_px, one.camera_px) > SAME_LENGTHS * one.length_px:
            return None
        return near


def _next(one: AxisSeen, before: _Known | None) -> _Known:
    if before is None or one.axis_rad is None:
        return _Known(camera_px=one.camera_px, since_px=one.camera_px, heading_rad=None)
    moved = (one.camera_px[0] - before.since_px[0], before.since_px[1] - one.camera_px[1])
    forward = moved[0] * math.cos(one.axis_rad) + moved[1] * math.sin(one.axis_rad)
    if abs(forward) >= MOVED_LENGTHS * one.length_px:
        heading = one.axis_rad if forward > 0 else one.axis_rad + math.pi
        return _Known(camera_px=one.camera_px, since_px=one.camera_px, heading_rad=_wrapped(heading))
    if before.heading_rad is None:
        return _Known(camera_px=one.camera_px, since_px=before.since_px, heading_rad=None)
    turned = math.cos(one.axis_rad - before.heading_rad) < 0
    heading = one.axis_rad + (math.pi if turned else 0.0)
    return _Known(camera_px=one.camera_px, since_px=before.since_px, heading_rad=_wrapped(heading))


def _wrapped(angle_rad: float) -> float:
    return math.atan2(math.sin(angle_rad), math.cos(angle_rad))
