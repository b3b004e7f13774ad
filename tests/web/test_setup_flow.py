"""The set-up's API: from nothing to a configuration that the daemon takes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from setup_rig import Daemon, Wizard, jpeg, pairs_of, png, state_of, view_of, with_everything, with_route
from typer.testing import CliRunner

from dnb_edge.assembly import assemble
from dnb_edge.cli.main import app as command_line
from dnb_edge.config.calibration_file import load_calibration, reference_picture
from dnb_edge.config.load import load_config
from dnb_edge.sim.rig import Rig, floor_to_camera_px
from dnb_edge.values import Clock, SourceInfo


@pytest.fixture(scope="module")
def rig() -> Rig:
    return Rig(seed=1, laps=1)


@pytest.fixture
def wizard(tmp_path: Path, rig: Rig) -> Wizard:
    return Wizard(tmp_path, Daemon(view_of(rig)))


def source_of(width_px: int = 1280, height_px: int = 720) -> SourceInfo:
    return SourceInfo(
        uri="sim:", width_px=width_px, height_px=height_px, nominal_fps=30.0, clock=Clock.SIMULATED, live=False
    )


def test_whole_flow_ends_in_a_configuration_that_the_daemon_takes(wizard: Wizard, rig: Rig) -> None:
    """From nothing to a saved configuration, each step told as done in its turn, which loads and assembles."""
    begun = wizard.ask("GET", "")
    assert {step["state"] for step in begun["steps"][:5]} == {"open"}
    assert state_of(wizard.ask("POST", "/photo"), "aim")[0] == "done"
    routed = with_route(wizard, rig)
    assert state_of(routed, "route")[0] == "done", routed["steps"]
    assert routed["track"]["length_m"] == pytest.approx(rig.circuit.centreline.length_m, rel=0.02)
    clicked = wizard.ask("PUT", "/keypoints", {"pairs": pairs_of(rig)})
    assert state_of(clicked, "keypoints")[0] == "done", clicked["keypoints"]
    assert len(clicked["keypoints"]["lane_camera_px"]) >= 3
    lined = wizard.ask("PUT", "/lines", {"start": {"ends_px": rig.start_line_px}})
    assert state_of(lined, "start")[0] == "done", lined["steps"]
    saved = wizard.ask("POST", "/save")
    assert saved["run"] == "new"
    assert {"new_run": True} in wizard.daemon.asked
    config = load_config(wizard.setup / "dnb-edge.yaml")
    assert config.capture.source == "v4l2:/dev/video0"
    assert (config.capture.width_px, config.capture.height_px) == (1280, 720)
    setup = assemble(config, source_of()).setup
    assert setup.not_scored_because is None
    assert setup.track.name == "my track"
    assert config.view.calibration is not None
    assert reference_picture(config.view.calibration, load_calibration(config.view.calibration)) is not None
    assert state_of(wizard.ask("GET", ""), "save")[0] == "done"


def test_clicks_give_the_map_of_the_command_line(wizard: Wizard, rig: Rig, tmp_path: Path) -> None:
    """The page's homography and errors are those of `calibrate keypoints` for the same clicks, to 1e-9."""
    answer = with_everything(wizard, rig)
    wizard.ask("POST", "/save")
    names = {path.name.partition("-")[0]: path for path in wizard.setup.iterdir()}
    out = tmp_path / "own.yaml"
    told = CliRunner().invoke(
        command_line,
        ["calibrate", "keypoints", "--keypoints", str(names["keypoints"]), "--twin-image", str(names["twin"]),
         "--metres-per-px", repr(rig.metres_per_px), "--out", str(out), "--json"],
    )  # fmt: skip
    assert told.exit_code == 0, told.output
    found, keypoints = json.loads(told.stdout), answer["keypoints"]
    own = load_calibration(out).ground.camera_to_twin
    assert keypoints["camera_to_twin"] == pytest.approx(own, rel=1e-9, abs=0)
    assert load_calibration(names["view"]).ground.camera_to_twin == pytest.approx(own, rel=1e-9, abs=0)
    assert keypoints["mean_px"] == pytest.approx(found["mean_px"], rel=1e-9)
    assert keypoints["leave_one_out_px"] == pytest.approx(found["leave_one_out_mean_px"], rel=1e-9)
    by_name = {row["name"]: row["error_px"] for row in found["by_keypoint"]}
    assert {point["name"]: pytest.approx(point["error_px"], rel=1e-9) for point in keypoints["points"]} == by_name


