"""A directory on a disk that may be full, bad or pulled out: files come into it whole and checked, or not at all.

Each is written under another name, synced, read back from the disk and compared, and then renamed; a manifest, a line a file,
says what lies there. Nothing that lies there is ever deleted or written over: where something else has a file's name, that is
renamed first. All paths start at an open directory, so that nothing lands beneath the mount point of a stick that has gone.
Knows files; knows nothing of recordings.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import hashlib
import json
import os
import stat
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

from dnb_edge.archive.in_directory import exists, folder, sync, write_all
from dnb_edge.errors import InputError, WorkError

FOLDER = "dnb-edge"
"""On the stick; all that is ever written lies in it."""
MANIFEST = "manifest.jsonl"
SUMS = "SHA256SUMS"
"""The manifest as `sha256sum -c` reads it."""
PARTIAL = "unfinished.partial"
"""The file that is being written: one name for all, so that a pulled stick keeps no more than one."""

BLOCK_BYTES = 1 << 20
SYNC_EVERY_BYTES = 8 << 20
"""So little waits in memory to be written: more of a slow stick's would hold up those who write to other disks."""


class NoRoom(WorkError):
    """The stick is full."""


class StickFailed(WorkError):
    """The stick has gone, or does not keep what is written to it."""


class TooLarge(WorkError):
    """The stick's file system takes no file of this size."""


class SourceFailed(WorkError):
    """The file that was to be copied has gone, changes meanwhile or cannot be read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """A file on the stick, as it was when it was copied and checked."""

    name: str
    """From the stick's folder of this box on."""
    size_bytes: int
    sha256: str
    modified_ns: int
    """Of the file that it is a copy of."""


class Pace:
    """Holds whoever copies back to so many bytes a second; None for as fast as it goes."""

    def __init__(self, bytes_per_s: float | None = None) -> None:
        self._bytes_per_s = bytes_per_s
        self._due_s = time.monotonic()

    def __call__(self, count: int) -> None:
        """Waits as long as `count` bytes may take; what was slow for another reason is not caught up."""
        if self._bytes_per_s is None:
            return
        now_s = time.monotonic()
        self._due_s = max(self._due_s, now_s) + count / self._bytes_per_s
        time.sleep(self._due_s - now_s)


Took = Callable[[int], None]
"""Called with each number of bytes that are copied."""


