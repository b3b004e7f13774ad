"""The whole application: who may reach each of its addresses, and what every answer carries."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient
from web_box import HOST, app_in, log_in, visitor

from dnb_edge.web import race
from dnb_edge.web.app import LIVE, routes
from dnb_edge.web.endpoint import Access, Endpoint
from dnb_edge.web.static_files import FOLDER

WHO_MAY = """
all    GET    /
all    GET    /api/v1/disk
all    POST   /api/v1/login
change POST   /api/v1/logout
all    GET    /api/v1/openapi.json
change GET    /api/v1/picture.jpg
change POST   /api/v1/race/aim
change POST   /api/v1/race/new
all    GET    /api/v1/runs
change DELETE /api/v1/runs/{run_id}
all    GET    /api/v1/runs/{run_id}
change PATCH  /api/v1/runs/{run_id}
change GET    /api/v1/runs/{run_id}/edits
change POST   /api/v1/runs/{run_id}/edits
change GET    /api/v1/runs/{run_id}/incidents/{car}/{number}.jpg
all    GET    /api/v1/runs/{run_id}/laps
change GET    /api/v1/runs/{run_id}/passes
change GET    /api/v1/runs/{run_id}/passes/{number}.jpg
all    GET    /api/v1/runs/{run_id}/picture.jpg
all    GET    /api/v1/runs/{run_id}/recording.mcap
all    GET    /api/v1/runs/{run_id}/recording.zip
all    GET    /api/v1/runs/{run_id}/report.html
all    GET    /api/v1/sessions/{session_id}.zip
change DELETE /api/v1/setup
change GET    /api/v1/setup
change PUT    /api/v1/setup/camera
change PUT    /api/v1/setup/keypoints
change PUT    /api/v1/setup/lane
change PUT    /api/v1/setup/lines
change GET    /api/v1/setup/look
change DELETE /api/v1/setup/model
change PUT    /api/v1/setup/model
change PUT    /api/v1/setup/model/card
change POST   /api/v1/setup/photo
change PUT    /api/v1/setup/photo
change GET    /api/v1/setup/picture.jpg
change PUT    /api/v1/setup/route
change POST   /api/v1/setup/save
change GET    /api/v1/setup/sigma.png
change GET    /api/v1/setup/teach
change POST   /api/v1/setup/twin
change PUT    /api/v1/setup/twin
change GET    /api/v1/setup/twin.png
all    GET    /api/v1/state
all    GET    /api/v1/table
all    GET    /login
all    GET    /overlay
all    GET    /projector
all    GET    /runs
all    GET    /runs/{run_id}
change GET    /runs/{run_id}/judge
change GET    /setup
all    GET    /static/{name}
"""
"""Every address with its method and who may. Whoever adds one writes it down here, and thinks about the middle column."""

TABLE = [tuple(line.split()) for line in WHO_MAY.strip().splitlines()]
CHANGES = {"POST", "PUT", "PATCH", "DELETE"}
REFUSALS = {"no-session", "no-token", "foreign-origin", "foreign-host"}


@pytest.fixture(scope="module")
def app(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return app_in(tmp_path_factory.mktemp("box"))


@pytest.fixture(scope="module")
def stranger(app: Any) -> TestClient:
    return visitor(app)


@pytest.fixture(scope="module")
def known(app: Any) -> tuple[TestClient, str]:
    client = visitor(app)
    return client, log_in(client)


def ask(client: TestClient, method: str, path: str, **headers: str) -> str:
    """Why the guard refuses: its error's code, `login` for a redirection there, or `passed`."""
    answer = client.request(method, re.sub(r"\{\w+\}", "nothing", path), headers=headers)
    if answer.status_code == 303 and answer.headers["location"].startswith("/login?"):
        return "login"
    if answer.status_code < 400:
        return "passed"
    if answer.headers["content-type"] == "application/json":
        code = answer.json()["error"]["code"]
    else:
        code = re.findall(r"\d{3} ([a-z-]+)</p>", answer.text)[0]
    return code if code in REFUSALS else "passed"


def test_every_address_stands_in_the_table(app: Any) -> None:
    """An address that the table here does not have, or has with another access, fails this test."""
    real = sorted((endpoint.access.value, endpoint.method, endpoint.path) for endpoint in app.state.table)
    assert real == sorted(TABLE)


