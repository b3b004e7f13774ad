"""The line to the daemon: a client of its Unix socket that comes back by itself, and keeps what browsers ask for again.

Knows the live messages; knows no browser. Implements `box.Daemon`.
"""

from __future__ import annotations

import asyncio
import logging
import time
import weakref
from collections.abc import AsyncIterator
from itertools import count
from pathlib import Path
from typing import Any

from dnb_edge.errors import WorkError
from dnb_edge.live.messages import (
    MOST_LINE_BYTES,
    PROTOCOL,
    AimCamera,
    Answer,
    Follow,
    Hello,
    Message,
    NewRun,
    Picture,
    ShowText,
    State,
    ToDaemon,
    Told,
    WatchPictures,
    blob_bytes,
    decode,
    encode,
)
from dnb_edge.web.endpoint import Refused
from dnb_edge.web.kept import Kept, is_fleeting
from dnb_edge.web.waiting import Waiting

_log = logging.getLogger(__name__)

WAITS_S = (0.2, 0.5, 1.0, 2.0)
"""Before each try after the line broke; the last one again and again."""
HELLO_S = 5.0
ANSWER_S = 20.0
"""Finishing a recording may take a while."""
PICTURE_EVERY_S = 0.1
WATCHED_S = 10.0
"""So long after the last wish for a picture none are asked for any more."""
STALE_S = 3.0
"""An older picture does not show what there is now."""
MOST_WAITING = 10_000


