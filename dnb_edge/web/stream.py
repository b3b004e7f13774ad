"""The live stream to browsers: one copy of each message for all of them, a bounded queue for each, and a fresh start or a
resumption at its beginning.

Knows the daemon's line and WebSockets; knows nothing of a race.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Coroutine
from typing import Any

from starlette.responses import JSONResponse
from starlette.websockets import WebSocket, WebSocketDisconnect

from dnb_edge import wire
from dnb_edge.live.messages import State, Told
from dnb_edge.web.box import Daemon
from dnb_edge.web.kept import is_fleeting
from dnb_edge.web.waiting import TooSlow, Waiting

MOST_WAITING = 256
"""Messages that wait for a browser; of two cars ten seconds' or more."""
SEND_S = 20.0
"""A browser that takes nothing for so long is gone."""
BEAT_S = 8.0
"""So often every browser hears something."""
TRY_LATER = 1013
UNWANTED = 1003

Texts = tuple[str, ...]
_BEAT = json.dumps({"kind": "beat"})


class Viewer:
    """One browser: what waits for it, and the number of the first event that it has not been given yet."""

    def __init__(self) -> None:
        self.waiting: Waiting[Texts] = Waiting(MOST_WAITING)
        self.next = 0


class Live:
    """Fans the daemon's line out. `run` does it; `serve` is the WebSocket's endpoint."""

    def __init__(self, daemon: Daemon, most_viewers: int) -> None:
        self._daemon = daemon
        self._most = most_viewers
        self._viewers: set[Viewer] = set()
        self._epoch: str | None = None
        self._texts: dict[int, str] = {}
        """What kept events are to browsers, by number: many come at once when the line was broken."""
        self._texts_epoch: str | None = None

    @property
    def viewers(self) -> int:
        """How many browsers watch."""
        return len(self._viewers)

    async def run(self) -> None:
        """Hands on whatever comes, until it is cancelled."""
        following = self._daemon.follow()
        self._epoch = self._daemon.epoch
        for viewer in self._viewers:
            # It has been begun again: nobody knows what they have missed.
            self._open(viewer, None, None)
        async with asyncio.TaskGroup() as group:
            group.create_task(self._beat())
            async for item in following:
                self._hand_on(item)

    async def serve(self, socket: WebSocket) -> None:
        """One browser, from its hello to its end."""
        if len(self._viewers) >= self._most:
            text = f"{self._most} browsers watch already: close one of them."
            await socket.send_denial_response(JSONResponse({"error": {"code": "too-many-viewers", "text": text}}, 503))
            return
        viewer = Viewer()
        self._viewers.add(viewer)
        try:
            await socket.accept()
            self._open(viewer, _number(socket.query_params.get("since")), socket.query_params.get("epoch"))
            code = await _first(_listen(socket), _send(socket, viewer))
        finally:
            self._viewers.discard(viewer)
        if code is not None:
            with contextlib.suppress(RuntimeError, WebSocketDisconnect, OSError):
                await socket.close(code)

    def _open(self, viewer: Viewer, since: int | None, epoch: str | None) -> None:
        """The beginning: hello, state, and the kept events that this browser lacks."""
        daemon, state = self._daemon, self._daemon.state
        first = max(daemon.first, 0 if state is None else state.first_sequence)
        known = daemon.events()
        upto = known[-1].sequence + 1 if known else first
        resumed = epoch is not None and epoch == daemon.epoch and since is not None and first <= since
        viewer.waiting.clear()
        # Of the events that a browser has seen some may come here only now, when the pages have just begun.
        viewer.next = max(upto, since) if resumed and since is not None else upto
        hello = {"kind": "hello", "epoch": daemon.epoch, "next": upto, "resumed": resumed}
        texts = self._known_texts(known)
        lacking = daemon.events(since) if resumed else known
        viewer.waiting.put((json.dumps(hello), _state_text(state), *(texts[told.sequence] for told in lacking)))

    def _known_texts(self, known: tuple[Told, ...]) -> dict[int, str]:
        """The text of each of them by its number: the same one for all browsers."""
        before = self._texts if self._texts_epoch == self._daemon.epoch else {}
        self._texts = {told.sequence: before.get(told.sequence) or _event_text(told) for told in known}
        self._texts_epoch = self._daemon.epoch
        return self._texts

    def _hand_on(self, item: Told | State | None) -> None:
        if self._daemon.epoch != self._epoch:
            self._epoch = self._daemon.epoch
            for viewer in self._viewers:
                self._open(viewer, None, None)
        state = self._daemon.state
        if not isinstance(item, Told):
            # What it says now: a state that somebody was told at the beginning is not followed by an older one.
            self._give_all(_state_text(state))
        elif state is None or item.sequence >= state.first_sequence:
            text = (_event_text(item),)
            fleeting = is_fleeting(item)
            for viewer in self._viewers:
                if item.sequence >= viewer.next:
                    viewer.next = item.sequence + 1
                    viewer.waiting.put(text, fleeting=fleeting)

    def _give_all(self, text: str) -> None:
        for viewer in self._viewers:
            viewer.waiting.put((text,))

    async def _beat(self) -> None:
        while True:
            await asyncio.sleep(BEAT_S)
            self._give_all(_BEAT)


async def _listen(socket: WebSocket) -> int | None:
    """Waits for the browser's end; it has nothing to say before."""
    message = await socket.receive()
    return None if message["type"] == "websocket.disconnect" else UNWANTED


async def _send(socket: WebSocket, viewer: Viewer) -> int | None:
    """Sends what waits, as long as the browser takes it."""
    try:
        while True:
            for text in await viewer.waiting.get():
                async with asyncio.timeout(SEND_S):
                    await socket.send_text(text)
                # Thousands may come at once, and sending alone lets nobody else run.
                await asyncio.sleep(0)
    except (TooSlow, TimeoutError):
        return TRY_LATER
    except (WebSocketDisconnect, OSError, RuntimeError):
        return None


async def _first(*work: Coroutine[Any, Any, int | None]) -> int | None:
    """The result of whichever ends first; the others are cancelled."""
    tasks = [asyncio.ensure_future(one) for one in work]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        return next(iter(done)).result()
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


def _number(text: str | None) -> int | None:
    """The query's number; None where it is none."""
    return int(text) if text is not None and text.isascii() and text.isdecimal() and len(text) < 16 else None


def _state_text(state: State | None) -> str:
    return json.dumps({"kind": "state", "state": None if state is None else wire.to_dict(state)})


def _event_text(told: Told) -> str:
    return json.dumps({"kind": "event", "sequence": told.sequence, "event": told.event})
