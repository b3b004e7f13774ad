"""Sending large things without hurting the race: few at once, together no faster than they may, ended where a client stops
taking.

Knows ASGI; knows nothing of what is sent.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Generator, Iterator, Mapping

import anyio
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from dnb_edge.web.endpoint import Refused

STALL_S = 60.0
"""A client that takes nothing for so long is given up, since others wait for its place."""
_AHEAD_S = 0.25
"""So much may be sent at once before anybody has to wait."""

_log = logging.getLogger(__name__)


class Lanes:
    """The places there are, and the pace of all of them together."""

    def __init__(self, most: int, bytes_per_s: float) -> None:
        self._most = most
        self._bytes_per_s = bytes_per_s
        self._due_s = 0.0
        self.taken = 0
        """Downloads that are on."""

    def enter(self) -> None:
        """Takes a place. Raises `Refused` (503) where there is none."""
        if self.taken >= self._most:
            text = f"{self._most} downloads are on already: try again when one has ended."
            raise Refused(503, "busy", text, retry_after_s=15.0)
        self.taken += 1

    def leave(self) -> None:
        """Gives it back."""
        self.taken -= 1

    async def wait(self, size_bytes: int) -> None:
        """Until so many bytes more may be sent."""
        now_s = time.monotonic()
        self._due_s = max(self._due_s, now_s - _AHEAD_S) + size_bytes / self._bytes_per_s
        if self._due_s > now_s:
            await asyncio.sleep(self._due_s - now_s)


class Sending(Response):
    """An answer of many pieces. Has a place in `lanes` from its making, and gives it back when it was sent or given up."""

    def __init__(self, content: Iterator[bytes], *, lanes: Lanes, status_code: int, headers: Mapping[str, str]) -> None:
        """`content` is read in other threads, piece by piece. Raises `Refused` (503) where too many are on already."""
        super().__init__(status_code=status_code, headers={"Content-Length": "0", **headers})
        if "Content-Length" not in headers:
            del self.headers["Content-Length"]
        lanes.enter()
        self._content = content
        self._lanes = lanes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Sends it; ends early, which the client sees, where it goes away or the disk fails."""
        try:
            async with anyio.create_task_group() as group:
                group.start_soon(_until_gone, receive, group.cancel_scope)
                await self._send(scope, send)
                group.cancel_scope.cancel()
        finally:
            self._lanes.leave()
            if isinstance(self._content, Generator):
                self._content.close()

    async def _send(self, scope: Scope, send: Send) -> None:
        try:
            await send({"type": "http.response.start", "status": self.status_code, "headers": self.raw_headers})
            while (piece := await run_in_threadpool(next, self._content, None)) is not None:
                await self._lanes.wait(len(piece))
                with anyio.fail_after(STALL_S):
                    await send({"type": "http.response.body", "body": piece, "more_body": True})
            await send({"type": "http.response.body", "body": b"", "more_body": False})
        except (OSError, TimeoutError) as error:
            # Nothing more can be said to the client: the end that does not come tells it.
            _log.warning("download of %s ended early: %s", scope["path"], error or "the client takes nothing more")


async def _until_gone(receive: Receive, sending: anyio.CancelScope) -> None:
    while (await receive())["type"] != "http.disconnect":
        pass
    sending.cancel()
