"""`dnb-edge report` beyond one page: figures, videos, several runs, health, and what it says where it cannot."""

from __future__ import annotations

import signal
import time
from dataclasses import replace
from html import unescape
from pathlib import Path

import cv2
import numpy as np
import pytest
from edge_command import PATIENCE_S, Running
from table_runs import GROUND, SOURCE, Car, entry, record
from typer.testing import CliRunner

from dnb_edge.cli.main import app
from dnb_edge.errors import InputError
from dnb_edge.report.overlay import CAR_COLOURS
from dnb_edge.values import Clock, Health, LostFrames

CAR = Car((3.0, 3.1, 2.9))
FPS = 5.0


def said(*words: object) -> str:
    ran = CliRunner().invoke(app, ["report", *map(str, words)])
    assert ran.exit_code == 0, ran.exception
    return ran.stdout


def refused(*words: object) -> str:
    ran = CliRunner().invoke(app, ["report", *map(str, words)])
    assert isinstance(ran.exception, InputError), ran.exception
    return str(ran.exception)


def read(path: Path) -> list[np.ndarray]:
    reader = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    images = []
    while (taken := reader.read())[0]:
        images.append(taken[1])
    reader.release()
    return images


def shows_car(image: np.ndarray, t_s: float) -> bool:
    """Whether the car's ground point is drawn where it truly was."""
    at_px = GROUND.point_to_camera_px(CAR.at(t_s))
    assert at_px is not None
    u, v = round(at_px[0]), round(at_px[1])
    return bool((np.abs(image[v - 4 : v + 5, u - 4 : u + 5].astype(int) - CAR_COLOURS[0]).mean()) < 25)


def test_figures_are_files_of_the_form_that_is_asked_for(tmp_path: Path) -> None:
    """Each is named on stdout; a page is not written beside."""
    run = record(tmp_path, "run.mcap", CAR)
    lines = said(run, "--figures", tmp_path / "figures", "--format", "svg", "--lap", "3").splitlines()
    files = sorted((tmp_path / "figures").iterdir())
    assert sorted(lines) == [f"Figure: {path}" for path in files]
    assert {"path.svg", "along.svg", "speed-car1-lap3.svg", "lost-car1.svg"} <= {path.name for path in files}
    assert not (tmp_path / "run.html").exists()


def test_a_video_has_the_recorded_pictures_with_what_was_known(tmp_path: Path) -> None:
    """At the recorded rate, as long as the run, with the car where it truly was."""
    run = record(tmp_path, "run.mcap", CAR, image_fps=FPS)
    out = tmp_path / "run.mp4"
    words = said(run, "--video", out)
    images = read(out)
    assert words == f"Video: {out} ({len(images)} pictures)\n"
    assert len(images) == pytest.approx(CAR.lasts_s * FPS, abs=2)
    for k in (10, 25, len(images) - 3):
        assert shows_car(images[k], k / FPS), k
        assert not shows_car(images[k], k / FPS + 1.2), k


def test_a_video_of_one_lap_is_shorter(tmp_path: Path) -> None:
    """A second before and after it, no more."""
    run = record(tmp_path, "run.mcap", CAR, image_fps=FPS)
    said(run, "--video", tmp_path / "lap.avi", "--lap", "2")
    assert len(read(tmp_path / "lap.avi")) == pytest.approx((3.1 + 2.0) * FPS, abs=2)


def test_the_pictures_can_come_from_the_clip(tmp_path: Path) -> None:
    """Of a run of a file, at the clip's own rate; a clip of another size is refused."""
    source = replace(SOURCE, uri="file:race.mp4", clock=Clock.MEDIA)
    run = record(tmp_path, "run.mcap", CAR, source=source)
    assert "name the clip that was raced, file:race.mp4, with --clip" in refused(run, "--video", tmp_path / "a.mp4")
    for name, size in (("race.mp4", (1000, 1000)), ("other.mp4", (640, 480))):
        writer = cv2.VideoWriter(str(tmp_path / name), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"mp4v"), 10, size)
        for _ in range(40):
            writer.write(np.full((size[1], size[0], 3), 90, np.uint8))
        writer.release()
    said(run, "--video", tmp_path / "a.mp4", "--clip", tmp_path / "race.mp4")
    images = read(tmp_path / "a.mp4")
    assert len(images) == 40
    assert shows_car(images[30], 3.0)
    told = refused(run, "--video", tmp_path / "b.mp4", "--clip", tmp_path / "other.mp4")
    assert "its pictures are 640x480, those of" in told
    assert not (tmp_path / "b.mp4").exists()