class Stick:
    """`place`/dnb-edge/`host`, open for copying into; nobody else copies there meanwhile."""

    def __init__(self, place: Path, host: str, *, pace: Pace | None = None) -> None:
        """Makes the folders where they are not there. Raises `InputError` where that cannot be, or another one copies there."""
        self.path = place / FOLDER / host
        self._pace = pace or Pace()
        with contextlib.ExitStack() as stack:
            try:
                top = os.open(place, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
                stack.callback(os.close, top)
                middle = folder(top, FOLDER)
                stack.callback(os.close, middle)
                self._directory = folder(middle, host)
            except OSError as error:
                raise InputError(f"{self.path}: nothing can be written there: {error.strerror}") from error
        try:
            fcntl.flock(self._directory, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self._entries = {entry.name: entry for entry in self._manifest()}
        except BlockingIOError as error:
            os.close(self._directory)
            raise InputError(f"{self.path}: another dnb-edge is copying there: wait until it is done") from error
        except OSError as error:
            os.close(self._directory)
            raise StickFailed(f"{self.path}: cannot be read: {error.strerror}") from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        os.close(self._directory)

    @property
    def free_bytes(self) -> int:
        """For ordinary users. Raises `StickFailed`."""
        with self._speaking():
            found = os.fstatvfs(self._directory)
        return found.f_bavail * found.f_frsize

    def is_known(self, source: Path, name: str) -> bool:
        """Whether a checked copy of `source`, as that is now, lies there by the manifest; its size is looked at, no more.

        Raises `SourceFailed`, `StickFailed`.
        """
        known = self._entries.get(name)
        if known is None:
            return False
        with _reading(source):
            found = source.stat()
        same = (known.size_bytes, known.modified_ns) == (found.st_size, found.st_mtime_ns)
        return same and self._size(name) == known.size_bytes

    def has(self, source: Path, name: str) -> bool:
        """Whether a copy of `source` lies there, by reading both. Raises `SourceFailed`, `StickFailed`."""
        with _reading(source):
            found = source.stat()
        if self._size(name) != found.st_size:
            return False
        with _reading(source):
            opened = os.open(source, os.O_RDONLY | os.O_CLOEXEC)
        try:
            with _reading(source):
                digest = self._digest(opened)
        finally:
            os.close(opened)
        with self._speaking(name):
            copied = os.open(name, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW, dir_fd=self._directory)
        try:
            with self._speaking(name):
                same = self._digest(copied) == digest
        finally:
            os.close(copied)
        known = Entry(name=name, size_bytes=found.st_size, sha256=digest, modified_ns=found.st_mtime_ns)
        if same and self._entries.get(name) != known:
            self._note(known)
        return same

    def put(self, source: Path, name: str, took: Took = lambda _: None) -> Entry:
        """Copies `source` there, checked, and notes it. Raises `NoRoom`, `TooLarge`, `StickFailed`, `SourceFailed`."""
        with _reading(source):
            opened = os.open(source, os.O_RDONLY | os.O_CLOEXEC)
        try:
            entry = self._put(opened, source, name, took)
        finally:
            os.close(opened)
        self._note(entry)
        return entry

    def finish(self) -> None:
        """Writes the list of checksums anew. Raises `NoRoom`, `StickFailed`."""
        lines = (
            f"{entry.sha256}  {entry.name}\n" for entry in sorted(self._entries.values(), key=lambda one: one.name)
        )
        with self._partial() as partial, self._speaking(SUMS):
            write_all(partial, "".join(lines).encode())
            os.fsync(partial)
            os.rename(PARTIAL, SUMS, src_dir_fd=self._directory, dst_dir_fd=self._directory)
            sync(self._directory)

    def _put(self, opened: int, source: Path, name: str, took: Took) -> Entry:
        with _reading(source):
            before = os.fstat(opened)
        with self._partial() as partial:
            self._check_size(partial, before.st_size, name)
            digest = self._pour(opened, source, partial, name, took)
            with _reading(source):
                after = os.fstat(opened)
            if (before.st_size, before.st_mtime_ns) != (after.st_size, after.st_mtime_ns):
                raise SourceFailed(f"{source.name}: was written to meanwhile")
            with self._speaking(name):
                os.utime(partial, ns=(before.st_mtime_ns, before.st_mtime_ns))
                os.fsync(partial)
                # What is compared must come from the disk, not from the memory that it was written from.
                os.posix_fadvise(partial, 0, 0, os.POSIX_FADV_DONTNEED)
                same = self._digest(partial) == digest
            if not same:
                raise StickFailed(f"{name}: the stick gives back other bytes than were written: use another stick")
            with self._speaking(name):
                self._place(name)
        return Entry(name=name, size_bytes=before.st_size, sha256=digest, modified_ns=before.st_mtime_ns)

    def _pour(self, opened: int, source: Path, partial: int, name: str, took: Took) -> str:
        """Copies all bytes; their SHA-256."""
        digest, unsynced, done = hashlib.sha256(), 0, 0
        while True:
            with _reading(source):
                block = os.pread(opened, BLOCK_BYTES, done)
            if not block:
                return digest.hexdigest()
            digest.update(block)
            with self._speaking(name):
                write_all(partial, block)
                unsynced += len(block)
                if unsynced >= SYNC_EVERY_BYTES:
                    os.fdatasync(partial)
                    unsynced = 0
            # The memory is the race's: what was copied is not wanted again.
            os.posix_fadvise(opened, done, len(block), os.POSIX_FADV_DONTNEED)
            done += len(block)
            took(len(block))
            self._pace(len(block))

    def _check_size(self, partial: int, size_bytes: int, name: str) -> None:
        """Raises `TooLarge` where the file system's files end before that: a place behind their end cannot be gone to."""
        try:
            os.lseek(partial, size_bytes, os.SEEK_SET)
            os.lseek(partial, 0, os.SEEK_SET)
        except OSError as error:
            raise self._fault(OSError(errno.EFBIG, os.strerror(errno.EFBIG)), name) from error

    def _place(self, name: str) -> None:
        """Gives the written file its name; another one that has it is renamed. Raises OSError."""
        below, _, last = name.rpartition("/")
        directory = folder(self._directory, below) if below else os.dup(self._directory)
        try:
            if exists(directory, last):
                number = 1
                while exists(directory, aside := f"{last}.older-{number}"):
                    number += 1
                os.rename(last, aside, src_dir_fd=directory, dst_dir_fd=directory)
            os.rename(PARTIAL, last, src_dir_fd=self._directory, dst_dir_fd=directory)
            sync(directory)
        finally:
            os.close(directory)
        sync(self._directory)

    @contextmanager
    def _partial(self) -> Iterator[int]:
        """The file to write to, empty; it goes again unless it gets another name."""
        flags = os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC | os.O_NOFOLLOW
        with self._speaking():
            partial = os.open(PARTIAL, flags, 0o644, dir_fd=self._directory)
        try:
            yield partial
        finally:
            # An error of the stick's here is of what is given up anyhow.
            with contextlib.suppress(OSError):
                os.close(partial)
            with contextlib.suppress(OSError):
                os.unlink(PARTIAL, dir_fd=self._directory)

    def _manifest(self) -> Iterator[Entry]:
        """What is noted, later lines last; a line that a pulled stick cut short counts for nothing. Raises OSError."""
        try:
            opened = os.open(MANIFEST, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW, dir_fd=self._directory)
        except FileNotFoundError:
            return
        with os.fdopen(opened, encoding="utf-8", errors="replace") as stream:
            for line in stream:
                if (entry := _entry(line)) is not None:
                    yield entry

    def _note(self, entry: Entry) -> None:
        flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC | os.O_NOFOLLOW
        with self._speaking(MANIFEST):
            opened = os.open(MANIFEST, flags, 0o644, dir_fd=self._directory)
            try:
                # Where the line before was cut short this one begins anew.
                write_all(opened, f"\n{json.dumps(asdict(entry))}\n".encode())
                os.fsync(opened)
            finally:
                os.close(opened)
        self._entries[entry.name] = entry

    def _size(self, name: str) -> int | None:
        """Of the file there; None where there is none of that name."""
        with self._speaking(name):
            try:
                found = os.stat(name, dir_fd=self._directory, follow_symlinks=False)
            except (FileNotFoundError, NotADirectoryError):
                return None
        return found.st_size if stat.S_ISREG(found.st_mode) else None

    def _digest(self, opened: int) -> str:
        """SHA-256 of a whole file, in hexadecimal. Raises OSError."""
        digest, done = hashlib.sha256(), 0
        while block := os.pread(opened, BLOCK_BYTES, done):
            digest.update(block)
            os.posix_fadvise(opened, done, len(block), os.POSIX_FADV_DONTNEED)
            done += len(block)
            self._pace(len(block))
        return digest.hexdigest()

    @contextmanager
    def _speaking(self, name: str | None = None) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise self._fault(error, name) from error

    def _fault(self, error: OSError, name: str | None) -> WorkError:
        """What an error of the stick means."""
        if error.errno in {errno.ENOSPC, errno.EDQUOT}:
            return NoRoom(f"{self.path}: the stick is full")
        if error.errno == errno.EFBIG:
            return TooLarge(f"{name}: larger than the stick's file system takes (FAT ends at 4 GB): format it as exFAT")
        what = f"{self.path}/{name}" if name is not None else str(self.path)
        return StickFailed(f"{what}: the stick was pulled out, or fails: {error.strerror}")


def _entry(line: str) -> Entry | None:
    try:
        found = json.loads(line)
        return Entry(
            name=str(found["name"]),
            size_bytes=int(found["size_bytes"]),
            sha256=str(found["sha256"]),
            modified_ns=int(found["modified_ns"]),
        )
    except (ValueError, TypeError, KeyError, RecursionError):
        return None


@contextmanager
def _reading(source: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise SourceFailed(f"{source.name}: cannot be read: {error.strerror}") from error
