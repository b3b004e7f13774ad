"""All endpoints in one tuple, the guard before them, and the Starlette application that it makes.

Knows every module of endpoints; knows nothing of what they do.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine, Iterable
from contextlib import asynccontextmanager
from typing import Any

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route, WebSocketRoute

from dnb_edge.errors import DnbEdgeError
from dnb_edge.web import board, downloads, judge, login, openapi, race, runs, setup, static_files
from dnb_edge.web.box import Box, Daemon, WebSettings
from dnb_edge.web.daemon_line import DaemonLine
from dnb_edge.web.endpoint import API, Endpoint, Refused
from dnb_edge.web.guard import Guard, security_headers
from dnb_edge.web.guard_answers import Answers
from dnb_edge.web.guard_door import Door
from dnb_edge.web.guard_hosts import own_names
from dnb_edge.web.guard_rates import Limits
from dnb_edge.web.pages import TemplatePages
from dnb_edge.web.sessions import Sessions
from dnb_edge.web.signpost import Signpost, address_of
from dnb_edge.web.static_files import StaticFiles
from dnb_edge.web.stream import Live

LIVE = f"{API}/live"
"""The one address that is a WebSocket's."""
AGAIN_S = 0.5

_log = logging.getLogger(__name__)


def make_app(
    settings: WebSettings,
    *,
    daemon: Daemon | None = None,
    limits: Limits | None = None,
    clock_s: Callable[[], float] = time.monotonic,
) -> Starlette:
    """The application. `daemon`: another one than the one behind `settings.socket`, for tests."""
    files = StaticFiles()
    pages = TemplatePages(files)
    line = DaemonLine(settings.socket) if daemon is None else daemon
    live = Live(line, settings.most_viewers)
    box = Box(settings=settings, daemon=line, pages=pages)
    limits = Limits() if limits is None else limits
    sessions = Sessions()
    table: tuple[Endpoint, ...] = (
        *static_files.endpoints(files),
        *login.endpoints(box, sessions, limits=limits, clock_s=clock_s),
        *race.endpoints(box),
        *board.endpoints(box),
        *runs.endpoints(box),
        *downloads.endpoints(box),
        *judge.endpoints(box),
        *setup.endpoints(box),
    )
    table = (*table, openapi.endpoint(table))
    answers = Answers(pages)

    @asynccontextmanager
    async def lifespan(_app: Starlette) -> AsyncIterator[None]:
        # Held here: the event loop itself keeps tasks by weak references only.
        tasks = [asyncio.create_task(lasting(live.run))]
        if isinstance(line, DaemonLine):
            signpost = Signpost(line, lambda: address_of(settings.host, settings.port))
            tasks += [asyncio.create_task(lasting(work)) for work in (line.run, signpost.run)]
        try:
            yield
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    app = Starlette(
        routes=[WebSocketRoute(LIVE, live.serve), *routes(table)],
        middleware=[
            Middleware(
                Guard,
                hosts=own_names(settings.names),
                sessions=sessions,
                answers=answers,
                limits=limits,
                clock_s=clock_s,
            )
        ],
        exception_handlers={
            **dict.fromkeys((Refused, DnbEdgeError, HTTPException, ClientDisconnect), answers.answer),
            500: _last_resort(answers),
        },
        lifespan=lifespan,
    )
    app.router.redirect_slashes = False
    app.state.table = table
    return app


async def lasting(work: Callable[[], Coroutine[Any, Any, None]]) -> None:
    """Does what is to be done as long as the pages are there, and begins it again where something unforeseen ends it."""
    while True:
        task = asyncio.create_task(work())
        try:
            await asyncio.wait([task])
        finally:
            task.cancel()
            await asyncio.wait([task])
        if (error := task.exception()) is not None:
            _log.error("something inside has failed, and is begun again", exc_info=error)
        await asyncio.sleep(AGAIN_S)


def routes(table: Iterable[Endpoint]) -> Iterable[BaseRoute]:
    """A route for each address in `table`; those without ids first, so that none hides another one."""
    addresses: dict[str, dict[str, Endpoint]] = {}
    for endpoint in table:
        methods = addresses.setdefault(endpoint.path, {})
        if endpoint.method in methods:
            raise ValueError(f"{endpoint.method} {endpoint.path} stands twice in the table")
        methods[endpoint.method] = endpoint
    return (Route(path, Door(addresses[path])) for path in sorted(addresses, key=lambda path: (path.count("{"), path)))


def _last_resort(answers: Answers) -> Callable[[Request, Exception], Awaitable[Response]]:
    """Answers what nobody foresaw, outside of the guard; the server logs it afterwards."""

    async def answer(request: Request, error: Exception) -> Response:
        response = await answers.answer(request, error)
        security_headers(response.headers, request.headers.get("host", ""))
        return response

    return answer
