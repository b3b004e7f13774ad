"""`dnb-edge model`: what it says, and how it refuses what it cannot use."""

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from edge_command import edge

from dnb_edge.cli import model, model_files
from dnb_edge.cli.model_bench import parse_threads
from dnb_edge.detect.check import figures, judge
from dnb_edge.detect.onnx import default_model_path
from dnb_edge.errors import InputError
from dnb_edge.sim.rig import Rig

BOX_PX = 80.0


@pytest.fixture(scope="session")
def labelled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three simulated pictures with one car each, in images/ and labels/; the third has no label file."""
    folder = tmp_path_factory.mktemp("labelled")
    (folder / "images").mkdir()
    (folder / "labels").mkdir()
    rig = Rig(seed=1, laps=1)
    for number in range(3):
        image, truth = rig.frame(40 * number).bgr, rig.frame_truth(40 * number)
        height, width = image.shape[:2]
        cv2.imwrite(str(folder / "images" / f"{number}.png"), image)
        if number < 2:
            u, v = truth.camera_px
            label = f"0 {(u + 0.5) / width} {(v + 0.5) / height} {BOX_PX / width} {BOX_PX / height}\n"
            (folder / "labels" / f"{number}.txt").write_text(label)
    return folder


def test_check_tells_figures_and_draws_the_worst(labelled, tmp_path):
    """The JSON has the fields that scripts rely on, true of the pictures, and alone on stdout; the sheet is a picture."""
    sheet = tmp_path / "worst.png"
    ran = edge("model", "check", "--images", labelled, "--json", "--worst", sheet, "--confidence", "0.25")
    assert ran.code == 0, ran.err
    (result,) = ran.events
    assert (result["images"], result["cars"], result["unlabelled"]) == (2, 2, 1)
    assert result["recall"] == result["found"] / 2
    found = result["found"] + result["false"]
    assert result["precision"] == (result["found"] / found if found else None)
    assert set(result["centre_error_px"]) == {"p50", "p95"}
    if result["found"]:
        assert 0 <= result["centre_error_px"]["p50"] <= result["centre_error_px"]["p95"] < BOX_PX
    assert [one["confidence"] for one in result["thresholds"]] == [0.25, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9]
    assert "1 pictures without a label file" in ran.err
    assert cv2.imread(str(sheet)) is not None


def test_check_names_the_line_that_is_no_label(labelled, tmp_path):
    """A label that cannot be read ends the command with code 2 and one line that names its file and line."""
    (tmp_path / "a.png").write_bytes((labelled / "images" / "0.png").read_bytes())
    (tmp_path / "a.txt").write_text("0 0.5 0.5 0.1 0.1\n0 0.5 0.5 left 0.1\n")
    ran = edge("model", "check", "--images", tmp_path)
    assert ran.code == 2
    assert "a.txt, line 2" in ran.complaint()


def test_names_with_brackets_are_told_as_they_are(labelled, tmp_path):
    """Brackets in a path are no markup: what is said names the folder and the sheet whole."""
    folder = tmp_path / "[bold]x[/odd]"
    shutil.copytree(labelled, folder)
    ran = edge("model", "check", "--images", folder, "--worst", folder / "w.png")
    assert ran.code == 0, ran.err
    assert f"{folder}: 1 pictures without" in ran.err
    assert f"Worst cases: {folder / 'w.png'}" in ran.err


@pytest.mark.parametrize(
    ("files", "message"),
    [
        (None, "not a folder"),
        ({}, "no pictures"),
        ({"a.jpg": b"", "b.jpg": b""}, "2 pictures and no label file"),
    ],
)
def test_folders_that_hold_nothing_to_check(tmp_path, files, message):
    """An absent, an empty and an unlabelled folder are refused by name, each with what to do."""
    folder = tmp_path / "pictures"
    if files is not None:
        folder.mkdir()
        for name, content in files.items():
            (folder / name).write_bytes(content)
    with pytest.raises(InputError, match=f"pictures: .*{message}"):
        model_files.labelled_pictures(folder)


def test_a_picture_that_is_none_is_named(tmp_path):
    """A file that only has a picture's name is refused by it."""
    (tmp_path / "a.jpg").write_bytes(b"no picture")
    with pytest.raises(InputError, match=r"a\.jpg: not a readable picture"):
        model_files.read_picture(tmp_path / "a.jpg")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["none.onnx"], r"none\.onnx: the model cannot be read"),
        (["/"], "/: the model cannot be read"),
        (["--worst", "none/sheet.png"], r"sheet\.png: give a file NAME\.png in a folder that exists"),
        (["--set", "detector.threads=2"], "--set needs a configuration"),
    ],
)
def test_check_refuses_what_it_cannot_use(labelled, words, message, capsys):
    """An unknown model, a sheet that cannot be written and a setting of nothing are refused before the work."""
    with pytest.raises(InputError, match=message):
        model.app(["check", "--images", str(labelled), *words], standalone_mode=False)


def test_the_marker_detector_has_no_model_to_check(labelled):
    """`model check` with a configuration of roof markers says that there is no model."""
    config = model.DetectorConfig(kind="markers")
    with pytest.raises(InputError, match="has no model to check"):
        model.make_look(config, None)


def test_a_lower_confidence_asks_the_detector_for_more():
    """`--confidence` below the detector's own makes it report more, not only count more."""
    look, least = model.make_look(model.DetectorConfig(model=default_model_path()), 0.01)
    usual, own = model.make_look(model.DetectorConfig(), None)
    image = np.random.default_rng(1).integers(0, 256, (240, 320, 3), dtype=np.uint8)
    assert least == 0.01 < own
    assert len(look(image)) >= len(usual(image))
    assert all(one.confidence >= 0.8 * 0.01 for one in look(image))


def test_figures_are_strict_json_where_nothing_is_known():
    """What `--json` prints holds no NaN, whatever was found or labelled."""
    for pictures in ([], [judge([], [])], [judge([], [(0.0, 0.0, 1.0, 1.0)])]):
        assert (
            json.loads(json.dumps(model.plain(figures(pictures, 0.2)), allow_nan=False))["centre_error_px"]["p50"]
            is None
        )


def test_bench_compares_all_passes_with_another_network():
    """Window and full frame on each number of threads, with the ratio to the other network on as many threads."""
    shipped = default_model_path()
    ran = edge("model", "bench", "--against", shipped, "--threads", "1,2", "--turns", "2", "--json")
    assert ran.code == 0, ran.err
    (result,) = ran.events
    assert [(one["name"], one["threads"]) for one in result["passes"]] == [
        ("window", 1), ("full_frame", 1), ("window", 2), ("full_frame", 2)
    ]  # fmt: skip
    assert len(result["against"]) == 4
    for one in result["passes"]:
        assert 0 < one["p50_ms"] <= one["p99_ms"]
        assert one["samples"] == 10
        assert one["ratio"]["cpu"] > 0


@pytest.mark.parametrize("text", ["", "0", "1,x", "17", "-1", "1;2"])
def test_threads_that_are_none(text):
    """Anything but a list of small positive numbers is refused."""
    with pytest.raises(InputError, match="--threads"):
        parse_threads(text)


def test_threads_are_told_once_each():
    """A list of numbers, each once, ascending."""
    assert parse_threads("2, 1,2") == [1, 2]
