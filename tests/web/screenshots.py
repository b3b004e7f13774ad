"""Pictures of every page of a whole box, on the sizes of telephones, a desk and a projector, light and dark, to be looked at.

From a box that knows nothing to one with a race, a judge's page and faults: `make screenshots`, or `screenshots.py DIR`.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
from playwright.sync_api import Browser, Page
from running_box import RunningBox, chromium, log_in, opened, wait_until
from test_setup_page import keypoints_tapped, pictures_given, route_found, settled, tap

from dnb_edge.sim.rig import Rig

SIZES = {"360x740": (360, 740), "390x844": (390, 844), "1280x720": (1280, 720), "1920x1080": (1920, 1080)}
THEMES = ("light", "dark")
LAPS = 60
STEPS = ("aim", "twin", "route", "keypoints", "start", "sectors", "save", "drive", "teach")


class Album:
    """Takes a page's pictures, numbered in the order in which a newcomer meets them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def take(self, page: Page, name: str, *, whole: bool = True, settle_ms: int = 250) -> None:
        """One picture a size and theme, of the whole page or of what the window shows."""
        for size, (width, height) in SIZES.items():
            page.set_viewport_size({"width": width, "height": height})
            for theme in THEMES:
                page.emulate_media(color_scheme=theme)  # type: ignore[arg-type]
                page.wait_for_timeout(settle_ms)
                page.screenshot(path=self.folder / f"{name}.{size}.{theme}.png", full_page=whole)
        page.set_viewport_size({"width": 390, "height": 844})
        page.emulate_media(color_scheme="light")


def new_page(browser: Browser) -> Page:
    page, _ = opened(browser, viewport={"width": 390, "height": 844})
    return page


def nothing_yet(album: Album, browser: Browser, box: RunningBox) -> None:
    """The pages alone: the race does not run, nothing is recorded."""
    box.start_web()
    page = new_page(browser)
    for name, path in (
        ("board", "/"),
        ("runs", "/runs"),
        ("projector", "/projector"),
        ("overlay", "/overlay"),
        ("setup", "/setup"),
    ):
        page.goto(box.url + path)
        page.wait_for_timeout(1500)
        album.take(page, f"1-down-{name}")
    page.goto(f"{box.url}/nowhere")
    album.take(page, "1-down-nowhere")
    log_in(page, box)
    page.goto(f"{box.url}/setup")
    page.wait_for_timeout(1500)
    album.take(page, "1-down-setup-logged-in")
    page.goto(f"{box.url}/login")
    album.take(page, "1-down-logged-in")
    page.context.close()


def first_start(album: Album, browser: Browser, box: RunningBox) -> None:
    """The race's process waits to be set up."""
    box.start_daemon("--setup", box.setup, config=False)
    page = new_page(browser)
    for name, path in (("board", "/"), ("projector", "/projector"), ("overlay", "/overlay"), ("login", "/login")):
        page.goto(box.url + path)
        page.wait_for_timeout(1500)
        album.take(page, f"2-first-{name}")
    page.goto(f"{box.url}/login")
    page.get_by_label("code").fill("1111 1111")
    page.keyboard.press("Enter")
    page.wait_for_timeout(1000)
    album.take(page, "2-first-wrong-code")
    page.context.close()


def set_up(album: Album, browser: Browser, box: RunningBox) -> None:
    """The whole wizard by taps, each step before and after, to the first timed lap."""
    rig = Rig(laps=LAPS)
    twin = box.folder / "twin.png"
    cv2.imwrite(str(twin), rig.twin)
    (u0, v0), (u1, v1) = rig.start_line_px
    middle = (u0 + u1) / 2, (v0 + v1) / 2
    camera_px, twin_px = rig.keypoint_pairs(8)
    pairs = [
        {"camera_px": camera, "twin_px": on_twin}
        for camera, on_twin in zip(camera_px.tolist(), twin_px.tolist(), strict=True)
    ]
    page = new_page(browser)
    log_in(page, box)
    steps(album, page, box, "3-setup-empty")
    page.goto(f"{box.url}/setup#aim")
    page.wait_for_selector("#setup[data-ready=yes]")
    pictures_given(page, twin)
    route_found(page, (middle[0], middle[1] - 40), rig.metres_per_px)
    keypoints_tapped(page, pairs)
    tap(page, "start-view", "twin", middle)
    settled(page, "start")
    steps(album, page, box, "4-setup-done", only=STEPS[:7])
    page.goto(f"{box.url}/setup#save")
    page.wait_for_selector("#setup[data-ready=yes]")
    page.locator("#save-now").click()
    settled(page, "save")
    wait_until(lambda: box.daemon is not None and box.daemon.events("crossing"))
    album.take(page, "4-setup-saved")
    steps(album, page, box, "5-setup-racing", only=("aim", "drive", "teach"))
    wait_until(lambda: box.daemon is not None and box.daemon.events("lap"))
    page.context.close()


