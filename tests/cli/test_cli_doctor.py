"""`dnb-edge doctor` as a shell runs it: what it prints, its exit codes, and that each thing that is broken is found."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from edge_command import edge

from dnb_edge.doctor.checks import CHECKS
from dnb_edge.doctor.verdict import Status
from dnb_edge.sim.rig import Rig

SIM = "capture.source=sim:?laps=1"


def told(config: Path, *words: str) -> tuple[int, dict[str, dict[str, Any]]]:
    """The exit code, and what `--json` tells of each check by its name."""
    away = ("--socket", str(config.parent / "no.sock"), "--runs", str(config.parent))
    ran = edge("doctor", "--config", config, "--set", SIM, *away, *words, "--json")
    said = json.loads(ran.out)
    assert said["well"] == (ran.code == 0)
    assert said["counts"] == {
        status.value: [one["status"] for one in said["checks"]].count(status) for status in Status
    }
    return ran.code, {one["name"]: one for one in said["checks"]}


@pytest.fixture(scope="module")
def unspoilt(pristine: Path) -> tuple[int, dict[str, dict[str, Any]]]:
    """What the doctor says where nothing was spoilt."""
    return told(pristine / "demo.yaml")


def test_all_checks_are_made_on_a_simulated_track(unspoilt: tuple[int, dict[str, dict[str, Any]]]) -> None:
    """Each check has its verdict in the table's order; what is amiss has a fix; nothing of ours is broken."""
    code, checks = unspoilt
    assert list(checks) == [check.name for check in CHECKS]
    well = ("set-up", "config", "track", "calibration", "calibration-age", "frames", "picture", "sharpness", "model", "python",
            "disk-access", "disk-space", "recordings", "monotonic")  # fmt: skip
    assert {name: checks[name] for name in well if checks[name]["status"] != "ok"} == {}
    assert all((one["fix"] is not None) == (one["status"] in ("warn", "fail")) for one in checks.values())
    assert [one for one in checks.values() if "please report" in one["found"]] == []
    failed = [one for one in checks.values() if one["status"] == "fail"]
    assert (code == 0) == (not failed)


def other_twin(track: Path) -> None:
    np.save(track / "keypoints_twin.npy", np.load(track / "keypoints_twin.npy")[::-1])


def mirrored_twin(track: Path) -> None:
    np.save(track / "keypoints_twin.npy", np.load(track / "keypoints_twin.npy") * [-1.0, 1.0] + [4000.0, 0.0])


def no_lane(track: Path) -> None:
    twin = cv2.imread(str(track / "twin.png"))
    cv2.imwrite(str(track / "twin.png"), np.full_like(twin, 255))


def broken_recording(track: Path) -> None:
    (track / "run-0123abcd-0001.mcap").write_bytes(b"\x89MCAP0\r\n")


@pytest.mark.parametrize(
    ("spoil", "words", "name", "status", "said"),
    [
        (no_lane, (), "track", "fail", "twin.png"),
        (lambda track: (track / "twin.png").unlink(), (), "track", "fail", "twin.png"),
        (other_twin, (), "calibration", "fail", "mm off on average"),
        (mirrored_twin, (), "calibration", "fail", "mirror"),
        (broken_recording, (), "recordings", "warn", "runs recover"),
        (None, ("--set", "race.lops=3"), "config", "fail", "race.lops"),
        (None, ("--set", "display.uri=oled:0"), "config", "fail", "display.uri"),
        (None, ("--set", "display.uri=serial:/dev/gone"), "display", "fail", "/dev/gone is not there"),
        (None, ("--set", "display.uri=serial:/dev/gone"), "display-answer", "fail", "No such file"),
        (None, ("--set", "detector.model=m.onnx"), "model", "fail", "m.onnx"),
        (None, ("--set", "capture.source=v4l2:/dev/video99"), "camera", "fail", "/dev/video99 is not there"),
        (None, ("--set", "capture.source=v4l2:/dev/video99"), "frames", "fail", "no such camera"),
        (None, ("--set", "capture.source=file:gone.mp4"), "frames", "fail", "gone.mp4"),
        (None, ("--runs", "gone", "--set", "record.directory=gone"), "disk-access", "warn", "mkdir -p"),
    ],
)
def test_what_is_broken_is_found(
    config: Path, unspoilt: tuple[int, dict[str, dict[str, Any]]], spoil: Callable[[Path], object] | None,
    words: tuple[str, ...], name: str, status: str, said: str,
) -> None:  # fmt: skip
    """One thing at a time: its check says so, with a fix, and failures alone decide about the exit code."""
    assert unspoilt[1][name]["status"] != status
    if spoil is not None:
        spoil(config.parent)
    code, checks = told(config, "--only", name, *words)
    found = checks[name]
    assert found["status"] == status, found
    assert said in f"{found['found']} {found['fix']}", found
    assert code == (1 if status == "fail" else 0)


