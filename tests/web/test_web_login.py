"""The set-up code and the sessions: who gets one, how often one may guess, when it is over."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient
from web_box import app_in, codes, log_in, visitor

from dnb_edge.live.messages import Phase, Picture, State, Told
from dnb_edge.web.endpoint import Refused
from dnb_edge.web.login import safe_next
from dnb_edge.web.sessions import CODE_USES, COOKIE, IDLE_S, MOST_SESSIONS, MOST_WRONG, Sessions, SetupCode, spaced

LOGIN = "/api/v1/login"


class Display:
    """A daemon that shows what it is asked to."""

    epoch = "epoch"
    state = State(phase=Phase.RACING)

    def __init__(self) -> None:
        self.asked: list[dict[str, Any]] = []
        self.refuses = False

    def events(self, since: int | None = None) -> tuple[Told, ...]:
        return ()

    first = 0

    async def follow(self) -> AsyncIterator[Told | State | None]:
        await asyncio.Event().wait()
        yield None

    async def picture(self, *, newer_than_ns: int | None = None, timeout_s: float = 5.0) -> Picture:
        raise NotImplementedError

    async def ask(self, **what: Any) -> None:
        if self.refuses:
            raise Refused(503, "daemon-down", "It is not there yet.")
        self.asked.append(what)


@pytest.fixture
def clock() -> list[float]:
    return [1000.0]


@pytest.fixture
def client(tmp_path: Path, clock: list[float]) -> TestClient:
    return visitor(app_in(tmp_path, clock_s=lambda: clock[0]))


def guess(client: TestClient, code: str = "00000000") -> int:
    return int(client.post(LOGIN, json={"code": code}).status_code)


def test_the_code_is_shown_and_logged_when_the_page_is_opened(tmp_path: Path) -> None:
    """Not before; on the displays for two minutes, and at most every ten seconds however often the page is opened."""
    daemon, now_s = Display(), [0.0]
    client = visitor(app_in(tmp_path, daemon=daemon, clock_s=lambda: now_s[0]))
    client.get("/")
    assert daemon.asked == []
    with codes() as heard:
        for _ in range(5):
            client.get("/login")
    (code,) = set(heard)
    assert re.fullmatch(r"\d{4} \d{4}", code)
    assert daemon.asked == [{"show": f"set-up code {code}", "for_s": 120.0}]
    now_s[0] = 11.0
    client.get("/login")
    assert len(daemon.asked) == 2


def test_nobody_covers_a_display_for_long(tmp_path: Path) -> None:
    """One address has the code shown three times in ten minutes, for two each; another one still has it shown."""
    daemon, now_s = Display(), [0.0]
    app = app_in(tmp_path, daemon=daemon, clock_s=lambda: now_s[0])
    client = visitor(app)
    for _ in range(20):
        now_s[0] += 11.0
        page = client.get("/login").text
        # The display shows it still from before.
        assert ("notice--warn" in page) == (now_s[0] >= 33.0 + 120.0)
    assert len(daemon.asked) == 3
    other = TestClient(app, base_url="http://localhost", client=("192.168.1.7", 1))
    now_s[0] += 11.0
    assert "notice--warn" not in other.get("/login").text
    assert len(daemon.asked) == 4


def test_tries_while_no_display_is_there_do_not_count(tmp_path: Path) -> None:
    """Whoever opens the page again and again while the box starts up sees the code as soon as a display can show it."""
    daemon, now_s = Display(), [0.0]
    client = visitor(app_in(tmp_path, daemon=daemon, clock_s=lambda: now_s[0]))
    daemon.refuses = True
    for _ in range(5):
        now_s[0] += 11.0
        assert "notice--warn" in client.get("/login").text
    daemon.refuses = False
    assert "notice--warn" not in client.get("/login").text


def test_who_has_logged_in_has_no_code_shown(tmp_path: Path) -> None:
    """It would cover the laps for nothing."""
    daemon, now_s = Display(), [0.0]
    client = visitor(app_in(tmp_path, daemon=daemon, clock_s=lambda: now_s[0]))
    log_in(client)
    asked = len(daemon.asked)
    now_s[0] = 11.0
    assert "You are logged in" in client.get("/login").text
    assert len(daemon.asked) == asked


def test_nobody_floods_the_log(client: TestClient) -> None:
    """So many lines at once, then one every ten seconds."""
    with codes() as heard:
        for _ in range(100):
            client.get("/login")
    assert len(heard) == 60


def test_without_a_daemon_the_page_says_where_the_code_is(client: TestClient) -> None:
    """The displays cannot show it, the log has it."""
    with codes() as heard:
        assert "journalctl" in client.get("/login").text
    assert len(heard) == 1


def test_no_answer_has_the_code(client: TestClient) -> None:
    """Whoever sees only what the box sends does not learn it."""
    with codes() as heard:
        page = client.get("/login").text
    plain = heard[0].replace(" ", "")
    assert plain not in page + client.get("/api/v1/state").text + client.post(LOGIN, json={"code": "1"}).text


def test_the_cookie_is_strict(client: TestClient) -> None:
    """HttpOnly, SameSite=Strict, for twelve hours; Secure where the page came by https."""
    with codes() as heard:
        client.get("/login")
    plain = client.post(LOGIN, json={"code": heard[-1]}).headers["set-cookie"]
    assert f"{COOKIE}=" in plain
    for part in ("HttpOnly", "SameSite=strict", "Path=/", "Max-Age=43200"):
        assert part in plain
    assert "Secure" not in plain
    secure = client.post(f"https://localhost{LOGIN}", json={"code": heard[-1]}).headers["set-cookie"]
    assert "Secure" in secure


def test_three_wrong_codes_a_minute(client: TestClient, clock: list[float]) -> None:
    """The fourth is not looked at, be it right; a minute later it is."""
    with codes() as heard:
        client.get("/login")
    assert [guess(client) for _ in range(4)] == [401, 401, 401, 429]
    assert guess(client, heard[-1]) == 429
    clock[0] += 61.0
    assert guess(client, heard[-1]) == 200


def test_ten_wrong_codes_an_hour(client: TestClient, clock: list[float]) -> None:
    """However they are spread."""
    tries = []
    for _ in range(11):
        tries.append(guess(client))
        clock[0] += 61.0
    assert tries == [401] * 10 + [429]
    assert int(client.post(LOGIN, json={"code": "1"}).headers["retry-after"]) > 2000
    clock[0] += 3600.0
    assert guess(client) == 401


@pytest.mark.parametrize("address", ["10.0.{}.{}", "2001:db8:{}:{}::1"])
def test_many_addresses_together_guess_no_faster(tmp_path: Path, clock: list[float], address: str) -> None:
    """Thirty wrong codes a minute and two hundred an hour of everybody; then a fresh address waits too, with the right one."""
    app = app_in(tmp_path, clock_s=lambda: clock[0])
    with codes() as heard:
        visitor(app).get("/login")

    def tries(number: int, code: str = "00000000") -> int:
        client = TestClient(app, base_url="http://localhost", client=(address.format(number // 250, number % 250), 1))
        return guess(client, code)

    assert [tries(number) for number in range(31)] == [401] * 30 + [429]
    assert tries(1000, heard[-1]) == 429
    number = 31
    for _ in range(10):
        clock[0] += 61.0
        for _ in range(20):
            tries(number)
            number += 1
    clock[0] += 61.0
    assert tries(2000) == 429
    clock[0] += 3600.0
    assert tries(2001) == 401


@pytest.mark.parametrize(
    "body", [{}, {"code": 12345678}, {"code": None}, {"code": "1" * 65}, {"code": "1", "more": 1}, [], "x"]
)
def test_malformed_log_ins(client: TestClient, body: Any) -> None:
    """Refused before the code is looked at."""
    assert client.post(LOGIN, json=body).status_code == 422


def test_logging_out_ends_the_session(client: TestClient) -> None:
    """For the cookie, and for whoever has copied it."""
    token = log_in(client)
    kept = client.cookies[COOKIE]
    assert client.post("/api/v1/logout", headers={"X-CSRF-Token": token}).status_code == 200
    assert COOKIE not in client.cookies
    client.cookies.set(COOKIE, kept)
    assert client.post("/api/v1/logout", headers={"X-CSRF-Token": token}).status_code == 401


def test_a_session_ends_after_twelve_hours_without_use(client: TestClient, clock: list[float]) -> None:
    """Use prolongs it."""
    log_in(client)
    for _ in range(3):
        clock[0] += IDLE_S - 1.0
        assert client.get("/api/v1/picture.jpg").status_code == 503
    clock[0] += IDLE_S + 1.0
    assert client.get("/api/v1/picture.jpg").status_code == 401


def test_each_page_keeps_the_browser_logged_in(client: TestClient) -> None:
    """Its cookie, with all its guards, lasts from the last page on, as the session does; without a session none is set."""
    assert "set-cookie" not in client.get("/login").headers
    log_in(client)
    again = client.get("/login").headers["set-cookie"]
    for part in (f"{COOKIE}={client.cookies[COOKIE]}", "HttpOnly", "SameSite=strict", "Path=/", "Max-Age=43200"):
        assert part in again


def test_a_page_has_its_sessions_token(client: TestClient) -> None:
    """In its head, for the scripts; without a session there is none."""
    assert 'name="csrf"' not in client.get("/login").text
    token = log_in(client)
    assert f'<meta name="csrf" content="{token}">' in client.get("/login").text


@pytest.mark.parametrize(
    "cookie", ["", "x", "=", "a=b; c", f"{COOKIE}=", f"{COOKIE}=x; {COOKIE}=y", "\x01=2", "é=1", "a" * 5000]
)
def test_any_other_cookie_is_nobody(client: TestClient, cookie: str) -> None:
    """Made-up and malformed ones."""
    assert client.get("/api/v1/picture.jpg", headers={"Cookie": cookie.encode("latin-1")}).status_code == 401


def test_codes_are_compared_whole() -> None:
    """With spaces and hyphens as people type them; nothing shorter, longer or of other digits."""
    code = SetupCode()
    now = code.now(0.0)
    for typed in (now, spaced(now), f" {now[:2]}-{now[2:]} "):
        assert code.accepts(typed, 0.0)
    other = "0" if now[-1] != "0" else "1"
    for typed in (
        "",
        now[:-1],
        now + "0",
        now[:-1] + other,
        "٣" * 8,
        "é",
        "\ud800".encode("utf-8", "replace").decode(),
    ):
        assert not code.accepts(typed, 0.0)


def test_a_code_wears_out() -> None:
    """After so many uses, hours or wrong guesses there is another one."""
    code = SetupCode()
    first = code.now(1.0)
    assert all(code.accepts(first, 1.0) for _ in range(CODE_USES))
    second = code.now(1.0)
    assert second != first
    assert code.now(IDLE_S) == second
    third = code.now(IDLE_S + 2.0)
    assert third != second
    for _ in range(MOST_WRONG):
        code.accepts("", IDLE_S + 3.0)
    assert code.now(IDLE_S + 3.0) != third


def test_cookies_are_kept_nowhere() -> None:
    """Only their hash; and no more sessions than so many."""
    sessions = Sessions()
    session, cookie = sessions.begin(0.0)
    assert sessions.find(cookie, 1.0) is session
    assert cookie not in repr(vars(sessions))
    for _ in range(MOST_SESSIONS):
        sessions.begin(2.0)
    assert sessions.find(cookie, 3.0) is None


@pytest.mark.parametrize(
    ("address", "wanted"),
    [
        ("/setup", "/setup"),
        ("/runs/x/judge", "/runs/x/judge"),
        (None, "/"),
        ("", "/"),
        ("setup", "/"),
        ("//evil.example", "/"),
        ("/\\evil.example", "/"),
        ("https://evil.example", "/"),
        ("javascript:alert(1)", "/"),
        ("/\t/evil.example", "/"),
        ("/\n/evil.example", "/"),
        ("/login?next=/", "/"),
    ],
)
def test_the_way_on_stays_on_the_box(address: str | None, wanted: str) -> None:
    """A link to the log-in page leads to no other site."""
    assert safe_next(address) == wanted
