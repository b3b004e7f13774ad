"""The WebSocket server that Foxglove connects to: the daemon's race, live, to look at and nothing else.

Knows the line to the daemon and foxglove's server; what is shown `foxglove_channels` knows. Nobody can change anything through
it. It asks nobody for a code, so it listens to this machine alone unless somebody says otherwise.
"""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import foxglove
from foxglove.websocket import ChannelView, Client, ServerListener, WebSocketServer

from dnb_edge import __version__
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.errors import InputError
from dnb_edge.live.messages import Told
from dnb_edge.web.daemon_line import DaemonLine
from dnb_edge.web.endpoint import Refused
from dnb_edge.web.foxglove_channels import LiveChannels
from dnb_edge.web.waiting import TooSlow

BACKLOG_MESSAGES = 256
"""What waits for a slow client at most; it loses the oldest."""
LOOK_S = 0.25
"""How often it is looked whether somebody wants pictures."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FoxgloveSettings:
    """Where it listens, and to whom."""

    socket: Path
    """The daemon's live socket."""
    host: str = "127.0.0.1"
    port: int = 8765
    pictures_per_s: float = 5.0
    """At most; none are fetched while nobody looks."""


class FoxgloveServer:
    """One server, for as long as `run` does."""

    def __init__(self, settings: FoxgloveSettings) -> None:
        """Listens at once. Raises `InputError` where that cannot be."""
        self._settings = settings
        self._line = DaemonLine(settings.socket)
        self._context = foxglove.Context()
        self._channels = LiveChannels(self._context, on_new_run=self._forget)
        self._listener = _Listener()
        try:
            self._server: WebSocketServer = foxglove.start_server(
                name=f"dnb-edge {__version__}",
                host=settings.host,
                port=settings.port,
                server_listener=self._listener,
                context=self._context,
                message_backlog_size=BACKLOG_MESSAGES,
            )
        except RuntimeError as error:
            reason = str(error).removeprefix("FoxgloveError: ").partition(" (os error")[0]
            raise InputError(
                f"--host {settings.host} --port {settings.port}: {reason}: is another server there? Give others"
            ) from error

    @property
    def address(self) -> str:
        """What to type into Foxglove's dialog Open connection."""
        host = f"[{self._settings.host}]" if ":" in self._settings.host else self._settings.host
        return f"ws://{host}:{self._server.port}"

    async def run(self) -> None:
        """Passes on what the daemon says, until it is cancelled; the server has stopped then."""
        loop = asyncio.get_running_loop()
        self._listener.on_topic = lambda topic: loop.call_soon_threadsafe(self._again, topic)
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self._events())
                tasks.create_task(self._pictures())
                tasks.create_task(self._line.run())
        finally:
            self._listener.on_topic = None
            await asyncio.to_thread(self._server.stop)

    def _forget(self) -> None:
        """Clients forget the laps and trails of the run before."""
        self._server.clear_session()

    def _again(self, topic: str) -> None:
        self._channels.again(topic, self._line.events())

    async def _events(self) -> None:
        while True:
            try:
                async for item in self._line.follow():
                    if isinstance(item, Told):
                        self._channels.told(item)
                    else:
                        self._channels.state(item)
            except TooSlow:
                # What comes from now on is still worth showing.
                continue

    async def _pictures(self) -> None:
        last_t_ns: int | None = None
        while True:
            if not self._channels.wants_pictures:
                await asyncio.sleep(LOOK_S)
                continue
            try:
                picture = await self._line.picture(newer_than_ns=last_t_ns)
            except Refused as refused:
                await asyncio.sleep(refused.retry_after_s or LOOK_S)
                continue
            last_t_ns = picture.t_ns
            self._channels.picture(picture)
            await asyncio.sleep(1.0 / self._settings.pictures_per_s)


async def serve(settings: FoxgloveSettings, *, ready: Callable[[str], None]) -> None:
    """Serves until SIGTERM or SIGINT; `ready` is given the address. Raises `InputError` where it cannot listen."""
    notifier = ServiceNotifier()
    server = FoxgloveServer(settings)
    ready(server.address)
    loop = asyncio.get_running_loop()
    task = asyncio.ensure_future(server.run())
    for one in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(one, task.cancel)
    notifier.ready()
    feeding = asyncio.ensure_future(_feed(notifier))
    try:
        await task
    except asyncio.CancelledError:
        notifier.stopping()
    finally:
        feeding.cancel()


async def _feed(notifier: ServiceNotifier) -> None:
    while True:
        notifier.feed(progressed=True)
        await asyncio.sleep(1.0)


class _Listener(ServerListener):
    """Tells which topic somebody begins to look at. Called by the server's threads."""

    def __init__(self) -> None:
        self.on_topic: Callable[[str], object] | None = None

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:  # noqa: ARG002 the SDK calls it so
        """Somebody looks at `channel`."""
        tell = self.on_topic
        if tell is not None:
            tell(channel.topic)
