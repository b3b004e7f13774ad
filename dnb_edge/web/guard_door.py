"""The door of one address: which methods it has, who may, what body it takes; then its endpoint's handler.

Knows endpoints and requests; knows neither hosts nor how often somebody asks (`guard`), nor what is asked for.
"""

from __future__ import annotations

import asyncio
import re
import secrets
from collections.abc import Mapping
from urllib.parse import quote

from pydantic import BaseModel, ValidationError
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import RedirectResponse
from starlette.types import Message, Receive, Scope, Send

from dnb_edge.web.endpoint import Access, Endpoint, Refused
from dnb_edge.web.guard_hosts import own_origin
from dnb_edge.web.sessions import Session

CSRF_HEADER = "x-csrf-token"
SAFE_METHODS = frozenset({"GET", "HEAD"})
BODY_S = 15.0
"""Time for a body to come."""
SLOWEST_BYTES_PER_S = 64 * 1024
"""More time, for large ones."""

_ID = re.compile(r"[A-Za-z0-9_~-][A-Za-z0-9._~-]{0,199}")


class Door:
    """An ASGI application: all endpoints of one address."""

    def __init__(self, endpoints: Mapping[str, Endpoint], *, body_s: float = BODY_S) -> None:
        self._endpoints = dict(endpoints)
        self._body_s = body_s

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answers one request, or raises what `guard_answers` makes an answer of."""
        endpoint = self._endpoints.get("GET" if scope["method"] == "HEAD" else scope["method"])
        if endpoint is None:
            allowed = {*self._endpoints, *(("HEAD",) if "GET" in self._endpoints else ())}
            raise HTTPException(405, headers={"Allow": ", ".join(sorted(allowed))})
        check_ids(scope.get("path_params", {}))
        body = _Body(receive, most_bytes=endpoint.most_body_bytes, within_s=self._body_s)
        request = Request(scope, body.receive, send)
        if _wants_login(endpoint, request):
            await RedirectResponse(f"/login?next={quote(scope['path'])}", 303)(scope, receive, send)
            return
        admit(endpoint, request)
        if endpoint.query is not None:
            request.state.query = read_query(request, endpoint.query)
        if scope["method"] not in SAFE_METHODS:
            check_body_type(endpoint, request)
            if endpoint.body is not None:
                request.state.body = await read_body(request, endpoint.body)
        response = await endpoint.handler(request)
        await response(scope, receive, send)


def admit(endpoint: Endpoint, request: Request) -> None:
    """Lets the request pass to `endpoint`, or raises `Refused`: 401 without a session, 403 with a wrong origin or token."""
    session: Session | None = getattr(request.state, "session", None)
    changes = request.method not in SAFE_METHODS
    origin = request.headers.get("origin")
    if changes and origin is not None and not own_origin(origin, request.url.scheme, request.headers.get("host", "")):
        raise Refused(
            403, "foreign-origin", "This was sent by a page of another site: open the box's own page instead."
        )
    if endpoint.access is Access.ALL:
        return
    if session is None:
        raise Refused(
            401, "no-session", "Log in with the set-up code first: open /login, the code is on the box's display."
        )
    if changes and not secrets.compare_digest(request.headers.get(CSRF_HEADER, "").encode(), session.csrf.encode()):
        raise Refused(403, "no-token", "The page is out of date: load it again, then repeat what you did.")


def check_ids(found: Mapping[str, object]) -> None:
    """Raises `Refused` (404) where what stands in the address is no id: ids are letters, digits and -._~, and never paths."""
    for value in found.values():
        if not isinstance(value, str) or _ID.fullmatch(value) is None or ".." in value:
            raise Refused(404, "not-found", "There is nothing under this address.")


def check_body_type(endpoint: Endpoint, request: Request) -> None:
    """Raises `Refused`: 415 for a body of another type than the endpoint takes, 413 for one that says that it is too large."""
    accepted = (("application/json",) if endpoint.body is not None else ()) + endpoint.body_types
    given = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if accepted and given not in accepted:
        raise Refused(415, "wrong-type", f"The body must be {' or '.join(accepted)}, with that Content-Type.")
    length = request.headers.get("content-length", "0")
    if not (length.isascii() and length.isdecimal()) or int(length) > endpoint.most_body_bytes:
        raise _too_large(endpoint.most_body_bytes)


def read_query(request: Request, model: type[BaseModel]) -> BaseModel:
    """What stands behind the question mark, checked. Raises `Refused` (422)."""
    given = request.query_params
    if len(given) != len(given.multi_items()):
        raise Refused(422, "bad-query", "The same name stands twice behind the question mark.")
    try:
        return model.model_validate_strings(dict(given))
    except ValidationError as error:
        raise Refused(422, "bad-query", _first_mistake(error)) from error


async def read_body(request: Request, model: type[BaseModel]) -> BaseModel:
    """The request's JSON body, checked. Raises `Refused`: 400 where it is no JSON, 422 where it is other than wanted."""
    try:
        return model.model_validate_json(await request.body())
    except ValidationError as error:
        if error.errors(include_url=False, include_input=False)[0]["type"] == "json_invalid":
            raise Refused(400, "no-json", "The body is no JSON.") from error
        raise Refused(422, "bad-body", _first_mistake(error)) from error


def _first_mistake(error: ValidationError) -> str:
    first = error.errors(include_url=False, include_context=False, include_input=False)[0]
    where = ".".join(str(part) for part in first["loc"])
    text = first["msg"].removeprefix("Value error, ")
    return f"{where}: {text}" if where else text


class _Body:
    """The rest of a request's body: so many bytes and so long, and no more."""

    def __init__(self, receive: Receive, *, most_bytes: int, within_s: float) -> None:
        self._receive = receive
        self._most_bytes = most_bytes
        self._left_bytes = most_bytes
        self._within_s = within_s + most_bytes / SLOWEST_BYTES_PER_S
        self._until_s: float | None = None
        self._whole = False

    async def receive(self) -> Message:
        """As ASGI's. Raises `Refused`: 413 where the body is too large, 408 where it takes too long."""
        if self._whole:
            return await self._receive()
        if self._until_s is None:
            self._until_s = asyncio.get_running_loop().time() + self._within_s
        try:
            async with asyncio.timeout_at(self._until_s):
                message = await self._receive()
        except TimeoutError as error:
            raise Refused(408, "slow-body", "The body took too long to come: try again.") from error
        if message["type"] != "http.request":
            return message
        self._left_bytes -= len(message.get("body", b""))
        if self._left_bytes < 0:
            raise _too_large(self._most_bytes)
        self._whole = not message.get("more_body", False)
        return message


def _too_large(most_bytes: int) -> Refused:
    return Refused(413, "too-large", f"This is more than the {most_bytes:,} bytes that are taken here.")


def _wants_login(endpoint: Endpoint, request: Request) -> bool:
    """Whether a page is asked for that only those who are logged in may see."""
    stranger = getattr(request.state, "session", None) is None
    return endpoint.access is Access.CHANGE and stranger and not endpoint.in_api and request.method in SAFE_METHODS
