"""What a running service tells the doctor, over a real live socket."""

import itertools
import os
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import cv2
import numpy as np
import pytest

from dnb_edge.doctor import gather, setup_facts
from dnb_edge.doctor.box import Box, Where
from dnb_edge.doctor.camera_rules import judge_rate
from dnb_edge.doctor.live_facts import ask_service
from dnb_edge.doctor.setup_rules import RacePace
from dnb_edge.doctor.verdict import CannotTell, Status
from dnb_edge.live.messages import Phase, State
from dnb_edge.live.server import LiveServer
from dnb_edge.values import Frame, Health, LostFrames, StampSource

HEALTH = Health(
    t_ns=1, t_s=0.0, frames=600, detected_frames=590, dropped_frames=8, fps=29.5, latency_ms=9.0, display="online",
    recording="recording", view_error_mean_px=None, view_error_mean_m=None, warnings=("camera gap of 2.1 s",),
    latency_p95_ms=21.0, view_moved_m=0.012, lost=(LostFrames(reason="queue", frames=6), LostFrames(reason="gap", frames=2)),
)  # fmt: skip


def show_pictures(made: LiveServer, over: threading.Event, *, health: Health | None = None) -> None:
    """Fifty pictures a second, each with `health` where that is given, until it is over."""
    jpeg = cv2.imencode(".jpg", np.full((48, 64, 3), 90, dtype=np.uint8))[1].tobytes()
    for number in itertools.count(1):
        if over.wait(0.02):
            return
        stamp_ns = number * 33_333_333
        made.offer(
            Frame(
                sequence=number, t_ns=stamp_ns, stamp_source=StampSource.START_OF_FRAME, width_px=64, height_px=48, jpeg=jpeg
            )
        )  # fmt: skip
        if health is not None:
            made.tell(replace(health, t_ns=stamp_ns))


@pytest.fixture
def server(tmp_path: Path) -> Iterator[LiveServer]:
    """A daemon's end of the socket that races and has pictures until it is closed."""
    with LiveServer(tmp_path / "s", version="1") as made:
        over = threading.Event()
        thread = threading.Thread(target=show_pictures, args=(made, over), kwargs={"health": HEALTH})
        made.show(State(phase=Phase.RACING, source="v4l2:/dev/video0"))
        thread.start()
        yield made
        over.set()
        thread.join()


def box(tmp_path: Path, *, config: str = "gone.yaml") -> Box:
    where = Where(config=tmp_path / config, setup=tmp_path / "setup", socket=tmp_path / "s", seconds=1.0)
    return Box(where)


def test_a_race_tells_of_its_camera(server: LiveServer, tmp_path: Path) -> None:
    """Pictures, rate, losses and warnings come over the socket; the camera is not touched."""
    looked = box(tmp_path)
    footage = looked.footage
    assert (footage.from_service, footage.info.live, footage.fps) == (True, True, 29.5)
    assert (footage.info.width_px, footage.info.uri) == (64, "v4l2:/dev/video0")
    assert footage.lost == HEALTH.lost
    assert len(footage.stills) == 5
    assert len(footage.brightness) > 12
    assert judge_rate(gather.rate(looked)).status is Status.OK
    answer = gather.answer(looked)
    assert (answer.phase, answer.warnings) == (Phase.RACING, HEALTH.warnings)
    pace = setup_facts.find_pace(looked)
    assert isinstance(pace, RacePace)
    assert pace.lost_share == pytest.approx(6 / 606)
    with pytest.raises(CannotTell, match="the running service has the camera"):
        gather.controls(looked)


def test_a_service_without_a_camera_says_why(tmp_path: Path) -> None:
    """Its own reason is the answer of the check of pictures."""
    with LiveServer(tmp_path / "s", version="1") as server:
        server.show(State(phase=Phase.FAULT, reason="/dev/video0: there is no such camera"))
        looked = box(tmp_path)
        answer = gather.answer(looked)
        assert (answer.phase, answer.reason) == (Phase.FAULT, "/dev/video0: there is no such camera")
        with pytest.raises(CannotTell, match="there is no such camera"):
            _ = looked.footage


def test_between_two_races_nobody_counts_frames(tmp_path: Path) -> None:
    """Its pictures are then all that is known: that none of them is missing says nothing of the camera's."""
    with LiveServer(tmp_path / "s", version="1") as server:
        server.show(State(phase=Phase.SETUP, source="v4l2:/dev/video0"))
        over = threading.Event()
        thread = threading.Thread(target=show_pictures, args=(server, over))
        thread.start()
        try:
            looked = box(tmp_path)
            assert looked.footage.lost is None
            with pytest.raises(CannotTell, match="in a race only"):
                gather.losses(looked)
        finally:
            over.set()
            thread.join()


@contextmanager
def as_nobody() -> Iterator[None]:
    """For a moment without root's rights."""
    groups = os.getgroups()
    os.setgroups([])
    os.setegid(65534)
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)
        os.setegid(0)
        os.setgroups(groups)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become somebody who may less")
@pytest.mark.parametrize("folder_mode", [0o700, 0o755])
def test_who_may_not_ask_is_not_told_that_nobody_is_there(folder_mode: int) -> None:
    """Else the service's own camera would be opened, and its being busy be told as a fault."""
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        Path(name).chmod(folder_mode)
        with (
            LiveServer(Path(name) / "s", version="1"),
            as_nobody(),
            pytest.raises(CannotTell, match="only the service's group may ask it: run this with sudo"),
        ):
            ask_service(Path(name) / "s", seconds=0.5)


def test_nobody_there_is_no_service(tmp_path: Path) -> None:
    """No socket, and one that a killed daemon left behind."""
    assert ask_service(tmp_path / "s", seconds=0.5) is None
    LiveServer(tmp_path / "s", version="1").close()
    (tmp_path / "s").touch()
    began_s = time.monotonic()
    assert ask_service(tmp_path / "s", seconds=0.5) is None
    assert gather.answer(box(tmp_path)).phase is None
    assert time.monotonic() - began_s < 30.0


@pytest.mark.parametrize("moved_m", [0.012, None])
def test_a_race_that_says_nothing_need_not_have_looked(moved_m: float | None) -> None:
    """That the camera has moved is believed; that nothing is said is no proof that it stands where it was."""
    service = SimpleNamespace(health=replace(HEALTH, view_moved_m=moved_m))
    view = SimpleNamespace(calibration=None, keypoints=None)
    known = SimpleNamespace(service=service, config=SimpleNamespace(view=view), footage=SimpleNamespace(info=None))
    if moved_m is None:
        with pytest.raises(CannotTell, match="kept no picture"):
            setup_facts.find_place(cast("Box", known))
    else:
        assert setup_facts.find_place(cast("Box", known)).moved_m == moved_m
