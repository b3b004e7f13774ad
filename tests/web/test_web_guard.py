"""What the guard refuses: names of other people's, bodies that are too large, too slow or no JSON, paths in place of ids."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import httpx
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ConfigDict
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route
from starlette.testclient import TestClient
from web_box import app_in, log_in, visitor

from dnb_edge.errors import InputError, TemporaryFault, WorkError
from dnb_edge.web.app import routes
from dnb_edge.web.endpoint import Access, Endpoint, Refused
from dnb_edge.web.guard_answers import Answers, as_refused
from dnb_edge.web.guard_door import Door, check_ids
from dnb_edge.web.guard_hosts import Hosts, host_name, own_names, own_origin
from dnb_edge.web.guard_rates import MOST_ADDRESSES, Buckets, Failures, Limits, counted_as
from dnb_edge.web.sessions import COOKIE

OURS = Hosts(names=frozenset({"localhost", "box", "box.local", "race.example.org", "10.0.0.9"}))


@pytest.mark.parametrize(
    ("host", "admitted"),
    [
        ("localhost", True),
        ("LocalHost:8080", True),
        ("box.local:8080", True),
        ("box.local.", True),
        ("race.example.org", True),
        ("127.0.0.1:8080", True),
        ("127.9.9.9", True),
        ("[::1]:8080", True),
        ("192.168.1.5:8080", True),
        ("10.0.0.9", True),
        ("[::ffff:192.168.1.5]", True),
        ("192.168.1.6", False),
        ("[fe80::1]", False),
        ("evil.example", False),
        ("box.local.evil.example", False),
        ("evil-box.local", False),
        ("localhost@evil.example", False),
        ("localhost:80:80", False),
        ("localhost:99999", False),
        ("localhost/..", False),
        ("loc alhost", False),
        ("", False),
        (None, False),
        ("0x7f000001", False),
        ("2130706433", False),
    ],
)
def test_hosts(host: str | None, admitted: bool) -> None:
    """The box's names and its own addresses, and not what merely looks like them."""
    assert OURS.admits(host, "192.168.1.5") is admitted


def test_own_names_hold_what_is_configured() -> None:
    """`web.names`, in whatever way somebody wrote them."""
    found = own_names((" Race.Example.ORG. ", "[fe80::1]"))
    assert found.admits("race.example.org:443", None)
    assert found.admits("[fe80::1]", None)
    assert found.admits("localhost", None)
    assert not found.admits("", None)


@given(st.text(max_size=40))
def test_no_host_breaks_the_guard(host: str) -> None:
    """Any text is a name or is none; what is one holds nothing that a header or an address gives a meaning."""
    name = host_name(host)
    assert name is None or set(name) <= set("abcdefghijklmnopqrstuvwxyz0123456789.-_:[]")
    OURS.admits(host, host)


@pytest.mark.parametrize(
    ("origin", "scheme", "host", "own"),
    [
        ("http://localhost:8080", "http", "localhost:8080", True),
        ("http://localhost:8080", "ws", "localhost:8080", True),
        ("https://box.local", "https", "box.local", True),
        ("https://box.local", "wss", "box.local", True),
        ("http://box.local", "https", "box.local", False),
        ("http://localhost", "http", "localhost:8080", False),
        ("http://localhost:8080.evil.example", "http", "localhost:8080", False),
        ("http://evil.example", "http", "localhost:8080", False),
        ("null", "http", "localhost:8080", False),
        ("", "http", "localhost:8080", False),
    ],
)
def test_origins(origin: str, scheme: str, host: str, own: bool) -> None:
    """Exactly the page's own: scheme, name and port."""
    assert own_origin(origin, scheme, host) is own


class Wanted(BaseModel):
    """A body."""

    model_config = ConfigDict(extra="forbid", strict=True)
    name: str
    count: int = 0


class Asked(BaseModel):
    """A query."""

    model_config = ConfigDict(extra="forbid")
    after: int | None = None


class NoPages:
    """Pages that nobody sees."""

    def page(self, request: Request, name: str, *, status: int = 200, **values: Any) -> Response:
        """A line."""
        return Response("a page", status, media_type="text/html")


