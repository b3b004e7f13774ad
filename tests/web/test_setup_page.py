"""The set-up's page in a real browser: the whole way with taps, on a telephone's width."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page
from running_box import chromium, opened
from setup_rig import Daemon, pairs_of, png, view_of
from web_box import app_in, codes, served

from dnb_edge.config.calibration_file import load_calibration
from dnb_edge.config.keypoints import load_yaml_pairs
from dnb_edge.config.load import load_config
from dnb_edge.sim.rig import Rig
from dnb_edge.track.scale import TwinScale
from dnb_edge.view.findings import find

PHONE = {"width": 360, "height": 740}
SIZES = {"camera": (1280, 720), "twin": (1200, 800)}


def tap(page: Page, view: str, of: str, px: Any) -> None:
    """Clicks at a place of the picture that is shown whole: px have their middle at whole numbers.

    Playwright counts from within the canvas's rim."""
    page.wait_for_selector("#setup[data-ready=yes]")
    canvas = page.locator(f"#{view} canvas[data-shown=yes]")
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    assert box is not None
    (width, height), rim = SIZES[of], 1.0
    inner = box["width"] - 2 * rim, box["height"] - 2 * rim
    scale = min(inner[0] / width, inner[1] / height)
    x, y = (inner[k] / 2 + (px[k] + 0.5 - size / 2) * scale for k, size in enumerate((width, height)))
    canvas.click(position={"x": x, "y": y})


def settled(page: Page, step: str, state: str = "good") -> None:
    """Waits until the box has said that a step is done."""
    page.wait_for_selector(f"#{step} .state.notice--{state}")
    page.wait_for_selector("#setup[data-ready=yes]")


def logged_in(page: Page, port: int) -> None:
    with codes() as heard:
        page.goto(f"http://127.0.0.1:{port}/login?next=/setup")
    page.get_by_label("code").fill(heard[-1])
    page.keyboard.press("Enter")
    page.wait_for_selector(".setup-bar")


def pictures_given(page: Page, twin: Path) -> None:
    page.get_by_role("button", name="Take the picture").click()
    settled(page, "aim")
    page.locator("#next").click()
    page.set_input_files("#twin-file", twin)
    settled(page, "twin")
    page.locator("#next").click()


def route_found(page: Page, on_lane_px: tuple[float, float], metres_per_px: float) -> None:
    tap(page, "route-view", "twin", on_lane_px)
    page.wait_for_selector('#lane-said:has-text("The lane:")')
    page.select_option("#scale-kind", "px")
    page.fill("#scale-value", str(metres_per_px))
    page.locator("#scale-keep").click()
    settled(page, "route")
    page.locator("#next").click()


def keypoints_tapped(page: Page, pairs: list[dict[str, Any]]) -> None:
    for pair in pairs:
        tap(page, "camera-view", "camera", pair["camera_px"])
        tap(page, "keypoint-twin-view", "twin", pair["twin_px"])
    settled(page, "keypoints")
    tapped_u = last_twin_u(page)
    for key in ("ArrowRight", "Shift+ArrowRight"):
        page.locator("#keypoint-twin-view canvas").press(key)
    settled(page, "keypoints")
    assert last_twin_u(page) == pytest.approx(tapped_u + 1.1, abs=0.021)
    for _ in range(2):
        page.locator("#undo").click()
    settled(page, "keypoints")
    assert last_twin_u(page) == tapped_u
    page.locator("#next").click()


def last_twin_u(page: Page) -> float:
    """Where the box has the last keypoint on the twin, px to the right."""
    draft = page.evaluate("fetch('/api/v1/setup').then((answer) => answer.json())")["draft"]
    return float(draft["pairs"][-1]["twin_px"][0])


def test_whole_way_by_taps(tmp_path: Path) -> None:
    """On a telephone's width, from aiming to a saved configuration: what is tapped is what is kept to a fraction of a px, the
    map is the command line's for these taps, keys nudge, undo takes back, and nothing breaks the page's rules."""
    rig = Rig(seed=1, laps=1)
    (tmp_path / "twin.png").write_bytes(png(rig.twin))
    (u0, v0), (u1, v1) = rig.start_line_px
    middle, pairs = ((u0 + u1) / 2, (v0 + v1) / 2), pairs_of(rig)
    with served(app_in(tmp_path, daemon=Daemon(view_of(rig)))) as port, chromium() as browser:
        page, wrong = opened(browser, viewport=PHONE)
        logged_in(page, port)
        pictures_given(page, tmp_path / "twin.png")
        route_found(page, (middle[0], middle[1] - 40), rig.metres_per_px)
        keypoints_tapped(page, pairs)
        tap(page, "start-view", "twin", middle)
        settled(page, "start")
        for step in ("aim", "route", "keypoints", "save"):
            page.goto(f"http://127.0.0.1:{port}/setup#{step}")
            page.wait_for_selector("#setup[data-ready=yes]")
            assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"], step
        page.locator("#save-now").click()
        settled(page, "save")
        page.goto("about:blank")
        assert wrong == []
    config = load_config(tmp_path / "setup" / "dnb-edge.yaml")
    kept = load_yaml_pairs(next((tmp_path / "setup").glob("keypoints-*.yaml")))
    assert np.abs(kept.camera_array() - [pair["camera_px"] for pair in pairs]).max() < 0.2
    assert np.abs(kept.twin_array() - [pair["twin_px"] for pair in pairs]).max() < 0.2
    scale = TwinScale(metres_per_px=rig.metres_per_px, height_px=800.0)
    own = find(kept, scale, size_px=(1280, 720), say=str).fit.calibration.ground.camera_to_twin
    assert config.view.calibration is not None
    assert load_calibration(config.view.calibration).ground.camera_to_twin == pytest.approx(own, rel=1e-9)
