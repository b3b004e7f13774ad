"""The daemon's end of its local socket: tells up to eight clients what happens, and passes on what they ask.

One thread serves all clients and never waits for any of them; another makes pictures, only while somebody watches. The race
only hands values over. Knows sockets, threads and the monotonic clock; what an answer is to be, others know.
"""

from __future__ import annotations

import logging
import os
import secrets
import selectors
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Self, TypeAlias

from dnb_edge.errors import WorkError
from dnb_edge.live.backlog import FLEETING, MOST_KEPT, Backlog, News, Numbered
from dnb_edge.live.client import Client, Gone
from dnb_edge.live.messages import (
    PROTOCOL,
    AimCamera,
    Answer,
    Follow,
    Hello,
    NewRun,
    Phase,
    Picture,
    ShowText,
    State,
    VehicleSays,
    WatchPictures,
    decode,
    encode,
)
from dnb_edge.live.pictures import picture_of
from dnb_edge.live.socket_file import SocketFile
from dnb_edge.values import Event, Frame

MOST_CLIENTS = 8
STALL_S = 5.0
"""A client that takes no byte of what waits for it for so long is cut off."""
TICK_S = 0.5
MOST_FRESH = 512
"""Fleeting events on their way to the clients; later ones are lost."""
LEAST_EVERY_S = 0.02
ACCEPT_AGAIN_S = 0.1
CLOSE_S = 1.0
"""How long the last words may take."""

log = logging.getLogger(__name__)

Order: TypeAlias = NewRun | AimCamera | ShowText | VehicleSays
Reply: TypeAlias = Callable[[str | None], None]
"""Tells whoever asked the end of it: why it was not done, or None where it was. From any thread, once."""


def _refuse(order: Order, reply: Reply) -> None:
    reply(f"this dnb-edge takes no {type(order).__name__}")


