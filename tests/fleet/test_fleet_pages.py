"""The hub's pages and JSON: what they show, to whom, and that nothing that boxes or browsers send gets through them."""

import re

import pytest
from fleet_rig import TOPICS, lap
from starlette.testclient import TestClient

from dnb_edge import wire
from dnb_edge.fleet.hub import Hub
from dnb_edge.fleet.messages import BoxState, Parcel, Status, encode
from dnb_edge.fleet.pages import FILES, make_app
from dnb_edge.fleet.store import Store


class NoLine:
    """A line on which nothing is heard."""

    def publish(self, topic, payload, *, retain=False, qos=1):
        pass


class Clock:
    def __init__(self) -> None:
        self.now_s = 1_000_000.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def store(tmp_path):
    made = Store(tmp_path / "hub.sqlite")
    yield made
    made.close()


@pytest.fixture
def hub(store, clock):
    made = Hub(topics=TOPICS, store=store, say=lambda words: None, wall_s=clock)
    made.greeted(NoLine())
    return made


@pytest.fixture
def browser(hub, store, clock):
    return TestClient(make_app(hub, store, wall_s=clock, names=("hub.example",)), base_url="http://localhost")


def hear(hub: Hub, box: str, *messages) -> None:
    for message in messages:
        kind = {Status: "status", BoxState: "state", Parcel: "parcel"}[type(message)]
        hub.heard(NoLine(), f"dnb-edge/box/{box}/{kind}", encode(message), retained=False)
    hub.turn(NoLine())


def parcels(count: int, **changes) -> list[Parcel]:
    return [
        Parcel(
            queue="q", number=number, first=1, run="run-1", track="oval", wall_s=5.0,
            event={"event": "lap", **wire.to_dict(lap(number)), **changes},
        )
        for number in range(1, count + 1)
    ]  # fmt: skip


STANDINGS = {"rows": [{"place": 1, "name": "Ada", "laps": 3, "best_lap_s": 12.5}]}
STATE = BoxState(
    phase="racing", track="oval", run="run-1", standings=STANDINGS, health={"fps": 30.0, "warnings": ["it is hot"]}
)


def test_a_box_is_shown_with_what_it_does(hub, browser):
    """Its state, health, standings, laps, on both pages."""
    hear(hub, "north", Status(online=True), STATE, *parcels(3))
    for path in ("/", "/box/north"):
        page = browser.get(path).text
        for text in (
            "north",
            "racing",
            "oval",
            "it is hot",
            "30.0",
            "Ada",
            "12.500 s",
            "1.000 s",
            "91.50 %",
            "valid",
            "run-1",
        ):
            assert text in page, (path, text)
    assert browser.get("/box/south").status_code == 404


@pytest.mark.parametrize(
    ("messages", "later_s", "words"),
    [
        ([STATE], 0, "not heard since the hub is on the line"),
        ([Status(online=True), STATE], 0, "racing"),
        ([Status(online=True), STATE], 30, "offline: silent"),
        ([Status(online=False), STATE], 0, "offline<"),
        ([Status(online=False, reason="stopped"), STATE], 0, "offline: stopped"),
        ([Status(online=True), BoxState(phase=None, reason="no dnb-edge answers")], 0, "its race does not answer"),
        ([Status(online=True), BoxState(phase="fault", reason="no camera")], 0, "no camera"),
    ],
)
def test_whether_a_box_is_there_is_told(messages, later_s, words, hub, browser, clock):
    """By its status, and by its state, which comes every five seconds from whoever is there."""
    hear(hub, "north", *messages)
    clock.now_s += later_s
    assert words in browser.get("/").text


def test_a_hub_that_is_off_the_line_says_so(hub, browser):
    """And of no box that it is there."""
    hear(hub, "north", Status(online=True), STATE)
    hub.broken("mqtt://host:1883: connection refused")
    page = browser.get("/").text
    assert "The hub is not on the line: mqtt://host:1883: connection refused" in page
    assert "not heard since" in page
    assert browser.get("/api/v1/boxes").json()["trouble"] == "mqtt://host:1883: connection refused"


