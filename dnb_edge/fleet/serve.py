"""The hub's HTTP server, in a thread beside the line to the broker.

Knows uvicorn and sockets; knows no page.
"""

from __future__ import annotations

import logging
import socket
import threading
from types import TracebackType
from typing import Self

import uvicorn
from starlette.types import ASGIApp

from dnb_edge.errors import InputError

MOST_BUSY = 200
IDLE_S = 15
STOP_S = 3.0


class PageServer:
    """Serves `app` at `host` and `port` from `with` on."""

    def __init__(self, app: ASGIApp, *, host: str, port: int) -> None:
        """Listens at once. Raises `InputError` where that cannot be."""
        self._socket = _listen(host, port)
        logging.getLogger("uvicorn.error").setLevel(logging.ERROR)
        self._server = uvicorn.Server(
            uvicorn.Config(
                app,
                loop="asyncio",
                http="h11",
                ws="none",
                lifespan="off",
                log_config=None,
                access_log=False,
                server_header=False,
                timeout_keep_alive=IDLE_S,
                timeout_graceful_shutdown=1,
                limit_concurrency=MOST_BUSY,
                h11_max_incomplete_event_size=16 * 1024,
                proxy_headers=False,
            )
        )
        # Signals are the main thread's, which speaks with the broker.
        self._thread = threading.Thread(
            target=self._server.run, kwargs={"sockets": [self._socket]}, name="fleet-pages", daemon=True
        )

    @property
    def address(self) -> str:
        """What to type into a browser."""
        host, port = self._socket.getsockname()[:2]
        if host in {"0.0.0.0", "::"}:  # noqa: S104 asked, not bound
            host = socket.gethostname()
        return f"http://[{host}]:{port}/" if ":" in host else f"http://{host}:{port}/"

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._server.should_exit = True
        self._thread.join(STOP_S)
        self._socket.close()


def _listen(host: str, port: int) -> socket.socket:
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        made = socket.socket(family, socket.SOCK_STREAM)
    except OSError as error:
        raise InputError(f"--host {host}: {error.strerror or error}: give an address of this machine") from error
    try:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind(address)
        made.listen(128)
    except OSError as error:
        made.close()
        raise InputError(
            f"--port {port}: {error.strerror}: is another server there? Give another port or host"
        ) from error
    return made
