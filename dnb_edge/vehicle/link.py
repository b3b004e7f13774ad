"""The gateway's line to the daemon: a client of the live socket that never waits, and comes back by itself.

Knows sockets and the live messages' bytes. Knows nothing of what they mean.
"""

from __future__ import annotations

import itertools
import logging
import socket
import time
from pathlib import Path

from dnb_edge.errors import WorkError
from dnb_edge.live.messages import (
    MOST_LINE_BYTES,
    PROTOCOL,
    Follow,
    FromDaemon,
    Hello,
    Message,
    State,
    ToDaemon,
    Told,
    VehicleSays,
    blob_bytes,
    decode,
    encode,
)
from dnb_edge.live.vehicle_word import VehicleWord

BACK_OFF_S = (0.2, 0.5, 1.0, 2.0)
MOST_OUT_BYTES = 64 * 1024
"""Of words that wait for a daemon which takes none; later ones are lost."""
READ_BYTES = 64 * 1024

log = logging.getLogger(__name__)


class Link:
    """Connected to the daemon at `path` whenever it is there. For one thread."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._socket: socket.socket | None = None
        self._said = bytearray()
        self._out = bytearray()
        self._asks = itertools.count(1)
        self._due_s = 0.0
        self._tries = 0
        self.lost = 0
        """Words that the daemon was not there for, or did not take."""

    @property
    def connected(self) -> bool:
        """Whether the daemon is there."""
        return self._socket is not None

    @property
    def due_s(self) -> float:
        """When it is tried again, by the monotonic clock."""
        return self._due_s

    @property
    def waits(self) -> bool:
        """Whether something waits to be taken by the daemon."""
        return bool(self._out)

    def fileno(self) -> int | None:
        """Of the connection; None without one."""
        return None if self._socket is None else self._socket.fileno()

    def tend(self, now_s: float) -> None:
        """Connects where there is no connection and it is time to try."""
        if self._socket is not None or now_s < self._due_s:
            return
        self._due_s = now_s + BACK_OFF_S[min(self._tries, len(BACK_OFF_S) - 1)]
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK | socket.SOCK_CLOEXEC)
        try:
            # A Unix socket connects at once or not at all.
            connection.connect(str(self._path))
        except OSError as error:
            connection.close()
            if self._tries == 0:
                log.warning("%s: no dnb-edge answers there (%s); it is tried again", self._path, error.strerror)
            self._tries += 1
            return
        self._socket = connection
        self._said.clear()
        self._out.clear()

    def read(self) -> list[FromDaemon]:
        """What the daemon has said; on its first message it is asked for events, those of this run that have been included."""
        if self._socket is None:
            return []
        try:
            said = self._socket.recv(READ_BYTES)
            if not said:
                raise WorkError("it has hung up")
            self._said += said
            return [message for message in self._messages() if isinstance(message, Hello | State | Told)]
        except BlockingIOError:
            return []
        except (OSError, WorkError) as error:
            self._gone(getattr(error, "strerror", None) or str(error))
            return []

    def hand_over(self, words: list[VehicleWord]) -> None:
        """Gives words to the daemon, or loses them where it is away or takes nothing."""
        if self._socket is None or len(self._out) > MOST_OUT_BYTES:
            self.lost += len(words)
            return
        self._send(VehicleSays(ask=next(self._asks), words=tuple(words)))

    def write(self) -> None:
        """Gives the daemon what it takes."""
        if self._socket is None:
            return
        try:
            sent = self._socket.send(self._out)
        except BlockingIOError:
            return
        except OSError:
            # It has gone; what it said last is still to be read, and then its end.
            self._out.clear()
            return
        del self._out[:sent]

    def close(self) -> None:
        """Ends the connection. Safe to repeat."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _send(self, message: ToDaemon) -> None:
        self._out += encode(message)
        self.write()

    def _messages(self) -> list[Message]:
        """The whole messages that have come. Raises `WorkError` where that is none, or of another version."""
        found: list[Message] = []
        while (end := self._said.find(b"\n")) >= 0:
            line = bytes(self._said[:end])
            size = blob_bytes(line)
            if len(self._said) < end + 1 + size:
                break
            message = decode(line, bytes(self._said[end + 1 : end + 1 + size]))
            del self._said[: end + 1 + size]
            if isinstance(message, Hello):
                self._greet(message)
            if message is not None:
                found.append(message)
        if len(self._said) > MOST_LINE_BYTES:
            raise WorkError(f"a line of more than {MOST_LINE_BYTES} bytes")
        return found

    def _greet(self, hello: Hello) -> None:
        if hello.protocol != PROTOCOL:
            raise WorkError("what answers there is another version of dnb-edge: restart it")
        log.info("%s: connected", self._path)
        self._tries = 0
        self._send(Follow(ask=next(self._asks), since=hello.first_sequence, epoch=hello.epoch))

    def _gone(self, why: str | None) -> None:
        log.warning("%s: dnb-edge has gone (%s); it is tried again", self._path, why)
        self.close()
        # Not in the same turn: whoever watches the descriptor must see that it has gone.
        self._due_s = time.monotonic() + BACK_OFF_S[0]
