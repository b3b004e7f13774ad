"""`dnb-edge calibrate refine` as a shell runs it: what it says, what it writes and what it refuses."""

import json
import os
import pty
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from edge_command import COMMAND, PATIENCE_S, EdgeOnce, Ran, edge, environment

from dnb_edge.cli.demo import write_demo_config
from dnb_edge.config.calibration_file import load_calibration
from dnb_edge.sim.circuit import LANE_HSV, TWIN_SCALE, edge_line
from dnb_edge.sim.renderer import Renderer
from dnb_edge.sim.rig import Rig
from dnb_edge.view.calibration import CalibrationMethod
from dnb_edge.view.refine_edges import strip_mask

HSV = ",".join(map(str, LANE_HSV))


@pytest.fixture(scope="session")
def bench(rig: Rig, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The demo with six badly clicked keypoints, and a picture of its empty room; for reading only."""
    folder = tmp_path_factory.mktemp("refine")
    path = write_demo_config(folder, rig)
    cv2.imwrite(str(folder / "empty.png"), Renderer(rig.circuit, rig.camera, 1).picture(0, None))
    camera, twin = rig.keypoint_pairs(6)
    random = np.random.default_rng(4)
    view = yaml.safe_load(path.read_text())["view"]
    across = view["image_size_px"][0] / rig.camera.width_px
    np.save(folder / view["keypoints_camera"], (camera + random.normal(0.0, 3.0, camera.shape)) * across)
    np.save(folder / view["keypoints_twin"], twin)
    return path


@pytest.fixture(scope="session")
def once(tmp_path_factory: pytest.TempPathFactory) -> EdgeOnce:
    return EdgeOnce(tmp_path_factory.mktemp("once-refine"))


@pytest.fixture(scope="session")
def written(bench: Path, once: EdgeOnce) -> tuple[Ran, Path]:
    """A refinement taken with --yes, its plot drawn."""
    folder = bench.parent
    out = folder / "refined.yaml"
    words = ("--config", bench, "--picture", folder / "empty.png", "--out", out, "--plot", folder / "both.png")
    return once("written", "calibrate", "refine", *words, "--yes", "--json"), out


def test_nothing_that_is_read_is_written_over(bench, tmp_path):
    """The picture is never drawn over; --set needs the configuration that it changes."""
    words = ("calibrate", "refine", "--picture", bench.parent / "empty.png")
    ran = edge(*words, "--config", bench, "--plot", bench.parent / "empty.png")
    assert (ran.code, "is read, too, and would be lost" in ran.complaint()) == (2, True)
    ran = edge(*words, "--calibration", tmp_path / "v.yaml", "--set", "race.laps=2")
    assert (ran.code, "--set: sets keys of --config" in ran.complaint()) == (2, True)


def test_yes_takes_what_is_better(written):
    """--yes writes the refined calibration with the picture of its view and its inputs; the JSON tells before and after."""
    ran, out = written
    assert ran.code == 0, ran.err
    facts = json.loads(ran.out)
    assert facts["better"]
    assert facts["written"] == str(out)
    assert facts["after"]["overlap"] > facts["before"]["overlap"]
    assert facts["after"]["edge_median_m"] < facts["before"]["edge_median_m"]
    assert len(facts["after"]["leave_one_out_px"]) == 6
    calibration = load_calibration(out)
    assert calibration.method is CalibrationMethod.REFINED
    assert calibration.covariance is not None
    assert "empty.png" in [one.name for one in calibration.inputs]
    assert calibration.reference is not None
    assert (out.parent / calibration.reference.name).exists()
    assert calibration.error.mean_px == pytest.approx(facts["after"]["mean_px"])
    assert "/" not in calibration.notes[-1]
    picture = cv2.imread(str(out.parent / "both.png"))
    assert picture.shape[0] > 800


def test_without_a_terminal_and_yes_it_only_reports(bench, tmp_path):
    """Nobody to ask: the table is printed, nothing is written, it says so, and the exit code is 0."""
    out = tmp_path / "refined.yaml"
    ran = edge("calibrate", "refine", "--config", bench, "--picture", bench.parent / "empty.png", "--out", out)
    assert ran.code == 0
    assert "overlap of the lanes" in ran.out
    assert "each left out in turn" in ran.out
    assert "better: " in ran.out
    assert "give --yes" in ran.err
    assert not out.exists()


@pytest.mark.parametrize(("answer", "taken"), [("y", True), ("n", False), ("", False)])
def test_on_a_terminal_it_asks(bench, written, tmp_path, answer, taken):
    """It is written where the answer is yes; Enter alone is no."""
    del written  # only so that both do not run at once
    out = tmp_path / "refined.yaml"
    words = ("calibrate", "refine", "--config", bench, "--picture", bench.parent / "empty.png", "--out", out)
    master, terminal = pty.openpty()
    with subprocess.Popen(
        [*COMMAND, *map(str, words)], env=environment(), stdin=terminal, stdout=terminal, stderr=terminal
    ) as process:
        os.close(terminal)
        said = b""
        while b"take it?" not in said:
            said += os.read(master, 1000)
        os.write(master, answer.encode() + b"\n")
        assert process.wait(PATIENCE_S) == 0
    os.close(master)
    assert out.exists() == taken


def test_what_is_not_better_is_not_written(bench, tmp_path):
    """A picture of the room seen by a camera that was moved: --yes does not take it, and fails."""
    picture = cv2.imread(str(bench.parent / "empty.png"))
    turned = cv2.getRotationMatrix2D((640, 360), 2.0, 1.0)
    moved = tmp_path / "moved.png"
    cv2.imwrite(str(moved), cv2.warpAffine(picture, turned, (1280, 720), borderMode=cv2.BORDER_REFLECT))
    exact = tmp_path / "exact"
    exact.mkdir()
    config = write_demo_config(exact, Rig(seed=1, laps=3))
    out = tmp_path / "refined.yaml"
    ran = edge("calibrate", "refine", "--config", config, "--picture", moved, "--out", out, "--yes")
    assert ran.code == 1
    assert "not better" in ran.out
    assert "keep the present calibration" in ran.err
    assert not out.exists()


def test_a_calibration_file_is_refined_with_its_keypoints(bench, written, tmp_path):
    """From files alone: a calibration, the twin and its lane's colour, the clicks."""
    _, out = written
    view = yaml.safe_load(bench.read_text())["view"]
    track = yaml.safe_load(bench.read_text())["track"]
    folder = bench.parent
    ran = edge(
        "calibrate", "refine", "--calibration", out, "--twin-image", folder / track["image"], "--lane-hsv", HSV,
        "--camera", folder / view["keypoints_camera"], "--twin", folder / view["keypoints_twin"],
        "--picture", folder / "empty.png", "--json",
    )  # fmt: skip
    assert ran.code == 0, ran.err
    facts = json.loads(ran.out)
    assert facts["moved_px"] < 1.0
    assert facts["written"] is None


def test_a_lane_told_by_its_shade_serves_as_well(bench, rig, written):
    """`track.lane` in the configuration, instead of a colour, gives the same edges."""
    del written
    text = yaml.safe_load(bench.read_text())
    del text["track"]["lane_hsv"]
    text["track"]["lane"] = "dark"
    left, right = (edge_line(rig.circuit, offset, 0.01) for offset in (0.13, -0.13))
    strip = strip_mask(left, right, TWIN_SCALE, closed=True)
    paper = np.full((800, 1200), 255, dtype=np.uint8)
    paper[:, : strip.shape[1]][strip] = 60
    cv2.imwrite(str(bench.parent / "shade.png"), paper)
    text["track"]["image"] = "shade.png"
    other = bench.parent / "shade.yaml"
    other.write_text(yaml.safe_dump(text))
    ran = edge("calibrate", "refine", "--config", other, "--picture", bench.parent / "empty.png", "--json")
    assert ran.code == 0, ran.err
    assert json.loads(ran.out)["better"]


def test_a_refined_calibration_is_not_refined_by_the_same_edges_again(bench, written):
    """Without its keypoints the edges would count twice."""
    _, out = written
    track = yaml.safe_load(bench.read_text())["track"]
    folder = bench.parent
    words = ("--twin-image", folder / track["image"], "--lane-hsv", HSV, "--picture", folder / "empty.png")
    ran = edge("calibrate", "refine", "--calibration", out, *words)
    assert ran.code == 2
    assert "refined already" in ran.complaint()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--picture", "empty.png"), "--config"),
        (("--picture", "none.png", "--config", "demo.yaml"), "none.png"),
        (("--picture", "demo.yaml", "--config", "demo.yaml"), "not a picture"),
        (("--picture", "empty.png", "--config", "demo.yaml", "--calibration", "x.yaml"), "--config, or"),
        (("--picture", "empty.png", "--config", "demo.yaml", "--keypoints", "x.yaml"), "leave x.yaml out"),
        (("--picture", "empty.png", "--calibration", "x.yaml", "--set", "a=1"), "--set"),
        (("--picture", "empty.png", "--config", "demo.yaml", "--plot", "x.txt"), ".png or .svg"),
        (("--picture", "empty.png", "--config", "demo.yaml", "--out", "x.txt", "--yes"), ".yaml"),
        (("--picture", "empty.png", "--config", "demo.yaml", "--yes"), "--out"),
        (("--picture", "empty.png", "--config", "demo.yaml", "--click-sigma-px", "0"), "positive"),
        (("--picture", "grey.png", "--config", "demo.yaml"), "cannot be told from the floor"),
        (("--picture", "square.png", "--config", "demo.yaml"), "aspect ratio"),
    ],
)
def test_what_is_wrong_is_one_line(bench, words, says):
    """Exit code 2 and one line that says what to do."""
    folder = bench.parent
    for name, shape in (("grey.png", (720, 1280, 3)), ("square.png", (720, 720, 3))):
        if not (folder / name).exists():
            cv2.imwrite(str(folder / name), np.full(shape, 128, dtype=np.uint8))
    ran = edge("calibrate", "refine", *words, cwd=folder)
    assert ran.code == 2
    assert says in ran.complaint()
    assert ran.out == ""
