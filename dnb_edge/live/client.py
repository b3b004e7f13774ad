"""One client on the socket, from our side: what it is still to be told, in which order, and what it says.

Nothing here can pile up: lasting events stay in the backlog until the client has room for them, of the others a few wait, and
of pictures and states the latest. Knows bytes and a non-blocking socket; knows no thread, and no clock but what it is told.
"""

from __future__ import annotations

import socket
from collections import deque
from typing import Protocol

from dnb_edge.errors import WorkError
from dnb_edge.live.backlog import News, Numbered
from dnb_edge.live.messages import Answer, encode
from dnb_edge.values import Frame

MOST_FLEETING = 64
"""Fleeting events that wait for a client: of two cars a second's."""
MOST_ANSWERS = 32
MOST_ASKED_BYTES = 64 * 1024
"""A longer line is no question of ours."""
BATCH = 64
"""Events that are given to the kernel at once."""
READ_BYTES = 16 * 1024
TURN = 8
"""Times that a client is given something before it is the others' turn."""


class Gone(Exception):
    """The client has closed its end, or the connection failed."""


class Server(Protocol):
    """What a client's connection asks of the server; each call is short."""

    @property
    def state_line(self) -> bytes:
        """The message of what the daemon does now."""

    def news(self, sequence: int, *, most: int) -> News:
        """The lasting events from a number on."""


class Client:
    """A connection. One thread uses it; others only add answers and replace the picture."""

    def __init__(self, connection: socket.socket, *, number: int, hello: bytes, now_s: float) -> None:
        self.number = number
        self.connection = connection
        self.cursor: int | None = None
        """Number of the next event that it is to be told; None while it has not asked for any."""
        self.picture: bytes | None = None
        self.every_s: float | None = None
        """At most one picture in so many seconds; None where it wants none."""
        self.picture_due_s = 0.0
        self.pictured: Frame | None = None
        """The frame whose picture it was given last."""
        self.moved_s = now_s
        """When it last took bytes, or last had nothing to take."""
        self._out = memoryview(hello)
        self._state = b""
        """What it was told last of the daemon's state."""
        self._said = bytearray()
        self._answers: deque[bytes] = deque()
        self._fleeting: deque[Numbered] = deque(maxlen=MOST_FLEETING)

    def tell(self, fleeting: Numbered) -> None:
        """Lets an event wait for it that may be lost."""
        if self.cursor is not None:
            self._fleeting.append(fleeting)

    def answer(self, answer: Answer) -> None:
        """Lets an answer wait for it; lost where it asks and asks and never reads."""
        if len(self._answers) < MOST_ANSWERS:
            self._answers.append(encode(answer))

    def follow(self, sequence: int) -> None:
        """From this number on it is told what happens."""
        self.cursor = sequence
        self._fleeting.clear()

    def listen(self) -> list[bytes]:
        """The whole lines that it has said. Raises `Gone`, and `WorkError` for a line without end."""
        try:
            said = self.connection.recv(READ_BYTES)
        except BlockingIOError:
            return []
        except OSError as error:
            raise Gone from error
        if not said:
            raise Gone
        self._said += said
        *lines, rest = bytes(self._said).split(b"\n")
        if max(map(len, (*lines, rest))) > MOST_ASKED_BYTES:
            raise WorkError(f"a line of more than {MOST_ASKED_BYTES} bytes")
        self._said = bytearray(rest)
        return lines

    def write(self, server: Server, now_s: float) -> bool:
        """Gives it what it takes, for a short time; True where more waits. Raises `Gone`, and `WorkError` where it lags too far
        behind."""
        for _ in range(TURN):
            if not self._out and not self._fill(server):
                self.moved_s = now_s
                return False
            try:
                taken = self.connection.send(self._out)
            except BlockingIOError:
                return True
            except OSError as error:
                raise Gone from error
            self._out = self._out[taken:]
            self.moved_s = now_s
        return True

    def _fill(self, server: Server) -> bool:
        """Takes what comes next: state and answers, then events by their numbers, a picture where all else is told."""
        if self._state is not server.state_line:
            told = self._state = server.state_line
        elif self._answers:
            told = self._answers.popleft()
        elif self.cursor is not None and (events := self._events(self.cursor, server)):
            told = b"".join(event.line() for event in events)
        elif self.picture is not None:
            told, self.picture = self.picture, None
        else:
            return False
        self._out = memoryview(told)
        return True

    def _events(self, cursor: int, server: Server) -> list[Numbered]:
        """The next events that it is to be told, in order; the cursor moves behind them."""
        news = server.news(cursor, most=BATCH)
        if cursor < news.first != news.run_first < cursor:
            raise WorkError("it lags too far behind")
        # Where the latest run is a new one nobody wants the end of the last one any more: the state has told of it.
        cursor = max(cursor, news.run_first)
        # A lasting event that is left for the next batch comes before later fleeting ones.
        end = news.lasting[-1].sequence if len(news.lasting) == BATCH else news.next
        fleeting = []
        while self._fleeting and self._fleeting[0].sequence <= end:
            fleeting.append(self._fleeting.popleft())
        events = sorted(
            (*news.lasting, *(one for one in fleeting if one.sequence >= cursor)), key=lambda one: one.sequence
        )
        if events:
            self.cursor = max(events[-1].sequence + 1, news.first)
        return events
