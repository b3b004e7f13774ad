"""A client of the live socket with the patience of tests: the product's own, that can also say what is none of its messages and
wait for what is told to it."""

import time
from pathlib import Path
from typing import Any

from dnb_edge.errors import TemporaryFault
from dnb_edge.live import caller
from dnb_edge.live.messages import Answer, Follow, FromDaemon

PATIENCE_S = 120.0


class Caller(caller.Caller):
    """Connected to the server at `path`."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, timeout_s=PATIENCE_S)

    def say_bytes(self, line: bytes) -> None:
        self._socket.sendall(line)

    def hear_or_end(self) -> FromDaemon | None:
        """The next message; None where the connection has ended."""
        try:
            return self.hear()
        except TemporaryFault as fault:
            if "has gone" not in str(fault):
                raise
            return None

    def hear_until(self, true: Any) -> list[FromDaemon]:
        """All messages up to the first for which `true(message)` holds, that one included."""
        deadline_s = time.monotonic() + PATIENCE_S
        heard: list[FromDaemon] = []
        while not heard or not true(heard[-1]):
            heard.append(self.hear(deadline_s=deadline_s))
        return heard

    def answer(self, ask: int) -> Answer:
        """The answer to `ask`; what comes before it is passed over."""
        last = self.hear_until(lambda one: isinstance(one, Answer) and one.ask == ask)[-1]
        assert isinstance(last, Answer)
        return last

    def follow(self, since: int | None = 0, epoch: str | None = None) -> None:
        """Asks for events; by default for all kept ones of this epoch."""
        self.say(Follow, since=since, epoch=self.hello.epoch if epoch is None else epoch)
