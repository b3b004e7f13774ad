"""Whole, right files of every kind that a user hands to dnb-edge: what the fuzzer starts from.

They are made here from the simulator, so that nothing is stored; `write` takes a few seconds, `Corpus` reads them back.
"""

import json
import math
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from dnb_edge import wire
from dnb_edge.config.calibration_file import calibration_file
from dnb_edge.config.lens_file import LensFile, LensFileView, lens_file
from dnb_edge.config.track_file import MadeOf, track_file
from dnb_edge.core import Core
from dnb_edge.detect.onnx import default_model_path
from dnb_edge.race.edit import Action, Edit, LapKey
from dnb_edge.record.edits import RunIdentity, append_edit, edits_path, read_edits
from dnb_edge.record.header import RunHeader
from dnb_edge.record.reader import read_run
from dnb_edge.record.writer import Recorder, RecordingSettings
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.layout import NamedLine, laid_out
from dnb_edge.track.line import line_across
from dnb_edge.track.model import Track
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import Clock, Frame, SourceInfo, StampSource
from dnb_edge.view.boards import parse_board
from dnb_edge.view.calibration import Calibration, CalibrationMethod, InputFile
from dnb_edge.view.ground import GroundMap
from dnb_edge.view.homography import CalibrationError
from dnb_edge.view.lens import Lens, LensModel
from dnb_edge.view.pose import CameraPose

REPOSITORY = Path(__file__).resolve().parents[2]
FRAMES = 40
RUN = "run.mcap"