def test_every_route_is_made_of_the_table(app: Any) -> None:
    """Nothing is reachable that is not an endpoint, but the one WebSocket."""
    assert {route.path for route in app.routes} == {path for _, _, path in TABLE} | {LIVE}


@pytest.mark.parametrize(("access", "method", "path"), TABLE)
class TestAccess:
    """Each address for each kind of visitor."""

    def test_nobody_watches_only(self, stranger: TestClient, access: str, method: str, path: str) -> None:
        """Without a session: what all may, and nothing else; pages lead to the log-in."""
        wanted = "passed" if access == "all" else "no-session" if path.startswith("/api/") else "login"
        assert ask(stranger, method, path) == wanted

    def test_a_session_alone_changes_nothing(self, known: Any, access: str, method: str, path: str) -> None:
        """With the cookie that browsers send by themselves, and without the token."""
        wanted = "no-token" if method in CHANGES and access == "change" else "passed"
        assert ask(known[0], method, path) == wanted

    def test_a_wrong_token_changes_nothing(self, known: Any, access: str, method: str, path: str) -> None:
        """With the cookie and somebody else's token."""
        wanted = "no-token" if method in CHANGES and access == "change" else "passed"
        assert ask(known[0], method, path, **{"X-CSRF-Token": "x" * 43}) == wanted

    def test_a_foreign_origin_changes_nothing(self, known: Any, access: str, method: str, path: str) -> None:
        """Even with session and token: a page of another site, or of another port of this box."""
        client, token = known
        wanted = "foreign-origin" if method in CHANGES else "passed"
        for origin in ("http://evil.example", "http://localhost:81", "https://localhost", "null"):
            assert ask(client, method, path, **{"X-CSRF-Token": token, "Origin": origin}) == wanted

    def test_a_foreign_host_reaches_nothing(self, known: Any, access: str, method: str, path: str) -> None:
        """Even with session and token: a name that somebody has made to point at the box."""
        client, token = known
        assert ask(client, method, path, **{"X-CSRF-Token": token, "Host": "evil.example"}) == "foreign-host"

    def test_session_and_token_pass(self, app: Any, access: str, method: str, path: str) -> None:
        """Whoever has both is let through, to be told by the endpoint itself what is missing."""
        client = visitor(app)
        token = log_in(client)
        assert ask(client, method, path, **{"X-CSRF-Token": token, "Origin": HOST}) == "passed"


def test_two_endpoints_of_one_method_and_address_are_a_mistake() -> None:
    """One of them would never be reached."""

    async def handler(_request: Any) -> Any: ...

    one = Endpoint(method="GET", path="/x", access=Access.ALL, handler=handler, summary="x")
    with pytest.raises(ValueError, match="GET /x stands twice"):
        list(routes([one, one]))


@pytest.mark.parametrize(
    ("method", "path", "status", "kind"),
    [
        ("GET", "/nothing", 404, "text/html; charset=utf-8"),
        ("GET", "/api/v1/nothing", 404, "application/json"),
        ("GET", "/api/v2/state", 404, "application/json"),
        ("POST", "/", 405, "text/html; charset=utf-8"),
        ("DELETE", "/api/v1/state", 405, "application/json"),
        ("OPTIONS", "/api/v1/login", 405, "application/json"),
        ("TRACE", "/api/v1/state", 405, "application/json"),
        ("PROPFIND", "/login", 405, "text/html; charset=utf-8"),
        ("GET", "/login/", 404, "text/html; charset=utf-8"),
        ("GET", "/login?" + "x" * 3000, 414, "text/html; charset=utf-8"),
    ],
)
def test_what_there_is_not(stranger: TestClient, method: str, path: str, status: int, kind: str) -> None:
    """Refusals are JSON in the API and pages elsewhere; a wrong method tells the right ones."""
    answer = stranger.request(method, path)
    assert (answer.status_code, answer.headers["content-type"]) == (status, kind)
    assert ("Allow" in answer.headers) == (status == 405)
    if kind == "application/json":
        assert answer.json()["error"].keys() == {"code", "text"}


def test_head_is_answered_like_get(stranger: TestClient) -> None:
    """Where there is GET there is HEAD."""
    assert stranger.head("/login").status_code == 200
    assert stranger.head("/api/v1/login").status_code == 405


