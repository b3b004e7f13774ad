"""The set-up's API: from nothing to a configuration that the daemon takes, and all that may be wrong on the way."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from starlette.testclient import TestClient

from dnb_edge.assembly import assemble
from dnb_edge.config.calibration_file import load_calibration, reference_picture
from dnb_edge.config.load import load_config
from dnb_edge.live.messages import Phase, Picture, State, Told
from dnb_edge.sim.rig import Rig
from dnb_edge.values import Clock, SourceInfo
from dnb_edge.web.app import make_app
from dnb_edge.web.box import WebSettings
from dnb_edge.web.endpoint import Refused

HOST = "http://localhost"
SETUP = "/api/v1/setup"


class Daemon:
    """A daemon with one picture to give, or none at all."""

    def __init__(self, jpeg: bytes | None, size_px: tuple[int, int] = (1280, 720)) -> None:
        self.jpeg = jpeg
        self.size_px = size_px
        self.asked: list[dict[str, Any]] = []
        self.epoch = "epoch" if jpeg is not None else None

    @property
    def state(self) -> State | None:
        return None if self.jpeg is None else State(phase=Phase.SETUP, source="v4l2:/dev/video0")

    def events(self, since: int | None = None) -> tuple[Told, ...]:
        return ()

    async def follow(self) -> AsyncIterator[Told | State | None]:
        await asyncio.Event().wait()
        yield None

    async def picture(self, *, newer_than_ns: int | None = None, timeout_s: float = 5.0) -> Picture:
        if self.jpeg is None:
            raise Refused(503, "no-camera", "The camera is not there: plug it in.")
        return Picture(t_ns=7, frame=1, width_px=self.size_px[0], height_px=self.size_px[1], jpeg=self.jpeg)

    async def ask(self, **what: Any) -> None:
        self.asked.append(what)
        if self.jpeg is None:
            raise Refused(503, "daemon-down", "The timing service is not running: it comes back by itself.")


class Wizard:
    """A client that is logged in."""

    def __init__(self, folder: Path, daemon: Daemon, caplog: pytest.LogCaptureFixture) -> None:
        self.setup = folder / "setup"
        self.daemon = daemon
        settings = WebSettings(
            socket=folder / "live.sock", runs=folder / "runs", setup=self.setup, state=folder / "state"
        )
        self.client = TestClient(make_app(settings, daemon=daemon), base_url=HOST)
        with caplog.at_level("WARNING"):
            self.client.get("/login")
        code = re.findall(r"set-up code ([\d ]+) ", caplog.text)[-1]
        answer = self.client.post("/api/v1/login", json={"code": code})
        assert answer.status_code == 200, answer.text
        self.headers = {"X-CSRF-Token": answer.json()["csrf"]}

    def ask(self, method: str, path: str, body: Any = None, *, status: int = 200) -> Any:
        answer = self.client.request(method, SETUP + path, json=body, headers=self.headers)
        assert answer.status_code == status, answer.text
        return answer.json()

    def send(self, path: str, data: bytes, kind: str = "image/png", *, status: int = 200) -> Any:
        answer = self.client.put(SETUP + path, content=data, headers={**self.headers, "Content-Type": kind})
        assert answer.status_code == status, answer.text
        return answer.json()

    def refused(self, method: str, path: str, body: Any = None, *, status: int = 422) -> str:
        return str(self.ask(method, path, body, status=status)["error"]["text"])


def state_of(answer: Any, key: str) -> tuple[str, str]:
    step = next(step for step in answer["steps"] if step["key"] == key)
    return step["state"], step["text"]


def png(image: np.ndarray) -> bytes:
    return cv2.imencode(".png", image)[1].tobytes()


def jpeg(image: np.ndarray) -> bytes:
    return cv2.imencode(".jpg", image)[1].tobytes()


@pytest.fixture(scope="module")
def rig() -> Rig:
    return Rig(seed=1, laps=1)


@pytest.fixture(scope="module")
def view(rig: Rig) -> bytes:
    frame = rig.frame(0)
    return frame.jpeg if frame.jpeg is not None else jpeg(frame.bgr)


@pytest.fixture
def wizard(tmp_path: Path, view: bytes, caplog: pytest.LogCaptureFixture) -> Iterator[Wizard]:
    return Wizard(tmp_path, Daemon(view), caplog)


def pairs_of(rig: Rig, count: int = 8) -> list[dict[str, Any]]:
    camera_px, twin_px = rig.keypoint_pairs(count)
    return [
        {"name": str(k), "camera_px": camera, "twin_px": twin}
        for k, (camera, twin) in enumerate(zip(camera_px.tolist(), twin_px.tolist(), strict=True), start=1)
    ]


def with_route(wizard: Wizard, rig: Rig) -> Any:
    wizard.send("/twin", png(rig.twin))
    (u0, v0), (u1, v1) = rig.start_line_px
    wizard.ask("PUT", "/lane", {"at_px": [(u0 + u1) / 2, (v0 + v1) / 2 - 30]})
    return wizard.ask("PUT", "/route", {"scale": {"metres_per_px": rig.metres_per_px}, "name": "my track"})


def with_everything(wizard: Wizard, rig: Rig) -> Any:
    wizard.ask("POST", "/photo")
    with_route(wizard, rig)
    wizard.ask("PUT", "/keypoints", {"pairs": pairs_of(rig)})
    return wizard.ask("PUT", "/lines", {"start": {"ends_px": rig.start_line_px}})


def test_whole_flow_ends_in_a_configuration_that_the_daemon_takes(wizard: Wizard, rig: Rig) -> None:
    """From nothing to a saved configuration, each step told as done in its turn, which loads and assembles."""
    begun = wizard.ask("GET", "")
    assert {step["state"] for step in begun["steps"][:5]} == {"open"}
    assert state_of(wizard.ask("POST", "/photo"), "aim")[0] == "done"
    routed = with_route(wizard, rig)
    assert state_of(routed, "route")[0] == "done", routed["steps"]
    assert routed["track"]["length_m"] == pytest.approx(rig.circuit.centreline.length_m, rel=0.02)
    clicked = wizard.ask("PUT", "/keypoints", {"pairs": pairs_of(rig)})
    assert state_of(clicked, "keypoints")[0] == "done", clicked["keypoints"]
    assert len(clicked["keypoints"]["lane_camera_px"]) >= 3
    lined = wizard.ask("PUT", "/lines", {"start": {"ends_px": rig.start_line_px}})
    assert state_of(lined, "start")[0] == "done", lined["steps"]
    saved = wizard.ask("POST", "/save")
    assert saved["run"] == "new"
    assert {"new_run": True} in wizard.daemon.asked
    config = load_config(wizard.setup / "dnb-edge.yaml")
    assert config.capture.source == "v4l2:/dev/video0"
    assert (config.capture.width_px, config.capture.height_px) == (1280, 720)
    info = SourceInfo(uri="sim:", width_px=1280, height_px=720, nominal_fps=30.0, clock=Clock.SIMULATED, live=False)
    setup = assemble(config, info).setup
    assert setup.not_scored_because is None
    assert setup.track.name == "my track"
    assert config.view.calibration is not None
    assert reference_picture(config.view.calibration, load_calibration(config.view.calibration)) is not None
    assert state_of(wizard.ask("GET", ""), "save")[0] == "done"
