"""The set-up's page in a real browser: the whole way with taps, on a telephone's width."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page
from running_box import chromium, opened
from setup_rig import Daemon, pairs_of, png, view_of
from setup_taps import answer_of, logged_in, pairs_tapped, pictures_given, route_found, settled, tap
from web_box import app_in, served

from dnb_edge.config.calibration_file import load_calibration
from dnb_edge.config.keypoints import load_yaml_pairs
from dnb_edge.config.load import load_config
from dnb_edge.detect.onnx import default_model_path
from dnb_edge.sim.rig import Rig
from dnb_edge.track.scale import TwinScale
from dnb_edge.view.findings import find

PHONE = {"width": 360, "height": 740}
DESK = {"width": 1920, "height": 1080}
CAMERA, TWIN = (1280, 720), (1200, 800)


def keypoints_tapped(page: Page, pairs: list[dict[str, Any]]) -> None:
    pairs_tapped(page, CAMERA, TWIN, pairs)
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
    return float(answer_of(page)["draft"]["pairs"][-1]["twin_px"][0])


def test_whole_way_by_taps(tmp_path: Path) -> None:
    """On a telephone's width, from aiming to a saved configuration: what is tapped is what is kept to a fraction of a px, the
    map is the command line's for these taps, keys nudge, undo takes back, a taught model is taken, nothing breaks the page."""
    rig = Rig(seed=1, laps=1)
    (tmp_path / "twin.png").write_bytes(png(rig.twin))
    (u0, v0), (u1, v1) = rig.start_line_px
    middle, pairs = ((u0 + u1) / 2, (v0 + v1) / 2), pairs_of(rig)
    with served(app_in(tmp_path, daemon=Daemon(view_of(rig)))) as port, chromium() as browser:
        page, wrong = opened(browser, viewport=PHONE)
        logged_in(page, port)
        pictures_given(page, tmp_path / "twin.png")
        route_found(page, TWIN, (middle[0], middle[1] - 40), rig.metres_per_px)
        keypoints_tapped(page, pairs)
        tap(page, "start-view", TWIN, middle)
        settled(page, "start")
        for step in ("aim", "route", "keypoints", "save"):
            page.goto(f"http://127.0.0.1:{port}/setup#{step}")
            page.wait_for_selector("#setup[data-ready=yes]")
            assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"], step
        page.goto(f"http://127.0.0.1:{port}/setup#teach")
        model = default_model_path()
        page.set_input_files("#model-files", [model, model.with_suffix(".json")])
        settled(page, "teach")
        page.goto(f"http://127.0.0.1:{port}/setup#save")
        page.locator("#save-now").click()
        settled(page, "save")
        page.goto("about:blank")
        assert wrong == []
    config = load_config(tmp_path / "setup" / "dnb-edge.yaml")
    assert config.detector.model is not None
    kept = load_yaml_pairs(next((tmp_path / "setup").glob("keypoints-*.yaml")))
    assert np.abs(kept.camera_array() - [pair["camera_px"] for pair in pairs]).max() < 0.2
    assert np.abs(kept.twin_array() - [pair["twin_px"] for pair in pairs]).max() < 0.2
    scale = TwinScale(metres_per_px=rig.metres_per_px, height_px=800.0)
    own = find(kept, scale, size_px=(1280, 720), say=str).fit.calibration.ground.camera_to_twin
    assert config.view.calibration is not None
    assert load_calibration(config.view.calibration).ground.camera_to_twin == pytest.approx(own, rel=1e-9)


def test_papers_photograph_by_taps(real_dir: Path, tmp_path: Path) -> None:
    """On a desk's screen, with the paper's own photograph, twin and keypoints: the way ends in a saved configuration that the
    command line takes, the poor keypoints are told, and the map is the command line's for these taps."""
    files = real_dir / "drivenetbench"
    photo_px, twin_px = (3840, 2160), (2537, 2540)
    camera, twin = (np.load(files / f"keypoints_from_{side}.npy").tolist() for side in ("camera", "diagram"))
    pairs = [{"camera_px": a, "twin_px": b} for a, b in zip(camera, twin, strict=True)]
    daemon = Daemon((files / "photo.jpg").read_bytes(), size_px=photo_px)
    with served(app_in(tmp_path, daemon=daemon)) as port, chromium() as browser:
        page, wrong = opened(browser, viewport=DESK)
        logged_in(page, port)
        pictures_given(page, files / "digital-twin.jpg")
        route_found(page, twin_px, (1859, 60), 0.0015)
        pairs_tapped(page, photo_px, twin_px, pairs)
        settled(page, "keypoints", "bad")
        assert "mm" in page.locator("#keypoints .state").inner_text()
        page.fill("#limit", "60")
        page.locator("#limit").blur()
        settled(page, "keypoints")
        said = answer_of(page)["keypoints"]
        page.locator("#next").click()
        tap(page, "start-view", twin_px, (1859, 116))
        settled(page, "start")
        page.goto(f"http://127.0.0.1:{port}/setup#save")
        page.locator("#save-now").click()
        settled(page, "save")
        page.goto("about:blank")
        assert wrong == []
    assert said["mean_px"] == pytest.approx(26.7, abs=0.5)
    config = load_config(tmp_path / "setup" / "dnb-edge.yaml")
    kept = load_yaml_pairs(next((tmp_path / "setup").glob("keypoints-*.yaml")))
    # Half a px of the screen, on which the 3840 px stand in some 850.
    assert np.abs(kept.camera_array() - camera).max() < 2.5
    own = find(kept, TwinScale(metres_per_px=0.0015, height_px=float(twin_px[1])), size_px=photo_px, say=str)
    assert config.view.calibration is not None
    calibration = load_calibration(config.view.calibration)
    assert calibration.ground.camera_to_twin == pytest.approx(own.fit.calibration.ground.camera_to_twin, rel=1e-9)
