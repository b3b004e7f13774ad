"""`dnb-edge calibrate keypoints`, as a shell sees it."""

import json
import sys

import cv2
import numpy as np
import pytest
from keypoint_samples import TWIN, seen

from dnb_edge.cli.main import main

CAMERA = seen(TWIN)


@pytest.fixture
def shell(monkeypatch, capsys):
    """Runs the command with arguments; gives exit code, stdout, stderr."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["dnb-edge", "calibrate", "keypoints", *map(str, arguments)])
        with pytest.raises(SystemExit) as caught:
            main()
        out, err = capsys.readouterr()
        return int(caught.value.code or 0), out, err

    return run


def saved(tmp_path, camera=CAMERA, twin=TWIN):
    np.save(tmp_path / "camera.npy", camera)
    np.save(tmp_path / "twin.npy", twin)
    return ("--camera", tmp_path / "camera.npy", "--twin", tmp_path / "twin.npy")


def test_the_papers_figure_as_json_and_picture(shell, real_dir, tmp_path):
    """All known answers to 0.01 px, JSON alone on stdout, and the plot in either format."""
    folder = real_dir / "drivenetbench"
    files = ("--camera", folder / "keypoints_from_camera.npy", "--twin", folder / "keypoints_from_diagram.npy")
    code, out, err = shell(*files, "--json", "--plot", tmp_path / "figure.png")
    assert (code, err) == (0, "")
    facts = json.loads(out)
    assert [row["points"] for row in facts["by_count"]] == [4, 5, 6, 7, 8, 9]
    means = [row["mean_px"] for row in facts["by_count"]]
    sums = [row["sum_px"] for row in facts["by_count"]]
    assert means == pytest.approx([1244.73, 34.96, 32.56, 39.91, 36.73, 26.69], abs=0.01)
    assert sums == pytest.approx([11202.58, 314.62, 293.07, 359.16, 330.55, 240.23], abs=0.01)
    assert facts["mean_px"] == pytest.approx(26.69, abs=0.01)
    assert facts["sum_px"] == pytest.approx(240.23, abs=0.01)
    assert facts["leave_one_out_mean_px"] == pytest.approx(57.96, abs=0.01)
    assert "mean_m" not in facts
    assert cv2.imread(str(tmp_path / "figure.png")) is not None
    assert shell(*files, "--plot", tmp_path / "figure.svg")[0] == 0
    assert (tmp_path / "figure.svg").read_bytes().startswith(b"<?xml")


def test_a_table_for_people(shell, tmp_path):
    """Without --json the same numbers stand in tables, in millimetres too where the scale is given."""
    code, out, _ = shell(*saved(tmp_path, CAMERA + 0.5 * np.sign(np.sin(np.arange(14)).reshape(7, 2))))
    assert code == 0
    assert "left out in turn" in out
    assert "fitted to the first" in out
    assert " mm" not in out
    assert " mm" in shell(*saved(tmp_path), "--metres-per-px", "0.002")[1]


def test_metres_in_json(shell, tmp_path):
    """With the scale, errors are in metres beside pixels; with four pairs there is no leave-one-out."""
    code, out, _ = shell(*saved(tmp_path, CAMERA[:4], TWIN[:4]), "--metres-per-px", "0.002", "--json")
    assert code == 0
    facts = json.loads(out)
    assert facts["mean_m"] == pytest.approx(0.002 * facts["mean_px"])
    assert facts["leave_one_out_mean_px"] is facts["leave_one_out_mean_m"] is None
    assert len(facts["by_count"]) == 1


def test_yaml_pairs(shell, tmp_path):
    """A YAML file serves like two arrays, and its names stand in the table, brackets and all."""
    lines = [f"  - {{name: 'p [{k}]', camera_px: [{u}, {v}], twin_px: [{x}, {y}]}}" for k, ((u, v), (x, y)) in
             enumerate(zip(CAMERA, TWIN, strict=True))]  # fmt: skip
    path = tmp_path / "pairs.yaml"
    path.write_text("pairs:\n" + "\n".join(lines) + "\n")
    code, out, _ = shell("--keypoints", path)
    assert code == 0
    assert "p [3]" in out
    assert shell("--keypoints", path, *saved(tmp_path))[0] == 2


LINE = np.array([[10.0 * k, 20.0 * k + 5] for k in range(7)])


@pytest.mark.parametrize(
    ("camera", "twin", "options", "message"),
    [
        (CAMERA, TWIN[:6], (), "7 camera points but 6 twin points"),
        (CAMERA[:3], TWIN[:3], (), "3 pairs of keypoints: a homography needs at least 4"),
        (LINE, TWIN, (), "camera keypoints lie on one line"),
        (CAMERA, LINE, (), "twin keypoints lie on one line"),
        (CAMERA[[0, 0, 2, 3, 4]], TWIN[:5], (), "keypoints 1 and 2 are the same point"),
        (CAMERA, TWIN.ravel(), (), "keypoints of shape (14,)"),
        (CAMERA, TWIN, ("--metres-per-px", "-1"), "--metres-per-px -1: must be a positive number"),
        (CAMERA, TWIN, ("--plot", "figure.pdf"), "must end in .png or .svg"),
        (CAMERA, TWIN, ("--plot", "nowhere/figure.png"), "make it first"),
    ],
)
def test_bad_input_is_one_line_and_code_2(shell, tmp_path, monkeypatch, camera, twin, options, message):
    """Every mistake: exit code 2, one line, no traceback, nothing on stdout."""
    monkeypatch.chdir(tmp_path)
    code, out, err = shell(*saved(tmp_path, camera, twin), *options, "--json")
    assert (code, out) == (2, "")
    assert message in err
    assert err.startswith("dnb-edge: ")
    assert err.count("\n") == 1


def test_missing_files_and_options(shell, tmp_path):
    """A file that is not there, and one side without the other."""
    good = saved(tmp_path)
    assert "cannot read the keypoints" in shell("--camera", tmp_path / "none.npy", *good[2:])[2]
    code, _, err = shell(*good[:2])
    assert code == 2
    assert "give --camera and --twin" in err
