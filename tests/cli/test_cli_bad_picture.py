"""A camera that shows nothing, through the command line: the run ends well, says what is wrong, and invents no car."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from edge_command import edge

from dnb_edge.assembly import assemble
from dnb_edge.config.load import load_config
from dnb_edge.errors import InputError
from dnb_edge.record.reader import read_run
from dnb_edge.values import Clock, Health, SourceInfo

INFO = SourceInfo(uri="x:", width_px=1280, height_px=720, nominal_fps=30.0, clock=Clock.MEDIA, live=False)


@pytest.fixture
def black_clip(tmp_path: Path) -> Path:
    """Two seconds of nothing."""
    path = tmp_path / "black.mp4"
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"mp4v"), 30, (1280, 720))
    for _ in range(60):
        writer.write(np.zeros((720, 1280, 3), dtype=np.uint8))
    writer.release()
    return path


def test_a_black_clip_is_told_and_gives_no_car(pristine: Path, black_clip: Path, tmp_path: Path) -> None:
    """Health and its recording say black, stderr says so once, the last line for how long; no lap, no observation, code 0."""
    words = ("run", "--config", pristine / "demo.yaml", "--source", f"file:{black_clip}", "--record", tmp_path / "runs")
    ran = edge(*words, "--json", "--observations")
    assert ran.code == 0
    assert ran.of("observation", "crossing", "lap") == []
    assert ran.of("health")[-1]["picture"] == "black"
    assert ran.of("health")[-1]["warnings"][0].startswith("picture black")
    assert "picture black" in ran.complaint()
    (last,) = ran.of("run")
    assert (last["frames"], last["detected_frames"]) == (60, 0)
    assert last["bad_pictures"][0].startswith("black for 1.")
    recorded = [event for event in read_run(Path(last["recording"])).events() if isinstance(event, Health)]
    assert recorded[-1].picture == "black"


def test_the_board_and_the_last_line_say_it_too(pristine: Path, black_clip: Path) -> None:
    """For people: a warning while it lasts, and a sentence at the end."""
    ran = edge("run", "--config", pristine / "demo.yaml", "--source", f"file:{black_clip}")
    assert ran.code == 0
    assert "warning: picture black" in ran.out + ran.err
    assert "The picture was black for 1." in ran.out + ran.err


def test_markers_on_roofs_know_where_the_camera_stands(pristine: Path) -> None:
    """With the detector `markers` the view knows the camera's height (2.2 m in the demo); otherwise it is not asked for."""
    plain = assemble(load_config(pristine / "demo.yaml", []), INFO)
    assert plain.setup.ground.camera_m is None
    marked = assemble(load_config(pristine / "demo.yaml", ["detector.kind=markers"]), INFO)
    assert marked.setup.ground.camera_m is not None
    assert marked.setup.ground.camera_m[2] == pytest.approx(2.2, rel=0.01)


def test_a_height_that_cannot_be_is_refused(pristine: Path) -> None:
    """A measured height that contradicts the keypoints is named before the run begins."""
    with pytest.raises(InputError, match="camera_height_m"):
        assemble(load_config(pristine / "demo.yaml", ["detector.kind=markers", "view.camera_height_m=9"]), INFO)
