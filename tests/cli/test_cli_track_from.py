"""`dnb-edge track build` from photographs, recordings and drives, as a shell sees it, on the simulated rig."""

import json
import sys

import cv2
import numpy as np
import pytest

from dnb_edge.cli.main import main
from dnb_edge.config.calibration_file import calibration_file, load_calibration
from dnb_edge.config.track_file import load_track
from dnb_edge.sim.circuit import TWIN_SCALE, demo_circuit
from dnb_edge.sim.renderer import Renderer
from dnb_edge.sim.rig import Rig, demo_camera
from dnb_edge.track.centreline import Centreline
from dnb_edge.view.calibration import Calibration, CalibrationMethod
from dnb_edge.view.ground import GroundMap
from dnb_edge.view.homography import CalibrationError
from dnb_edge.view.photograph import twin_of

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """A folder with photographs of the simulated room, empty and with the car, and the exact calibration."""
    folder = tmp_path_factory.mktemp("room")
    circuit, camera = demo_circuit(), demo_camera()
    cv2.imwrite(str(folder / "empty.png"), Renderer(circuit, camera, 1).picture(0, None))
    to_twin = np.array(
        [[1, 0, 0], [0, -1, TWIN_SCALE.height_px * TWIN_SCALE.metres_per_px], [0, 0, TWIN_SCALE.metres_per_px]]
    )
    h = to_twin @ np.linalg.inv(camera.floor_homography())
    h *= np.sign((h @ [640, 719, 1])[2])
    ground = GroundMap(camera_to_twin=tuple(h.ravel().tolist()), scale=TWIN_SCALE, width_px=1280, height_px=720)
    none = CalibrationError(mean_px=0.0, sum_px=0.0, max_px=0.0, leave_one_out_mean_px=None, per_point_px=(0.0,))
    calibration = Calibration(ground=ground, covariance=None, error=none, method=CalibrationMethod.KEYPOINTS)
    (folder / "calibration.yaml").write_bytes(calibration_file(calibration))
    return folder


@pytest.fixture
def shell(monkeypatch, capsys):
    """Runs `dnb-edge track build` with arguments; gives exit code, stdout, stderr."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["dnb-edge", "track", "build", *map(str, arguments)])
        with pytest.raises(SystemExit) as caught:
            main()
        out, err = capsys.readouterr()
        return int(caught.value.code or 0), out, err

    return run


def truth():
    """The circuit's own centreline."""
    line = demo_circuit().centreline
    at = np.arange(2000) * line.length_m / 2000
    return Centreline(points_m=line.at(at), half_left_m=np.full(2000, 0.13), half_right_m=np.full(2000, 0.13))


def mean_off_m(path):
    """Mean distance, metres, of the track file's route from the circuit's centreline, and whether it is driven like it."""
    route = load_track(path).centreline
    s_m, d_m = truth().locate(route.points_m)
    steps = np.diff(s_m)
    return float(np.abs(d_m).mean()), float(np.median(steps)) > 0


@pytest.mark.parametrize("lane", [(), ("--lane", "between-lines"), ("--lane-pixel", "640,540")])
def test_a_photograph_of_the_empty_track(shell, room, tmp_path, lane):
    """However the lane is told, the route lies within 5 mm of the true centreline on average, and the width is right."""
    out = tmp_path / "track.yaml"
    code, text, err = shell("--photo", room / "empty.png", "--calibration", room / "calibration.yaml", *lane,
                            "--out", out, "--twin-out", tmp_path / "twin.png", "--json")  # fmt: skip
    assert (code, err) == (0, "")
    facts = json.loads(text)
    assert facts["lane_width_m"] == pytest.approx(0.26, abs=0.015)
    assert facts["metres_per_px"] == TWIN_SCALE.metres_per_px
    assert mean_off_m(out) == (pytest.approx(0.0, abs=0.005), True)
    twin = cv2.imread(str(tmp_path / "twin.png"))
    assert twin.shape[0] == TWIN_SCALE.height_px
    if lane:
        return
    # The twin is one that a drawing could be: the same lane is found in it again.
    code, text, err = shell("--image", tmp_path / "twin.png", "--lane", "dark", "--close-gap-px", 16,
                            "--metres-per-px", TWIN_SCALE.metres_per_px, "--json")  # fmt: skip
    assert (code, err) == (0, "")
    assert json.loads(text)["length_m"] == pytest.approx(facts["length_m"], rel=0.01)