def test_the_api_gives_laps_and_events_piece_by_piece(hub, browser):
    """Newest laps first, events from an id on; whoever reads on misses none and gets none twice."""
    hear(hub, "north", Status(online=True), STATE, *parcels(5))
    hear(hub, "south", *parcels(2))
    first = browser.get("/api/v1/laps", params={"box": "north", "limit": 2}).json()["laps"]
    assert [one["event"]["number"] for one in first] == [5, 4]
    more = browser.get("/api/v1/laps", params={"box": "north", "before": first[-1]["id"]}).json()["laps"]
    assert [one["event"]["number"] for one in more] == [3, 2, 1]
    seen, after = [], 0
    while found := browser.get("/api/v1/events", params={"after": after, "limit": 3}).json()["events"]:
        seen += [(one["box"], one["event"]["number"]) for one in found]
        after = found[-1]["id"]
    assert seen == [("north", n) for n in range(1, 6)] + [("south", 1), ("south", 2)]
    boxes = browser.get("/api/v1/boxes").json()["boxes"]
    assert [(one["name"], one["online"], one["laps"]) for one in boxes] == [("north", True, 5), ("south", None, 2)]
    for wrong in ("limit=x", "before=-1", "nonsense=1", "after=1.5", "limit=9999999999999999999"):
        assert browser.get(f"/api/v1/laps?{wrong}").status_code == 400, wrong


def test_nothing_that_a_box_says_becomes_part_of_the_page(hub, browser):
    """Escaped, whatever the member; of any type, the page is made."""
    evil = "<script>alert(1)</script>"
    state = BoxState(
        phase=evil,
        reason=evil,
        run=evil,
        track=evil,
        standings={"rows": [{"name": evil}, 3]},
        health={"warnings": [evil]},
    )
    hear(
        hub,
        "north",
        Status(online=True),
        state,
        *parcels(1, time_s="x", valid="yes", reasons=3, car=[evil], sigma_s=None),
    )
    for health in ({"warnings": 3, "fps": "x", "disk_free_bytes": None}, {"fps": True, "latency_ms": [1]}):
        hear(hub, "south", Status(online=True), BoxState(phase="racing", health=health, standings={"rows": 3}))
        for path in ("/", "/box/north", "/box/south"):
            answer = browser.get(path)
            assert (answer.status_code, "<script>alert" in answer.text) == (200, False)


@pytest.mark.parametrize(
    ("topic", "payload"),
    [
        ("dnb-edge/box/north/parcel", b"x"),
        ("dnb-edge/box/north/parcel", b"[" * 70_000),
        ("dnb-edge/box/north/parcel", b'{"queue": "q", "number": 1}'),
        ("dnb-edge/box/north/parcel", encode(parcels(1)[0]).replace(b"91.5", b"Infinity")),
        ("dnb-edge/box/north/parcel", b" " * 66_000 + encode(parcels(1)[0])),
        ("dnb-edge/box/north/parcel", encode(parcels(1)[0]).replace(b"oval", rb"\ud800")),
        ("dnb-edge/box/north/status", b'{"online": "yes"}'),
        ("dnb-edge/box/north/state", b"\xff\xfe"),
        ("dnb-edge/hub/status", b"{"),
    ],
)
def test_nonsense_on_a_topic_is_counted_and_nothing_else(topic, payload, hub, browser):
    """It neither ends the hub nor comes into the store."""
    hub.heard(NoLine(), topic, payload, retained=False)
    hub.turn(NoLine())
    found = browser.get("/api/v1/boxes").json()
    assert (found["nonsense"], found["boxes"]) == (1, [])


@pytest.mark.parametrize(
    "topic", ["dnb-edge/box/.hidden/parcel", "dnb-edge/box/a b/state", "other/box/a/state", "dnb-edge/box//state"]
)
def test_a_topic_of_no_box_is_passed_over(topic, hub, browser):
    """A name that no box can have is never shown."""
    hub.heard(NoLine(), topic, encode(STATE), retained=False)
    hub.turn(NoLine())
    assert browser.get("/api/v1/boxes").json()["boxes"] == []


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("localhost:8090", 200),
        ("127.0.0.1", 200),
        ("hub.example", 200),
        ("evil.example", 421),
        ("8.8.8.8", 421),
        ("", 421),
    ],
)
def test_a_foreign_name_is_not_answered(host, status, browser):
    """A page of another site may have a name of its own lead here."""
    assert browser.get("/api/v1/boxes", headers={"host": host}).status_code == status


def test_the_pages_are_to_look_at_only_and_closed(browser):
    """No other method, no file but those named, nothing from elsewhere, strict headers on every answer."""
    for method in ("POST", "PUT", "DELETE", "PATCH"):
        assert browser.request(method, "/api/v1/boxes").status_code == 405
    assert browser.get("/static/../pages.py").status_code == 404
    page = browser.get("/")
    assert page.headers["content-security-policy"].startswith("default-src 'self'")
    assert page.headers["x-frame-options"] == "DENY"
    assert not re.search(r'(?:src|href)="(?!/|data:,|#)', page.text)
    assert not re.search(r"<script(?![^>]*src=)|style=|\son\w+=", page.text)
    for name in FILES:
        assert browser.get(f"/static/{name}").status_code == 200
