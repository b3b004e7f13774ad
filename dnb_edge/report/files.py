"""Files that a person asks for: whole under their name, or not at all."""

from __future__ import annotations

import errno
import os
from pathlib import Path

from dnb_edge.errors import InputError, WorkError


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
        kind = WorkError if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EIO) else InputError
        raise kind(f"{path}: cannot be written: {error.strerror or error}") from error