def test_cars_are_taken_out_of_several_photographs(shell, room, tmp_path):
    """Three photographs with the car in three places make a twin without it."""
    rig = Rig(seed=1, laps=1)
    photos = []
    for index in (0, 70, 140):
        path = tmp_path / f"{index}.png"
        cv2.imwrite(str(path), rig.frame(index).bgr)
        photos += ["--photo", path]
    code, _, err = shell(*photos, "--calibration", room / "calibration.yaml", "--twin-out", tmp_path / "some.png")
    assert (code, err) == (0, "")
    ground = load_calibration(room / "calibration.yaml").ground
    none = twin_of(cv2.imread(str(room / "empty.png")), ground, right_px=1500.0).astype(int)
    some = cv2.imread(str(tmp_path / "some.png")).astype(int)
    width = min(some.shape[1], none.shape[1])
    assert np.percentile(np.abs(some[:, :width] - none[:, :width]), 99.9) < 25


def test_driving_round_defines_the_track(shell, room, tmp_path):
    """From nothing but a calibration and a car that drives three rounds, the route lies within 10 mm of the true centreline."""
    out = tmp_path / "driven.yaml"
    code, text, err = shell(
        "--drive", "sim:?laps=4&fps=20", "--calibration", room / "calibration.yaml", "--out", out, "--json"
    )
    assert (code, err) == (0, "")
    facts = json.loads(text)
    assert facts["laps"] == 3
    assert facts["spread_m"] < 0.015
    assert mean_off_m(out) == (pytest.approx(0.0, abs=0.01), True)


def test_one_round_is_enough_with_a_warning(shell, room, tmp_path):
    """One round is taken, and it is said what that means; where the car does not come round there is none."""
    code, text, err = shell("--drive", "sim:?laps=1&fps=15", "--calibration", room / "calibration.yaml",
                            "--rounds", 1, "--lane-width-m", 0.26, "--json")  # fmt: skip
    assert code == 0
    assert "One lap only" in err
    assert json.loads(text)["lane_width_m"] == pytest.approx(0.26)
    code, out, err = shell(
        "--drive", "file:" + str(clip(tmp_path / "still.mp4", room)), "--calibration", room / "calibration.yaml"
    )
    assert (code, out) == (2, "")
    assert "no moving car was found in" in err


def clip(path, room):
    """A clip of the empty room."""
    picture = cv2.imread(str(room / "empty.png"))
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), 10, (1280, 720))
    for _ in range(12):
        writer.write(picture)
    writer.release()
    return path


def test_the_laps_of_a_recording_define_the_track(shell, tmp_path, monkeypatch, capsys):
    """Recorded laps make a track with their own start line, within 10 mm of the true centreline; a twin as well."""
    monkeypatch.setattr(sys, "argv", ["dnb-edge", "demo", "--fast", "--laps", "2", "--out", str(tmp_path / "demo")])
    with pytest.raises(SystemExit):
        main()
    capsys.readouterr()
    (run,) = (tmp_path / "demo").glob("*.mcap")
    out = tmp_path / "laps.yaml"
    code, text, err = shell("--laps", run, "--out", out, "--twin-out", tmp_path / "twin.png", "--json")
    assert (code, err) == (0, "")
    assert json.loads(text)["laps"] == 2
    assert mean_off_m(out) == (pytest.approx(0.0, abs=0.01), True)
    recorded = demo_circuit().start_line_m
    line = load_track(out).start_line
    assert np.allclose([line.start_m, line.end_m], recorded, atol=0.01)
    code, text, err = shell("--laps", run, "--laps", run, "--start-at", "600,330", "--json")
    assert code == 0
    assert json.loads(text)["laps"] == 4