LENS = Lens(
    model=LensModel.PINHOLE, fx_px=901.25, fy_px=903.5, cx_px=633.1, cy_px=352.9,
    distortion=(-0.21, 0.043, 1e-05, -0.0004, 0.0), width_px=1280, height_px=720,
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Corpus:
    """The bytes of the right files, and as plain data where they are documents."""

    files: dict[str, bytes]
    identity: RunIdentity
    """Of the recording `run.mcap`."""

    @classmethod
    def read(cls, folder: Path) -> "Corpus":
        """What `write` wrote into `folder`."""
        files = {path.name: path.read_bytes() for path in sorted(folder.iterdir())}
        run = read_run(folder / RUN)
        return cls(files=files, identity=RunIdentity.of(run.header, run.first_t_ns))

    def tree(self, name: str) -> Any:
        """The document `name` as plain data."""
        load = json.loads if name.endswith(".json") else yaml.safe_load
        return load(self.files[name])


def write(folder: Path) -> None:
    """Writes one right file of every kind."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("example", "drivenetbench"):
        (folder / f"config-{name}.yaml").write_bytes((REPOSITORY / "configs" / f"{name}.yaml").read_bytes())
    (folder / "config-full.yaml").write_text(_FULL_CONFIG)
    rules = REPOSITORY / "dnb_edge" / "config" / "rule_sets"
    for name in ("carla", "deepracer"):
        (folder / f"rules-{name}.yaml").write_bytes((rules / f"{name}.yaml").read_bytes())
    (folder / "calibration.yaml").write_bytes(calibration_file(_calibration()))
    (folder / "lens.yaml").write_bytes(lens_file(_lens()))
    (folder / "track.yaml").write_bytes(track_file(_track(), MadeOf(picture="twin.png", sha256="0" * 64)))
    document = {"format": "dnb-edge track", "version": 1, "track": _track().to_dict()}
    (folder / "track.json").write_text(json.dumps(document))
    (folder / "keypoints.yaml").write_text(_KEYPOINTS)
    (folder / "layout.yaml").write_text(_LAYOUT)
    np.save(folder / "camera.npy", np.array([[100, 100], [1200, 90], [1100, 650], [150, 700], [600, 400]], float))
    np.save(folder / "twin.npy", np.array([[0, 0], [2000, 0], [2000, 1000], [0, 1000], [990, 520]], np.float32))
    (folder / "card.json").write_bytes(default_model_path().with_suffix(".json").read_bytes())
    _record(folder)


def _record(folder: Path) -> None:
    """A short run with everything that a recording holds, and a judge's edits beside it."""
    # Half of the package, which the processes that only read the corpus need not load.
    from dnb_edge.sim.driver import drive  # noqa: PLC0415
    from dnb_edge.truth.course import course  # noqa: PLC0415
    from dnb_edge.truth.sightings import Sightings, moments, sighted  # noqa: PLC0415

    here = course("demo")
    driven = drive(here.place.circuit, laps=1, seed=1)
    at = moments(driven, fps=30.0)
    length_m = here.place.circuit.centreline.length_m
    kept = np.ones(len(at.t_s), dtype=bool)
    found = list(islice(sighted(driven, here.place.camera, at, Sightings(), lap_m=length_m, kept=kept, seed=1), FRAMES))
    setup = {"core": here.setup.to_dict(), "calibration": {"mean_px": 1.0}, "sha256": {"track.image": "0" * 64}}
    camera = here.place.camera
    source = SourceInfo(
        uri="sim:", width_px=camera.width_px, height_px=camera.height_px, nominal_fps=30.0, clock=Clock.SIMULATED, live=False
    )  # fmt: skip
    header = RunHeader(name="fuzzed", setup=setup, config={"track": {"image": "nowhere.png"}}, source=source)
    recorder = Recorder(RecordingSettings(directory=folder / "made", lossless=True, chunk_size_bytes=16384), header)
    core = Core(here.setup)
    for one in found:
        small = {"width_px": 16, "height_px": 16, "bgr": np.zeros((16, 16, 3), np.uint8)}
        recorder.add_frame(Frame(sequence=one.sequence, t_ns=one.t_ns, stamp_source=StampSource.SIMULATED, **small))
        recorder.add_detections(one)
        for event in core.step(one):
            recorder.add_event(event)
    made = recorder.close()
    made.rename(folder / RUN)
    (folder / "made").rmdir()
    _judge(folder / RUN)


def _judge(recording: Path) -> None:
    run = read_run(recording)
    identity = RunIdentity.of(run.header, run.first_t_ns)
    log = read_edits(recording, identity)
    for number in (1, 2, 3):
        key = LapKey(car=1, number=number, start_t_ns=number * 10**9, end_t_ns=(number + 1) * 10**9)
        edit = Edit(
            number=number, time="2026-11-23T10:00:00+00:00", author="judge", action=Action.REMOVE, reason="seen", laps=(key,)
        )  # fmt: skip
        log = append_edit(log, edit, identity)
    edits_path(recording).rename(recording.parent / "edits.jsonl")


def _calibration() -> Calibration:
    covariance = tuple(tuple(1e-09 * (i == j) / (1 + i) for j in range(9)) for i in range(9))
    return Calibration(
        ground=GroundMap(
            camera_to_twin=(2.4, 0.6, -741.7, 0.2, 3.47, -300.1, 1e-4, 2.5e-3, 0.4),
            scale=TwinScale(metres_per_px=0.0015, height_px=2540.0),
            width_px=1280, height_px=720, camera_m=(1.4, -0.3, 2.3), lens=LENS,
        ),
        covariance=covariance,
        error=CalibrationError(
            per_point_px=(1.0, 2.5, 0.25), mean_px=1.25, sum_px=3.75, max_px=2.5, leave_one_out_mean_px=None
        ),
        method=CalibrationMethod.KEYPOINTS,
        pose=CameraPose(position_m=(1.4, -0.3, 2.3), focal_px=901.25, pitch_deg=58.0),
        camera_id="usb-0001",
        made_at="2026-11-23T05:00:00+00:00",
        inputs=(InputFile(name="keypoints.yaml", sha256="0" * 64),),
        notes=("a note",),
    )  # fmt: skip


def _lens() -> LensFile:
    views = (LensFileView(name="1.png", rms_px=0.2, max_px=0.9, bad=False, sha256="0" * 64),)
    return LensFile(
        lens=LENS, camera_id="usb-0001", board=parse_board("chessboard:7x10:15mm"), made_at="2026-11-23T05:00:00+00:00",
        rms_px=0.2, sigmas={"fx_px": 0.4}, views=views,
    )  # fmt: skip


def _track() -> Track:
    angles = np.linspace(0, 2 * math.pi, 60, endpoint=False)
    route = Centreline(
        points_m=np.column_stack((2 + np.cos(angles), 2 + 0.7 * np.sin(angles))),
        half_left_m=np.full(60, 0.1),
        half_right_m=np.full(60, 0.1),
        closed=True,
    )
    sector = line_across(route, 0.4 * route.length_m, name="sector 1")
    return laid_out(
        route,
        name="oval",
        scale=TwinScale(metres_per_px=0.01, height_px=400.0),
        start=line_across(route, 0.1 * route.length_m, name="start"),
        finish=line_across(route, 0.8 * route.length_m, name="finish"),
        sectors=[NamedLine(line=sector, name=None)],
        source="fuzz",
    )


def identity_text(identity: RunIdentity) -> dict[str, Any]:
    """The identity as a file of edits holds it."""
    return wire.to_dict(identity)


_KEYPOINTS = """\
image_size: [3840, 2160]
pairs:
  - {name: north gate, camera_px: [1158, 1227], twin_px: [2324, 999]}
  - {name: south gate, camera_px: [158, 227], twin_px: [324, 99]}
  - {name: 3, camera_px: [1800, 300.5], twin_px: [2000, 120]}
  - {camera_px: [300, 1900], twin_px: [400, 1800]}
  - {camera_px: [2300, 1700], twin_px: [3400, 1650]}
"""

_LAYOUT = """\
twin: {metres_per_px: 0.002, height_px: 1500}
sigma_mm: 5
markers:
  - {number: 0, track_m: [0.50, 0.40]}
  - {number: 3, track_m: [2.50, 0.40], point: top left}
  - {number: 4, twin_px: [812, 200]}
"""

_FULL_CONFIG = """\
version: 1
entry: {name: lane-net, version: v2, notes: a note}
session: monday
rules: laps
track:
  image: twin.png
  lane_hsv: [0, 0, 25]
  measured: {from_px: [100, 400], to_px: [1100, 400], length_m: 2.5}
  waypoints_px: [[300, 200], [700, 500]]
  start_line_px: [[600, 300], [600, 380]]
  sectors_at_px: [[900, 500]]
view: {keypoints: keypoints.yaml, max_mean_error_m: 0.02}
detector:
  kind: markers
  threads: 1
  markers: {dictionary: 4X4_50, marker_size_m: 0.07, marker_height_m: 0.1, ids: [1, 2]}
capture:
  source: v4l2:/dev/video0
  exposure_us: 5000
  power_line_hz: 50
  white_balance_k: auto
  controls: {sharpness: 3}
race: {laps: 10, min_lap_s: 2.0, off_lane_s: 0.3}
start: {mode: grid}
penalties: {}
cars:
  - {name: red, colour: "#d02020"}
  - {name: blue, colour: "#2040d0"}
record: {directory: runs, image_fps: 5}
display: {uri: "serial:/dev/ttyUSB0"}
"""
