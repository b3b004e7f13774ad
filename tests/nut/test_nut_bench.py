"""The benchmark: what it counts, cold starts in processes of their own, what it reads of the machine; and the verb."""

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from nut_models import BYTES, write_model
from typer.testing import CliRunner

from dnb_edge.cli.nut import app
from dnb_edge.errors import InputError, WorkError
from dnb_edge.nut.bench import Effort, fps_of, latency_of, start_cold, time_passes
from dnb_edge.nut.bench_card import read_bench_card
from dnb_edge.nut.fit import aside_inputs, picture_input
from dnb_edge.nut.host import governor, processor_name
from dnb_edge.nut.onnx import load_model


class Slow:
    """A network that takes as long as the clock beside it is told."""

    def __init__(self, clock):
        self.clock, self.shown = clock, []

    def run(self, feeds):
        self.shown.append(feeds)
        self.clock.now_s += next(self.clock.takes_s)
        return []


class Clock:
    """Stands still but for the networks."""

    def __init__(self, takes_s):
        self.now_s, self.takes_s = 0.0, iter(takes_s)

    def perf_counter(self):
        return self.now_s

    def process_time(self):
        return self.now_s / 2


def test_warm_up_is_not_counted(tmp_path, monkeypatch):
    """The first pass is told by itself, those of the warm-up not at all, and repeats are rows."""
    clock = Clock([0.9, 0.5, 0.001, 0.002, 0.003, 0.004, 0.005, 0.006])
    monkeypatch.setattr("dnb_edge.nut.bench.time", clock)
    picture = picture_input(load_model(write_model(tmp_path / "net.onnx")))
    model, told = Slow(clock), []
    timed = time_passes(model, picture, {}, Effort(repeats=2, passes=3, warm_up=2), done=lambda: told.append(None))
    assert timed.first_ms == pytest.approx(900.0)
    assert timed.inference_ms == pytest.approx(np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]))
    assert timed.cpu_ms == pytest.approx(timed.inference_ms / 2)
    assert timed.preprocessing_ms is None
    assert len(told) == 8
    assert fps_of(timed.inference_ms) == pytest.approx(1000 / 3.5, abs=1e-3)


def test_percentiles_have_the_spread_of_the_repeats():
    """Over all passes, and the least and the most that one repeat had."""
    latency = latency_of(np.array([[1.0, 2.0, 3.0], [5.0, 6.0, 100.0]]))
    assert (latency.p50.all_ms, latency.p50.least_ms, latency.p50.most_ms) == (4.0, 2.0, 6.0)
    assert (latency.mean_ms, latency.max_ms) == (19.5, 100.0)
    assert latency.p99.all_ms <= 100.0


def test_pictures_take_turns_and_preprocessing_is_told_apart(tmp_path):
    """Each picture of a clip is shown as often as the others, resized, and its preparation has times of its own."""
    model = load_model(write_model(tmp_path / "net.onnx", speed=(1, 1)))
    picture, asides = picture_input(model), aside_inputs(model)
    shown = []

    class Watched:
        def run(self, feeds):
            shown.append(feeds)
            return model.run(feeds)

    pictures = [np.full((24, 40, 3), grey, np.uint8) for grey in (0, 255)]
    timed = time_passes(Watched(), picture, asides, Effort(repeats=2, passes=10, warm_up=2), pictures=pictures)
    assert [float(feeds["image"].mean()) for feeds in shown[:4]] == pytest.approx([0.0, 1.0, 0.0, 1.0])
    assert {feeds["image"].shape for feeds in shown} == {(1, 3, 12, 16)}
    assert all(feeds["speed"].shape == (1, 1) for feeds in shown)
    assert timed.preprocessing_ms.shape == timed.inference_ms.shape == (2, 10)
    assert (timed.preprocessing_ms > 0.0).all()


