"""Real recordings with pictures for the judge's tests, and a browser that has logged in to an app that serves them."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from starlette.testclient import TestClient

__all__ = ["Car", "Wanderer", "browser", "priced", "record", "setup"]

sys.path.insert(0, str(Path(__file__).parents[1] / "cli"))

from table_runs import FPS, GROUND, SOURCE, Car, setup

from dnb_edge.core import CoreSetup
from dnb_edge.race.rules import Effect, PenaltyRules
from dnb_edge.record.header import RunHeader
from dnb_edge.record.identity import identity_of
from dnb_edge.record.names import pictures_directory
from dnb_edge.record.writer import Recorder, RecordingSettings
from dnb_edge.values import BgrImage, Detection, Frame, FrameDetections, PointM, StampSource
from dnb_edge.web.app import make_app
from dnb_edge.web.box import WebSettings
from dnb_edge.web.endpoint import Refused

PICTURE_EVERY = 6
"""Frames."""
OFF_LANE_M = 0.35


@dataclass(frozen=True)
class Wanderer(Car):
    """Leaves the lane for a while in the middle of its second lap."""

    def at(self, t_s: float) -> PointM:
        """Track m."""
        x, y = super().at(t_s)
        if not 4.0 < t_s < 6.0:
            return x, y
        further = 1 + OFF_LANE_M * math.sin(math.pi * (t_s - 4.0) / 2.0) ** 2
        return 2 + (x - 2) * further, 2 + (y - 2) * further


def priced(**changes: Any) -> CoreSetup:
    """A lap off the lane costs two seconds."""
    return setup(penalties=PenaltyRules(off_track=Effect(seconds=2.0)), **changes)


def record(
    path: Path, *cars: Car, made: CoreSetup | None = None, finish: bool = True, image_ring_bytes: int | None = None
) -> Path:
    """A recording of `cars` with pictures of the first; without `finish` as it is while it is written: `path` with `.part`
    behind."""
    made = made if made is not None else priced()
    header = RunHeader(
        setup={"core": made.to_dict(), "calibration": {}, "sha256": {}},
        config={},
        source=SOURCE,
        identity=identity_of(made).to_dict(),
        name="net",
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    spec = RecordingSettings(
        directory=path.parent, image_fps=FPS, lossless=True, sync_period_s=3600.0, image_ring_bytes=image_ring_bytes
    )
    writer = Recorder(spec, header, None)
    for k in range(int(max(car.lasts_s for car in cars) * FPS)):
        t_ns = round(k * 1e9 / FPS)
        found = tuple(_detection(car, t_ns * 1e-9) for car in cars)
        if k % PICTURE_EVERY == 0:
            writer.add_frame(_frame(k, t_ns, found[0].camera_px))
        writer.add_detections(FrameDetections(sequence=k, t_ns=t_ns, detections=found, full_frame=True))
    if finish:
        written = writer.close()
        ring = pictures_directory(written)
        if ring.exists():
            ring.rename(pictures_directory(path))
        return written.rename(path)
    writer.wait_saved()
    part = writer.path
    writer.abandon()
    return part.rename(path.with_name(f"{path.name}.part"))


def _detection(car: Car, t_s: float) -> Detection:
    camera_px = GROUND.point_to_camera_px(car.at(t_s))
    assert camera_px is not None
    return Detection(camera_px=camera_px, sigma_px=1.0, length_px=40.0, confidence=0.9)


def _frame(sequence: int, t_ns: int, camera_px: tuple[float, float]) -> Frame:
    """A grey floor with a red car."""
    image: BgrImage = np.full((1000, 1000, 3), 90, dtype=np.uint8)
    cv2.circle(image, (round(camera_px[0]), round(camera_px[1])), 20, (0, 0, 255), -1)
    done, jpeg = cv2.imencode(".jpg", image)
    assert done
    return Frame(
        sequence=sequence,
        t_ns=t_ns,
        stamp_source=StampSource.SIMULATED,
        width_px=1000,
        height_px=1000,
        jpeg=jpeg.tobytes(),
    )


@dataclass
class Shown:
    """A daemon that shows texts and does nothing else."""

    texts: list[str] = field(default_factory=list)
    state = None
    epoch = None

    def events(self, _since: int | None = None) -> tuple[Any, ...]:
        """None."""
        return ()

    async def follow(self) -> AsyncIterator[Any]:
        """Nothing comes."""
        return
        yield

    async def picture(self, **_when: Any) -> Any:
        """Refused."""
        raise Refused(503, "daemon-down", "no daemon")

    async def ask(self, **what: Any) -> None:
        """Remembers what is to be shown."""
        self.texts.append(str(what.get("show")))


def browser(runs: Path, *, logged_in: bool = True) -> TestClient:
    """A client of an app that serves the recordings in `runs`."""
    daemon = Shown()
    place = runs.parent
    settings = WebSettings(socket=place / "no.sock", runs=runs, setup=place / "setup", cache=place / "cache")
    client = TestClient(make_app(settings, daemon=daemon), base_url="http://localhost", client=("127.0.0.1", 50000))
    if logged_in:
        client.get("/login")
        code = re.sub(r"\D", "", daemon.texts[-1])
        answer = client.post("/api/v1/login", json={"code": code})
        assert answer.status_code == 200, answer.text
        client.headers["X-CSRF-Token"] = answer.json()["csrf"]
    return client