def door(handler: Any = None, *, body_s: float = 5.0, **changes: Any) -> Starlette:
    """An application of one endpoint."""

    async def echo(request: Request) -> Response:
        query = getattr(request.state, "query", None)
        if query is not None:
            return JSONResponse(query.model_dump())
        body = getattr(request.state, "body", None)
        return JSONResponse(body.model_dump() if body is not None else {"bytes": len(await request.body())})

    whole: dict[str, Any] = {
        "method": "POST",
        "path": "/api/v1/x",
        "access": Access.ALL,
        "summary": "x",
        "body": Wanted,
    }
    endpoint = Endpoint(handler=handler or echo, **(whole | changes))
    answers = Answers(NoPages())
    handlers = dict.fromkeys((Refused, InputError, WorkError, TemporaryFault, 404, 405), answers.answer)
    return Starlette(
        routes=[Route("/api/v1/x", Door({endpoint.method: endpoint}, body_s=body_s))], exception_handlers=handlers
    )


def post(app: Starlette, content: Any, kind: str = "application/json") -> httpx.Response:
    """What is answered to a body."""
    answer: httpx.Response = visitor(app).post("/api/v1/x", content=content, headers={"Content-Type": kind})
    return answer


@pytest.mark.parametrize(
    ("content", "status", "code"),
    [
        (b"", 400, "no-json"),
        (b"{", 400, "no-json"),
        (b"\xff\xfe{}", 400, "no-json"),
        (b'{"name": "\xed\xa0\x80"}', 400, "no-json"),
        (b"[" * 30000, 400, "no-json"),
        (b'{"name": NaN}', 422, "bad-body"),
        (b"[]", 422, "bad-body"),
        (b"null", 422, "bad-body"),
        (b'{"name": 1}', 422, "bad-body"),
        (b'{"name": "x", "count": "1"}', 422, "bad-body"),
        (b'{"name": "x", "count": true}', 422, "bad-body"),
        (b'{"name": "x", "more": 1}', 422, "bad-body"),
        (b'{"name": "x", "count": ' + b"9" * 5000 + b"}", 400, "no-json"),
        (b'{"name": "' + b"x" * 70000 + b'"}', 413, "too-large"),
    ],
)
def test_malformed_bodies(content: bytes, status: int, code: str) -> None:
    """Each is refused in a line; none is a failure inside."""
    answer = post(door(), content)
    assert answer.status_code == status, answer.text
    assert answer.json()["error"]["code"] == code
    assert len(answer.text) < 400


def test_a_body_reaches_its_handler() -> None:
    """Checked and typed."""
    assert post(door(), b'{"name": "x", "count": 3}', "application/json; charset=utf-8").json() == {
        "name": "x",
        "count": 3,
    }


@pytest.mark.parametrize(
    "kind", ["", "text/plain", "application/x-www-form-urlencoded", "multipart/form-data; boundary=x"]
)
def test_bodies_of_another_type(kind: str) -> None:
    """What a form of another site could send without asking is not looked at."""
    assert post(door(), b'{"name": "x"}', kind).status_code == 415


@pytest.mark.parametrize("content", [b"x" * 101, iter([b"x" * 60, b"x" * 60])])
def test_large_bodies(content: Any) -> None:
    """More than the endpoint takes is refused, whether its length is told or it comes in pieces without end."""
    app = door(body=None, body_types=("image/png",), most_body_bytes=100)
    answer = post(app, content, "image/png")
    assert (answer.status_code, answer.headers["connection"]) == (413, "close")
    assert post(app, b"x" * 100, "image/png").json() == {"bytes": 100}


def test_slow_bodies() -> None:
    """A body that trickles is refused when its time is up, however lively it is."""
    app = door(body_s=0.2, most_body_bytes=1000)

    async def trickle() -> Any:
        while True:
            yield b" "
            await asyncio.sleep(0.02)

    async def ask() -> int:
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://localhost") as client:
            answer = await client.post("/api/v1/x", content=trickle(), headers={"Content-Type": "application/json"})
            return answer.status_code

    # httpx's transport reads a body as fast as it is asked to: the limit must end it.
    assert asyncio.run(asyncio.wait_for(ask(), 20)) in {408, 413}


@pytest.mark.parametrize(
    ("query", "status"),
    [
        ("", 200),
        ("?after=7", 200),
        ("?after=x", 422),
        ("?after=1&after=2", 422),
        ("?other=1", 422),
    ],
)
def test_queries(query: str, status: int) -> None:
    """What stands behind the question mark is checked as bodies are."""
    app = door(method="GET", body=None, query=Asked)
    answer = visitor(app).get(f"/api/v1/x{query}")
    assert answer.status_code == status, answer.text


