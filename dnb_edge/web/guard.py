"""What every request passes first, over HTTP and WebSocket alike: the host's name, how often, the session; and what every
answer gets last, its security headers.

Knows requests and sessions; knows no endpoint (`guard_door` has those).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from http.cookies import CookieError, SimpleCookie

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket

from dnb_edge.web.endpoint import Refused
from dnb_edge.web.guard_answers import Answers
from dnb_edge.web.guard_hosts import Hosts, host_name, own_origin
from dnb_edge.web.guard_rates import Buckets, Limits, counted_as
from dnb_edge.web.sessions import COOKIE, Sessions

MOST_ADDRESS_CHARACTERS = 2000


def security_headers(headers: MutableHeaders, host: str) -> None:
    """Adds what browsers are to be strict about; a handler's own Content-Security-Policy or Cache-Control stays."""
    name = host if host_name(host) is not None else ""
    # 'self' does not mean WebSockets to all browsers.
    sockets = f" ws://{name} wss://{name}" if name else ""
    headers.setdefault(
        "Content-Security-Policy",
        f"default-src 'self'; img-src 'self' data: blob:; connect-src 'self'{sockets}; object-src 'none'; base-uri 'none'; "
        "form-action 'self'; frame-ancestors 'none'",
    )
    headers.setdefault("Cache-Control", "no-store")
    headers["X-Content-Type-Options"] = "nosniff"
    headers["X-Frame-Options"] = "DENY"
    headers["Referrer-Policy"] = "same-origin"
    headers["Cross-Origin-Opener-Policy"] = "same-origin"
    headers["Cross-Origin-Resource-Policy"] = "same-origin"
    headers["Permissions-Policy"] = "camera=(), geolocation=(), microphone=()"


class Guard:
    """ASGI middleware."""

    def __init__(
        self,
        app: ASGIApp,
        *,
        hosts: Hosts,
        sessions: Sessions,
        answers: Answers,
        limits: Limits,
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._app = app
        self._hosts = hosts
        self._sessions = sessions
        self._answers = answers
        self._buckets = Buckets(limits.per_s, limits.burst)
        self._clock_s = clock_s

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes the request on, or answers it itself."""
        if scope["type"] not in {"http", "websocket"}:
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)

        async def send_with_headers(message: Message) -> None:
            if message["type"] in {"http.response.start", "websocket.http.response.start"}:
                security_headers(MutableHeaders(scope=message), headers.get("host", ""))
            await send(message)

        try:
            self._check(scope, headers)
        except Refused as refused:
            await self._refuse(scope, receive, send_with_headers, refused)
            return
        scope.setdefault("state", {})["session"] = self._sessions.find(_cookie(headers), self._clock_s())
        await self._app(scope, receive, send_with_headers)

    def _check(self, scope: Scope, headers: Headers) -> None:
        server = scope.get("server")
        hosts = headers.getlist("host")
        if len(hosts) != 1 or not self._hosts.admits(hosts[0], server[0] if server else None):
            raise Refused(
                421, "foreign-host", "The box is not known by this name: use its address, or add the name to web.names."
            )
        wait_s = self._buckets.take(counted_as(scope.get("client")), self._clock_s())
        if wait_s is not None:
            raise Refused(429, "too-many", "Too many requests: wait a moment.", retry_after_s=wait_s)
        if len(scope["path"]) + len(scope.get("query_string", b"")) > MOST_ADDRESS_CHARACTERS:
            raise Refused(414, "too-long", "The address is too long.")
        origin = headers.get("origin")
        if scope["type"] == "websocket" and origin is not None and not own_origin(origin, scope["scheme"], hosts[0]):
            raise Refused(
                403, "foreign-origin", "This was sent by a page of another site: open the box's own page instead."
            )

    async def _refuse(self, scope: Scope, receive: Receive, send: Send, refused: Refused) -> None:
        if scope["type"] == "http":
            response = await self._answers.answer(Request(scope), refused)
            await response(scope, receive, send)
            return
        socket = WebSocket(scope, receive, send)
        if "websocket.http.response" in scope.get("extensions", {}):
            request = Request({**scope, "type": "http", "method": "GET"})
            await socket.send_denial_response(await self._answers.answer(request, refused))
        else:
            await socket.close(1008)


def _cookie(headers: Headers) -> str | None:
    """The session's cookie; of several the last, as `SimpleCookie` has it."""
    text = headers.get("cookie")
    if not text:
        return None
    try:
        found = SimpleCookie(text).get(COOKIE)
    except CookieError:
        return None
    return None if found is None else found.value
