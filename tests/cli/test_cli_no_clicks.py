"""From printed sheets on the floor to laps, with nothing measured and nothing clicked: the verbs fit together."""

from __future__ import annotations

import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from edge_command import edge

from dnb_edge.config.calibration_file import load_calibration
from dnb_edge.sim.camera import PinholeCamera
from dnb_edge.sim.circuit import TWIN_SCALE
from dnb_edge.sim.renderer import Renderer
from dnb_edge.sim.rig import Rig, demo_camera, floor_to_camera_px
from dnb_edge.values import BgrImage

SHEETS = ((0.25, 0.25, 0.1), (2.75, 0.3, -0.3), (0.2, 1.8, 0.8), (2.75, 1.75, 2.0), (1.5, 1.0, 0.4))
"""Middle, track m, and turn of each sheet, as they were thrown down: not all of them beside the lane."""
SAMPLES = 4


def with_sheet(picture: BgrImage, camera: PinholeCamera, number: int) -> BgrImage:
    """`picture` with sheet `number` of 150 mm and its white rim on the floor, each pixel the mean of many samples."""
    x, y, turn = SHEETS[number]
    side, rim = 600, 120
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    sheet = np.full((side + 2 * rim,) * 2, 235, dtype=np.uint8)
    sheet[rim:-rim, rim:-rim] = np.where(cv2.aruco.generateImageMarker(dictionary, number, side) > 0, 235, 25)
    half = 0.075 * (1 + 2 * rim / side)
    c, s = math.cos(turn), math.sin(turn)
    corners = np.array([[-half, half], [half, half], [half, -half], [-half, -half]]) @ np.array([[c, s], [-s, c]]) + (
        x,
        y,
    )
    ends = [-0.5, len(sheet) - 0.5]
    source = np.array(
        [[ends[0], ends[0]], [ends[1], ends[0]], [ends[1], ends[1]], [ends[0], ends[1]]], dtype=np.float32
    )
    target = ((floor_to_camera_px(camera, corners) + 0.5) * SAMPLES - 0.5).astype(np.float32)
    matrix = cv2.getPerspectiveTransform(source, target)
    size = (camera.width_px, camera.height_px)
    seen, cover = (
        cv2.resize(
            cv2.warpPerspective(layer, matrix, (SAMPLES * size[0], SAMPLES * size[1])),
            size,
            interpolation=cv2.INTER_AREA,
        )
        for layer in (sheet, np.full_like(sheet, 255))
    )
    share = cover[..., None] / 255.0
    return np.asarray(np.clip(picture * (1.0 - share) + seen[..., None], 0, 255).round(), dtype=np.uint8)


@pytest.fixture(scope="module")
def photographs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two photographs of the simulated room: with the sheets on the floor, and without."""
    folder, rig = tmp_path_factory.mktemp("photographs"), Rig(seed=1, laps=2)
    room = Renderer(rig.circuit, demo_camera(), 1).picture(0, None)
    cv2.imwrite(str(folder / "empty.png"), room)
    for number in range(len(SHEETS)):
        room = with_sheet(room, demo_camera(), number)
    cv2.imwrite(str(folder / "marked.png"), room)
    return folder


def test_sheets_on_the_floor_lead_to_laps(photographs: Path) -> None:
    """`calibrate markers`, `track build --photo`, `run`: the laps are those that were driven, on a route as long."""
    view, track, config = (photographs / name for name in ("view.yaml", "track.yaml", "race.yaml"))
    found = edge("calibrate", "markers", "--picture", photographs / "marked.png", "--out", view, "--json")
    assert (found.code, found.err.strip()) == (0, "")
    assert json.loads(found.out)["height_m"] == pytest.approx(2.2, abs=0.06)

    # The race starts where the room's own line is painted, so that laps can be held against the truth.
    rig, ground = Rig(seed=1, laps=2), load_calibration(view).ground
    line_m = TWIN_SCALE.to_track_m(np.array(rig.start_line_px))
    line_px = ground.scale.to_twin_px(ground.to_track_m(floor_to_camera_px(demo_camera(), line_m)))
    start = ",".join(f"{number:.1f}" for number in line_px.ravel())
    words = ("--photo", photographs / "empty.png", "--calibration", view, "--lane", "dark", "--start-line", start)
    built = edge("track", "build", *words, "--out", track, "--json")
    assert (built.code, built.err.strip()) == (0, "")
    assert json.loads(built.out)["length_m"] == pytest.approx(rig.circuit.centreline.length_m, rel=0.01)

    config.write_text(f"version: 1\ntrack: {{file: {track.name}}}\nview: {{calibration: {view.name}}}\n")
    ran = edge("run", "--config", config, "--source", "sim:?laps=2", "--json")
    assert ran.code == 0
    laps = ran.of("lap")
    assert [lap["valid"] for lap in laps] == [True, True]
    assert [lap["suspect"] for lap in laps] == [[], []]
    for lap, true in zip(laps, rig.truth.laps, strict=True):
        assert lap["time_s"] == pytest.approx(true.time_s, abs=0.008)
        assert lap["similarity_percent"] > 96.0