@pytest.mark.parametrize(
    ("error", "status", "code"),
    [
        (Refused(409, "changed", "No."), 409, "changed"),
        (InputError("setup.yaml: no"), 422, "input"),
        (WorkError("disk full"), 500, "failed"),
        (TemporaryFault("camera away"), 503, "away"),
        (HTTPException(418), 418, "refused"),
        (ClientDisconnect(), 400, "gone"),
        (ZeroDivisionError("secret"), 500, "internal"),
    ],
)
def test_errors_in_the_words_of_the_api(error: Exception, status: int, code: str) -> None:
    """Ours with their line; others without a word of theirs."""
    refused = as_refused(error)
    assert (refused.status, refused.code) == (status, code)
    assert ("secret" in refused.text) is False


def test_a_refusal_says_when_to_try_again() -> None:
    """In whole seconds, rounded up."""

    async def busy(_request: Request) -> Response:
        raise Refused(503, "busy", "Busy.", retry_after_s=1.2)

    assert post(door(busy), b'{"name": "x"}').headers["retry-after"] == "2"


TARGETS = ("etc/passwd", "app.py", "dnb-edge.yaml")
UPS = (
    "../", "..\\", "..%2f", "..%2F", "%2e%2e/", "%2e%2e%2f", "..%5c", "%2e%2e%5c", "..%252f", "%252e%252e%252f", "..%c0%af",
    "%c0%ae%c0%ae/", "..%ef%bc%8f", "....//", "....%2f%2f", "..;/", "..%00/", "%2e./", ".%2e/", "..%u2216", "%uff0e%uff0e%2f",
    "..%0d%0a/", "/../", "//../", "./../", "..././", "..%e2%81%84", "..%01/",
)  # fmt: skip
ESCAPES = [
    *(up * 3 + target for up in UPS for target in TARGETS[:1]),
    *(up + "app.py" for up in UPS[:12]),
    "/etc/passwd", "%2fetc%2fpasswd", "%2Fetc%2Fpasswd", "//etc/passwd", "\\\\host\\share", "C:%5cx", "file:%2f%2fetc%2fpasswd",
    "%00", "login.js%00", "login.js%00.png", ".", "..", "%2e", "%2e%2e", "...", ".hidden", "~root%2f", "login.js%20",
    "%20login.js", "login.js/", "LOGIN.JS%3a%3a$DATA", "login%2ejs%2f..%2f..%2fapp.py", "con", "%ff", "%f0%9f%92%a9", "a" * 250,
]  # fmt: skip
"""Fifty and more ways to write a path where an id belongs."""


@pytest.fixture(scope="module")
def box(tmp_path_factory: pytest.TempPathFactory) -> tuple[TestClient, str, list[Endpoint], Path]:
    """The real application with files that must not get out."""
    folder = tmp_path_factory.mktemp("box")
    app = app_in(folder, limits=Limits(per_s=0.0))
    for place in (folder, folder / "runs", folder / "setup", folder.parent):
        (place / "app.py").write_text("SECRET", encoding="utf-8")
        (place / "dnb-edge.yaml").write_text("name: SECRET", encoding="utf-8")
    client = visitor(app)
    return client, log_in(client), app.state.table, folder


def as_sent(client: TestClient, method: str, address: str, token: str) -> tuple[int, str]:
    """Status and text of the answer to a request whose address no client has tidied up; decoded as the server does."""
    path = unquote(address)
    headers = {"Host": "localhost", "X-CSRF-Token": token, "Cookie": f"{COOKIE}={client.cookies[COOKIE]}"}
    told: list[Any] = []
    scope = {
        "type": "http", "http_version": "1.1", "method": method, "scheme": "http", "path": path, "raw_path": address.encode(),
        "root_path": "", "query_string": b"", "headers": [(k.lower().encode(), v.encode()) for k, v in headers.items()],
        "client": ("192.168.1.9", 1), "server": ("192.168.1.5", 80), "state": {},
    }  # fmt: skip

    async def receive() -> Any:
        return {"type": "http.request", "body": b"", "more_body": False}

    async def send(message: Any) -> None:
        told.append(message)

    asyncio.run(client.app(scope, receive, send))  # type: ignore[arg-type]
    return told[0]["status"], b"".join(message.get("body", b"") for message in told[1:]).decode(errors="replace")


def test_there_are_fifty_ways() -> None:
    """So many are tried below on each address."""
    assert len(set(ESCAPES)) >= 50


