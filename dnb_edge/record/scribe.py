"""The recorder's thread: which file is open, when it is synced, and what is done when the disk fails or fills up.

Knows the rhythm of syncing, the way from one file to the next, and which messages are kept in memory until the disk has
them. Knows no race. A file whose write or sync failed is left as it is; what it had not acknowledged of laps, crossings and
the like is written again into the next one.
"""

from __future__ import annotations

import math
import os
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2

from dnb_edge.record import names, retention
from dnb_edge.record.acks import Acks
from dnb_edge.record.keeper import RoomKeeper
from dnb_edge.record.mailbox import Mailbox
from dnb_edge.record.pictures import IncidentPictures, PictureRing
from dnb_edge.record.room import Level, Statvfs
from dnb_edge.record.runfile import Continues, FileSpec, Item, RunFile, error_words
from dnb_edge.values import (
    Crossing,
    Frame,
    FrameDetections,
    Incident,
    Lap,
    Observation,
    RaceState,
    Running,
    RunSummary,
    Score,
    Standings,
    Target,
    VehicleReport,
)

BATCH = 64
BACK_OFF_S = (1.0, 2.0, 5.0, 10.0, 30.0)
"""Waits between attempts to open another file; the last one repeats. The first attempt is made at once."""

KEPT_MOST = 20_000
"""Laps, crossings and the like that wait in memory for a disk; the oldest are then lost."""

WRITE_ERRORS = (OSError, RuntimeError, ValueError, TypeError, OverflowError, cv2.error)
"""What foxglove-sdk (RuntimeError), JSON (ValueError, TypeError), OpenCV and the system can say while we write."""