def test_a_run_without_pictures_says_so(tmp_path: Path) -> None:
    """One line; a simulated run's clock is no clip's; options that want each other say so."""
    run = record(tmp_path, "run.mcap", CAR)
    out = tmp_path / "run.mp4"
    assert refused(run, "--video", out) == (
        f"{run}: has no pictures, so there is nothing to make a video of: race with record.image_fps"
    )
    assert "whose clock no clip has" in refused(run, "--video", out, "--clip", tmp_path / "any.mp4")
    assert "is for --video" in refused(run, "--clip", tmp_path / "any.mp4")
    assert "videos are .mp4" in refused(run, "--video", tmp_path / "run.gif")
    assert "there is no lap 9 of car 1" in refused(run, "--lap", "9")
    assert "must be a lap's number" in refused(run, "--lap", "best")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.mcap"]


def test_several_runs_are_one_page(tmp_path: Path) -> None:
    """A folder, several files, or those of one session among them; sessions that are not there are named."""
    record(tmp_path, "a.mcap", CAR, entry=entry("alpha"), session="one")
    record(tmp_path, "b.mcap", Car((2.8, 2.7)), entry=entry("beta"), session="one")
    record(tmp_path, "c.mcap", Car((2.5, 2.6)), entry=entry("gamma"), session="two")
    assert said(tmp_path) == f"Report: {tmp_path / 'session.html'}\n"
    page = unescape((tmp_path / "session.html").read_text(encoding="utf-8"))
    assert all(name in page for name in ("alpha", "beta", "gamma"))
    assert "3 runs, 3 entries, 7 valid of 7 laps" in page
    assert said("--session", "one", tmp_path, "--out", tmp_path / "out").endswith("session-one.html\n")
    page = unescape((tmp_path / "out" / "session-one.html").read_text(encoding="utf-8"))
    assert "beta" in page
    assert "gamma" not in page
    assert "sessions here: 'one', 'two'" in refused("--session", "three", tmp_path)
    assert "are of one run" in refused(tmp_path, "--lap", "1")


def test_the_page_has_the_recorded_health(tmp_path: Path) -> None:
    """What the appliance told while it recorded, and the time in which no frame came."""
    healths = [
        Health(
            t_ns=second * 10**9,
            t_s=float(second),
            frames=30 * second,
            detected_frames=30 * second,
            dropped_frames=second,
            fps=29.0,
            latency_ms=12.0,
            display="none",
            recording="recording",
            view_error_mean_px=None,
            view_error_mean_m=None,
            lost=(LostFrames(reason="queue", frames=second),),
            warnings=("the processor is hot",) if second == 4 else (),
        )
        for second in range(1, 9)
    ]
    run = record(tmp_path, "run.mcap", CAR, health=healths)
    said(run)
    page = unescape((tmp_path / "run.html").read_text(encoding="utf-8"))
    section = page[page.index("<h2>Health</h2>") :]
    assert "8 (3.23 %): 8 queue" in section
    assert "the processor is hot" in section
    assert "0:04.0" in section


def test_ctrl_c_leaves_no_half_video(tmp_path: Path) -> None:
    """While it is being written: the process ends by the signal, and nothing of the video is left."""
    run = record(tmp_path, "run.mcap", Car((3.0,) * 12), image_fps=30.0)
    out = tmp_path / "video"
    out.mkdir()
    command = Running("report", run, "--video", out / "run.webm", err=tmp_path / "err")
    with command:
        deadline_s = time.monotonic() + PATIENCE_S
        while not any(out.rglob("*.webm")):
            assert command.process.poll() is None, (tmp_path / "err").read_text()
            assert time.monotonic() < deadline_s
            time.sleep(0.02)
        command.process.send_signal(signal.SIGINT)
        assert command.process.wait(60) == 130
    assert list(out.iterdir()) == []
