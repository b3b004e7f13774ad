"""The server under the application: its limits on connections and on slow clients, and its beginning and end.

Knows sockets, uvicorn and the service manager; knows no page.
"""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import logging
import signal
import socket
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from dnb_edge.display.service import ServiceNotifier
from dnb_edge.errors import InputError
from dnb_edge.web.guard_rates import counted_as
from dnb_edge.web.signpost import own_address

HEAD_S = 10.0
"""Time for a request's line and headers to come."""
IDLE_S = 15
"""A connection on which nothing is asked for so long is closed."""
STALL_S = 30.0
"""A client that takes nothing of its answer for so long is cut off."""
MOST_HEAD_BYTES = 16 * 1024
MOST_CONNECTIONS = 800
"""A browser has up to seven: six that it keeps for a while, and its live stream."""
MOST_BUSY = 750
"""With so many a request is answered with 503."""
MOST_PER_ADDRESS = 64
"""Connections of one address; the machine's own are not counted: a proxy's are all from there."""
MOST_SAID_BYTES = 1024
"""What a browser may say on the live stream, where it has nothing to say."""
PING_S = 15.0
ALL = "::"
"""The host that means all addresses of the machine, of both kinds."""
STOP_S = 1
"""Time for answers to be finished when the server ends."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Patience:
    """How long clients are waited for, seconds."""

    head_s: float = HEAD_S
    stall_s: float = STALL_S


class Server(uvicorn.Server):
    """uvicorn's server, which ends cleanly at SIGTERM and SIGINT and feeds the service manager's watchdog."""

    def __init__(
        self, app: ASGIApp, *, patience: Patience | None = None, notifier: ServiceNotifier | None = None
    ) -> None:
        self._notifier = notifier
        super().__init__(
            uvicorn.Config(
                app,
                http=_protocol(Patience() if patience is None else patience),
                ws=_Socket,
                loop="asyncio",
                lifespan="on",
                log_config=None,
                access_log=False,
                server_header=False,
                timeout_keep_alive=IDLE_S,
                timeout_graceful_shutdown=STOP_S,
                limit_concurrency=MOST_BUSY,
                backlog=128,
                h11_max_incomplete_event_size=MOST_HEAD_BYTES,
                ws_max_size=MOST_SAID_BYTES,
                ws_ping_interval=PING_S,
                ws_ping_timeout=PING_S,
                ws_per_message_deflate=False,
                forwarded_allow_ips=["127.0.0.1", "::1"],
                timeout_notify=1,
                callback_notify=self._feed,
            )
        )

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """As uvicorn's; the service manager hears of it."""
        await super().startup(sockets)
        if self._notifier is not None and self.started:
            self._notifier.ready()

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """SIGTERM and SIGINT end the server, and are not raised again when it has ended."""
        loop = asyncio.get_running_loop()
        try:
            for one in (signal.SIGTERM, signal.SIGINT):
                loop.add_signal_handler(one, self._stop)
        except (RuntimeError, ValueError):
            # Only the main thread hears signals.
            yield
            return
        yield

    def _stop(self) -> None:
        if self._notifier is not None:
            self._notifier.stopping()
        self.should_exit = True

    async def _feed(self) -> None:
        if self._notifier is not None:
            self._notifier.feed(progressed=True)


def listeners(host: str, port: int) -> list[socket.socket]:
    """Sockets that listen at `host` and `port`: for `::` one for IPv6, as far as the machine has that, and one for IPv4.

    Raises `InputError` where that cannot be.
    """
    if host != ALL:
        return [listener(host, port)]
    # Not one socket for both: IPv4 clients would have other addresses there than they have.
    first = listener("0.0.0.0", port)  # noqa: S104 whoever says :: means all
    if not _has_ipv6():
        return [first]
    try:
        return [first, listener(ALL, first.getsockname()[1])]
    except InputError:
        first.close()
        raise


def listener(host: str, port: int) -> socket.socket:
    """A socket that listens at `host` and `port`, an IPv6 one for IPv6 alone. Raises `InputError` where that cannot be."""
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        made = socket.socket(family, socket.SOCK_STREAM)
    except OSError as error:
        raise InputError(f"--host {host}: {error.strerror or error}: give an address of this machine") from error
    try:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if family == socket.AF_INET6:
            made.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        made.bind(address)
    except OSError as error:
        made.close()
        raise InputError(
            f"--port {port}: {error.strerror}: is another server there? Give another port or host"
        ) from error
    return made


