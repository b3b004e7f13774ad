"""`dnb-edge teach` as a shell runs it: wrong input in one line, and its smallest form where torch is installed."""

import importlib
import importlib.util
import json
import shutil

import cv2
import numpy as np
import pytest
from edge_command import edge

from dnb_edge.assembly import assemble
from dnb_edge.config.load import load_config
from dnb_edge.train.teach_drive import lane_mask
from dnb_edge.values import Clock, SourceInfo

TORCH = importlib.util.find_spec("torch") is not None
needs_torch = pytest.mark.skipif(not TORCH, reason="teaching needs the extra 'train' (torch)")


def _labelled(folder, count, text="0 0.5 0.5 0.25 0.25\n"):
    folder.mkdir(exist_ok=True)
    for number in range(count):
        picture = np.full((96, 128, 3), 110, np.uint8)
        cv2.circle(picture, (64, 48), 12, (40, 40, 200), -1)
        cv2.imwrite(str(folder / f"{number:03d}.png"), picture)
        (folder / f"{number:03d}.txt").write_text(text)
    return folder


@pytest.fixture(scope="module")
def random_model(tmp_path_factory):
    """A model of random weights: quick to teach, and knows no car."""
    torch = importlib.import_module("torch")
    card, network, quantise, weights = (
        importlib.import_module(f"dnb_edge.train.{name}") for name in ("card", "network", "quantise", "weights")
    )
    torch.manual_seed(1)
    path = tmp_path_factory.mktemp("model") / "random.onnx"
    made = network.CentreNet().eval()
    quantise.quantise(
        made, path, [np.random.default_rng(1).random((1, network.INPUT_CHANNELS, 64, 64), dtype=np.float32)] * 2
    )
    weights.save_weights(weights.weights_path(path), made)
    card.write_card(path, {"sha256": card.file_sha256(path)})
    return path


def test_wrong_input_is_one_line_that_names_it(tmp_path):
    """Nothing given, a missing clip, folders with nothing to learn from, too few labels, a bad name: exit 2 and one line."""
    empty = tmp_path / "empty"
    empty.mkdir()
    bare = _labelled(tmp_path / "bare", 3)
    for path in bare.glob("*.txt"):
        path.unlink()
    torn = _labelled(tmp_path / "torn", 3)
    (torn / "001.png").write_bytes(b"torn")
    few = _labelled(tmp_path / "few", 12)
    cases = [
        ((), "nothing to teach from"),
        (("none.mp4",), "none.mp4"),
        (("--labels", empty), "empty: no pictures"),
        (("--labels", bare), "bare: 3 pictures and no label file"),
        (("--labels", torn), "001.png: not a readable picture"),
        (("--labels", few), "few: 12 labelled cars are too few"),
        (("--labels", few, "--name", "../x"), "--name ../x"),
        (("--labels", few, "--name", ""), "--name : give a plain file name"),
        (("--labels", few, "--out", few / "000.png"), "000.png: no folder can be made"),
        (("--labels", few, "--out", few / "000.png" / "deeper"), "deeper: no folder can be made"),
    ]
    for words, says in cases:
        ran = edge("teach", *words, cwd=tmp_path)
        assert ran.code == 2, words
        assert says in ran.complaint().replace("\n", " "), words
        assert not (tmp_path / "taught").exists()


@pytest.mark.skipif(TORCH, reason="torch is installed here")
def test_without_torch_one_line_says_what_to_install(tmp_path):
    """With right labels and no PyTorch: exit 2 and the command that installs it."""
    ran = edge("teach", "--labels", _labelled(tmp_path / "right", 24), cwd=tmp_path)
    assert ran.code == 2
    assert "pip install 'dnb-edge[train]'" in ran.complaint()


def test_the_command_line_needs_no_torch():
    """Whatever is installed, starting `dnb-edge` does not load PyTorch."""
    code = "import sys, dnb_edge.cli.main; sys.exit('torch' in sys.modules)"
    subprocess = importlib.import_module("subprocess")
    assert subprocess.run([importlib.import_module("sys").executable, "-c", code], check=False).returncode == 0


def test_the_lane_of_a_configuration_is_where_the_car_drives(config, rig):
    """Every true ground point of the simulated drive lies on the mask; most of the picture does not."""
    info = SourceInfo(
        uri="sim:",
        width_px=rig.camera.width_px,
        height_px=rig.camera.height_px,
        nominal_fps=None,
        clock=Clock.SIMULATED,
        live=False,
    )
    mask = lane_mask(assemble(load_config(config), info).setup, info.width_px, info.height_px)
    for number in range(0, rig.frames, 25):
        u, v = rig.frame_truth(number).camera_px
        assert mask[round(v), round(u)], number
    assert 0.02 < mask.mean() < 0.6


@needs_torch
def test_labels_are_taught_after_the_sheet_was_looked_at(random_model, tmp_path):
    """Nobody to ask is exit 2 with the sheet's path; a number beyond it too; with --yes a model, its card, weights and JSON."""
    folder, out = _labelled(tmp_path / "right", 24), tmp_path / "out"
    words = ["teach", "--labels", folder, "--out", out, "--model", random_model, "--iterations", 1, "--force", "--json"]
    asked = edge(*words)
    assert asked.code == 2
    assert "contact-sheet.png" in asked.err
    assert "--yes" in asked.err.splitlines()[-1]
    assert cv2.imread(str(out / "contact-sheet.png")) is not None
    beyond = edge(*words, "--reject", "99")
    assert beyond.code == 2
    assert "'99' is not on the contact sheet" in beyond.err
    ran = edge(*words, "--yes", "--name", "mine[1].v2")
    assert ran.code == 0, ran.err
    said = json.loads(ran.out)
    assert said["model"] == str(out / "mine[1].v2.onnx")
    assert said["before"]["cars"] == said["after"]["cars"] == 5
    card = json.loads((out / "mine[1].v2.json").read_text())
    assert card["command"] == "dnb-edge teach --labels right --seed 1 --minutes 14 --iterations 1"
    assert sorted(path.name for path in out.iterdir()) == [
        "contact-sheet.png",
        "mine[1].v2.json",
        "mine[1].v2.onnx",
        "mine[1].v2.weights.npz",
    ]


@needs_torch
def test_a_base_without_weights_is_told_before_the_sheet(random_model, tmp_path):
    """A model without its weights cannot be taught: one line says so before anything is labelled or written."""
    for path in (random_model, random_model.with_suffix(".json")):
        shutil.copy(path, tmp_path)
    bare = tmp_path / random_model.name
    ran = edge("teach", "--labels", _labelled(tmp_path / "right", 24), "--model", bare, "--yes", cwd=tmp_path)
    assert ran.code == 2
    assert "random.weights.npz: the weights cannot be read" in ran.complaint()
    assert not (tmp_path / "taught").exists()


@needs_torch
def test_a_drive_labels_itself_and_is_taught(random_model, config, clip, tmp_path):
    """A clip of the simulated drive and a model that knows no car: labelled by the mask, taught, written."""
    words = [
        "--config",
        config,
        "--out",
        tmp_path / "out",
        "--model",
        random_model,
        "--iterations",
        1,
        "--yes",
        "--force",
    ]
    ran = edge("teach", clip, *words)
    assert ran.code == 0, ran.err
    assert "pictures labelled; 0 of 1 paths with the present model's ground points" in ran.err
    assert (tmp_path / "out" / "my-car.onnx").exists()
    assert "following: share found" in ran.out
