"""The whole box in a real browser: a race on the board, a reload in mid-lap, a daemon that goes and comes back, a download.

The race is simulated and runs in real time; everything else is what users have.
"""

import re
import urllib.request

import pytest
from mcap.reader import make_reader
from playwright.sync_api import expect
from running_box import PATIENCE_S, chromium, log_in, opened, running_box, wait_until

PHONE = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}


@pytest.fixture(scope="module")
def browser():
    expect.set_options(timeout=1000 * PATIENCE_S)
    with chromium() as one:
        yield one


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    with running_box(tmp_path_factory.mktemp("box")) as one:
        yield one


def shown_laps(page) -> list[tuple[int, float]]:
    """Number and time of each lap in the board's table, the latest first."""
    rows = page.locator("[data-show=laps] tr").all_inner_texts()
    found = [re.search(r"(\d+)\s.*?(\d+\.\d{3})", row, re.DOTALL) for row in rows]
    return [(int(row[1]), float(row[2])) for row in found if row is not None]


def driven_laps(box, at_least: int) -> list[tuple[int, float]]:
    """What the appliance said, the latest first, once there are as many."""
    wait_until(lambda: len(box.daemon.events("lap")) >= at_least, lambda: box.daemon.said)
    return [(lap["number"], round(lap["time_s"], 3)) for lap in reversed(box.daemon.events("lap"))]


def laps_are_shown(box, page, at_least: int) -> None:
    """The page has exactly the laps that were driven."""
    driven_laps(box, at_least)
    expect(page.locator("[data-show=laps] tr").nth(at_least - 1)).to_be_visible()

    def alike() -> bool:
        driven = driven_laps(box, at_least)
        # At most the latest lap is on its way.
        return shown_laps(page) in (driven, driven[1:])

    wait_until(alike, lambda: f"{shown_laps(page)} are shown of {driven_laps(box, at_least)}")


def test_a_race_is_on_the_board_and_survives_a_reload_in_mid_lap(box, browser):
    """Every lap with the appliance's own number and time, on a phone; after a reload the same laps and a clock that runs on."""
    page, wrong = opened(browser, **PHONE)
    page.goto(box.url)
    laps_are_shown(box, page, 2)
    page.reload()
    laps_are_shown(box, page, 2)
    clock = page.locator("[data-show=clock]")
    expect(clock).to_have_text(re.compile(r"\d"))
    expect(clock).not_to_have_text(clock.inner_text())
    laps_are_shown(box, page, len(driven_laps(box, 1)) + 1)
    assert wrong == []
    page.context.close()


def test_the_board_is_not_wider_than_the_phone(box, browser):
    """Nothing is cut off and nothing scrolls sideways."""
    page, _ = opened(browser, **PHONE)
    page.goto(box.url)
    laps_are_shown(box, page, 1)
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["viewport"]["width"]
    page.context.close()


def test_a_recording_that_is_being_made_can_be_taken_home(box, browser, tmp_path):
    """From the page of the current run: a valid, finished copy that the stock reader opens, with the laps so far."""
    laps = driven_laps(box, 2)
    page, wrong = opened(browser)
    page.goto(f"{box.url}/runs")
    page.locator("#runs h2 a").first.click()
    page.wait_for_url(re.compile("/runs/."))
    with page.expect_download(timeout=1000 * PATIENCE_S) as download:
        page.locator(".runs-take a[href*='.mcap']").first.click()
    path = tmp_path / "copy.mcap"
    download.value.save_as(path)
    with path.open("rb") as file:
        reader = make_reader(file)
        assert reader.get_summary() is not None
        found = [message.data for _, channel, message in reader.iter_messages() if channel.topic == "/lap"]
    assert len(found) >= len(laps)
    assert wrong == []
    page.context.close()


def test_the_page_says_that_the_daemon_is_down_and_goes_on_when_it_is_back(box, browser):
    """By itself, without a reload; the race that begins then is on the board from its first lap."""
    page, _ = opened(browser)
    page.goto(box.url)
    laps_are_shown(box, page, 1)
    box.stop_daemon()
    line = page.locator("[data-show=line]")
    expect(line).to_have_text(re.compile("down|not running"))
    box.start_daemon()
    expect(line).to_have_text("live")
    laps_are_shown(box, page, 1)
    page.context.close()


def begun(box) -> set[str]:
    """The runs that have been begun, finished or not."""
    return {path.name.partition(".")[0] for path in box.runs.glob("*.mcap*")}


def test_who_may_change_something_has_shown_the_code(box, browser):
    """A new race is begun by the API with the session that the code opened, and refused without."""
    page, _ = opened(browser)
    log_in(page, box)
    run, before = box.daemon.events("health")[-1], begun(box)
    answer = page.evaluate(
        """async () => {
            const token = document.querySelector('meta[name=csrf]').content;
            const ask = more => fetch('/api/v1/race/new', {
                method: 'POST', headers: {'Content-Type': 'application/json', ...more}, body: '{}',
            });
            return [(await ask({})).status, (await ask({'X-CSRF-Token': token})).status];
        }"""
    )
    assert answer[0] == 403
    assert answer[1] in (200, 202, 204)
    assert run["t_s"] > 0
    wait_until(lambda: begun(box) - before, lambda: box.daemon.said)
    page.context.close()


def test_the_first_page_is_small(box):
    """The board's page with all that it loads: 200 kB at most."""
    with urllib.request.urlopen(box.url) as answer:
        text = answer.read()
    total = len(text)
    for name in set(re.findall(rb'(?:src|href)="(/static/[^"]+)"', text)):
        with urllib.request.urlopen(box.url + name.decode()) as answer:
            total += len(answer.read())
    assert total <= 200_000
