"""A file that survives power cuts and full disks: `.part` until finished, synced on request, renamed once complete.

Knows POSIX files and nothing of MCAP. It stands behind the MCAP writers as their file object, and it never raises into
them: the first error of the disk is remembered in `failure`, whatever is written later is thrown away, the owner asks.
A failed fsync is never tried again, since the kernel may already have dropped the dirty pages (PostgreSQL's fsync
errors of 2018); the file is given up as it stands and what had been synced before stays readable in the `.part`.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
from pathlib import Path

PART_SUFFIX = ".part"
"""Ending of a recording that is being written, or was when the power went."""


def sync_directory(directory: Path) -> None:
    """Make the names in `directory` durable. Raises OSError."""
    descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    except OSError as error:
        # Some network file systems cannot sync a directory and say so with EINVAL: then there is nothing to do.
        if error.errno != errno.EINVAL:
            raise
    finally:
        os.close(descriptor)


class DurableFile:
    """A new file for writing front to back, at `final` + `suffix` until `finish`.

    The creation is exclusive and the file stays locked (flock) while it is open, so that recovery leaves it alone.
    `write`, `seek`, `tell` and `flush` are the file object that foxglove-sdk and mcap want; they never raise OSError.
    """

    def __init__(self, final: Path, *, suffix: str = PART_SUFFIX) -> None:
        """Create the file. Raises OSError: FileExistsError where it, or `final`, is there already."""
        if final.exists():
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(final))
        self.final = final
        self.path = final.with_name(final.name + suffix)
        """The file as it is called now."""
        self.failure: OSError | None = None
        self._size = 0
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
        self._descriptor: int | None = os.open(self.path, flags, 0o644)
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(self._descriptor)
            self.path.unlink()
            raise

    def write(self, data: bytes | bytearray | memoryview) -> int:
        """Append `data`, all of it; after a failure or `abandon`, throw it away. Returns its length in either case."""
        length = len(data)
        self._size += length
        if self._descriptor is None:
            return length
        rest = memoryview(data)
        try:
            while rest:
                rest = rest[os.write(self._descriptor, rest) :]
        except OSError as error:
            self._fail(error)
        return length

    def tell(self) -> int:
        """Bytes written so far."""
        return self._size

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """The present offset; a real move raises ValueError, since the file only grows."""
        if (whence, offset) not in {(os.SEEK_CUR, 0), (os.SEEK_END, 0), (os.SEEK_SET, self._size)}:
            raise ValueError(f"{self.path.name}: written front to back, cannot seek to {offset}")
        return self._size

    def flush(self) -> None:
        """Nothing: there is no buffer here, and durability is asked for with `sync`."""

    def sync(self) -> bool:
        """Bring everything written so far to the disk; True where it is there. A failure is never retried."""
        if self._descriptor is None:
            return False
        try:
            os.fdatasync(self._descriptor)
        except OSError as error:
            self._fail(error)
        return self.failure is None

    def sync_new(self) -> bool:
        """As `sync`, and the file's name in its directory with it: once, after the first bytes."""
        if self._descriptor is None:
            return False
        try:
            os.fsync(self._descriptor)
            sync_directory(self.path.parent)
        except OSError as error:
            self._fail(error)
        return self.failure is None

    def finish(self) -> bool:
        """Sync, give the file its final name and sync the directory; False, with `failure` set, where that failed.

        A file that meanwhile took the final name is not replaced: the `.part` stays. Between that look and the rename
        nobody of ours can take the name, since whoever wants it must first create the same `.part`.
        """
        if self._descriptor is None:
            return False
        try:
            os.fsync(self._descriptor)
            if self.final.exists():
                raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(self.final))
            self.path = self.path.rename(self.final)
            sync_directory(self.final.parent)
        except OSError as error:
            self._fail(error)
            return False
        self._close()
        return True

    def abandon(self) -> None:
        """Stop writing and leave the `.part` as it is."""
        self._close()

    def discard(self) -> None:
        """Stop writing and remove the file, where it can be removed: for one that never held anything."""
        self._close()
        with contextlib.suppress(OSError):
            self.path.unlink(missing_ok=True)

    def _fail(self, error: OSError) -> None:
        if self.failure is None:
            self.failure = error
        self._close()

    def _close(self) -> None:
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is None:
            return
        try:
            os.close(descriptor)
        except OSError as error:
            if self.failure is None:
                self.failure = error
