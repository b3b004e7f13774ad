"""Files that a person asks for: whole under their name, or not at all."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dnb_edge.errors import InputError, WorkError

_DISK_FAULTS = (errno.ENOSPC, errno.EDQUOT, errno.EIO)


def write_whole(path: Path, data: bytes) -> None:
    """Writes `data` to `path` through a neighbour that takes its name at the end, so nobody ever sees half of it.

    Raises `InputError` where the directory cannot be used or `path` is one, `WorkError` where the disk refuses.
    """
    if not path.parent.is_dir():
        raise InputError(f"{path}: there is no directory {path.parent}: make it first")
    if path.is_dir():
        raise InputError(f"{path}: is a directory: name a file")
    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        try:
            with partial.open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)
    except OSError as error:
        kind = WorkError if error.errno in _DISK_FAULTS else InputError
        raise kind(f"{path}: cannot be written: {error.strerror or error}") from error


@contextmanager
def scratch_beside(path: Path) -> Iterator[Path]:
    """A hidden folder beside `path` for what is not finished yet; gone at the end, whatever happens.

    Raises `InputError` where none can be made there, `WorkError` where the disk is full.
    """
    try:
        folder = tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.stem}-")
    except OSError as error:
        kind = WorkError if error.errno in _DISK_FAULTS else InputError
        raise kind(f"{path}: nothing can be written there: {error.strerror or error}") from error
    with folder as name:
        yield Path(name)