@pytest.mark.parametrize(
    ("shift_px", "status", "said"), [(0.0, "ok", "where it was"), (6.0, "fail", "the camera has moved")]
)
def test_a_camera_that_moved_is_found(config: Path, rig: Rig, shift_px: float, status: str, said: str) -> None:
    """The pictures are compared with the one that the calibration kept; without one nobody can tell."""
    track = config.parent
    unkept = told(config, "--only", "camera-moved")[1]["camera-moved"]
    assert (unkept["status"], "kept no picture" in unkept["found"]) == ("skip", True)
    cv2.imwrite(str(track / "still.png"), rig.frame(0).bgr)
    made = edge(
        "calibrate", "keypoints", "--config", config, "--picture", track / "still.png", "--out", track / "view.yaml"
    )
    assert made.code == 0, made.err
    plain = yaml.safe_load(config.read_text())
    config.write_text(yaml.safe_dump(plain | {"view": {"calibration": "view.yaml"}}))
    writer = cv2.VideoWriter(str(track / "clip.mp4"), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"mp4v"), 30, (1280, 720))
    shift = np.array([[1.0, 0.0, shift_px], [0.0, 1.0, -0.5 * shift_px]])
    for number in range(5):
        picture = cv2.warpAffine(rig.frame(6 * number).bgr, shift, (1280, 720), borderMode=cv2.BORDER_REFLECT)
        writer.write(picture)
    writer.release()
    uri = ("--set", f"capture.source=file:{track}/clip.mp4")
    code, checks = told(config, "--only", "camera-moved", "--only", "calibration", "--only", "calibration-age", *uri)
    assert checks["calibration"]["status"] == "ok", checks
    assert checks["calibration-age"]["found"] == "0 days old"
    assert checks["camera-moved"]["status"] == status, checks
    assert said in checks["camera-moved"]["found"]
    assert code == (1 if status == "fail" else 0)


def test_for_people(config: Path) -> None:
    """A line a check with its group above and its fix below, and a summary; codes 0 and 1."""
    away = ("--socket", config.parent / "no.sock", "--runs", config.parent)
    ran = edge("doctor", "--config", config, "--set", SIM, *away, "--only", "track", "--only", "config")
    assert (ran.code, ran.err) == (0, "")
    assert "Set-up" in ran.out
    assert re.search(r"^OK +track +demo track", ran.out, re.MULTILINE)
    assert "2 ok, 0 warn, 0 fail, 0 skip" in ran.out
    no_lane(config.parent)
    ran = edge("doctor", "--config", config, *away, "--only", "track")
    assert ran.code == 1
    assert "FAIL" in ran.out
    assert "-> Mend what is named" in ran.out


def test_the_list() -> None:
    """Every check with what it looks at, made or not."""
    ran = edge("doctor", "--list")
    assert ran.code == 0
    assert [line.split()[0] for line in ran.out.splitlines()] == [check.name for check in CHECKS]
    listed = json.loads(edge("doctor", "--list", "--json", "--only", "disk").out)
    assert {one["group"] for one in listed} == {"Disk"}


@pytest.mark.parametrize(
    ("words", "said"),
    [(("--only", "sharpnes"), "sharpness"), (("--config", "gone.yaml"), "gone.yaml: there is no such file")],
)
def test_a_wrong_command_is_refused(words: tuple[str, ...], said: str) -> None:
    """Code 2 and one line."""
    ran = edge("doctor", *words)
    assert (ran.code, ran.out) == (2, "")
    assert said in ran.complaint()
