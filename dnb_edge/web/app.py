"""All endpoints in one tuple, the guard before them, and the Starlette application that it makes.

Knows every module of endpoints; knows nothing of what they do.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable
from contextlib import AsyncExitStack, asynccontextmanager
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route

from dnb_edge.errors import DnbEdgeError
from dnb_edge.live.messages import Picture, State, Told
from dnb_edge.web import login, static_files
from dnb_edge.web.box import Box, Daemon, WebSettings
from dnb_edge.web.endpoint import Endpoint, Refused
from dnb_edge.web.guard import Guard, security_headers
from dnb_edge.web.guard_answers import Answers
from dnb_edge.web.guard_door import Door
from dnb_edge.web.guard_hosts import own_names
from dnb_edge.web.guard_rates import Limits
from dnb_edge.web.pages import TemplatePages
from dnb_edge.web.sessions import Sessions
from dnb_edge.web.static_files import StaticFiles

FEATURES = ("board", "runs", "downloads", "setup", "judge")
"""Modules of this room with endpoints(box)."""


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
    line = daemon if daemon is not None else _Away()
    box = Box(settings=settings, daemon=line, pages=pages)
    limits = Limits() if limits is None else limits
    sessions = Sessions()
    table = (
        *static_files.endpoints(files),
        *login.endpoints(box, sessions, limits=limits, clock_s=clock_s),
        *(endpoint for name in FEATURES for endpoint in _endpoints_of(name, box)),
    )
    answers = Answers(pages)

    @asynccontextmanager
    async def lifespan(_app: Starlette) -> AsyncIterator[None]:
        async with AsyncExitStack():
            yield

    app = Starlette(
        routes=list(routes(table)),
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
            **dict.fromkeys((Refused, DnbEdgeError, 404, 405), answers.answer),
            500: _last_resort(answers),
        },
        lifespan=lifespan,
    )
    app.router.redirect_slashes = False
    app.state.table = table
    return app


def routes(table: Iterable[Endpoint]) -> Iterable[BaseRoute]:
    """A route for each address in `table`; those without ids first, so that none hides another one."""
    addresses: dict[str, dict[str, Endpoint]] = {}
    for endpoint in table:
        methods = addresses.setdefault(endpoint.path, {})
        if endpoint.method in methods:
            raise ValueError(f"{endpoint.method} {endpoint.path} stands twice in the table")
        methods[endpoint.method] = endpoint
    return (Route(path, Door(addresses[path])) for path in sorted(addresses, key=lambda path: (path.count("{"), path)))


def _endpoints_of(name: str, box: Box) -> tuple[Endpoint, ...]:
    full = f"dnb_edge.web.{name}"
    if find_spec(full) is None:
        return ()
    found: tuple[Endpoint, ...] = import_module(full).endpoints(box)
    return found


def _last_resort(answers: Answers) -> Callable[[Request, Exception], Awaitable[Response]]:
    """Answers what nobody foresaw, outside of the guard; the server logs it afterwards."""

    async def answer(request: Request, error: Exception) -> Response:
        response = await answers.answer(request, error)
        security_headers(response.headers, request.headers.get("host", ""))
        return response

    return answer


class _Away:
    """A daemon that never comes."""

    state = None
    epoch = None

    def events(self, _since: int | None = None) -> tuple[Told, ...]:
        """None."""
        return ()

    async def follow(self) -> AsyncIterator[Told | State | None]:
        """Nothing comes."""
        await asyncio.Event().wait()
        yield None

    async def picture(self, **_when: Any) -> Picture:
        """Refused."""
        raise Refused(503, "daemon-down", "The timing service is not running: it comes back by itself.")

    async def ask(self, **_what: Any) -> None:
        """Refused."""
        raise Refused(503, "daemon-down", "The timing service is not running: it comes back by itself.")