class LiveServer:
    """Serves clients at `path` until it is closed. Methods may be called from several threads; none of them blocks."""

    def __init__(
        self,
        path: Path,
        *,
        version: str,
        on_order: Callable[[Order, Reply], None] = _refuse,
        most_kept: int = MOST_KEPT,
        stall_s: float = STALL_S,
    ) -> None:
        """`on_order` is called in the server's thread and must not block. Raises `InputError` as `SocketFile` does."""
        self.epoch = secrets.token_hex(8)
        self.on_order = on_order
        self.watched = False
        """Whether anybody wants pictures."""
        self.clients = 0
        self._version = version
        self._stall_s = stall_s
        self._lock = threading.Lock()
        self._backlog = Backlog(most=most_kept)
        self._state = State(phase=Phase.STARTING)
        self.state_line = encode(self._state)
        """The message of what the daemon does now."""
        self._fresh: deque[Numbered] = deque(maxlen=MOST_FRESH)
        self._connected: dict[int, Client] = {}
        self._numbers = 0
        self._frame: Frame | None = None
        self._new_frame = threading.Event()
        self._closing = threading.Event()
        self._file = SocketFile(path)
        self._wake: int | None = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._file.listener, selectors.EVENT_READ)
        self._selector.register(self._wake, selectors.EVENT_READ)
        self._threads = [
            threading.Thread(target=self._serve, name="live", daemon=True),
            threading.Thread(target=self._watch, name="live-pictures", daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    @property
    def state(self) -> State:
        """What was told last."""
        return self._state

    def begin_run(self) -> None:
        """From here on events belong to another run; those of the one before are forgotten."""
        with self._lock:
            self._backlog.begin_run()
            self._fresh.clear()

    def tell(self, event: Event) -> None:
        """Numbers an event and hands it over."""
        if isinstance(event, FLEETING):
            if not self.clients:
                return
            with self._lock:
                self._fresh.append(self._backlog.add(event))
        else:
            with self._lock:
                self._backlog.add(event)
        self._rouse()

    def show(self, state: State) -> None:
        """Tells all clients what the daemon does now; whose events they are is filled in here."""
        with self._lock:
            self._state = replace(state, first_sequence=self._backlog.run_first)
            self.state_line = encode(self._state)
        self._rouse()

    def news(self, sequence: int, *, most: int) -> News:
        """The first `most` lasting events numbered `sequence` or later."""
        with self._lock:
            return self._backlog.news(sequence, most=most)

    def offer(self, frame: Frame) -> None:
        """The newest frame, for whoever watches; a reference to it is kept until the next one comes."""
        self._frame = frame
        if self.watched:
            self._new_frame.set()

    def close(self) -> None:
        """Tells the last words as far as clients take them within a second, and ends. Safe to repeat."""
        if self._closing.is_set():
            return
        self._closing.set()
        self._new_frame.set()
        self._rouse(anyway=True)
        for thread in self._threads:
            thread.join(CLOSE_S)
        self._file.close()

    def _rouse(self, *, anyway: bool = False) -> None:
        """Has the server's thread look what there is to do."""
        if not (self.clients or anyway):
            return
        with self._lock:
            if self._wake is not None:
                os.eventfd_write(self._wake, 1)

    def _serve(self) -> None:
        while not self._closing.is_set():
            for key, mask in self._selector.select(TICK_S):
                if key.fileobj is self._file.listener:
                    self._accept()
                elif key.fileobj == self._wake:
                    os.eventfd_read(self._wake)
                elif mask & selectors.EVENT_READ:
                    self._listen(key.data)
            self._write_all()
        self._end()

    def _accept(self) -> None:
        try:
            connection, _ = self._file.listener.accept()
        except OSError as error:
            # It has gone again, or there are no descriptors left for now.
            log.warning("live socket: a client could not be let in: %s", error.strerror)
            time.sleep(ACCEPT_AGAIN_S)
            return
        connection.settimeout(0.0)
        with self._lock:
            if len(self._connected) >= MOST_CLIENTS:
                connection.close()
                return
            self._numbers += 1
            hello = Hello(
                protocol=PROTOCOL,
                version=self._version,
                epoch=self.epoch,
                next_sequence=self._backlog.next,
                first_sequence=self._backlog.first,
            )
            client = Client(connection, number=self._numbers, hello=encode(hello), now_s=time.monotonic())
            self._connected[client.number] = client
            self.clients = len(self._connected)
        self._selector.register(connection, selectors.EVENT_READ, client)

    def _listen(self, client: Client) -> None:
        try:
            for line in client.listen():
                self._asked(client, line)
        except Gone:
            self._let_go(client)
        except WorkError as error:
            log.warning("live socket: a client is cut off: %s", error)
            self._let_go(client)

    def _asked(self, client: Client, line: bytes) -> None:
        """Does what a line asks. Raises `WorkError` where it is no question."""
        asked = decode(line)
        match asked:
            case Follow():
                with self._lock:
                    client.follow(self._place(asked))
            case WatchPictures():
                with self._lock:
                    client.every_s = None if asked.every_s is None else max(LEAST_EVERY_S, asked.every_s)
                    client.picture_due_s = 0.0
                    self._count_watchers()
                client.answer(Answer(ask=asked.ask, done=True))
                self._new_frame.set()
            case NewRun() | AimCamera() | ShowText() | VehicleSays():
                self.on_order(asked, self._reply(client, asked.ask))
            case None:
                log.warning("live socket: a client asks for something that this version does not know")
            case _:
                raise WorkError(f"{type(asked).__name__} is for us to say")

    def _place(self, asked: Follow) -> int:
        """Number of the first event that a client is told."""
        if asked.since is None:
            return self._backlog.next
        known = asked.epoch == self.epoch and self._backlog.first <= asked.since <= self._backlog.next
        return asked.since if known else 0

    def _reply(self, client: Client, ask: int) -> Reply:
        def reply(reason: str | None) -> None:
            client.answer(Answer(ask=ask, done=reason is None, reason=reason))
            self._rouse()

        return reply

    def _write_all(self) -> None:
        with self._lock:
            clients = list(self._connected.values())
            while self._fresh:
                event = self._fresh.popleft()
                for client in clients:
                    client.tell(event)
        for client in clients:
            self._write(client)

    def _write(self, client: Client) -> None:
        now_s = time.monotonic()
        try:
            waits = client.write(self, now_s)
            if waits and now_s - client.moved_s > self._stall_s:
                raise WorkError(f"it took nothing for {self._stall_s:g} s")
        except Gone:
            self._let_go(client)
            return
        except WorkError as error:
            log.warning("live socket: a client is cut off: %s", error)
            self._let_go(client)
            return
        wanted = selectors.EVENT_READ | (selectors.EVENT_WRITE if waits else 0)
        if self._selector.get_key(client.connection).events != wanted:
            self._selector.modify(client.connection, wanted, client)

    def _let_go(self, client: Client) -> None:
        with self._lock:
            if self._connected.pop(client.number, None) is None:
                return
            self.clients = len(self._connected)
            self._count_watchers()
        self._selector.unregister(client.connection)
        client.connection.close()

    def _count_watchers(self) -> None:
        self.watched = any(client.every_s is not None for client in self._connected.values())

    def _end(self) -> None:
        """Gives what waits to those who take it, for a short time, and closes all."""
        deadline_s = time.monotonic() + CLOSE_S / 2
        self._write_all()
        while time.monotonic() < deadline_s and any(
            key.events & selectors.EVENT_WRITE for key in self._selector.get_map().values()
        ):
            self._selector.select(0.02)
            self._write_all()
        for client in list(self._connected.values()):
            self._let_go(client)
        self._selector.close()
        with self._lock:
            if self._wake is not None:
                os.close(self._wake)
                self._wake = None

    def _watch(self) -> None:
        """The pictures' thread: makes one of the newest frame whenever a client is due another one."""
        shown: Frame | None = None
        made: Picture | None = None
        while not self._closing.is_set():
            due_s = self._next_due_s()
            if due_s is None:
                self._new_frame.wait()
                self._new_frame.clear()
                continue
            early_s = due_s - time.monotonic()
            if early_s > 0.0:
                # No longer: somebody else may want one sooner.
                if self._closing.wait(min(early_s, TICK_S)):
                    return
                continue
            frame = self._frame
            picture = None
            if frame is not None and any(client.pictured is not frame for client in self._due()):
                if frame is not shown:
                    shown, made = frame, picture_of(frame)
                picture = made
            if frame is None or picture is None:
                self._new_frame.wait(TICK_S)
                self._new_frame.clear()
                continue
            self._hand_out(frame, encode(picture))

    def _due(self) -> list[Client]:
        """The clients that are due a picture."""
        now_s = time.monotonic()
        with self._lock:
            return [
                client
                for client in self._connected.values()
                if client.every_s is not None and client.picture_due_s <= now_s
            ]

    def _next_due_s(self) -> float | None:
        """When the first client is due a picture, by time.monotonic; None where nobody wants one."""
        with self._lock:
            return min(
                (client.picture_due_s for client in self._connected.values() if client.every_s is not None),
                default=None,
            )

    def _hand_out(self, frame: Frame, picture: bytes) -> None:
        now_s = time.monotonic()
        for client in self._due():
            every_s = client.every_s
            # Gone, or asked for no more, meanwhile.
            if every_s is not None and client.pictured is not frame:
                client.picture, client.pictured = picture, frame
                client.picture_due_s = max(client.picture_due_s + every_s, now_s + every_s / 2)
        self._rouse()
