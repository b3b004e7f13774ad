"""The pictures of a recording that may go on for days: a ring of files beside it, of which the oldest goes.

The run's own file holds the pictures of incidents alone, which stay as long as the run does. Knows files of pictures and how
many bytes they may take together. An error here stops the pictures for a while and nothing else.
"""

from __future__ import annotations

import contextlib
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

from dnb_edge.record.durable import DurableFile
from dnb_edge.record.names import pictures_directory, pictures_files
from dnb_edge.record.runfile import FileSpec, RunFile, error_words
from dnb_edge.values import Frame, Incident

FILES = 16
"""Files that make the ring: that many parts of it go at once."""

LEAST_FILE_BYTES = 256 * 1024
MOST_FILE_BYTES = 64 * 1024 * 1024
"""Of one file: finishing it syncs what the system has not yet written, which must not take long."""

RETRY_S = 30.0

REMEMBERED = 64
"""Pictures that are kept in memory, in case one shows an incident that is told later."""

NEAR_NS = 500_000_000
"""A picture further from an incident's worst moment than this shows something else."""


class PictureRing:
    """Writes pictures beside the recording that is being written. For the recorder's thread alone."""

    def __init__(self, spec: FileSpec, ring_bytes: int, *, clock_s: Callable[[], float] = time.monotonic) -> None:
        """Nothing is opened yet."""
        self._spec = spec
        self._ring_bytes = ring_bytes
        self._file_bytes = min(max(ring_bytes // FILES, LEAST_FILE_BYTES), MOST_FILE_BYTES)
        self._clock_s = clock_s
        self._file: RunFile | None = None
        self._owner: Path | None = None
        self._finished: deque[tuple[Path, int]] = deque()
        self._retry_s: float | None = None
        self.reason: str | None = None
        """Why no pictures are written at present, a few words; None where all is well."""

    def write(self, frame: Frame, recording: Path) -> bool:
        """Write `frame` into the ring beside `recording`; False where it could not be written."""
        if self._retry_s is not None and self._clock_s() < self._retry_s:
            return False
        try:
            if self._file is None or self._owner != recording:
                self.close()
                self._file = self._next(recording)
                self._owner = recording
            self._file.write(frame)
            if self._file.failure is not None:
                raise self._file.failure
            if self._file.size_bytes >= self._file_bytes:
                self.close()
                self._forget_oldest()
        except OSError as error:
            self._give_up(error)
            return False
        self._retry_s = self.reason = None
        return True

    def close(self) -> None:
        """Finish the file that is open."""
        file, self._file = self._file, None
        if file is None:
            return
        if not file.finish():
            file.abandon()
        self._finished.append((file.path, file.size_bytes))

    def abandon(self) -> None:
        """Leave the file that is open as it is: whole pictures in it can be read."""
        file, self._file = self._file, None
        if file is not None:
            file.abandon()
            self._finished.append((file.path, file.size_bytes))

    def _next(self, recording: Path) -> RunFile:
        place = pictures_directory(recording)
        place.mkdir(exist_ok=True)
        there = pictures_files(recording)
        number = int(there[-1].name.partition(".")[0]) + 1 if there else 1
        return RunFile(DurableFile(place / f"{number:06d}.mcap"), self._spec)

    def _forget_oldest(self) -> None:
        """Keep the ring, with a file that is still to be filled, within its bytes."""
        while self._finished and sum(size for _, size in self._finished) + self._file_bytes > self._ring_bytes:
            path, _ = self._finished.popleft()
            path.unlink(missing_ok=True)
            with contextlib.suppress(OSError):
                # Not empty, as long as this recording goes on.
                path.parent.rmdir()

    def _give_up(self, error: OSError) -> None:
        self.reason = error_words(error)
        self._retry_s = self._clock_s() + RETRY_S
        self.abandon()


class IncidentPictures:
    """Remembers the last pictures, and says which of them belongs to an incident."""

    def __init__(self) -> None:
        self._recent: deque[Frame] = deque(maxlen=REMEMBERED)
        self._given_t_ns: int | None = None

    def seen(self, frame: Frame) -> None:
        """One more picture, later than those before."""
        self._recent.append(frame)

    def of(self, incident: Incident) -> Frame | None:
        """The picture nearest to its worst moment; None where none is near, or a later one has been given already."""
        near = min(self._recent, key=lambda frame: abs(frame.t_ns - incident.worst_t_ns), default=None)
        if near is None or abs(near.t_ns - incident.worst_t_ns) > NEAR_NS:
            return None
        if self._given_t_ns is not None and near.t_ns <= self._given_t_ns:
            return None
        self._given_t_ns = near.t_ns
        return near
