"""The hub's page in a real browser: it renews itself, says where the hub is away, and can be used by everybody."""

import shutil

import pytest
from axe_playwright_python.sync_playwright import Axe
from fleet_rig import TOPICS, lap
from playwright.sync_api import expect, sync_playwright

from dnb_edge import wire
from dnb_edge.fleet.hub import Hub
from dnb_edge.fleet.messages import BoxState, Parcel, Status, encode
from dnb_edge.fleet.pages import make_app
from dnb_edge.fleet.serve import PageServer
from dnb_edge.fleet.store import Store

PROGRAM = shutil.which("chromium")


class NoLine:
    """A line on which nothing is heard."""

    def publish(self, topic, payload, *, retain=False, qos=1):
        pass


def hear(hub: Hub, kind: str, message) -> None:
    hub.heard(NoLine(), f"dnb-edge/box/north/{kind}", encode(message), retained=False)
    hub.turn(NoLine())


def race(hub: Hub, number: int) -> None:
    event = {"event": "lap", **wire.to_dict(lap(number))}
    hear(hub, "parcel", Parcel(queue="q", number=number, first=1, run="r", track="t", wall_s=1.0, event=event))


@pytest.mark.skipif(PROGRAM is None, reason="no Chromium on this machine: apt install chromium")
def test_the_page_renews_itself_and_says_where_the_hub_is_away(tmp_path):
    """A lap appears without a reload; nothing breaks a rule of accessibility, light or dark; no script complains."""
    store = Store(tmp_path / "hub.sqlite")
    hub = Hub(topics=TOPICS, store=store, say=lambda words: None)
    hub.greeted(NoLine())
    hear(hub, "status", Status(online=True))
    hear(hub, "state", BoxState(phase="racing", reason="a reason", track="oval", health={"warnings": ["it is hot"]}))
    race(hub, 1)
    complaints: list[str] = []
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=PROGRAM, args=["--no-sandbox", "--disable-gpu"])
        with PageServer(make_app(hub, store), host="127.0.0.1", port=0) as server:
            page = browser.new_page(color_scheme="dark")
            page.on("pageerror", lambda error: complaints.append(str(error)))
            page.on("console", lambda message: complaints.append(message.text))
            page.goto(server.address)
            expect(page.locator("tbody tr")).to_have_count(1)
            race(hub, 2)
            expect(page.locator("tbody tr")).to_have_count(2, timeout=10_000)
            for scheme in ("dark", "light"):
                page.emulate_media(color_scheme=scheme)
                found = Axe().run(page)
                assert found.violations_count == 0, found.generate_report()
            assert complaints == []
        expect(page.locator("#stale")).to_be_visible(timeout=10_000)
        browser.close()
    store.close()