def test_colours_and_layouts_are_the_models(tmp_path):
    """Red comes first in whichever layout; a grey network gets grey; bytes stay bytes."""
    bgr = np.zeros((12, 16, 3), np.uint8)
    bgr[:, :, 2] = 200
    cases = {
        "nchw": ({}, (0, 0), 200 / 255),
        "nhwc": ({"shape": (1, 12, 16, 3), "nhwc": True}, (0, 0), 200 / 255),
        "bytes": ({"kind": BYTES}, (0, 0), 200),
        "grey": ({"shape": (1, 1, 12, 16), "weights": ((1.0, 0.0),)}, (0, 0), 60 / 255),
    }
    for name, (ends, place, value) in cases.items():
        picture = picture_input(load_model(write_model(tmp_path / f"{name}.onnx", **ends)))
        tensor = picture.tensor(bgr)
        assert tensor.shape == picture.shape, name
        assert tensor.flags["C_CONTIGUOUS"], name
        assert tensor.reshape(-1)[place[0]] == pytest.approx(value, abs=0.003), name


def ends_of(model, size_px):
    return picture_input(model, size_px), aside_inputs(model)


@pytest.mark.parametrize(
    ("ends", "size_px", "says"),
    [
        ({"shape": (1, 3, "h", "w")}, None, "image float32 (1, 3, h, w) leaves the picture's size open"),
        ({}, (10, 10), "image float32 (1, 3, 12, 16) takes no picture of 10x10"),
        (
            {"shape": (1, 5, 12, 16), "weights": ((1.0, 0.0),) * 5},
            None,
            "(1, 5, 12, 16) takes no single picture; wanted (1, ch",
        ),
        ({"shape": (8, 3, 12, 16), "out_shape": (8, 2)}, None, "(8, 3, 12, 16) takes no single picture"),
        ({"more_inputs": (("a", "b"),)}, None, "beside the picture it wants more0 float32 (a, b)"),
        ({"more_inputs": ((1, 3, 1000, 1000),)}, None, "beside the picture it wants more0 float32 (1, 3, 1000, 1000)"),
    ],
)
def test_a_model_that_takes_no_single_picture_is_refused(tmp_path, ends, size_px, says):
    """The line names the shapes it has and those wanted."""
    model = load_model(write_model(tmp_path / "net.onnx", **ends))
    with pytest.raises(InputError) as refusal:
        ends_of(model, size_px)
    assert says in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_cold_start_is_a_process_of_its_own(tmp_path):
    """Its parts add up to no more than its whole life, and the model takes some of its memory."""
    model = load_model(write_model(tmp_path / "net.onnx", shape=(1, 3, 120, 160), speed=(1, 1)))
    told = []
    cold, memory = start_cold(
        model, picture_input(model), aside_inputs(model), threads=1, starts=1, done=lambda: told.append(None)
    )
    parts = cold.process_ms + cold.import_ms + cold.load_ms + cold.first_answer_ms
    assert cold.starts == len(told) == 1
    assert min(cold.process_ms, cold.import_ms, cold.load_ms, cold.first_answer_ms) > 0.0
    assert cold.total_ms >= parts - 0.01
    assert memory.peak_bytes > memory.grown_bytes > 0


def test_a_cold_start_that_fails_is_told(tmp_path):
    """The last line of what the process said is the reason."""
    path = write_model(tmp_path / "net.onnx")
    model = load_model(path)
    path.unlink()
    with pytest.raises(
        WorkError, match=r"net\.onnx: a fresh process ended with exit code 1: .*cannot be read"
    ) as failure:
        start_cold(model, picture_input(model), {}, threads=1, starts=1)
    assert "\n" not in str(failure.value)


@pytest.mark.parametrize(
    ("files", "name", "governs"),
    [
        ({"proc/cpuinfo": "processor: 0\nmodel name\t: Fast CPU\n"}, "Fast CPU", None),
        ({"proc/cpuinfo": "Features: fp\n", "proc/device-tree/model": "Raspberry Pi 5\0"}, "Raspberry Pi 5", None),
        ({}, "aarch64", None),
        (
            {
                f"sys/devices/system/cpu/cpu{n}/cpufreq/scaling_governor": f"{g}\n"
                for n, g in enumerate(["on", "off", "on"])
            },
            "aarch64",
            "off,on",
        ),
    ],
)
def test_the_machine_is_named_as_linux_tells(tmp_path, files, name, governs):
    """By the processor, else by the board, else by the architecture; a governor where there is one."""
    for place, text in files.items():
        (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / place).write_text(text)
    assert processor_name(tmp_path, "aarch64") == name
    assert governor(tmp_path) == governs