class DaemonLine:
    """The daemon, as the web sees it. `run` keeps the line; all else may be called at any time in its event loop."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._kept = Kept()
        self._state: State | None = None
        self._epoch: str | None = None
        self._writer: asyncio.StreamWriter | None = None
        self._greeted = False
        self._followers: weakref.WeakSet[Waiting[Told | State | None]] = weakref.WeakSet()
        self._asks = count(1)
        self._answers: dict[int, asyncio.Future[Answer]] = {}
        self._picture: tuple[Picture, float] | None = None
        self._pictured = asyncio.Event()
        self._wanted_until_s: float | None = None
        """Until when pictures are wanted; None where they are not asked for."""

    @property
    def state(self) -> State | None:
        """What the daemon says of itself; None while it is down."""
        return self._state

    @property
    def epoch(self) -> str | None:
        """The daemon's process; None before the first."""
        return self._epoch

    @property
    def first(self) -> int:
        """From this number on no event is missing of those that last."""
        return self._kept.first

    def events(self, since: int | None = None) -> tuple[Told, ...]:
        """The kept events from number `since` on, oldest first; all kept ones for None."""
        return self._kept.since(since)

    def follow(self) -> AsyncIterator[Told | State | None]:
        """Whatever comes from this call on; None when the daemon has gone."""
        waiting: Waiting[Told | State | None] = Waiting(MOST_WAITING)
        self._followers.add(waiting)

        async def items() -> AsyncIterator[Told | State | None]:
            while True:
                yield await waiting.get()

        return items()

    async def picture(self, *, newer_than_ns: int | None = None, timeout_s: float = 5.0) -> Picture:
        """A camera picture, another one than that of `newer_than_ns`. Raises `Refused` (503) where there is none."""
        try:
            async with asyncio.timeout(timeout_s):
                while True:
                    self._want_pictures()
                    if self._picture is not None:
                        picture, came_s = self._picture
                        if picture.t_ns != newer_than_ns and time.monotonic() - came_s < STALE_S:
                            return picture
                    await self._pictured.wait()
        except TimeoutError as error:
            raise Refused(
                503, "no-picture", "No picture comes from the camera: is it plugged in?", retry_after_s=1.0
            ) from error

    async def ask(self, **what: Any) -> None:
        """Has the daemon do something, as `box.Daemon` says. Raises `Refused`."""
        number = next(self._asks)
        answer: asyncio.Future[Answer] = asyncio.get_running_loop().create_future()
        self._answers[number] = answer
        try:
            self._send(_order(number, what))
            async with asyncio.timeout(ANSWER_S):
                told = await answer
        except TimeoutError as error:
            raise Refused(504, "no-answer", "The timing service does not answer: try again.") from error
        finally:
            self._answers.pop(number, None)
        if not told.done:
            raise Refused(409, "not-now", told.reason or "The timing service will not do this now.")

    async def run(self) -> None:
        """Keeps the line, until it is cancelled."""
        tries = 0
        while True:
            self._greeted = False
            reason = await self._once()
            tries = 0 if self._greeted else tries + 1
            if tries <= 1:
                _log.warning("%s: no line to the timing service: %s", self._path, reason)
            await asyncio.sleep(WAITS_S[min(tries, len(WAITS_S) - 1)])

    async def _once(self) -> str:
        """One connection from its beginning to its end, and why it ended."""
        try:
            reader, self._writer = await asyncio.open_unix_connection(self._path, limit=MOST_LINE_BYTES)
            async with asyncio.timeout(HELLO_S):
                hello = await _read(reader)
            self._greet(hello)
            while True:
                self._take(await _read(reader))
        except (OSError, WorkError, EOFError, asyncio.LimitOverrunError, Refused) as error:
            if isinstance(error, EOFError):
                return "it has hung up"
            return getattr(error, "strerror", None) or str(error) or type(error).__name__
        finally:
            self._lost()

    def _greet(self, hello: Message | None) -> None:
        if not isinstance(hello, Hello):
            raise WorkError("it does not begin with a hello")
        if hello.protocol > PROTOCOL:
            raise WorkError("the timing service is newer than these pages: install both from the same version")
        self._greeted = True
        if hello.epoch != self._epoch:
            self._epoch = hello.epoch
            self._kept = Kept()
            for follower in self._followers:
                # What still waits is of the process before.
                follower.clear()
        self._kept.begin(hello.first_sequence)
        self._send(Follow(ask=next(self._asks), since=self._kept.next or 0, epoch=hello.epoch))
        if self._wanted_until_s is not None:
            self._wanted_until_s = None
            self._want_pictures()

    def _take(self, message: Message | None) -> None:
        match message:
            case State():
                self._state = message
                self._kept.forget_before(message.first_sequence)
                self._tell(message)
            case Told():
                if self._kept.add(message):
                    self._tell(message)
            case Picture():
                self._picture = (message, time.monotonic())
                self._pictured.set()
                self._pictured = asyncio.Event()
                if self._wanted_until_s is not None and time.monotonic() > self._wanted_until_s:
                    self._wanted_until_s = None
                    self._send(WatchPictures(ask=next(self._asks), every_s=None))
            case Answer():
                answer = self._answers.pop(message.ask, None)
                if answer is not None and not answer.done():
                    answer.set_result(message)
            case _:
                pass

    def _tell(self, item: Told | State | None) -> None:
        for follower in self._followers:
            follower.put(item, fleeting=isinstance(item, Told) and is_fleeting(item))

    def _lost(self) -> None:
        if self._writer is not None:
            self._writer.close()
            self._writer = None
        for answer in self._answers.values():
            if not answer.done():
                answer.set_exception(_down())
        if self._state is not None:
            self._state = None
            self._tell(None)

    def _send(self, message: ToDaemon) -> None:
        if self._writer is None or self._writer.is_closing():
            raise _down()
        self._writer.write(encode(message))

    def _want_pictures(self) -> None:
        if self._writer is None:
            raise _down()
        if self._wanted_until_s is None:
            self._send(WatchPictures(ask=next(self._asks), every_s=PICTURE_EVERY_S))
        self._wanted_until_s = time.monotonic() + WATCHED_S


async def _read(reader: asyncio.StreamReader) -> Message | None:
    """The next message; None for one of a kind that we do not know. Raises `EOFError` at the end."""
    line = await reader.readuntil(b"\n")
    size = blob_bytes(line)
    return decode(line, await reader.readexactly(size) if size else b"")


def _order(number: int, what: dict[str, Any]) -> ToDaemon:
    match what:
        case {"new_run": True}:
            return NewRun(ask=number, entry=what.get("entry"))
        case {"aim": bool(aim)}:
            return AimCamera(ask=number, aim=aim, camera=what.get("camera"))
        case {"show": str(text), "for_s": float(for_s)}:
            return ShowText(ask=number, text=text, for_s=for_s)
    raise ValueError(f"the daemon cannot be asked for {what}")


def _down() -> Refused:
    return Refused(
        503,
        "daemon-down",
        "The timing service is not running: this page goes on by itself as soon as it is.",
        retry_after_s=2.0,
    )
