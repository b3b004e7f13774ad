"""How much of what may still be written, by the room that is left on the disk: pictures give way first, laps never.

Knows statvfs and three levels. Deletes nothing: see `retention`.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

Statvfs = Callable[[Path], os.statvfs_result]

BACK_AGAIN = 1.1
"""What was stopped is taken up again where there is this much more room than where it stopped."""

LAPS_SHARE = 0.5
"""Share of the room to keep free that is for laps alone: below it telemetry stops."""

MOST_OF_DISK = 0.1
"""No more of a small disk than this is kept free."""


class Level(IntEnum):
    """What is still written."""

    ALL = 0
    NO_PICTURES = 1
    LAPS_ONLY = 2
    """And the few other messages that always get in; no detections, observations, targets."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Room:
    """The room of a file system for ordinary users, bytes."""

    free_bytes: int
    total_bytes: int

    def kept_free(self, wanted_bytes: int) -> int:
        """`wanted_bytes`, or what of it this disk can spare."""
        return min(wanted_bytes, int(self.total_bytes * MOST_OF_DISK))


def room_of(directory: Path, statvfs: Statvfs = os.statvfs) -> Room:
    """The room where `directory` lies. Raises OSError."""
    found = statvfs(directory)
    return Room(free_bytes=found.f_bavail * found.f_frsize, total_bytes=found.f_blocks * found.f_frsize)


def level_of(room: Room, keep_free_bytes: int, before: Level) -> Level:
    """What may be written with `room` left, where `before` was the level so far."""
    keep = room.kept_free(keep_free_bytes)
    level = Level.ALL
    for step, limit in ((Level.NO_PICTURES, keep), (Level.LAPS_ONLY, keep * LAPS_SHARE)):
        if room.free_bytes < limit * (BACK_AGAIN if before >= step else 1.0):
            level = step
    return level
