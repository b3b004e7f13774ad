"""The judge's page in a real browser: a decision with its preview, pictures, undo, two judges, no serious finding of axe."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from judged_runs import Wanderer, record
from playwright.sync_api import Browser, Page, expect
from running_box import PATIENCE_S, RunningBox, chromium, log_in, opened

from dnb_edge.archive.stored import run_id
from dnb_edge.record.edits import edits_path

PHONE_PX = (390, 844)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Chromium."""
    expect.set_options(timeout=1000 * PATIENCE_S)
    with chromium() as one:
        yield one


@pytest.fixture(scope="module")
def box(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningBox]:
    """The pages without an appliance, over one recording."""
    one = RunningBox(tmp_path_factory.mktemp("box"))
    record(one.runs / "run.mcap", Wanderer((3.0, 3.1, 2.9, 3.2)))
    try:
        one.start_web()
        yield one
    finally:
        one.close()


def judging(box: RunningBox, browser: Browser) -> tuple[Page, list[str]]:
    page, wrong = opened(browser, bypass_csp=True)
    log_in(page, box)
    page.goto(f"{box.url}/runs/{run_id('run')}/judge")
    expect(page.locator("#laps tbody tr")).to_have_count(4)
    return page, wrong


def actions(box: RunningBox) -> list[str]:
    """What is in the file of edits."""
    lines = edits_path(box.runs / "run.mcap").read_text().splitlines()[1:]
    return [f"{edit['action']} {edit['author']}: {edit['reason']}" for edit in map(json.loads, lines)]


def test_a_judge_decides_in_the_browser(box: RunningBox, browser: Browser) -> None:
    """Forgiving the rules' penalty: shown before and after, saved only then, listed, undone; pictures of all passes load; a
    judge whose page is older is refused and brought up to date; phone and axe find nothing serious."""
    page, wrong = judging(box, browser)
    other, _ = judging(box, browser)
    expect(page.locator("#laps tbody tr").nth(1)).to_contain_text("off track")
    page.get_by_label("Forgive lap 2 of car 1").click()
    save = page.get_by_role("button", name="Save")
    expect(save).to_be_disabled()
    page.get_by_role("button", name="Preview").click()
    expect(page.locator("#decision-error")).to_contain_text("Say who decides")
    page.get_by_label("Judge", exact=True).fill("Ada")
    page.get_by_label("Because").fill("<b>pushed</b>")
    page.get_by_role("button", name="Preview").click()
    expect(page.locator("#preview tbody tr").first).to_contain_text("+ 2 s")
    assert not edits_path(box.runs / "run.mcap").exists()
    page.get_by_label("Because").fill("<b>was pushed</b>")
    expect(save).to_be_disabled()
    page.get_by_role("button", name="Preview").click()
    save.click()
    expect(page.locator("#edits tbody tr")).to_have_count(1)
    expect(page.locator("#edits tbody tr").first).to_contain_text("<b>was pushed</b>")
    expect(page.locator("#laps tbody tr").nth(1)).not_to_contain_text("+ 2 s")
    assert actions(box) == ["forgive Ada: <b>was pushed</b>"]

    other.get_by_label("Remove lap 1 of car 1").click()
    other.get_by_label("Judge", exact=True).fill("Ben")
    other.get_by_label("Because").fill("carried")
    other.get_by_role("button", name="Preview").click()
    expect(other.locator(".toast")).to_contain_text("somebody decided meanwhile")
    expect(other.locator("#edits tbody tr")).to_have_count(1)
    other.context.close()

    page.get_by_label("Undo decision 1").click()
    page.get_by_label("Because").fill("it was not")
    page.get_by_role("button", name="Preview").click()
    page.get_by_role("button", name="Save").click()
    expect(page.locator("#edits tbody tr")).to_have_count(2)
    assert actions(box)[1:] == ["undo Ada: it was not"]

    images = page.locator(".judge-pictures img")
    expect(images).to_have_count(6)
    for k in range(6):
        images.nth(k).scroll_into_view_if_needed()
        page.wait_for_function(
            "image => image.complete && image.naturalWidth === 320", arg=images.nth(k).element_handle()
        )
    page.set_viewport_size({"width": PHONE_PX[0], "height": PHONE_PX[1]})
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE_PX[0]
    found = Axe().run(page).response["violations"]
    assert [(one["id"], one["impact"]) for one in found] == []
    assert wrong == [one for one in wrong if "409" in one]
    page.context.close()


def test_a_lap_is_added_from_pass_to_pass(box: RunningBox, browser: Browser) -> None:
    """Two clicks among the pictures fill in from and to; a lap over another one is refused in the command line's words."""
    page, _ = judging(box, browser)
    page.get_by_label("Lap to here, pass 3").click()
    expect(page.locator(".toast")).to_contain_text("now choose where it begins")
    page.get_by_label("Lap from here, pass 2").click()
    assert (page.get_by_label("From", exact=True).input_value(), page.get_by_label("To", exact=True).input_value()) == (
        "pass:2",
        "pass:3",
    )
    page.get_by_label("Judge", exact=True).fill("Ada")
    page.get_by_label("Because").fill("missed")
    page.get_by_role("button", name="Preview").click()
    expect(page.locator("#decision-error")).to_contain_text("lap 2 is driven in the same time")
    page.context.close()


def test_the_page_says_what_is_wrong(box: RunningBox, browser: Browser, tmp_path: Path) -> None:
    """A recording that cannot be read is told on the page, in words."""
    hurt = box.runs / "hurt.mcap"
    hurt.write_bytes((box.runs / "run.mcap").read_bytes()[:-3000])
    page, _ = opened(browser)
    log_in(page, box)
    page.goto(f"{box.url}/runs/{run_id('hurt')}/judge")
    expect(page.locator(".notice--bad")).to_contain_text("runs recover")
    hurt.unlink()
    page.context.close()
