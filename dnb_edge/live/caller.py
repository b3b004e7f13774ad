"""A plain client of the daemon's socket, for programs that say or ask one thing after the other and wait for the answer.

Knows sockets and the monotonic clock. Knows nothing of what an answer means; the pages' own line, which waits for nobody, is
the web's.
"""

from __future__ import annotations

import itertools
import socket
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from dnb_edge.errors import TemporaryFault, WorkError
from dnb_edge.live.messages import (
    MOST_LINE_BYTES,
    PROTOCOL,
    Answer,
    FromDaemon,
    Hello,
    Picture,
    State,
    ToDaemon,
    Told,
    blob_bytes,
    decode,
    encode,
)

TIMEOUT_S = 5.0
READ_BYTES = 64 * 1024


class Silence(TemporaryFault):
    """Nothing came in time; the line is as it was."""


class Caller:
    """Connected to the daemon at `path` until it is closed. For one thread."""

    def __init__(self, path: Path, *, timeout_s: float = TIMEOUT_S) -> None:
        """Raises `TemporaryFault` where no daemon answers in `timeout_s`, `WorkError` where it speaks another language."""
        self._path = path
        self._said = bytearray()
        self._asks = itertools.count(1)
        self._timeout_s = timeout_s
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_CLOEXEC)
        try:
            self._socket.settimeout(timeout_s)
            try:
                self._socket.connect(str(path))
            except OSError as error:
                raise TemporaryFault(f"{path}: no dnb-edge answers there: {error.strerror or error}") from error
            hello = self.hear()
            if not isinstance(hello, Hello) or hello.protocol != PROTOCOL:
                raise WorkError(f"{path}: what answers there is another version of dnb-edge: restart it")
        except (TemporaryFault, WorkError):
            self._socket.close()
            raise
        self.hello = hello
        """What it said first."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Ends the connection. Safe to repeat."""
        self._socket.close()

    def ask(self, kind: type[ToDaemon], *, timeout_s: float | None = None, **members: Any) -> None:
        """Sends a question of `kind` and waits until it is done; what else is told meanwhile is passed over.

        Raises `WorkError` with the daemon's reason where it refuses, `TemporaryFault` where it does not answer in time.
        """
        ask = self.say(kind, **members)
        deadline_s = time.monotonic() + (self._timeout_s if timeout_s is None else timeout_s)
        while True:
            heard = self.hear(deadline_s=deadline_s)
            if isinstance(heard, Answer) and heard.ask == ask:
                if not heard.done:
                    raise WorkError(heard.reason or "dnb-edge refuses")
                return

    def say(self, kind: type[ToDaemon], **members: Any) -> int:
        """Sends a message and waits for nothing; its number. Raises `TemporaryFault`."""
        ask = next(self._asks)
        try:
            self._socket.settimeout(self._timeout_s)
            self._socket.sendall(encode(kind(ask=ask, **members)))
        except OSError as error:
            raise self._gone(error) from error
        return ask

    def hear(self, *, deadline_s: float | None = None) -> FromDaemon:
        """The next message, up to `deadline_s` of the monotonic clock (by default so long from now as a call may take).

        Raises `Silence`, a `TemporaryFault`, where none comes, `TemporaryFault` where the daemon has gone, `WorkError` where
        what comes is none.
        """
        deadline_s = time.monotonic() + self._timeout_s if deadline_s is None else deadline_s
        while True:
            line = self._line(deadline_s)
            blob = self._bytes(blob_bytes(line), deadline_s)
            message = decode(line, blob)
            if isinstance(message, Hello | State | Told | Picture | Answer):
                return message

    def _line(self, deadline_s: float) -> bytes:
        while (end := self._said.find(b"\n")) < 0:
            if len(self._said) > MOST_LINE_BYTES:
                raise WorkError(f"{self._path}: a line of more than {MOST_LINE_BYTES} bytes")
            self._more(deadline_s)
        line = bytes(self._said[:end])
        del self._said[: end + 1]
        return line

    def _bytes(self, count: int, deadline_s: float) -> bytes:
        while len(self._said) < count:
            self._more(deadline_s)
        blob = bytes(self._said[:count])
        del self._said[:count]
        return blob

    def _more(self, deadline_s: float) -> None:
        """Reads what has come, or waits for it."""
        left_s = deadline_s - time.monotonic()
        if left_s <= 0:
            raise Silence(f"{self._path}: dnb-edge does not answer in time")
        try:
            self._socket.settimeout(left_s)
            said = self._socket.recv(READ_BYTES)
        except OSError as error:
            raise self._gone(error) from error
        if not said:
            raise TemporaryFault(f"{self._path}: dnb-edge has gone")
        self._said += said

    def _gone(self, error: OSError) -> TemporaryFault:
        if isinstance(error, TimeoutError):
            return Silence(f"{self._path}: dnb-edge does not answer in time")
        return TemporaryFault(f"{self._path}: dnb-edge has gone")
