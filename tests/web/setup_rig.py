"""What tests of the set-up share: a daemon with one picture to give, and the simulated track's files and clicks."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from web_box import app_in, log_in, visitor

from dnb_edge.live.messages import Phase, Picture, State, Told
from dnb_edge.sim.rig import Rig
from dnb_edge.web.endpoint import Refused

SETUP = "/api/v1/setup"


class Daemon:
    """A daemon with one picture to give; down without one."""

    def __init__(self, jpeg: bytes | None, size_px: tuple[int, int] = (1280, 720)) -> None:
        self.jpeg = jpeg
        self.size_px = size_px
        self.asked: list[dict[str, Any]] = []
        self.stamp_ns = 0

    @property
    def epoch(self) -> str | None:
        return None if self.jpeg is None else "epoch"

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
        await asyncio.sleep(0.0 if newer_than_ns is None else 0.3)
        self.stamp_ns += 1
        return Picture(t_ns=self.stamp_ns, frame=1, width_px=self.size_px[0], height_px=self.size_px[1], jpeg=self.jpeg)

    async def ask(self, **what: Any) -> None:
        self.asked.append(what)
        if self.jpeg is None:
            raise Refused(503, "daemon-down", "The timing service is not running: it comes back by itself.")


def png(image: np.ndarray) -> bytes:
    return cv2.imencode(".png", image)[1].tobytes()


def jpeg(image: np.ndarray) -> bytes:
    return cv2.imencode(".jpg", image)[1].tobytes()


def view_of(rig: Rig) -> bytes:
    """The camera's picture of the rig, as JPEG."""
    frame = rig.frame(0)
    return frame.jpeg if frame.jpeg is not None else jpeg(frame.bgr)


def pairs_of(rig: Rig, count: int = 8) -> list[dict[str, Any]]:
    """The rig's keypoints as the API wants them."""
    camera_px, twin_px = rig.keypoint_pairs(count)
    return [
        {"name": str(k), "camera_px": camera, "twin_px": twin}
        for k, (camera, twin) in enumerate(zip(camera_px.tolist(), twin_px.tolist(), strict=True), start=1)
    ]


class Wizard:
    """A browser at the set-up that is logged in."""

    def __init__(self, folder: Path, daemon: Daemon) -> None:
        self.setup = folder / "setup"
        self.daemon = daemon
        self.client = visitor(app_in(folder, daemon=daemon))
        self.headers = {"X-CSRF-Token": log_in(self.client)}

    def ask(self, method: str, path: str, body: Any = None, *, status: int = 200) -> Any:
        answer = self.client.request(method, SETUP + path, json=body, headers=self.headers)
        assert answer.status_code == status, answer.text
        return answer.json()

    def get(self, path: str) -> Any:
        return self.client.get(SETUP + path)

    def send(self, path: str, data: bytes, kind: str = "image/png", *, status: int = 200) -> Any:
        answer = self.client.put(SETUP + path, content=data, headers={**self.headers, "Content-Type": kind})
        assert answer.status_code == status, answer.text
        return answer.json()

    def refused(self, method: str, path: str, body: Any = None, *, status: int = 422) -> str:
        return str(self.ask(method, path, body, status=status)["error"]["text"])


def state_of(answer: Any, key: str) -> tuple[str, str]:
    """How far a step is, and its words."""
    step = next(step for step in answer["steps"] if step["key"] == key)
    return step["state"], step["text"]


def with_route(wizard: Wizard, rig: Rig) -> Any:
    """The rig's twin with lane, route and scale."""
    wizard.send("/twin", png(rig.twin))
    (u0, v0), (u1, v1) = rig.start_line_px
    wizard.ask("PUT", "/lane", {"at_px": [(u0 + u1) / 2, (v0 + v1) / 2 - 30]})
    return wizard.ask("PUT", "/route", {"scale": {"metres_per_px": rig.metres_per_px}, "name": "my track"})


def with_everything(wizard: Wizard, rig: Rig) -> Any:
    """All that saving needs."""
    wizard.ask("POST", "/photo")
    with_route(wizard, rig)
    wizard.ask("PUT", "/keypoints", {"pairs": pairs_of(rig)})
    return wizard.ask("PUT", "/lines", {"start": {"ends_px": rig.start_line_px}})