def test_draft_is_there_after_a_restart(wizard: Wizard, rig: Rig, tmp_path: Path) -> None:
    """Another process on the same directory goes on where the first was."""
    before = with_everything(wizard, rig)
    again = Wizard(tmp_path, Daemon(view_of(rig)))
    assert again.ask("GET", "") == before
    assert again.get("/twin.png").content == png(rig.twin)
    assert again.get("/picture.jpg").headers["content-type"] == "image/jpeg"


def test_each_step_names_those_that_come_first(wizard: Wizard, rig: Rig) -> None:
    """So that a page shows the way to them and not empty pictures; what is done comes first no more."""

    def needs(answer: dict[str, Any]) -> dict[str, list[str]]:
        return {step["key"]: step["needs"] for step in answer["steps"] if step["needs"]}

    route = {"start": ["route"], "sectors": ["route"]}
    assert needs(wizard.ask("GET", "")) == {"route": ["twin"], "keypoints": ["aim", "twin"], **route, "drive": ["save"]}
    assert needs(wizard.send("/twin", png(rig.twin))) == {"keypoints": ["aim"], **route, "drive": ["save"]}
    assert needs(with_everything(wizard, rig)) == {"drive": ["save"]}
    wizard.ask("POST", "/save")
    assert needs(wizard.ask("GET", "")) == {}


def test_saving_again_keeps_what_was_there(wizard: Wizard, rig: Rig) -> None:
    """What the set-up knows nothing of stays, the configuration before is kept, files that nobody needs go."""
    with_everything(wizard, rig)
    wizard.setup.mkdir(exist_ok=True)
    config = wizard.setup / "dnb-edge.yaml"
    config.write_text("name: Ada\nrace: {laps: 7}\ntrack: {file: old.yaml}\nview: {calibration: old.yaml}\n")
    wizard.ask("POST", "/save")
    first = config.read_text()
    assert (wizard.setup / "dnb-edge.yaml.bak").read_text().startswith("name: Ada")
    assert load_config(config).race.laps == 7
    assert load_config(config).name == "Ada"
    for count in (6, 7):
        answer = wizard.ask("PUT", "/keypoints", {"pairs": pairs_of(rig, count)})
        assert state_of(answer, "save") == ("open", "Changed since it was saved: save again")
        wizard.ask("POST", "/save")
    assert (wizard.setup / "dnb-edge.yaml.bak").read_text() != first
    assert len(list(wizard.setup.glob("keypoints-*"))) <= 2
    assert len(list(wizard.setup.glob("twin-*"))) == 1
    assert not list(wizard.setup.glob("*.new.yaml"))


def test_several_loops_are_named_and_one_is_chosen(wizard: Wizard) -> None:
    """Where the lanes form several loops each is drawn with a letter, and its waypoints choose it."""
    twin = np.full((400, 800, 3), 255, dtype=np.uint8)
    for middle in (200, 600):
        cv2.circle(twin, (middle, 200), 140, (40, 40, 40), 30)
    wizard.send("/twin", png(twin))
    answer = wizard.ask("PUT", "/lane", {"at_px": [200, 60]})
    state, text = state_of(answer, "route")
    assert state == "wrong"
    assert "2 loops" in text
    assert "--" not in text
    assert [loop["letter"] for loop in answer["loops"]] == ["A", "B"]
    chosen = answer["loops"][1]["waypoints_px"]
    answer = wizard.ask("PUT", "/route", {"waypoints_px": chosen, "scale": {"lap_m": 8.8}})
    assert state_of(answer, "route") == ("done", "A lap of 8.80 m")
    assert answer["loops"] == []


def test_line_lies_down_across_the_lane_and_turns_round(wizard: Wizard, rig: Rig) -> None:
    """A tap beside the middle becomes a line across the whole lane, driven as before; flipped it is driven the other way."""
    track = with_route(wizard, rig)["track"]
    at = track["middle_px"][150]
    lined = wizard.ask("PUT", "/lines", {"start": {"at_px": [at[0] + 5, at[1] + 5]}})
    (a, b) = lined["draft"]["lines"]["start_px"]
    assert np.hypot(b[0] - a[0], b[1] - a[1]) == pytest.approx(track["lane_width_px"], rel=0.05)
    assert state_of(lined, "start")[0] == "done"
    flipped = wizard.ask(
        "PUT", "/lines", {"start": {"at_px": at, "flipped": True}, "sectors": [{"at_px": track["middle_px"][300]}]}
    )
    forward = np.subtract(lined["track"]["middle_px"][1], lined["track"]["middle_px"][0])
    backward = np.subtract(flipped["track"]["middle_px"][1], flipped["track"]["middle_px"][0])
    assert forward @ backward < 0
    assert state_of(flipped, "sectors") == ("done", "1 sector line")
    assert [line["name"] for line in flipped["track"]["lines"]] == ["start", "sector 1"]


