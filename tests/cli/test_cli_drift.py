"""A camera that is bumped in the middle of a run, through the command line: laps, health, recording, report, and the check."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
from edge_command import Ran, edge

from dnb_edge.record.reader import read_run
from dnb_edge.sim.rig import Rig

BUMP_PX = 4.0
FPS = 15.0


@dataclass(frozen=True)
class Bumped:
    """A run over a clip of two laps, the camera bumped in the second."""

    ran: Ran
    config: Path
    clip: Path
    bump_s: float
    recording: Path
    still: Path
    """A picture from before the bump."""


def _picture(rig: Rig, number: int, shift_px: float) -> np.ndarray:
    picture = rig.frame(number).bgr
    if shift_px == 0.0:
        return picture
    matrix = np.array([[1, 0, shift_px], [0, 1, -0.5 * shift_px]])
    return cv2.warpAffine(picture, matrix, (1280, 720), borderMode=cv2.BORDER_REFLECT)


@pytest.fixture(scope="module")
def bumped(pristine: Path, tmp_path_factory: pytest.TempPathFactory) -> Bumped:
    """The demo's car, filmed at 15 frames a second."""
    directory = tmp_path_factory.mktemp("bumped")
    rig = Rig(seed=1, fps=FPS, laps=2)
    second = rig.truth.laps[1]
    bump_s = second.start_s + 0.3 * second.time_s
    clip = directory / "bumped.mp4"
    writer = cv2.VideoWriter(str(clip), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"mp4v"), FPS, (1280, 720))
    for number in range(rig.frames):
        writer.write(_picture(rig, number, BUMP_PX if number / FPS >= bump_s else 0.0))
    writer.release()
    still = directory / "still.png"
    cv2.imwrite(str(still), _picture(rig, 0, 0.0))
    config = pristine / "demo.yaml"
    ran = edge("run", "--config", config, "--source", f"file:{clip}", "--record", directory, "--json")
    assert ran.code == 0, ran.err
    (recording,) = directory.glob("*.mcap")
    return Bumped(ran=ran, config=config, clip=clip, bump_s=bump_s, recording=recording, still=still)


def test_the_lap_after_the_bump_is_suspect_and_valid(bumped: Bumped) -> None:
    """The lap before it is clean; the one in which it was told carries why, and stays valid."""
    first, second = bumped.ran.of("lap")
    assert first["suspect"] == []
    (why,) = second["suspect"]
    assert why.startswith("the camera had moved by ")
    assert why.endswith(" mm since it was calibrated")
    assert (first["valid"], second["valid"]) == (True, True)


def test_health_tells_it_within_five_seconds(bumped: Bumped) -> None:
    """With its size: 4.5 px, of 2.6 to 4.5 mm, over the demo's track; stderr says it once."""
    told = [health for health in bumped.ran.of("health") if health["view_moved_m"] is not None]
    assert bumped.bump_s < told[0]["t_s"] <= bumped.bump_s + 5.0
    assert 0.011 < told[0]["view_moved_m"] < 0.021
    assert told[0]["warnings"][0].startswith("camera moved ")
    assert bumped.ran.err.count("camera moved ") == 1


def test_the_recording_scores_the_same(bumped: Bumped) -> None:
    """What was known of the view is in the recording, frame by frame, so that laps are marked alike when raced again."""
    again = edge("score", bumped.recording, "--json")
    assert again.of("lap", "score", "crossing") == bumped.ran.of("lap", "score", "crossing")
    moved = [found.view_moved_m is not None for found in read_run(bumped.recording).detections()]
    assert 0 < moved.index(True) < len(moved)
    assert all(moved[moved.index(True) :])


def test_export_and_report_say_it(bumped: Bumped, tmp_path: Path) -> None:
    """The CSV has a column of its own, the page stands it beside `valid`, and a person's list of laps ends with it."""
    rows = list(csv.DictReader(io.StringIO(edge("runs", "export", bumped.recording).out)))
    assert rows[0]["suspect"] == ""
    assert rows[1]["suspect"].startswith("the camera had moved by ")
    assert edge("report", bumped.recording, "--out", tmp_path).code == 0
    (page,) = tmp_path.glob("*.html")
    assert "yes, but suspect: the camera had moved by " in page.read_text()
    lines = edge("score", bumped.recording).out.splitlines()
    assert ["SUSPECT: the camera had moved by" in line for line in lines if line.startswith("  lap ")] == [False, True]


def test_check_says_in_place(bumped: Bumped) -> None:
    """Exit code 0, and no shift to speak of, before the bump."""
    words = ("calibrate", "check", "--config", bumped.config, "--source", f"file:{bumped.clip}")
    ran = edge(*words, "--reference", bumped.still, "--json")
    assert ran.code == 0, ran.err
    facts = json.loads(ran.out)
    assert facts["in_place"]
    assert facts["moved_px"] < 0.3
    assert facts["agreeing"] > 0.7 * facts["patches"]
    assert edge(*words, "--reference", bumped.still).out.startswith("The camera is in its place.")


def test_check_says_moved_by_how_much(bumped: Bumped, tmp_path: Path) -> None:
    """Exit code 1, with the shift in px, mm and per cent of the span; nothing is changed."""
    elsewhere = tmp_path / "elsewhere.png"
    cv2.imwrite(str(elsewhere), _picture(Rig(seed=1, laps=1), 0, -BUMP_PX))
    words = ("calibrate", "check", "--config", bumped.config, "--source", f"file:{bumped.clip}")
    ran = edge(*words, "--reference", elsewhere, "--json")
    assert ran.code == 1
    facts = json.loads(ran.out)
    assert facts["verdict"] == "moved"
    assert facts["moved_px"] == pytest.approx(np.hypot(BUMP_PX, 0.5 * BUMP_PX), abs=0.3)
    assert facts["share_of_span"] == pytest.approx(facts["moved_m"] / facts["span_m"])
    assert "has moved since it was calibrated" in ran.complaint()


def test_check_asks_for_what_it_needs(bumped: Bumped, tmp_path: Path) -> None:
    """No reference, none that can be read, one of another shape, one of another place: a line that says what to do."""
    words = ("calibrate", "check", "--config", bumped.config, "--source", f"file:{bumped.clip}")
    without = edge(*words)
    assert (without.code, "--reference PICTURE" in without.complaint()) == (2, True)
    missing = edge(*words, "--reference", tmp_path / "none.png")
    assert (missing.code, "none.png" in missing.complaint()) == (2, True)
    square = tmp_path / "square.png"
    cv2.imwrite(str(square), np.zeros((500, 500, 3), np.uint8))
    other = edge(*words, "--reference", square)
    assert (other.code, "500x500" in other.complaint()) == (2, True)
    noise = tmp_path / "noise.png"
    blotches = cv2.GaussianBlur(np.random.default_rng(1).normal(0, 90, (720, 1280)), (0, 0), 3)
    cv2.imwrite(str(noise), np.clip(128 + 5 * blotches, 0, 255).astype(np.uint8))
    foreign = edge(*words, "--reference", noise)
    assert (foreign.code, "cannot be compared" in foreign.complaint()) == (1, True)