def test_only_one_module_of_the_room_imports_onnx_runtime():
    """And none imports the detector's room."""
    room = Path(__file__).resolve().parents[2] / "dnb_edge" / "nut"
    texts = {path.name: path.read_text(encoding="utf-8") for path in room.rglob("*.py")}
    assert [name for name, text in texts.items() if "import onnxruntime" in text] == ["onnx.py"]
    assert not [name for name, text in texts.items() if "dnb_edge.detect" in text]


def edge(*words, cwd):
    """`dnb-edge nut bench WORDS` in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "dnb_edge", "nut", "bench", *map(str, words)],
        cwd=cwd,
        env=os.environ | {"OMP_NUM_THREADS": "1", "NO_COLOR": "1"},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_the_verb_keeps_a_card_that_can_be_read(tmp_path):
    """With a clip and an entry's name: the same on stdout and in the file; all that it counts is there and plausible."""
    clip = cv2.VideoWriter(str(tmp_path / "clip.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (64, 48))
    for grey in (0, 100, 200):
        clip.write(np.full((48, 64, 3), grey, np.uint8))
    clip.release()
    path = write_model(tmp_path / "net.onnx", shape=(1, 3, "h", "w"))
    words = ("--size", "32x24", "--frames", "clip.avi", "--repeats", 2, "--passes", 10, "--entry", "Our net", "--json")
    done = edge("net.onnx", *words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr.splitlines()[0] == "Card: Our-net.nut.json"
    assert all("The machine was busy" in line for line in done.stderr.splitlines()[1:])
    card = read_bench_card(tmp_path / "Our-net.nut.json")
    assert json.loads(done.stdout) == json.loads((tmp_path / "Our-net.nut.json").read_text())
    assert (card.entry, card.model_sha256) == ("Our net", hashlib.sha256(path.read_bytes()).hexdigest())
    assert (card.input_shape, card.threads, card.repeats, card.passes) == ((1, 3, 24, 32), 1, 2, 10)
    assert 0.0 < card.p50_ms <= card.p95_ms <= card.p99_ms <= card.inference.max_ms
    assert card.inference.p50.least_ms <= card.p50_ms <= card.inference.p50.most_ms
    assert card.fps == pytest.approx(1000 / card.inference.mean_ms, rel=0.02)
    assert card.preprocessing is not None
    assert card.preprocessing.p50.all_ms > 0.0
    assert card.memory.peak_bytes > 10_000_000
    assert card.cold_start.starts == 3
    assert card.host.cores >= 1


def test_the_verb_tells_a_table(tmp_path):
    """For people, in a directory of their choice; an entry without a name is the file's."""
    write_model(tmp_path / "net.onnx")
    (tmp_path / "out").mkdir()
    done = edge("net.onnx", "--repeats", 2, "--passes", 10, "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    for part in ("net: net.onnx", "p50 ms", "inference", "throughput", "cold start", "memory", "warm-up"):
        assert part in done.stdout
    assert read_bench_card(tmp_path / "out" / "net.nut.json").frames is None


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("none.onnx",), "none.onnx: the model cannot be read (No such file or directory)"),
        (("net.onnx", "--size", "9"), "--size 9: give WIDTHxHEIGHT"),
        (("net.onnx", "--size", "0x9"), "--size 0x9: give WIDTHxHEIGHT"),
        (("net.onnx", "--frames", "none.mp4"), "none.mp4"),
        (("net.onnx", "--out", "no/where.json"), "there is no directory no: make it first"),
        (("net.onnx", "--entry", " "), "--entry: give the entry's name"),
    ],
)
def test_the_verb_refuses_in_one_line(tmp_path, monkeypatch, words, says):
    """Bad input is told before anything is measured."""
    monkeypatch.chdir(tmp_path)
    write_model(tmp_path / "net.onnx")
    result = CliRunner().invoke(app, ["bench", *words])
    assert isinstance(result.exception, InputError)
    assert says in str(result.exception)
    assert "\n" not in str(result.exception)
    assert list(tmp_path.glob("*.json")) == []
