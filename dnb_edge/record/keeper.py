"""Keeps room on the disk that is recorded on: says what may still be written, and deletes old recordings where that is allowed.

For the recorder's thread, which asks once a second. Knows `room` and `retention`; writes nothing itself.
"""

from __future__ import annotations

from pathlib import Path

from dnb_edge.errors import InputError, WorkError
from dnb_edge.record import retention
from dnb_edge.record.room import Level, Statvfs, level_of, room_of

LOOK_PERIOD_S = 1.0
"""How often the room on the disk is looked at."""

TOTAL_PERIOD_S = 60.0
"""How often all recordings are added up, where there is room enough."""


class RoomKeeper:
    """Looks at the disk now and then."""

    def __init__(self, limits: retention.Limits, *, may_delete: bool, statvfs: Statvfs, now_s: float) -> None:
        """Nothing is looked at yet."""
        self._limits = limits
        self._may_delete = may_delete
        self._statvfs = statvfs
        self._removed = 0
        self._last_removed = ""
        self._refused: str | None = None
        self._next_total_s = now_s
        self.level = Level.ALL
        """What may be written."""
        self.due_s = now_s
        """When to look next."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is wrong, or was done, in words."""
        found = []
        if self.level is Level.LAPS_ONLY:
            found.append("the disk is nearly full: only laps are recorded, no detections and no pictures")
        elif self.level is Level.NO_PICTURES:
            found.append("the disk is nearly full: no pictures are recorded")
        if self._refused is not None:
            found.append(self._refused)
        if self._removed:
            found.append(
                f"{self._removed} old recordings, or their pictures, deleted to make room, last of {self._last_removed}"
            )
        return tuple(found)

    def look(self, place: Path, now_s: float) -> None:
        """See how much room there is in `place`, and make some where old recordings may go."""
        self.due_s = now_s + LOOK_PERIOD_S
        try:
            room = room_of(place, self._statvfs)
            wanted = room.kept_free(self._limits.keep_free_bytes) * retention.MORE_THAN_KEPT
            adding_up = self._limits.max_total_bytes is not None and now_s >= self._next_total_s
            if self._may_delete and (room.free_bytes < wanted or adding_up):
                self._make_room(place, now_s)
                room = room_of(place, self._statvfs)
        except OSError:
            # A disk that does not even tell its size fails at the next write, which says more.
            return
        self.level = level_of(room, self._limits.keep_free_bytes, self.level)

    def _make_room(self, place: Path, now_s: float) -> None:
        """Delete one old recording, or its pictures; the next look deletes the next."""
        try:
            removal = retention.prune_one(place, self._limits, self._statvfs)
            left = retention.still_too_much(place, self._limits, self._statvfs)
        except (InputError, WorkError) as error:
            self._refused = str(error)
            return
        if removal is None:
            self._next_total_s = now_s + TOTAL_PERIOD_S
            self._refused = None if left is None else f"nothing more may be deleted: {left}"
        else:
            self._removed += 1
            self._last_removed = removal.name
            self._refused = None