def test_twin_is_made_of_the_picture(wizard: Wizard, rig: Rig) -> None:
    """A rectangle on the floor, tapped and measured, gives a twin with its scale and four keypoints that fit it."""
    corners_m = np.array([[0.4, 1.8], [2.6, 1.8], [2.6, 0.3], [0.4, 0.3]])
    corners = floor_to_camera_px(rig.camera, corners_m).tolist()
    wizard.ask("POST", "/photo")
    answer = wizard.ask("POST", "/twin", {"corners_px": corners, "width_m": 2.2, "height_m": 1.5})
    assert state_of(answer, "twin")[0] == "done"
    assert answer["keypoints"]["mean_mm"] == pytest.approx(0.0, abs=0.01)
    answer = wizard.ask("PUT", "/lane", {"shade": "auto"})
    assert state_of(answer, "route")[0] == "done", answer["steps"]
    assert answer["track"]["length_m"] == pytest.approx(rig.circuit.centreline.length_m, rel=0.03)
    mirrored = [corners[k] for k in (1, 0, 3, 2)]
    assert "other way" in wizard.refused("POST", "/twin", {"corners_px": mirrored, "width_m": 2.2, "height_m": 1.5})


def test_sigma_map_and_looks_are_pictures_and_numbers(wizard: Wizard, rig: Rig) -> None:
    """The sigma map is a PNG once there is a map, and a look tells sharpness by part of the picture."""
    assert wizard.get("/sigma.png").status_code == 422
    with_everything(wizard, rig)
    drawn = wizard.get("/sigma.png")
    assert drawn.status_code == 200
    assert cv2.imdecode(np.frombuffer(drawn.content, np.uint8), cv2.IMREAD_COLOR) is not None
    sharp = wizard.ask("GET", "/look")
    assert sharp["fault"] is None
    image = cv2.imdecode(np.frombuffer(view_of(rig), np.uint8), cv2.IMREAD_COLOR)
    wizard.daemon.jpeg = jpeg(cv2.GaussianBlur(image, (0, 0), 3))
    blurred = wizard.ask("GET", f"/look?after={sharp['t_ns']}")
    assert blurred["t_ns"] > sharp["t_ns"]
    assert all(blurred["sharpness"][part] < 0.7 * sharp["sharpness"][part] for part in sharp["sharpness"])


def test_papers_photograph_is_set_up(real_dir: Path, tmp_path: Path) -> None:
    """The paper's own photograph, twin and keypoints go through the set-up; its keypoints' known error is told, and limits."""
    files = real_dir / "drivenetbench"
    photo = next(path for path in sorted(files.glob("*.jp*g")) if "twin" not in path.name)
    wizard = Wizard(tmp_path, Daemon(None))
    assert state_of(wizard.send("/photo", photo.read_bytes(), "image/jpeg"), "aim")[0] == "done"
    wizard.send("/twin", (files / "digital-twin.jpg").read_bytes(), "image/jpeg")
    wizard.ask("PUT", "/lane", {"at_px": [1859, 60]})
    answer = wizard.ask("PUT", "/route", {"scale": {"metres_per_px": 0.0015}})
    camera, twin = (np.load(files / f"keypoints_from_{side}.npy").tolist() for side in ("camera", "diagram"))
    pairs = [
        {"name": str(k), "camera_px": a, "twin_px": b} for k, (a, b) in enumerate(zip(camera, twin, strict=True), 1)
    ]
    start = [[1885.433612, 263.652512], [1832.566388, -31.652511]]
    answer = wizard.ask("PUT", "/keypoints", {"pairs": pairs})
    assert answer["keypoints"]["mean_px"] == pytest.approx(26.7, abs=0.1)
    assert state_of(answer, "keypoints")[0] == "wrong"
    answer = wizard.ask("PUT", "/keypoints", {"pairs": pairs, "limit_mm": 60})
    assert answer["keypoints"]["over_limit"] is None
    answer = wizard.ask("PUT", "/lines", {"start": {"ends_px": start}})
    assert state_of(answer, "start")[0] == "done", answer["steps"]
    saved = wizard.ask("POST", "/save")
    assert saved["run"] == "later"
    config = load_config(wizard.setup / "dnb-edge.yaml")
    setup = assemble(config, source_of(3840, 2160)).setup
    assert setup.not_scored_because is None