_DATA = FrameDetections | Observation | Target | Running
_GIVES_WAY = _DATA | VehicleReport
"""What is left out where the disk is nearly full; of these a vehicle's lines are not missed when a race is scored again."""
_KEPT = Lap | Score | Crossing | Incident | RaceState | Standings | RunSummary
_SYNCED_AT_ONCE = Lap | Score | RunSummary


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Where files go and how long they get."""

    directory: Path
    fallback: tuple[Path, ...] = ()
    sync_period_s: float = 1.0
    keep_free_bytes: int = 0
    max_total_bytes: int | None = None
    prune: bool = False
    rotate_s: float | None = None
    image_ring_bytes: int | None = None
    go_on: bool = True
    """False to end the recording with its first file that fails."""

    @property
    def limits(self) -> retention.Limits:
        """For retention."""
        return retention.Limits(keep_free_bytes=self.keep_free_bytes, max_total_bytes=self.max_total_bytes)


class Scribe:
    """Writes one recording, file after file where it must be. `run` is the body of its thread."""

    def __init__(
        self,
        plan: Plan,
        spec: FileSpec,
        mail: Mailbox[Item],
        *,
        statvfs: Statvfs = os.statvfs,
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        """Nothing is opened yet."""
        self._plan = plan
        self._spec = spec
        self._mail = mail
        self._clock_s = clock_s
        self.acks = Acks()
        self.wanted_ticket = 0
        """Somebody waits for this one."""
        self.reason: str | None = None
        """Why nothing is being written at present; None where all is well."""
        self.progress = 0
        """Rounds of the thread: one a second at least while the disk answers, with or without anything to write."""
        self.finished = False
        self.keep_part = False
        """True to stop and leave the `.part`."""
        self.path = plan.directory
        """The last file, as it is called now; the directory before there is one."""
        self.lost = 0
        """Detections, observations and targets that no file has."""
        self.lost_pictures = 0
        self.saved_laps = 0
        self.troubles: tuple[str, ...] = ()
        """What went wrong with earlier files."""
        self._file: RunFile | None = None
        self._first: str | None = None
        self._previous = ""
        self._part = 0
        self._kept: deque[tuple[int, Item]] = deque()
        self._unsynced: list[tuple[int, bool]] = []
        """Tickets of what was written since the last sync and is not kept, and whether each is telemetry."""
        self._written = 0
        self._told_lost = self._told_lost_pictures = 0
        """Of those, what a finished file has told."""
        self._attempt = 0
        now_s = clock_s()
        self._next_open_s = now_s
        self._next_sync_s = now_s + plan.sync_period_s
        self._rotate_s: float | None = None
        self._keeper = RoomKeeper(plan.limits, may_delete=plan.prune, statvfs=statvfs, now_s=now_s)
        self._ring = None if plan.image_ring_bytes is None else PictureRing(spec, plan.image_ring_bytes)
        self._incident_pictures = IncidentPictures()

    def open_first(self) -> None:
        """Open the first file, in the first directory that takes it. Raises the first directory's OSError where none does."""
        first: OSError | None = None
        for place in (self._plan.directory, *self._plan.fallback):
            try:
                self._open(place, why="")
            except OSError as error:
                first = first or error
            else:
                if first is not None:
                    self._trouble(f"{self._plan.directory}: {error_words(first)}")
                return
        assert first is not None, "there is at least one directory"
        raise first

    def start_without(self, error: OSError) -> None:
        """Go on without a file for now, since none could be opened, and try again later."""
        self.reason = error_words(error)
        self._next_open_s = self._clock_s() + BACK_OFF_S[0]

    def run(self) -> None:
        """Write all that comes, to the end."""
        try:
            while (batch := self._mail.take(BATCH, self._wait_s())) is not None:
                self.progress += 1
                for ticket, item in batch:
                    self._take(ticket, item)
                self._after([item for _, item in batch])
            if not self.keep_part:
                self._end()
                if self._ring is not None:
                    self._ring.close()
        except WRITE_ERRORS as error:
            self.reason = error_words(error)
        finally:
            # Whatever stopped the thread, nobody may wait for it any more, and a half-written file keeps its `.part`.
            if not self.finished and self.reason is None and not self.keep_part:
                self.reason = "the recorder stopped unexpectedly"
            if self._file is not None:
                self._file.abandon()
            if self._ring is not None:
                self._ring.abandon()
            self._mail.close(discard=True)
            self.acks.wake()

    @property
    def ended(self) -> bool:
        """Whether nothing more will be saved for now."""
        return self.reason is not None or self.finished or self.keep_part

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is wrong, in words."""
        found = [*self.troubles, *self._keeper.warnings]
        if self._ring is not None and self._ring.reason is not None:
            found.append(f"no pictures are recorded: {self._ring.reason}")
        return tuple(found)

    def _wait_s(self) -> float:
        """Until something must be done though nothing comes."""
        due_s = self._next_sync_s if self._file is not None else self._next_open_s
        return max(0.0, min(due_s, self._keeper.due_s) - self._clock_s())

    def _take(self, ticket: int, item: Item) -> None:
        self._written = ticket
        if isinstance(item, Frame):
            self._take_picture(item)
            return
        if isinstance(item, _KEPT):
            self._kept.append((ticket, item))
            if len(self._kept) > KEPT_MOST:
                self.acks.lost(self._kept.popleft()[0])
                self.lost += 1
        is_data = isinstance(item, _DATA)
        if self._file is None or (isinstance(item, _GIVES_WAY) and self._keeper.level is Level.LAPS_ONLY):
            if is_data:
                self.lost += 1
            if not isinstance(item, _KEPT):
                self.acks.lost(ticket)
            return
        self._file.write(item)
        if not isinstance(item, _KEPT):
            self._unsynced.append((ticket, is_data))
        if isinstance(item, Incident) and self._ring is not None and self._keeper.level is Level.ALL:
            picture = self._incident_pictures.of(item)
            if picture is not None:
                self._file.write(picture)

    def _take_picture(self, frame: Frame) -> None:
        written = False
        if self._file is not None and self._keeper.level is Level.ALL:
            if self._ring is None:
                self._file.write(frame)
                written = True
            else:
                if frame.camera == 0:
                    # A judge looks at one camera's pictures.
                    self._incident_pictures.seen(frame)
                written = self._ring.write(frame, self._file.final)
        self.lost_pictures += not written

    def _after(self, batch: list[Item]) -> None:
        """What is due after a batch of items, or when nothing came for a while."""
        now_s = self._clock_s()
        if self._file is None and now_s >= self._next_open_s:
            self._open_again()
        urgent = any(isinstance(item, _SYNCED_AT_ONCE) for item in batch)
        urgent = urgent or self._written >= self.wanted_ticket > self.acks.through
        if self._file is not None and (urgent or now_s >= self._next_sync_s):
            self._sync()
            self._next_sync_s = self._clock_s() + self._plan.sync_period_s
        if self._file is not None and self._file.failure is not None:
            self._file_failed(self._file.failure)
        if now_s >= self._keeper.due_s:
            self._keeper.look(self.path.parent if self._file is not None else self._plan.directory, now_s)
        if self._rotate_s is not None and now_s >= self._rotate_s and any(isinstance(item, Lap) for item in batch):
            self._rotate()

    def _sync(self) -> None:
        if self._file is None or (self._written <= self.acks.through and not self._kept):
            return
        if self._file.sync():
            self._unsynced.clear()
            self.saved_laps += sum(isinstance(item, Lap) for _, item in self._kept)
            self._kept.clear()
            self.reason = None
            self._attempt = 0
            self.acks.saved(self._written)

    def _file_failed(self, error: OSError) -> None:
        """Leave the file as it is, and go on in another one at once where that can be."""
        assert self._file is not None, "a file failed"
        words = error_words(error)
        self._file.abandon()
        self.path, self._file = self._file.path, None
        for ticket, is_data in self._unsynced:
            self.acks.lost(ticket)
            self.lost += is_data
        self._unsynced.clear()
        if self._plan.go_on:
            self._trouble(f"{self.path.name} was given up: {words}")
        self._open_again(why=words, last=self.path.parent)

    def _open_again(self, *, why: str | None = None, last: Path | None = None) -> None:
        """Try every directory for a new file, the one that has just failed last; say why where none takes one."""
        why = why or self.reason or "interrupted"
        if not self._plan.go_on:
            self.reason, self._next_open_s = why, math.inf
            self.acks.wake()
            return
        places = [self._plan.directory, *self._plan.fallback]
        for place in sorted(places, key=lambda place: place == last):
            try:
                self._open(place, why=why)
                self._write_kept()
            except OSError as error:
                why = error_words(error)
                self._file = None
                continue
            # Only what the disk has acknowledged counts: a file that could be opened may still fail.
            self._sync()
            if self._file is not None and self._file.failure is None:
                self.reason = None
                self._keeper.look(place, self._clock_s())
                return
            if self._file is not None:
                why = error_words(self._file.failure)
                self._file.abandon()
                self.path, self._file = self._file.path, None
        self.reason = why
        self._next_open_s = self._clock_s() + BACK_OFF_S[min(self._attempt, len(BACK_OFF_S) - 1)]
        self._attempt += 1
        self.acks.wake()

    def _open(self, place: Path, *, why: str) -> None:
        """Open the next file in `place`. Raises OSError. A directory to fail over to is not made: its disk may be missing."""
        if place == self._plan.directory:
            place.mkdir(parents=True, exist_ok=True)
        continues = None
        if self._first is not None:
            continues = Continues(first=self._first, previous=self._previous, part=self._part + 1, why=why)
        places = (self._plan.directory, *self._plan.fallback)
        new = names.create_next(place, names.boot_tag(), after=self._previous, beside=places)
        file = RunFile(new, self._spec, continues)
        self._part += 1
        self._first = self._first or file.final.name
        self._previous = file.final.name
        self._file, self.path = file, file.path
        if self._plan.rotate_s is not None:
            self._rotate_s = self._clock_s() + self._plan.rotate_s

    def _write_kept(self) -> None:
        """Write again, into the file just opened, what no disk has acknowledged."""
        assert self._file is not None, "a file was opened"
        for _, item in self._kept:
            self._file.write(item)

    def _rotate(self) -> None:
        """Go on in a new file behind a lap's end; where none can be opened, in the old one for now."""
        old, self._file = self._file, None
        if old is None or self._kept:
            self._file = old
            return
        try:
            self._open(old.path.parent, why="rotated")
        except OSError as error:
            self._file, self.path = old, old.path
            self._rotate_s = self._clock_s() + BACK_OFF_S[-1]
            self._trouble(f"no new file: {error_words(error)}")
            return
        if not self._finish_file(old):
            self._trouble(f"{old.path.name}: {error_words(old.failure)}")
            old.abandon()

    def _end(self) -> None:
        """Finish what is open, and bring what is still kept to a disk, if there is one that takes it."""
        if self._file is None:
            self._open_again()
        self._sync()
        if self._file is not None and self._file.failure is not None:
            self._file_failed(self._file.failure)
        if self._file is None:
            return
        if self._finish_file(self._file):
            self.finished = True
            self.acks.saved(self._mail.last_ticket)
        else:
            self.reason = error_words(self._file.failure)

    def _finish_file(self, file: RunFile) -> bool:
        """Finish `file`, which says what got lost since the file before it was finished."""
        lost, pictures = self.lost + self._mail.lost, self.lost_pictures + self._mail.dropped_pictures
        done = file.finish(lost_messages=lost - self._told_lost, lost_pictures=pictures - self._told_lost_pictures)
        if done:
            self._told_lost, self._told_lost_pictures = lost, pictures
        if file is self._file:
            self.path = file.path
        return done

    def _trouble(self, text: str) -> None:
        self.troubles = (*self.troubles[-3:], text)