@pytest.mark.parametrize("path", ["/login", "/api/v1/state", "/static/login.js", "/nothing", "/api/v1/nothing"])
@pytest.mark.parametrize("host", ["localhost", "evil.example"])
def test_every_answer_is_strict(stranger: TestClient, path: str, host: str) -> None:
    """Good or bad, page or JSON, from the guard or from behind it: the same headers, and no word of other origins."""
    headers = stranger.get(path, headers={"Host": host, "Origin": "http://evil.example"}).headers
    policy = headers["content-security-policy"]
    assert "default-src 'self'" in policy
    assert "img-src 'self' data: blob:" in policy
    assert "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "same-origin"
    assert headers["x-frame-options"] == "DENY"
    assert not [name for name in headers if name.startswith("access-control-")]


def test_an_unforeseen_failure_shows_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An error that nobody expected is a plain 500 with the same strict headers, and no trace of the program."""

    async def broken(_self: Any, _request: Any) -> Any:
        raise ZeroDivisionError("secret")

    monkeypatch.setattr(race.Race, "state", broken)
    answer = visitor(app_in(tmp_path)).get("/api/v1/state")
    assert answer.status_code == 500
    assert answer.json()["error"]["code"] == "internal"
    assert "secret" not in answer.text
    assert "Traceback" not in answer.text
    assert "default-src 'self'" in answer.headers["content-security-policy"]


class Found(HTMLParser):
    """The addresses that a page refers to, and what of it the policy would not run."""

    def __init__(self) -> None:
        super().__init__()
        self.loaded: list[str] = []
        self.linked: list[str] = []
        self.inline: list[str] = []
        self._script = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Notes what the element loads or links."""
        found = dict(attrs)
        for name in ("src", "href", "data", "poster", "action"):
            address = found.get(name)
            if address is not None:
                (self.linked if tag in {"a", "form"} else self.loaded).append(address)
        self.inline += [name for name in found if name.startswith("on") or name == "style"]
        if tag == "style" or (tag == "script" and "src" not in found):
            self.inline.append(tag)


PAGES = [path for access, method, path in TABLE if method == "GET" and not path.startswith(("/api/", "/static/"))]


@pytest.mark.parametrize("path", PAGES)
def test_pages_need_nobody_else(known: Any, path: str) -> None:
    """Each page, its style and its scripts come from the box, in 200 kB or less, with nothing inline; they all exist."""
    client, _ = known
    page = client.get(re.sub(r"\{\w+\}", "nothing", path))
    seen, todo, size = set(), [], len(page.content)
    found = Found()
    found.feed(page.text)
    assert found.inline == []
    assert not [address for address in found.linked if re.match(r"\w+:|//", address)]
    todo = [address for address in found.loaded if address != "data:,"]
    while todo:
        address = todo.pop()
        assert address.startswith("/"), f"{path} asks for {address}"
        if address in seen or not address.startswith("/static/"):
            continue
        seen.add(address)
        answer = client.get(address, headers={"Accept-Encoding": "gzip"})
        assert answer.status_code == 200, f"{path} asks for {address}, which is not there"
        size += int(answer.headers["content-length"])
        todo += [f"/static/{name}" for name in re.findall(r"""from\s+["']\./([^"']+)["']""", answer.text)]
    assert size <= 200_000


def test_no_file_of_ours_asks_another_host() -> None:
    """No static file holds an address of another machine but XML's names and comments' references."""
    for path in FOLDER.iterdir():
        if path.suffix in {".js", ".css"}:
            code = re.sub(r"/\*.*?\*/|(?<!:)//[^\n]*", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
            others = [
                url for url in re.findall(r"(?:https?:)?//[a-z0-9.-]+\.[a-z]{2,}", code) if "www.w3.org" not in url
            ]
            assert others == [], path.name


def test_files_are_kept_by_browsers_as_long_as_they_are_the_same(stranger: TestClient) -> None:
    """With its content's hash a file is kept for good; without, it is asked for again and answered with 304."""
    page = stranger.get("/login").text
    (address,) = re.findall(r'"(/static/login\.js\?v=[0-9a-f]{12})"', page)
    assert "immutable" in stranger.get(address).headers["cache-control"]
    plain = stranger.get("/static/login.js")
    assert plain.headers["cache-control"] == "no-cache"
    again = stranger.get("/static/login.js", headers={"If-None-Match": plain.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    assert stranger.get("/static/login.js?v=000000000000").headers["cache-control"] == "no-cache"
