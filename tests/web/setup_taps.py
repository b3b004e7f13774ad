"""What a person does on the set-up's page in a real browser: logs in, taps places of pictures, waits for the box to answer."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from playwright.sync_api import Page
from web_box import codes

SizePx = tuple[int, int]
"""Of a picture, (width, height)."""


def tap(page: Page, view: str, size: SizePx, px: Sequence[float]) -> None:
    """Clicks at a place of the picture of that size that is shown whole: px have their middle at whole numbers.

    Playwright counts from within the canvas's rim."""
    page.wait_for_selector("#setup[data-ready=yes]")
    canvas = page.locator(f"#{view} canvas[data-shown=yes]")
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    assert box is not None
    rim = 1.0
    inner = box["width"] - 2 * rim, box["height"] - 2 * rim
    scale = min(inner[0] / size[0], inner[1] / size[1])
    x, y = (inner[k] / 2 + (px[k] + 0.5 - size[k] / 2) * scale for k in (0, 1))
    canvas.click(position={"x": x, "y": y})


def settled(page: Page, step: str, state: str = "good") -> None:
    """Waits until the box has said how far a step is."""
    page.wait_for_selector(f"#{step} .state.notice--{state}")
    page.wait_for_selector("#setup[data-ready=yes]")


def logged_in(page: Page, port: int) -> None:
    """Opens the page and types the code that the box shows."""
    with codes() as heard:
        page.goto(f"http://127.0.0.1:{port}/login?next=/setup")
    page.get_by_label("code").fill(heard[-1])
    page.keyboard.press("Enter")
    page.wait_for_selector(".setup-bar")


def pictures_given(page: Page, twin: Path) -> None:
    """The first two steps: the camera's picture, and the twin from a file."""
    page.get_by_role("button", name="Take the picture").click()
    settled(page, "aim")
    page.locator("#next").click()
    page.set_input_files("#twin-file", twin)
    settled(page, "twin")
    page.locator("#next").click()


def route_found(page: Page, twin: SizePx, on_lane_px: tuple[float, float], metres_per_px: float) -> None:
    """The third: a tap on the lane, and the scale."""
    tap(page, "route-view", twin, on_lane_px)
    page.wait_for_selector('#lane-said:has-text("The lane:")')
    page.select_option("#scale-kind", "px")
    page.fill("#scale-value", str(metres_per_px))
    page.locator("#scale-keep").click()
    settled(page, "route")
    page.locator("#next").click()


def pairs_tapped(page: Page, camera: SizePx, twin: SizePx, pairs: Sequence[dict[str, Any]]) -> None:
    """Each pair by two taps."""
    for pair in pairs:
        tap(page, "camera-view", camera, pair["camera_px"])
        tap(page, "keypoint-twin-view", twin, pair["twin_px"])


def answer_of(page: Page) -> dict[str, Any]:
    """What the box says of the whole set-up."""
    found: dict[str, Any] = page.evaluate("fetch('/api/v1/setup').then((answer) => answer.json())")
    return found
