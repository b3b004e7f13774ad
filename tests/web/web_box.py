"""The real application for tests: on folders of the test's own, with a browser that may have logged in."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import re
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.testclient import TestClient

from dnb_edge.web.app import make_app
from dnb_edge.web.box import WebSettings
from dnb_edge.web.server import Patience, Server, listener

HOST = "http://localhost"


def settings_in(folder: Path, **changes: Any) -> WebSettings:
    """Settings whose folders are there and empty, and whose daemon is down unless a test serves its socket."""
    for name in ("runs", "setup"):
        (folder / name).mkdir(exist_ok=True)
    places: dict[str, Any] = {"socket": folder / "live.sock", "runs": folder / "runs", "setup": folder / "setup"}
    return WebSettings(**(places | {"cache": folder} | changes))


def app_in(folder: Path, **changes: Any) -> Starlette:
    """The application on `folder`."""
    return make_app(settings_in(folder), **changes)


def visitor(app: Starlette) -> TestClient:
    """A browser that has not logged in."""
    return TestClient(app, base_url=HOST, raise_server_exceptions=False, follow_redirects=False)


class Codes(logging.Handler):
    """Hears the set-up code that the box logs."""

    def __init__(self) -> None:
        super().__init__()
        self.heard: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keeps the code of a line that has one."""
        self.heard += re.findall(r"set-up code ([\d ]{9})", record.getMessage())


@contextlib.contextmanager
def codes() -> Iterator[list[str]]:
    """The codes that are logged meanwhile."""
    handler = Codes()
    logger = logging.getLogger("dnb_edge.web.login")
    logger.addHandler(handler)
    try:
        yield handler.heard
    finally:
        logger.removeHandler(handler)


def log_in(client: TestClient) -> str:
    """Logs `client` in as a user does; the session's token."""
    with codes() as heard:
        assert client.get("/login").status_code == 200
    answer = client.post("/api/v1/login", json={"code": heard[-1]})
    assert answer.status_code == 200, answer.text
    return str(answer.json()["csrf"])


@contextlib.contextmanager
def served(app: Starlette, patience: Patience | None = None) -> Iterator[int]:
    """`app` on a real server in a thread, at the port that is given."""
    listening = listener("127.0.0.1", 0)
    port = listening.getsockname()[1]
    server = Server(app, patience=patience)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
    thread.start()
    try:
        asyncio.run(_started(server, thread))
        yield port
    finally:
        server.should_exit = True
        thread.join(20)
        listening.close()
        assert not thread.is_alive()


async def _started(server: Server, thread: threading.Thread) -> None:
    async with asyncio.timeout(20):
        while not server.started:
            assert thread.is_alive()
            await asyncio.sleep(0.01)
