"""A client of Foxglove's WebSocket protocol, and our server for it in a thread of its own."""

from __future__ import annotations

import asyncio
import base64
import json
import struct
import threading
from contextlib import ExitStack
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

from websockets.sync.client import ClientConnection, connect

from dnb_edge.web.foxglove_server import FoxgloveServer, FoxgloveSettings

PATIENCE_S = 60.0
_MESSAGE = struct.Struct("<BIQ")


class Served:
    """A `FoxgloveServer` that runs until the `with` statement's end."""

    def __init__(self, settings: FoxgloveSettings) -> None:
        self.server = FoxgloveServer(settings)
        self._started = threading.Event()
        self._thread = threading.Thread(target=asyncio.run, args=(self._run(),))

    def __enter__(self) -> Self:
        self._thread.start()
        assert self._started.wait(PATIENCE_S)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._loop.call_soon_threadsafe(self._task.cancel)
        self._thread.join(PATIENCE_S)
        assert not self._thread.is_alive()

    async def _run(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._task = asyncio.ensure_future(self.server.run())
        self._started.set()
        await asyncio.wait([self._task])


@dataclass(frozen=True)
class Channel:
    """What a channel is, wherever it is told of."""

    topic: str
    encoding: str
    schema_name: str
    schema_encoding: str
    schema: bytes


class Peer:
    """Connected to the server at `address`, and told of its channels."""

    def __init__(self, address: str) -> None:
        self._open = ExitStack()
        socket = connect(address, subprotocols=["foxglove.sdk.v1"], max_size=None)  # type: ignore[list-item]
        self._socket: ClientConnection = self._open.enter_context(socket)
        self.info = json.loads(self._socket.recv(PATIENCE_S))
        assert self.info["op"] == "serverInfo"
        self._ids: dict[str, int] = {}
        self._topics: dict[int, str] = {}
        self.channels: dict[str, Channel] = {}
        advertised = json.loads(self._socket.recv(PATIENCE_S))
        assert advertised["op"] == "advertise"
        for one in advertised["channels"]:
            self._ids[one["topic"]] = one["id"]
            text = one.get("schema", "")
            binary = one.get("schemaEncoding") == "protobuf"
            self.channels[one["topic"]] = Channel(
                topic=one["topic"],
                encoding=one["encoding"],
                schema_name=one["schemaName"],
                schema_encoding=one.get("schemaEncoding", ""),
                schema=base64.b64decode(text) if binary else text.encode(),
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._open.close()

    def subscribe(self, *topics: str) -> None:
        """Asks for what is told on `topics`."""
        wanted = []
        for topic in topics:
            number = len(self._topics) + 1
            self._topics[number] = topic
            wanted.append({"id": number, "channelId": self._ids[topic]})
        self._socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))

    def say(self, message: Any) -> None:
        """Sends anything else."""
        self._socket.send(message if isinstance(message, bytes) else json.dumps(message))

    def next(self, *topics: str) -> tuple[str, int, bytes]:
        """(topic, log time, data) of the next message on one of `topics`, all for none; others are passed over."""
        while True:
            said = self._socket.recv(PATIENCE_S)
            if isinstance(said, str):
                continue
            opcode, number, t_ns = _MESSAGE.unpack_from(said)
            topic = self._topics[number]
            if opcode == 1 and (not topics or topic in topics):
                return topic, t_ns, said[_MESSAGE.size :]

    def next_text(self) -> dict[str, Any]:
        """The next message that is no data."""
        while True:
            said = self._socket.recv(PATIENCE_S)
            if isinstance(said, str):
                return dict(json.loads(said))