BAD = [
    ((), "nothing to build a track from: give --image, --photo, --source, --laps or --drive"),
    (("--photo", "ROOM/empty.png"), "--photo: needs the camera's calibration"),
    (("--photo", "ROOM/empty.png", "--drive", "sim:"), "--photo and --drive: a track is built from one of them"),
    (
        ("--photo", "ROOM/empty.png", "CAL", "--metres-per-px", "0.01"),
        "--metres-per-px: goes with --image, not with --photo",
    ),
    (("--photo", "ROOM/empty.png", "CAL", "--rounds", "2"), "--rounds: goes with --drive"),
    (
        ("--photo", "ROOM/empty.png", "CAL", "--lane", "dark", "--lane-hex", "#fff"),
        "--lane and --lane-hex: one of them",
    ),
    (("--photo", "ROOM/empty.png", "CAL", "--lane-hex", "pink"), "--lane-hex pink: must be red, green and blue"),
    (("--photo", "ROOM/empty.png", "CAL", "--lane-pixel", "2000,3"), "shows no floor"),
    (("--photo", "ROOM/empty.png", "CAL", "--lane-hsv", "120,90,90"), "of the picture within hue 120"),
    (("--photo", "ROOM/empty.png", "CAL", "--area", "1,1,1,2"), "--area 1,1,1,2: must be two opposite corners"),
    (
        ("--photo", "ROOM/empty.png", "CAL", "--area", "50,50,54,54"),
        "floor that the camera does not see: choose another",
    ),
    (("--photo", "ROOM/empty.png", "CAL", "--out", "ROOM/empty.png"), "that file is read, and would be lost"),
    (("--photo", "ROOM/empty.png", "CAL", "--area", "1,0,3,2"), "the lane leaves the picture near"),
    (
        ("--photo", "ROOM/empty.png", "CAL", "--lane-tolerance", "1,2,3"),
        "--lane-tolerance: a lane told by its shade has none",
    ),
    (("--photo", "ROOM/square.png", "CAL"), "square.png: 700x700 px, the calibration"),
    (("--photo", "ROOM/empty.png", "--photo", "ROOM/square.png", "CAL"), "square.png: 700x700 px, "),
    (("--photo", "ROOM/plain.png", "CAL"), "plain.png: nothing in it is darker or lighter"),
    (("--photo", "ROOM/none.png", "CAL"), "none.png: cannot read"),
    (("--photo", "ROOM/empty.png", "--calibration", "ROOM/none.yaml"), "none.yaml: cannot read the calibration"),
    (("--laps", "ROOM/empty.png"), "empty.png: not an MCAP file"),
    (("--laps", "ROOM/empty.png", "--lane-width-m", "-1"), "--lane-width-m -1: must be a positive number"),
    (("--source", "file:ROOM/none.mp4", "CAL"), "none.mp4"),
]


@pytest.mark.parametrize(("arguments", "says"), BAD, ids=[text[:40] for _, text in BAD])
def test_bad_wishes_are_one_line(shell, room, arguments, says):
    """Each mistake is one line on stderr, with exit code 2."""
    cv2.imwrite(str(room / "square.png"), np.full((700, 700, 3), 90, dtype=np.uint8))
    cv2.imwrite(str(room / "plain.png"), np.full((720, 1280, 3), 150, dtype=np.uint8))
    given = []
    for argument in arguments:
        given += (
            ["--calibration", str(room / "calibration.yaml")]
            if argument == "CAL"
            else [argument.replace("ROOM", str(room))]
        )
    code, out, err = shell(*given)
    assert (code, out) == (2, "")
    assert says in err
    assert err.count("\n") == 1


def test_what_was_taken_for_the_lane_is_shown(shell, room, tmp_path):
    """Where that makes no route, --overlay shows the floor with it in red."""
    overlay = tmp_path / "taken.png"
    code, _, err = shell("--photo", room / "empty.png", "--calibration", room / "calibration.yaml", "--area", "1,0,3,2",
                         "--overlay", overlay)  # fmt: skip
    assert code == 2
    assert "--overlay shows what was taken for lane" in err
    picture = cv2.imread(str(overlay)).astype(int)
    assert (picture[..., 2] > picture[..., 0] + 60).mean() > 0.1
