"""The hub's pages and JSON: to look at only. Nothing that a browser sends changes anything.

Knows the hub and its store; knows no broker. The look is the box's own pages': their style sheet is served from where it is.
"""

from __future__ import annotations

import dataclasses
import ipaddress
import logging
import re
import socket
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from dnb_edge import wire
from dnb_edge.errors import DnbEdgeError
from dnb_edge.fleet.hub import Hub, Seen
from dnb_edge.fleet.store import Row, Store
from dnb_edge.fleet.view import card, lap

HERE = Path(__file__).parent
_WEB = HERE.parent / "web" / "static"
FILES = {
    "base.css": (_WEB / "base.css", "text/css; charset=utf-8"),
    "theme.js": (_WEB / "theme.js", "text/javascript; charset=utf-8"),
    "fleet.css": (HERE / "static" / "fleet.css", "text/css; charset=utf-8"),
    "fleet.js": (HERE / "static" / "fleet.js", "text/javascript; charset=utf-8"),
}
LAPS_SHOWN = 50
MOST_ASKED = 1000
"""Events that one answer of the API has."""
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), geolocation=(), microphone=()",
}
_HOST = re.compile(r"(?P<name>\[[0-9a-f:.]+\]|[a-z0-9][a-z0-9._-]{0,252})(?::[0-9]{1,5})?")

log = logging.getLogger(__name__)


def make_app(
    hub: Hub, store: Store, *, names: tuple[str, ...] = (), wall_s: Callable[[], float] = time.time
) -> Starlette:
    """The application. `names`: by which browsers may call this machine, besides its own, localhost and its addresses."""
    pages = _Pages(hub, store, wall_s)
    routes: list[tuple[str, Callable[[Request], Response]]] = [
        ("/", pages.boxes),
        ("/box/{name}", pages.box),
        ("/api/v1/boxes", pages.api_boxes),
        ("/api/v1/laps", pages.api_laps),
        ("/api/v1/events", pages.api_events),
        ("/static/{name}", _static),
    ]
    app = Starlette(
        routes=[Route(path, handler, methods=["GET"]) for path, handler in routes],
        middleware=[Middleware(_Guard, names=_own_names(names))],
        exception_handlers={DnbEdgeError: _failed, HTTPException: _refused},
    )
    app.router.redirect_slashes = False
    return app


class _Pages:
    """The handlers. Starlette calls them in threads of its own, for they wait for the disk."""

    def __init__(self, hub: Hub, store: Store, wall_s: Callable[[], float]) -> None:
        self._hub = hub
        self._store = store
        self._wall_s = wall_s
        self._jinja = Environment(
            loader=FileSystemLoader(HERE / "templates"),
            autoescape=True,
            undefined=StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
        )

    def boxes(self, request: Request) -> Response:
        """GET /."""
        del request
        glance = self._hub.glance()
        rows = self._store.latest(kind="lap", most=LAPS_SHOWN)
        return self._page(
            "boxes.html", glance=glance, cards=[self._card(one) for one in glance.boxes], laps=_laps(rows), box=None
        )

    def box(self, request: Request) -> Response:
        """GET /box/{name}."""
        name = request.path_params["name"]
        glance = self._hub.glance()
        found = next((one for one in glance.boxes if one.box.name == name), None)
        if found is None:
            raise HTTPException(404, "There is no such box.")
        rows = self._store.latest(kind="lap", most=4 * LAPS_SHOWN, box=name)
        return self._page("box.html", glance=glance, cards=[self._card(found)], laps=_laps(rows), box=name)

    def api_boxes(self, request: Request) -> Response:
        """GET /api/v1/boxes."""
        del request
        glance = self._hub.glance()
        boxes = [
            {
                "name": one.box.name,
                "online": one.online,
                "gone": one.gone,
                "state": None if one.box.state is None else wire.to_dict(one.box.state),
                "state_wall_s": one.box.state_wall_s,
                "laps": one.box.laps,
                "missing": one.box.missing,
            }
            for one in glance.boxes
        ]
        counts = {"nonsense": glance.nonsense, "passed_over": self._store.passed_over}
        return JSONResponse({"trouble": glance.trouble, **counts, "boxes": boxes})

    def api_laps(self, request: Request) -> Response:
        """GET /api/v1/laps?box=NAME&before=ID&limit=N: the newest first."""
        query = _Query(request, {"box", "before", "limit"})
        rows = self._store.latest(kind="lap", most=query.limit, box=query.box, before=query.number("before"))
        return JSONResponse({"laps": [dataclasses.asdict(row) for row in rows]})

    def api_events(self, request: Request) -> Response:
        """GET /api/v1/events?after=ID&box=NAME&limit=N: the oldest first; ask again after the last id."""
        query = _Query(request, {"box", "after", "limit"})
        rows = self._store.since(query.number("after") or 0, most=query.limit, box=query.box)
        return JSONResponse({"events": [dataclasses.asdict(row) for row in rows]})

    def _card(self, seen: Seen) -> Any:
        rows = self._store.latest(kind="lap", most=1, box=seen.box.name)
        return card(seen, rows[0] if rows else None, wall_s=self._wall_s())

    def _page(self, template: str, **values: Any) -> Response:
        text = self._jinja.get_template(template).render(values)
        return HTMLResponse(text.encode(errors="replace"))