def steps(album: Album, page: Page, box: RunningBox, name: str, only: tuple[str, ...] = STEPS) -> None:
    """Each of the wizard's steps."""
    for step in only:
        page.goto(f"{box.url}/setup#{step}")
        page.wait_for_selector("#setup[data-ready=yes]")
        page.wait_for_timeout(800)
        album.take(page, f"{name}-{1 + STEPS.index(step)}-{step}", settle_ms=350)


def race(album: Album, browser: Browser, box: RunningBox) -> None:
    """A race that runs, for all and for those who have logged in, and its recording."""
    wait_until(lambda: box.daemon is not None and len(box.daemon.events("lap")) >= 3, patience_s=120.0)
    page = new_page(browser)
    page.goto(f"{box.url}/")
    page.wait_for_timeout(2000)
    album.take(page, "6-race-board")
    for name in ("projector", "overlay"):
        page.goto(f"{box.url}/{name}")
        page.wait_for_timeout(2000)
        album.take(page, f"6-race-{name}", whole=False)
    log_in(page, box)
    page.goto(f"{box.url}/")
    page.locator("#new-run-open").click()
    album.take(page, "6-race-new-run", whole=False)
    # The first run is finished so, and a second one is being recorded.
    page.locator("#new-run-entry").fill("Ada")
    page.get_by_role("button", name="Begin another run").click()
    wait_until(lambda: len(list(box.runs.glob("*.mcap*"))) >= 2 and len(list(box.runs.glob("*.mcap"))) >= 1)
    recorded(album, page, box)
    page.goto(f"{box.url}/")
    page.locator("#log-out").click()
    page.wait_for_timeout(800)
    album.take(page, "7-logged-out", whole=False)
    page.context.close()


def recorded(album: Album, page: Page, box: RunningBox) -> None:
    """The list, one recording, its report, the judge's page with a decision."""
    page.goto(f"{box.url}/runs")
    page.wait_for_selector("#runs h2 a")
    page.wait_for_timeout(800)
    album.take(page, "7-runs")
    page.locator("#choose-all").click()
    page.locator("#make-table").click()
    page.wait_for_timeout(2500)
    album.take(page, "7-runs-table", whole=False)
    page.locator("#table-close").click()
    page.locator("#runs h2 a").last.click()
    page.wait_for_selector("#laps table")
    one = page.url
    page.wait_for_timeout(800)
    album.take(page, "7-run")
    page.goto(f"{one}/judge")
    page.wait_for_selector("#laps tbody tr")
    page.wait_for_timeout(1500)
    album.take(page, "7-judge")
    page.locator("#add-note").click()
    page.wait_for_timeout(500)
    album.take(page, "7-judge-note", whole=False)
    page.goto(f"{box.url}/api/v1/runs/{one.rsplit('/', 1)[1]}/report.html")
    page.wait_for_timeout(400)
    album.take(page, "7-report-waits")
    page.wait_for_selector("table", timeout=120_000)
    page.wait_for_timeout(500)
    album.take(page, "7-report")


def away(album: Album, browser: Browser, box: RunningBox) -> None:
    """The race's process goes; then it runs without a camera."""
    page = new_page(browser)
    page.goto(f"{box.url}/")
    page.wait_for_timeout(1500)
    box.stop_daemon()
    page.wait_for_timeout(1500)
    album.take(page, "8-gone-board")
    page.goto(f"{box.url}/runs")
    page.wait_for_timeout(1500)
    album.take(page, "8-gone-runs")
    box.source = "v4l2:/dev/video99"
    box.start_daemon("--setup", box.setup, config=False)
    page.goto(f"{box.url}/")
    page.wait_for_timeout(4000)
    album.take(page, "8-no-camera-board")
    page.goto(f"{box.url}/projector")
    page.wait_for_timeout(2000)
    album.take(page, "8-no-camera-projector", whole=False)
    log_in(page, box)
    page.goto(f"{box.url}/setup#aim")
    page.wait_for_timeout(9000)
    album.take(page, "8-no-camera-setup")
    page.context.close()


STAGES: dict[str, Callable[[Album, Browser, RunningBox], None]] = {
    stage.__name__: stage for stage in (nothing_yet, first_start, set_up, race, away)
}


def main(folder: Path, progress: Callable[[str], Any]) -> None:
    """All stages one after the other, on one box."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    with tempfile.TemporaryDirectory(prefix="dnb-edge-screenshots-") as place, chromium() as browser:
        box = RunningBox(Path(place), laps=LAPS)
        try:
            for name, stage in STAGES.items():
                progress(f"{name} ...\n")
                stage(Album(folder), browser, box)
        finally:
            box.close()
    progress(f"{len(list(folder.glob('*.png')))} pictures in {folder}\n")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "build/screenshots"), sys.stderr.write)
