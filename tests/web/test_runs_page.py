"""The recordings' pages in a real browser: found, named, compared, taken and deleted, by mouse and by keyboard."""

from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import expect
from running_box import chromium
from runs_made import Racing, guest, record
from web_box import codes, served

from dnb_edge.web.app import make_app
from dnb_edge.web.guard_rates import Limits

PHONE = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}
DESK = {"viewport": {"width": 1280, "height": 800}, "color_scheme": "dark"}
ONE = "run-0000000a-0001.mcap"
TWO = "run-0000000a-0002.mcap"


@pytest.fixture
def page(tmp_path: Path, request: pytest.FixtureRequest):
    """A page on two recordings, logged in, that remembers what went wrong in it."""
    runs = tmp_path / "runs"
    record(runs, 2.5, 2.8, name=ONE, entry="alpha <b>net</b>", session="spring")
    record(runs, 2.6, 2.7, name=TWO, entry="beta", session="spring")
    app = make_app(guest(tmp_path).settings, daemon=Racing(), limits=Limits(per_s=0))
    expect.set_options(timeout=30_000)
    with served(app) as port, chromium() as browser:
        context = browser.new_context(base_url=f"http://localhost:{port}", accept_downloads=True, **request.param)
        page = context.new_page()
        wrong: list[str] = []
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("console", lambda line: wrong.append(line.text) if line.type == "error" else None)
        with codes() as heard:
            page.goto("/login?next=/runs")
        page.locator("input").first.fill(heard[-1])
        page.keyboard.press("Enter")
        page.wait_for_url("**/runs")
        yield page
        assert wrong == []
        context.close()


def no_serious_finding(page) -> None:
    found = Axe().run(page).response["violations"]
    assert [(one["id"], one["nodes"][0]["html"]) for one in found if one["impact"] in {"serious", "critical"}] == []


@pytest.mark.parametrize("page", [PHONE, DESK], indirect=True, ids=["phone", "desk"])
def test_from_the_list_home(page, tmp_path: Path) -> None:
    """Find a recording, name it in place, compare both, take one; what an entry is called is text wherever it stands."""
    expect(page.locator("h2", has_text="alpha <b>net</b>")).to_be_visible()
    page.fill("#text", "nobody")
    expect(page.get_by_text("Nothing passes this filter.")).to_be_visible()
    page.fill("#text", "BETA")
    expect(page.locator(".runs-card")).to_have_count(1)
    page.get_by_role("button", name="Rename beta").press("Enter")
    page.keyboard.type("Final ☃")
    page.keyboard.press("Enter")
    expect(page.locator("h2", has_text="Final ☃")).to_be_visible()
    page.get_by_role("button", name="Pin", exact=True).click()
    expect(page.get_by_role("button", name="Pinned", exact=True)).to_be_visible()
    assert (tmp_path / "runs" / "run-0000000a-0002.pin").exists()
    page.fill("#text", "")
    expect(page.locator(".runs-card")).to_have_count(2)
    no_serious_finding(page)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "nothing sticks out"
    page.click("#choose-all")
    page.get_by_role("button", name="Table of 2 runs").click()
    expect(page.locator("#table tbody tr")).to_have_count(2)
    no_serious_finding(page)
    page.keyboard.press("Escape")
    with page.expect_download() as taken:
        page.get_by_role("link", name="Download Final ☃").click()
    assert taken.value.suggested_filename == TWO
    assert Path(taken.value.path()).read_bytes() == (tmp_path / "runs" / TWO).read_bytes()


@pytest.mark.parametrize("page", [PHONE], indirect=True, ids=["phone"])
def test_one_recording(page, tmp_path: Path) -> None:
    """Its laps with the best one, its report in a window of its own, and its end once its file's name was typed."""
    page.get_by_role("link", name="alpha <b>net</b>", exact=True).click()
    expect(page.locator("#laps tr.is-best")).to_have_count(1)
    no_serious_finding(page)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "nothing sticks out"
    with page.context.expect_page() as opened:
        page.get_by_role("link", name="Report").click()
    expect(opened.value.locator("h1", has_text="alpha <b>net</b>")).to_be_visible()
    opened.value.close()
    page.get_by_role("button", name="Rename").click()
    page.keyboard.type("dropped")
    page.keyboard.press("Escape")
    expect(page.locator("h1", has_text="alpha")).to_be_visible()
    page.get_by_role("button", name="Delete …").click()
    yes = page.get_by_role("button", name="Delete for good")
    page.keyboard.type("run-0000000a")
    expect(yes).to_be_disabled()
    no_serious_finding(page)
    page.keyboard.press("Escape")
    expect(page.locator("dialog")).to_have_count(0)
    page.get_by_role("button", name="Delete …").click()
    page.keyboard.type(ONE)
    page.keyboard.press("Enter")
    page.wait_for_url("**/runs")
    expect(page.locator(".runs-card")).to_have_count(1)
    assert sorted(path.name for path in (tmp_path / "runs").iterdir()) == [TWO]
