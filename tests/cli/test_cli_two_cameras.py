"""A track under two cameras, through the command line: raced, recorded, scored again; and what does not fit."""

import json
from pathlib import Path

import pytest
import yaml
from edge_command import edge
from mcap.reader import make_reader

from dnb_edge.sim.driver import drive
from dnb_edge.sim.files import DemoFiles, course_files
from dnb_edge.sim.places import place

LAP_LIMIT_S = 0.008


def hall(folder: Path, **changes: object) -> Path:
    """The configuration of the hall; `changes` are of its second camera's section `capture`."""
    here = place("hall")
    first, second = (course_files(folder / str(k), here.circuit, camera) for k, camera in enumerate(here.cameras))
    sections = {
        "track": {
            "image": str(first.twin),
            "lane_hsv": list(first.lane_hsv),
            "metres_per_px": first.metres_per_px,
            "start_line_px": [list(point) for point in first.start_line_px],
        },
        "view": view(first),
        "capture": {"source": "sim:?place=hall&laps=1&seed=2"},
        "further_cameras": [
            {"view": view(second), "capture": {"source": "sim:?place=hall&laps=1&seed=2&camera=1"} | changes}
        ],
    }
    path = folder / "hall.yaml"
    path.write_text(yaml.safe_dump(sections))
    return path


def view(files: DemoFiles) -> dict[str, object]:
    return {
        "keypoints_camera": str(files.camera_keypoints),
        "keypoints_twin": str(files.twin_keypoints),
        "image_size_px": list(files.keypoints_image_size_px),
        "max_mean_error_m": 0.02,
    }


def events(text: str) -> list[dict[str, object]]:
    return [json.loads(line) for line in text.splitlines()]


def test_a_lap_through_two_cameras_is_timed_recorded_and_scored_again(tmp_path):
    """The lap is true to 8 ms, is scored, the recording holds both cameras' pictures, and scoring it again says the same."""
    raced = edge("run", "--config", hall(tmp_path), "--record", tmp_path / "runs", "--json")
    assert raced.code == 0, raced.err
    told = events(raced.out)
    (lap,) = [event for event in told if event["event"] == "lap"]
    crossings_s = drive(place("hall").circuit, laps=1, seed=2).crossings_s
    assert lap["time_s"] == pytest.approx(crossings_s[1] - crossings_s[0], abs=LAP_LIMIT_S)
    assert lap["valid"]
    assert not lap["suspect"]
    assert lap["similarity_percent"] > 90.0
    (recording,) = (tmp_path / "runs").glob("*.mcap")
    with recording.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    topics = {channel.topic for channel in summary.channels.values()}
    assert {"/camera/image", "/camera_2/image", "/camera_2/annotations"} <= topics
    scored = edge("score", recording, "--json")
    assert scored.code == 0, scored.err
    kinds = ("crossing", "lap", "score")
    assert [one for one in events(scored.out) if one["event"] in kinds] == [
        one for one in told if one["event"] in kinds
    ]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"source": None}, "further_cameras.0: capture.source is missing"),
        ({"source": "sim:?place=hall&camera=7"}, "the place hall has no camera 7"),
        ({"source": "sim:?place=nowhere"}, "there is no place 'nowhere'"),
        ({"source": "file:nothing.mp4"}, "further_cameras.0: "),
    ],
    ids=["no source", "no such camera", "no such place", "no such file"],
)
def test_a_second_camera_that_is_not_there_is_named(tmp_path, changes, said):
    """One line names the camera's section and what is wrong, the exit code is 2, and nothing is written."""
    ran = edge("run", "--config", hall(tmp_path, **changes), "--record", tmp_path / "runs", "--json")
    assert (ran.code, ran.out) == (2, "")
    assert said in ran.err
    assert len(ran.err.strip().splitlines()) == 1
    assert not list(tmp_path.glob("runs/*"))


def test_cameras_of_two_clocks_are_refused(tmp_path, clip):
    """A video beside a simulated camera has another clock: no lap could be timed over both."""
    ran = edge("run", "--config", hall(tmp_path, source=f"file:{clip}"), "--json")
    assert ran.code == 2
    assert "stamped by another clock" in ran.err