class _Query:
    """What stands behind the question mark. Raises `HTTPException` (400) for what is not known or no number."""

    def __init__(self, request: Request, known: set[str]) -> None:
        unknown = sorted(request.query_params.keys() - known)
        if unknown:
            raise HTTPException(400, f"{unknown[0]}: no such parameter; there are {', '.join(sorted(known))}")
        self._asked = request.query_params
        self.box = self._asked.get("box")
        self.limit = min(self.number("limit") or 100, MOST_ASKED)

    def number(self, name: str) -> int | None:
        """A whole number from 0 on; None where it is not asked for."""
        text = self._asked.get(name)
        if text is None:
            return None
        if not (text.isascii() and text.isdecimal() and len(text) <= 15):
            raise HTTPException(400, f"{name}: a whole number is wanted")
        return int(text)


class _Guard:
    """ASGI middleware: this machine's own names only (a foreign page may call us by one of its own), strict headers."""

    def __init__(self, app: ASGIApp, *, names: frozenset[str]) -> None:
        self._app = app
        self._names = names

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers.update(HEADERS)
                headers.setdefault("Cache-Control", "no-store")
            await send(message)

        app: Callable[[Scope, Receive, Send], Awaitable[None]] = self._app
        hosts = Headers(scope=scope).getlist("host")
        if len(hosts) != 1 or not self._admits(hosts[0], scope.get("server")):
            app = PlainTextResponse(
                "This hub is not known by this name: use its address, or give it the name by --name.\n", 421
            )
        await app(scope, receive, send_with_headers)

    def _admits(self, host: str, server: Any) -> bool:
        found = _HOST.fullmatch(host.lower())
        if found is None:
            return False
        name = found["name"].rstrip(".").strip("[]")
        address = _address(name)
        if address is None:
            return name in self._names
        return (
            address.is_loopback or name in self._names or (server is not None and address == _address(str(server[0])))
        )


def _own_names(more: tuple[str, ...]) -> frozenset[str]:
    own = socket.gethostname().lower()
    short = own.partition(".")[0]
    return frozenset({"localhost", own, short, f"{short}.local", *(name.strip().lower().rstrip(".") for name in more)})


def _address(text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        found = ipaddress.ip_address(text.partition("%")[0])
    except ValueError:
        return None
    mapped = getattr(found, "ipv4_mapped", None)
    return found if mapped is None else mapped


def _laps(rows: list[Row]) -> list[Any]:
    return [lap(row) for row in rows]


def _static(request: Request) -> Response:
    """GET /static/{name}: the files that pages are made of, by their own names only."""
    found = FILES.get(request.path_params["name"])
    if found is None:
        raise HTTPException(404, "There is nothing under this address.")
    path, kind = found
    return FileResponse(path, media_type=kind, headers={"Cache-Control": "no-cache"})


def _refused(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    return _error(request, error.status_code, str(error.detail))


def _failed(request: Request, error: Exception) -> Response:
    log.warning("%s: %s", request.url.path, error)
    return _error(request, 500, "The store does not answer: the log has the reason.")


def _error(request: Request, status: int, text: str) -> Response:
    if request.url.path.startswith("/api/"):
        return JSONResponse({"error": {"text": text}}, status)
    return PlainTextResponse(f"{text}\n", status)
