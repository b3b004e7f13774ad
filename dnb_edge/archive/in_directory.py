"""Files and folders by an open directory and a name in it, so that nothing lands elsewhere when what is mounted there goes.

Knows POSIX files; every function raises OSError.
"""

from __future__ import annotations

import errno
import os


def folder(directory: int, name: str) -> int:
    """The folder `name` in `directory`, made where it is not there, never through a link."""
    try:
        os.mkdir(name, 0o755, dir_fd=directory)
        sync(directory)
    except FileExistsError:
        pass
    return os.open(name, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC, dir_fd=directory)


def exists(directory: int, name: str) -> bool:
    """Whether anything has the name, were it a link to nothing."""
    try:
        os.stat(name, dir_fd=directory, follow_symlinks=False)
    except FileNotFoundError:
        return False
    return True


def sync(directory: int) -> None:
    """Makes the names in `directory` durable."""
    try:
        os.fsync(directory)
    except OSError as error:
        # Some network file systems cannot sync a directory and say so with EINVAL: then there is nothing to do.
        if error.errno != errno.EINVAL:
            raise


def write_all(opened: int, data: bytes) -> None:
    """Writes all of `data` where the file stands."""
    rest = memoryview(data)
    while rest:
        rest = rest[os.write(opened, rest) :]
