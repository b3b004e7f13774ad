"""A Unix socket's file: made for the group alone, a dead one's swept away, a living one's left in peace.

Knows sockets as files. Knows no message.
"""

from __future__ import annotations

import fcntl
import logging
import os
import socket
import stat
from pathlib import Path

from dnb_edge.errors import InputError

MODE = 0o660
WAITING = 8
"""Connections that wait to be accepted."""
MOST_PATH_BYTES = 107
"""unix(7): sun_path."""

log = logging.getLogger(__name__)


class SocketFile:
    """Listens at `path` from when it is made until `close`."""

    def __init__(self, path: Path) -> None:
        """Raises `InputError` where another process answers there, something else lies there, or it cannot be made."""
        self.path = path
        if len(os.fsencode(path)) > MOST_PATH_BYTES:
            raise InputError(f"--live {path}: longer than {MOST_PATH_BYTES} bytes: give a shorter path")
        try:
            self._lock = os.open(path.with_name(f"{path.name}.lock"), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        except OSError as error:
            raise InputError(f"--live {path}: cannot be made: {error.strerror}") from error
        try:
            self._claim()
            self.listener = self._listen()
        except OSError as error:
            os.close(self._lock)
            raise InputError(f"--live {path}: cannot be made: {error.strerror}") from error
        except InputError:
            os.close(self._lock)
            raise
        self._inode = path.lstat().st_ino

    def close(self) -> None:
        """Lets nobody in any more; the file goes, unless it is another's by now. Safe to repeat."""
        if self.listener.fileno() < 0:
            return
        self.listener.close()
        try:
            if self.path.lstat().st_ino == self._inode:
                self.path.unlink()
        except FileNotFoundError:
            pass  # somebody has swept it away already
        except OSError as error:
            log.warning("%s: left behind: %s", self.path, error.strerror)
        finally:
            os.close(self._lock)

    def _claim(self) -> None:
        """Makes room at the path. The lock ends with its process, so of two that start at once one alone gets here."""
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise _taken(self.path) from error
        try:
            found = self.path.lstat()
        except FileNotFoundError:
            return
        if not stat.S_ISSOCK(found.st_mode):
            raise InputError(f"--live {self.path}: something that is no socket lies there: give another path")
        if _answers(self.path):
            raise _taken(self.path)
        self.path.unlink()

    def _listen(self) -> socket.socket:
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
        try:
            listener.bind(str(self.path))
            # Before anybody is listened to: bind() goes by the umask.
            self.path.chmod(MODE)
            listener.listen(WAITING)
        except OSError:
            listener.close()
            raise
        return listener


def _answers(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK) as caller:
        try:
            caller.connect(str(path))
        except (ConnectionRefusedError, FileNotFoundError):
            return False
        except BlockingIOError:
            return True  # its queue of callers is full
        return True


def _taken(path: Path) -> InputError:
    return InputError(
        f"--live {path}: another dnb-edge answers there: stop it (`systemctl stop dnb-edge`), or give --live another path"
    )
