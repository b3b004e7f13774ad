"""Bad input through the command line: one clear line that names what is wrong, exit code 2, and nothing written."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
from edge_command import CLIP_FRAMES, edge

from dnb_edge.detect.onnx import default_model_path


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One mistake: what to change before a run, the words to add to it, and what the line must name."""

    words: tuple[str, ...] = ()
    spoil: Callable[[Path], None] = lambda track: None
    """Changes something in the directory of the configuration, which is the working directory too."""
    names: tuple[str, ...]


def keypoints(camera: list[tuple[float, float]], twin: list[tuple[float, float]]) -> Callable[[Path], None]:
    def spoil(track: Path) -> None:
        np.save(track / "keypoints_camera.npy", np.array(camera, dtype=float))
        np.save(track / "keypoints_twin.npy", np.array(twin, dtype=float))

    return spoil


def write(name: str, content: bytes) -> Callable[[Path], None]:
    return lambda track: (track / name).write_bytes(content) and None


def add_line(text: str) -> Callable[[Path], None]:
    def spoil(track: Path) -> None:
        config = track / "demo.yaml"
        config.write_text(config.read_text() + text)

    return spoil


def cut_the_lane(track: Path) -> None:
    """Paints over a piece of the lane, right across it, away from the start line."""
    twin = cv2.imread(str(track / "twin.png"))
    middle = twin.shape[0] // 2
    twin[middle - 40 : middle + 40, : twin.shape[1] // 2] = 255
    cv2.imwrite(str(track / "twin.png"), twin)


def model(change: Callable[[bytearray], None], *, honest_card: bool = False) -> Callable[[Path], None]:
    """A copy of the shipped model, changed; with an honest card its checksum is right all the same."""

    def spoil(track: Path) -> None:
        shipped = default_model_path()
        content = bytearray(shipped.read_bytes())
        change(content)
        (track / "m.onnx").write_bytes(content)
        card = json.loads(shipped.with_suffix(".json").read_text())
        if honest_card:
            card["sha256"] = hashlib.sha256(content).hexdigest()
        (track / "m.json").write_text(json.dumps(card))

    return spoil


def flip_one_bit(content: bytearray) -> None:
    content[len(content) // 2] ^= 1


def write_clip(track: Path) -> None:
    """A clip of 96 x 64."""
    writer = cv2.VideoWriter(str(track / "clip.mp4"), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"mp4v"), 30, (96, 64))
    for value in range(40):
        writer.write(np.full((64, 96, 3), 5 * value, dtype=np.uint8))
    writer.release()


def cut_clip(track: Path) -> None:
    """A clip that lost its second half in copying."""
    write_clip(track)
    content = (track / "clip.mp4").read_bytes()
    (track / "clip.mp4").write_bytes(content[: len(content) // 2])


SQUARE = [(100.0, 100.0), (900.0, 100.0), (900.0, 600.0), (100.0, 600.0)]
LINE = [(100.0, 100.0), (200.0, 200.0), (300.0, 300.0), (400.0, 400.0)]

CASES = {
    "clip missing": Case(words=("--source", "file:gone.mp4"), names=("gone.mp4", "No such file")),
    "clip is text": Case(words=("--source", "file:demo.yaml"), names=("demo.yaml", "no video")),
    "clip is empty": Case(
        words=("--source", "file:clip.mp4"), spoil=write("clip.mp4", b""), names=("clip.mp4", "empty")
    ),
    "clip is cut off": Case(words=("--source", "file:clip.mp4"), spoil=cut_clip, names=("clip.mp4", "cut off")),
    "clip of another shape than the keypoints' picture": Case(
        words=("--source", "file:clip.mp4"), spoil=write_clip, names=("96x64", "1280x720", "aspect")
    ),
    "clip is a directory": Case(words=("--source", "file:."), names=("folder",)),
    "twin missing": Case(words=("--set", "track.image=gone.png"), names=("gone.png", "No such file")),
    "twin is no picture": Case(spoil=write("twin.png", b"not a picture"), names=("twin.png", "not an image")),
    "twin is empty": Case(spoil=write("twin.png", b""), names=("twin.png", "not an image")),
    "colour not on the twin": Case(
        words=("--set", "track.lane_hsv=[120, 90, 90]"), names=("twin.png", "no pixel", "hue 120")
    ),
    "route not closed": Case(spoil=cut_the_lane, names=("twin.png", "closed")),
    "start line off the route": Case(
        words=("--set", "track.start_line_px=[[5, 5], [9, 9]]"),
        names=("twin.png", "start", "crosses the route 0 times"),
    ),
    "keypoints missing": Case(words=("--set", "view.keypoints_camera=gone.npy"), names=("gone.npy", "No such file")),
    "keypoints are text": Case(spoil=write("keypoints_twin.npy", b"1 2\n"), names=("keypoints_twin.npy", ".npy")),
    "keypoints of unequal number": Case(
        spoil=keypoints([*SQUARE, (500.0, 300.0)], SQUARE), names=("5 camera points", "4 twin points")
    ),
    "keypoints too few": Case(spoil=keypoints(SQUARE[:3], SQUARE[:3]), names=("3 pairs", "at least 4")),
    "keypoints collinear": Case(spoil=keypoints(LINE, SQUARE), names=("keypoints_camera.npy", "camera", "one line")),
    "model missing": Case(words=("--model", "gone.onnx"), names=("gone.onnx", "No such file")),
    "model corrupt": Case(words=("--model", "m.onnx"), spoil=model(flip_one_bit), names=("m.onnx", "SHA-256")),
    "model is no network": Case(
        words=("--model", "m.onnx"), spoil=model(bytearray.clear, honest_card=True), names=("m.onnx", "cannot load")
    ),
    "model without its card": Case(
        words=("--model", "m.onnx"),
        spoil=write("m.onnx", default_model_path().read_bytes()),
        names=("m.onnx", "m.json", "card"),
    ),
    "model without its card that is none": Case(
        words=("--model", "m.onnx"), spoil=write("m.onnx", b"model"), names=("m.onnx", "cannot load")
    ),
    "configuration missing": Case(words=("--config", "gone.yaml"), names=("gone.yaml", "No such file")),
    "configuration is no YAML": Case(spoil=write("demo.yaml", b"a: [1\nb: 2\n"), names=("demo.yaml, line 2", "YAML")),
    "unknown key": Case(
        spoil=add_line("race:\n  lapz: 3\n"), names=("demo.yaml, line ", "race.lapz", "unknown key", "laps")
    ),
    "ill-typed key": Case(spoil=add_line("race:\n  laps: three\n"), names=("demo.yaml, line ", "race.laps", "integer")),
    "value out of range": Case(spoil=add_line("race:\n  laps: 0\n"), names=("demo.yaml, line ", "race.laps", "0")),
    "unknown key in --set": Case(words=("--set", "rice.laps=3"), names=("--set rice.laps=3", "rice", "unknown key")),
    "ill-typed key in --set": Case(words=("--set", "race.laps=three"), names=("--set race.laps=three", "integer")),
    "value out of range in --set": Case(words=("--set", "race.laps=0"), names=("--set race.laps=0", "at least 1")),
    "no camera there": Case(words=("--source", "v4l2:/dev/video99"), names=("/dev/video99", "no such camera")),
    "no camera but a device": Case(words=("--source", "v4l2:/dev/null"), names=("/dev/null", "not a capture device")),
    "no camera but a file": Case(words=("--source", "v4l2:demo.yaml"), names=("demo.yaml", "not a capture device")),
    "camera of another kind": Case(words=("--source", "libcamera:none"), names=("libcamera:none", "camera")),
    "unknown kind of source": Case(words=("--source", "rtsp://x"), names=("rtsp://x", "unknown kind")),
    "unknown simulator option": Case(words=("--source", "sim:?speed=9"), names=("sim:?speed=9", "speed")),
    "recording as source missing": Case(words=("--source", "mcap:gone.mcap"), names=("gone.mcap",)),
    "unknown display": Case(words=("--display", "lcd:0"), names=("lcd:0", "serial:")),
    "recording into a file": Case(words=("--record", "demo.yaml"), names=("demo.yaml", "cannot record")),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
def test_bad_input_is_one_line_and_leaves_nothing(config: Path, case: Case) -> None:
    """Each mistake in what a run is given ends it with code 2 and one line that names it, before anything is written."""
    track = config.parent
    case.spoil(track)
    before = {path: path.read_bytes() for path in track.rglob("*")}
    words = ("run", "--config", "demo.yaml", "--source", "sim:?laps=1", "--record", "runs", "--json", *case.words)
    ran = edge(*words, cwd=track)
    line = ran.complaint()
    assert (ran.code, ran.out) == (2, ""), line
    assert all(name in line for name in case.names), line
    assert {path: path.read_bytes() for path in track.rglob("*")} == before


@pytest.mark.parametrize(
    ("uri", "names"),
    [
        ("bogus:0", ("unknown kind of source", "v4l2:/dev/video0", "libcamera:0", "file:", "mcap:", "sim:")),
        ("/dev/video0", ("unknown kind of source", "v4l2:/dev/video0")),
        ("v4l2:", ("names no device or file", "v4l2:/dev/video0")),
        ("sim:?speed=9", ("speed",)),
    ],
)
def test_a_check_refuses_what_is_no_source(config: Path, uri: str, names: tuple[str, ...]) -> None:
    """Code 2 and one line with the key, the value and the kinds that there are, before anybody starts the race."""
    ran = edge("config", "check", config, "--set", f"capture.source={uri}")
    line = ran.complaint()
    assert (ran.code, ran.out) == (2, ""), line
    assert line.startswith(f"dnb-edge: capture.source: {uri}: "), line
    assert all(name in line for name in names), line


@pytest.mark.parametrize("uri", ["v4l2:/dev/video99", "libcamera:0", "file:gone.mp4", "mcap:gone.mcap", "sim:"])
def test_a_check_looks_for_no_device(config: Path, uri: str) -> None:
    """What is right is right before the camera is plugged in."""
    ran = edge("config", "check", config, "--set", f"capture.source={uri}")
    assert (ran.code, ran.err) == (0, "")


@pytest.mark.parametrize("uri", ["oled:0", "serial:ttyUSB0", "/dev/ttyUSB0"])
def test_a_check_refuses_what_is_no_display(config: Path, uri: str) -> None:
    """Code 2 and one line with the key, the value and what to write; a port that is not there yet is right."""
    ran = edge("config", "check", config, "--set", f"display.uri={uri}")
    assert (ran.code, ran.out) == (2, "")
    assert ran.complaint().startswith(f"dnb-edge: display.uri: display '{uri}': "), ran.err
    assert edge("config", "check", config, "--set", "display.uri=serial:/dev/gone").code == 0


def test_the_line_of_a_mistake_is_the_right_one(config: Path) -> None:
    """The line number is the key's own, not its section's."""
    lines = config.read_text().splitlines()
    add_line("race:\n  min_lap_s: 2.0\n  laps: 3.5\n")(config.parent)
    ran = edge("config", "check", config)
    assert ran.code == 2
    assert ran.complaint().startswith(f"dnb-edge: {config}, line {len(lines) + 3}: race.laps: ")


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("run", "--config", "demo.yaml"), "no source"),
        (("score", "gone.mcap"), "gone.mcap"),
        (("score", "demo.yaml"), "not an MCAP file"),
        (("table", "."), "no recordings"),
        (("report", "gone.mcap"), "gone.mcap"),
        (("calibrate", "keypoints", "--camera", "gone.npy", "--twin", "keypoints_twin.npy"), "gone.npy"),
        (("track", "build", "--image", "gone.png", "--lane-hsv", "1,2,3"), "gone.png"),
        (("runs", "list", "gone"), "gone"),
        (("config", "show", "gone.yaml"), "gone.yaml"),
    ],
    ids=lambda words: " ".join(words) if isinstance(words, tuple) else words,
)
def test_every_verb_refuses_in_one_line(pristine: Path, words: tuple[str, ...], named: str) -> None:
    """The other commands that read files hold to the same contract."""
    ran = edge(*words, cwd=pristine)
    assert (ran.code, ran.out) == (2, "")
    assert named in ran.complaint()


@pytest.mark.parametrize("words", [("--nope",), ("run", "--nope"), ("run", "--laps", "many"), ("score",), ("jump",)])
def test_a_wrong_command_line_is_an_input_error(words: tuple[str, ...]) -> None:
    """Unknown verbs and options, and ill-typed or missing ones, end with code 2 and a hint, without a traceback."""
    ran = edge(*words)
    assert (ran.code, ran.out) == (2, "")
    assert "--help" in ran.err
    assert "Traceback" not in ran.err


def test_a_serial_port_that_is_not_there_does_not_stop_the_race(pristine: Path, clip: Path) -> None:
    """The race runs on and ends well; Health says that the display is offline, and stderr says so once."""
    words = ("run", "--config", pristine / "demo.yaml", "--source", f"file:{clip}", "--json")
    ran = edge(*words, "--display", "serial:/dev/ttyUSB77")
    assert ran.code == 0
    assert ran.of("crossing") == edge(*words).of("crossing")
    assert ran.events[-1]["frames"] == CLIP_FRAMES
    assert {health["display"] for health in ran.of("health")} == {"offline"}
    assert all("/dev/ttyUSB77" in " ".join(health["warnings"]) for health in ran.of("health"))
    assert "display offline: /dev/ttyUSB77" in ran.complaint()