def addresses(host: str, port: int) -> tuple[str, ...]:
    """What to type into a browser, the best first."""
    tail = "" if port == 80 else f":{port}"
    try:
        bound = ipaddress.ip_address(host)
    except ValueError:
        return (f"http://{host}{tail}/",)
    if not bound.is_unspecified:
        return (f"http://[{host}]{tail}/" if bound.version == 6 else f"http://{host}{tail}/",)
    own = own_address()
    names = [f"{socket.gethostname().partition('.')[0].lower()}.local", *([] if own is None else [own]), "localhost"]
    return tuple(f"http://{name}{tail}/" for name in names)


def serve(app: ASGIApp, listening: list[socket.socket]) -> None:
    """Serves `app` until SIGTERM or SIGINT. Raises `InputError` as `ServiceNotifier` does."""
    # What malformed requests are is their senders' business; what fails inside is logged as an error.
    logging.getLogger("uvicorn.error").setLevel(logging.ERROR)
    Server(app, notifier=ServiceNotifier()).run(sockets=listening)


def _has_ipv6() -> bool:
    try:
        with socket.socket(socket.AF_INET6, socket.SOCK_STREAM) as probe:
            probe.bind((ALL, 0))
    except OSError:
        return False
    return True


class _Timer:
    """Cuts a connection off when its time is up."""

    def __init__(self, after_s: float) -> None:
        self._after_s = after_s
        self._handle: asyncio.TimerHandle | None = None

    def start(self, transport: asyncio.Transport) -> None:
        """Begins the time, unless it runs."""
        if self._handle is None:
            self._handle = asyncio.get_running_loop().call_later(self._after_s, transport.abort)

    def stop(self) -> None:
        """There is time again."""
        if self._handle is not None:
            self._handle.cancel()
            self._handle = None


def _protocol(patience: Patience) -> type[asyncio.Protocol]:
    """uvicorn's HTTP protocol with our patience."""

    class Patient(H11Protocol):
        """Times the head of each request and each stall of an answer; counts connections."""

        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            """A client has come."""
            self._head, self._stall = _Timer(patience.head_s), _Timer(patience.stall_s)
            super().connection_made(transport)
            if not _has_room(self):
                transport.abort()
                return
            self._head.start(transport)

        def data_received(self, data: bytes) -> None:
            """Bytes have come: of a head, a body, or of a body that nobody wants any more."""
            before = self.cycle
            super().data_received(data)
            if self.cycle is not before or self.transport.get_protocol() is not self:
                self._head.stop()
            elif self.cycle is None or self.cycle.response_complete:
                self._head.start(self.transport)

        def pause_writing(self) -> None:
            """The client takes nothing just now."""
            super().pause_writing()
            self._stall.start(self.transport)

        def resume_writing(self) -> None:
            """It does again."""
            super().resume_writing()
            self._stall.stop()

        def connection_lost(self, exc: Exception | None) -> None:
            """The client has gone."""
            self._head.stop()
            self._stall.stop()
            super().connection_lost(exc)

    return Patient


class _Socket(WebSocketsSansIOProtocol):
    """uvicorn's WebSocket protocol; a browser that takes nothing is cut off."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """A client has come."""
        self._stall = _Timer(STALL_S)
        super().connection_made(transport)

    def pause_writing(self) -> None:
        """The client takes nothing just now."""
        super().pause_writing()
        self._stall.start(self.transport)

    def resume_writing(self) -> None:
        """It does again."""
        super().resume_writing()
        self._stall.stop()

    def connection_lost(self, exc: Exception | None) -> None:
        """The client has gone."""
        self._stall.stop()
        super().connection_lost(exc)


def _has_room(new: H11Protocol) -> bool:
    """Whether one more connection is served: neither all together nor one address take too many."""
    if len(new.connections) > MOST_CONNECTIONS:
        return False
    if new.client is None or ipaddress.ip_address(new.client[0].partition("%")[0]).is_loopback:
        return True
    address = _counted(new.client[0])
    clients = (getattr(one, "client", None) for one in new.connections)
    return len([one for one in clients if one is not None and _counted(one[0]) == address]) <= MOST_PER_ADDRESS


@lru_cache(maxsize=2 * MOST_CONNECTIONS)
def _counted(address: str) -> str:
    """As `counted_as`; each new connection is compared with all others."""
    return counted_as((address, 0))
