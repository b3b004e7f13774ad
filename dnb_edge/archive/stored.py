"""What a directory of recordings holds: its files, and the runs that they make, with an id that is no path.

The id is the same after a restart, and after the file got its final name. Knows what a list says of recordings; knows nothing
of how they are read.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from dnb_edge.archive.glance import Contents
from dnb_edge.archive.label import stem_of
from dnb_edge.record.chain import Head
from dnb_edge.record.channels import EVENT_TOPICS
from dnb_edge.record.edits import RunIdentity, edits_path
from dnb_edge.values import Lap

_LAP_TOPIC = EVENT_TOPICS[Lap]
_ID_BYTES = 12


class FileState(StrEnum):
    """How a recording stands."""

    RECORDING = "recording"
    FINISHED = "finished"
    CUT = "cut"
    """It was cut short, and nobody finished it yet."""
    DAMAGED = "damaged"


@dataclass(frozen=True, slots=True, kw_only=True)
class SeenFile:
    """One file of a recording."""

    path: Path
    size_bytes: int
    modified_ns: int
    state: FileState
    head: Head | None
    """What it says before its first message, without the setup and the configuration; None where that cannot be read."""
    contents: Contents | None
    note: str | None
    """What is the matter with it, in a line; None where nothing is."""

    @property
    def stem(self) -> str:
        """Its name without ending."""
        return stem_of(self.path)


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredRecording:
    """One run: a file, or several that go on from one another."""

    id: str
    files: tuple[SeenFile, ...]
    """Oldest first."""
    missing: str | None
    """Name of the file that should come first and is not there."""
    label: str | None
    pinned: bool
    pinnable: bool
    """False where it is never deleted anyway, since somebody renamed it."""
    edited: bool
    """A judge has decided something about it."""
    pictures_bytes: int

    @property
    def last(self) -> SeenFile:
        """The file by which all of it is read."""
        return self.files[-1]

    @property
    def state(self) -> FileState:
        """How its last file stands."""
        return self.last.state

    @property
    def entry(self) -> str | None:
        """Who drives; None where the file cannot be read."""
        return None if self.last.head is None else self.last.head.header.driver.name

    @property
    def session(self) -> str | None:
        """Name of its session; None where nobody named one."""
        return None if self.last.head is None else self.last.head.header.session

    @property
    def laps(self) -> int | None:
        """How many the race counted; None where that cannot be read."""
        counts = [file.contents.counts.get(_LAP_TOPIC, 0) for file in self.files if file.contents is not None]
        return sum(counts) if counts else None

    @property
    def first_t_ns(self) -> int | None:
        """Stamp of its first message, the source's clock."""
        stamps = (file.contents.first_t_ns for file in self.files if file.contents is not None)
        return min((one for one in stamps if one is not None), default=None)

    @property
    def last_t_ns(self) -> int | None:
        """Stamp of its last message."""
        stamps = (file.contents.last_t_ns for file in self.files if file.contents is not None)
        return max((one for one in stamps if one is not None), default=None)

    @property
    def started_unix_ns(self) -> int | None:
        """When it began, by the system's clock then; None for a source whose clock has no such time."""
        offset_ns = None if self.last.head is None else self.last.head.header.wall_offset_ns
        return None if offset_ns is None or self.first_t_ns is None else self.first_t_ns + offset_ns

    @property
    def ordered_ns(self) -> int:
        """When it began or, where nobody knows, when its last file was written: for the order of a list."""
        started = self.started_unix_ns
        return self.last.modified_ns if started is None else started

    @property
    def size_bytes(self) -> int:
        """Of its files, without pictures beside them."""
        return sum(file.size_bytes for file in self.files)

    @property
    def notes(self) -> tuple[str, ...]:
        """What is the matter with it, a line each."""
        told = [] if self.missing is None else [f"goes on from {self.missing}, which is not here"]
        return (*told, *(file.note for file in self.files if file.note is not None))

    @property
    def identity(self) -> RunIdentity | None:
        """What tells this recording from others; None where it cannot be read."""
        return None if self.last.head is None else RunIdentity.of(self.last.head.header, self.first_t_ns)

    @property
    def stamp(self) -> str:
        """Text that is another one as soon as anything changes that its results are made of."""
        parts = [f"{file.path.name} {file.size_bytes} {file.modified_ns}" for file in self.files]
        try:
            found = edits_path(self.last.path).stat()
            parts.append(f"edits {found.st_size} {found.st_mtime_ns}")
        except FileNotFoundError:
            pass
        return hashlib.blake2b("\n".join(parts).encode(errors="surrogateescape"), digest_size=16).hexdigest()


def run_id(stem: str) -> str:
    """The id of the run whose first file is called `stem`."""
    return hashlib.blake2b(
        stem.encode(errors="surrogateescape"), digest_size=_ID_BYTES, person=b"dnb-edge run"
    ).hexdigest()


def session_id(name: str) -> str:
    """The id of the session of this name."""
    return hashlib.blake2b(name.encode(errors="replace"), digest_size=_ID_BYTES, person=b"dnb-edge ses").hexdigest()
