"""A client of the live socket, as the pages' process is one."""

import itertools
import socket
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from dnb_edge.live.messages import (
    Answer,
    Follow,
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

PATIENCE_S = 120.0


class Caller:
    """Connected to the server at `path`; says and hears whole messages."""

    def __init__(self, path: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.settimeout(PATIENCE_S)
        self._socket.connect(str(path))
        self._said = bytearray()
        self._asks = itertools.count(1)
        hello = self.hear()
        if not isinstance(hello, Hello):
            self.close()
            raise ConnectionRefusedError
        self.hello = hello

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        self._socket.close()

    def say(self, kind: type[ToDaemon], **members: Any) -> int:
        """Sends a message; its number."""
        ask = next(self._asks)
        self._socket.sendall(encode(kind(ask=ask, **members)))
        return ask

    def say_bytes(self, line: bytes) -> None:
        self._socket.sendall(line)

    def hear(self) -> FromDaemon | None:
        """The next message; None where the connection has ended."""
        while b"\n" not in self._said:
            if not self._more():
                return None
        line, _, rest = bytes(self._said).partition(b"\n")
        self._said = bytearray(rest)
        count = blob_bytes(line)
        while len(self._said) < count:
            if not self._more():
                return None
        blob, self._said = bytes(self._said[:count]), self._said[count:]
        message = decode(line, blob)
        assert isinstance(message, Hello | State | Told | Picture | Answer)
        return message

    def hear_until(self, true: Any) -> list[FromDaemon]:
        """All messages up to the first for which `true(message)` holds, that one included."""
        deadline_s = time.monotonic() + PATIENCE_S
        heard: list[FromDaemon] = []
        while True:
            message = self.hear()
            assert message is not None, f"the connection ended after {heard[-3:]}"
            assert time.monotonic() < deadline_s, f"waited in vain, heard {heard[-3:]}"
            heard.append(message)
            if true(message):
                return heard

    def answer(self, ask: int) -> Answer:
        """The answer to `ask`; what comes before it is passed over."""
        last = self.hear_until(lambda one: isinstance(one, Answer) and one.ask == ask)[-1]
        assert isinstance(last, Answer)
        return last

    def follow(self, since: int | None = 0, epoch: str | None = None) -> None:
        """Asks for events; by default for all kept ones of this epoch."""
        self.say(Follow, since=since, epoch=self.hello.epoch if epoch is None else epoch)

    def _more(self) -> bool:
        try:
            said = self._socket.recv(65536)
        except ConnectionResetError:
            return False
        self._said += said
        return bool(said)
