"""The service manager's end of the notify socket."""

import os
import socket
from pathlib import Path


class Manager:
    """Hears what a service tells, as systemd does."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self._socket.bind(str(path))

    def heard(self) -> list[str]:
        """All that was told since the last call."""
        told = []
        while True:
            try:
                told.append(self._socket.recv(4096).decode())
            except BlockingIOError:
                return told

    def close(self) -> None:
        self._socket.close()


def environment(path: Path, *, watchdog_s: float | None = None) -> dict[str, str]:
    """What the manager sets for its service, this process."""
    given = {"NOTIFY_SOCKET": str(path)}
    if watchdog_s is not None:
        given |= {"WATCHDOG_USEC": str(round(watchdog_s * 1e6)), "WATCHDOG_PID": str(os.getpid())}
    return given
