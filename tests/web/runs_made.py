"""Recordings with all that a race says, quickly made, and a browser on an app that serves them."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from starlette.testclient import TestClient

sys.path.insert(0, str(Path(__file__).parents[1] / "cli"))

from table_runs import FPS, GROUND, SOURCE, Car, setup
from web_box import HOST, log_in, settings_in

from dnb_edge.core import Core, CoreSetup
from dnb_edge.live.messages import Phase, State
from dnb_edge.record.header import RunHeader
from dnb_edge.record.identity import identity_of
from dnb_edge.record.writer import Recorder, RecordingSettings
from dnb_edge.values import Detection, EntryInfo, Event, FrameDetections, Lap
from dnb_edge.web.app import make_app
from dnb_edge.web.box import WebSettings
from dnb_edge.web.guard_rates import Limits


def header_of(made: CoreSetup, **changes: Any) -> RunHeader:
    plain: dict[str, Any] = {"name": "net", "config": {}, "source": SOURCE, "identity": identity_of(made).to_dict()}
    return RunHeader(setup={"core": made.to_dict(), "calibration": {}, "sha256": {}}, **(plain | changes))


def said(car: Car, made: CoreSetup, *, from_frame: int = 0) -> Iterator[FrameDetections | Event]:
    """What a race of `car` gives to its recorder, in order."""
    core = Core(made)
    for k in range(from_frame, int(car.lasts_s * FPS)):
        t_ns = round(k * 1e9 / FPS)
        camera_px = GROUND.point_to_camera_px(car.at(t_ns * 1e-9))
        assert camera_px is not None
        one = Detection(camera_px=camera_px, sigma_px=1.0, length_px=40.0, confidence=0.9)
        found = FrameDetections(sequence=k, t_ns=t_ns, detections=(one,), full_frame=True)
        yield found
        yield from core.step(found)
    yield from core.finish()


def recorder(folder: Path, header: RunHeader, **changes: Any) -> Recorder:
    plain: dict[str, Any] = {"image_fps": None, "lossless": True, "sync_period_s": 3600.0}
    return Recorder(RecordingSettings(directory=folder, **(plain | changes)), header, None)


def record(
    folder: Path, *lap_times_s: float, name: str | None = None, finish: bool = True, entry: str = "net", **header: Any
) -> Path:
    """A recording of a car that drives laps in these times; called `name` where that is given. Without `finish` as it is after
    a power cut.
    """
    made = setup()
    folder.mkdir(parents=True, exist_ok=True)
    writer = recorder(folder, header_of(made, name=entry, entry=EntryInfo(name=entry), **header))
    for one in said(Car(lap_times_s), made):
        if isinstance(one, FrameDetections):
            writer.add_detections(one)
        else:
            ticket = writer.add_event(one)
            if isinstance(one, Lap):
                assert writer.wait_saved(ticket)
    if finish:
        path = writer.close()
        return path if name is None else path.rename(folder / name)
    assert writer.wait_saved()
    path = writer.path
    writer.abandon()
    return path if name is None else path.rename(folder / f"{name}.part")


@dataclass
class Racing:
    """A daemon that says which run goes on, and shows nothing."""

    run: str | None = None
    epoch = None

    @property
    def state(self) -> State | None:
        return None if self.run is None else State(phase=Phase.RACING, run=self.run)

    def events(self, _since: int | None = None) -> tuple[Any, ...]:
        return ()

    async def ask(self, **_what: Any) -> None:
        return


@dataclass
class Guest:
    """A browser, and what it looks at."""

    client: TestClient
    settings: WebSettings
    daemon: Racing

    def runs(self, **query: Any) -> list[dict[str, Any]]:
        answer = self.client.get("/api/v1/runs", params=query)
        assert answer.status_code == 200, answer.text
        found: list[dict[str, Any]] = answer.json()["runs"]
        return found

    def only_id(self) -> str:
        (run,) = self.runs()
        return str(run["id"])


def guest(folder: Path, *, logged_in: bool = True, **changes: Any) -> Guest:
    """Somebody before an app on folders in `folder`; recordings belong into `folder / "runs"`."""
    settings, daemon = settings_in(folder, **changes), Racing()
    app = make_app(settings, daemon=daemon, limits=Limits(per_s=0))
    client = TestClient(app, base_url=HOST, raise_server_exceptions=False, follow_redirects=False)
    if logged_in:
        client.headers["X-CSRF-Token"] = log_in(client)
    return Guest(client=client, settings=settings, daemon=daemon)