def test_no_path_stands_for_an_id(box: Any) -> None:
    """On every address with ids, in every place of an id, by every method: never a file, never a failure inside."""
    client, token, table, folder = box
    before = sorted(folder.rglob("*"))
    tried = 0
    for endpoint in table:
        if "{" not in endpoint.path:
            continue
        head, *tails = endpoint.path.split("{")
        places = [tail.partition("}")[2] for tail in tails]
        for escape in ESCAPES:
            address = head + "".join(escape + place for place in places)
            status, text = as_sent(client, endpoint.method, address, token)
            assert status in {404, 405, 415}, (endpoint.method, address, status, text)
            assert "SECRET" not in text
            assert "root:" not in text
            tried += 1
    assert tried >= 50
    assert sorted(folder.rglob("*")) == before


@given(st.text(max_size=30))
def test_ids(text: str) -> None:
    """Whatever passes as an id holds no separator, is no way up and no hidden name."""
    try:
        check_ids({"run_id": text})
    except Refused:
        return
    assert text.isascii()
    assert not text.startswith(".")
    assert ".." not in text
    assert not set(text) & set("/\\:\0%")


@pytest.mark.parametrize("escape", ESCAPES)
def test_handlers_see_ids_only(escape: str) -> None:
    """The guard itself lets nothing else through, whatever a handler would do with it."""

    async def echo(request: Request) -> Response:
        return JSONResponse(request.path_params)

    endpoint = Endpoint(method="GET", path="/x/{run_id}", access=Access.ALL, handler=echo, summary="x")
    app = Starlette(routes=routes([endpoint]), exception_handlers={Refused: Answers(NoPages()).answer})
    app.router.redirect_slashes = False
    client = visitor(app)
    client.cookies.set(COOKIE, "x")
    status, _ = as_sent(client, "GET", f"/x/{escape}", "")
    assert status == (200 if escape == "con" else 404)
    assert as_sent(client, "GET", "/x/aB3-._~", "")[0] == 200


def test_buckets() -> None:
    """So many at once, then so many a second; each address for itself; a forgotten one begins anew."""
    buckets = Buckets(2.0, 3)
    assert [buckets.take("a", 0.0) for _ in range(3)] == [None] * 3
    assert buckets.take("a", 0.0) == 0.5
    assert buckets.take("b", 0.0) is None
    assert buckets.take("a", 0.5) is None
    assert buckets.take("a", 0.5) is not None
    assert [buckets.take("a", 100.0) for _ in range(4)][3] is not None
    for number in range(MOST_ADDRESSES):
        buckets.take(str(number), 100.0)
    assert len(buckets._left) == MOST_ADDRESSES
    assert buckets.take("a", 100.0) is None


def test_failures() -> None:
    """Three in a minute and ten in an hour, by the windows that are open at each instant."""
    failures = Failures(Limits().wrong_codes)
    for instant in (0.0, 1.0, 2.0):
        assert failures.wait_s("a", instant) is None
        failures.failed("a", instant)
    assert failures.wait_s("a", 2.0) == 58.0
    assert failures.wait_s("b", 2.0) is None
    assert failures.wait_s("a", 60.5) is None
    for number in range(7):
        failures.failed("a", 100.0 + 60.0 * number)
    assert failures.wait_s("a", 1000.0) == 2600.0
    assert failures.wait_s("a", 3601.5) is None


@pytest.mark.parametrize(
    ("client", "address"),
    [
        (("192.168.1.5", 1), "192.168.1.5"),
        (("::ffff:192.168.1.5", 1), "192.168.1.5"),
        (("fe80::1%eth0", 1), "fe80::/64"),
        (("2001:db8::1:2", 1), "2001:db8::/64"),
        (("testclient", 1), "testclient"),
        (None, "unknown"),
    ],
)
def test_addresses_are_counted(client: Any, address: str) -> None:
    """An IPv6 client cannot have as many tries as its network has addresses."""
    assert counted_as(client) == address


def test_who_asks_too_often_waits(tmp_path: Path) -> None:
    """The general limit answers 429 with the time to wait, and lets go again."""
    now_s = [0.0]
    client = visitor(app_in(tmp_path, limits=Limits(per_s=1.0, burst=5), clock_s=lambda: now_s[0]))
    answers = [client.get("/api/v1/state").status_code for _ in range(6)]
    assert answers == [200] * 5 + [429]
    assert client.get("/login").headers["retry-after"] == "1"
    now_s[0] = 1.0
    assert client.get("/api/v1/state").status_code == 200
