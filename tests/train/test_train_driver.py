"""How the driving network is taught: its lessons, how they are varied, the command end to end. Skipped without torch."""

from __future__ import annotations

import importlib
import json

import numpy as np
import pytest

from dnb_edge.errors import InputError
from dnb_edge.nut.model import open_onnx_driver
from dnb_edge.sim.control import Control, Sight
from dnb_edge.sim.task import LoopTask

torch = pytest.importorskip("torch", reason="training needs the extra 'train' (torch)")

data = importlib.import_module("dnb_edge.train.driver_data")
driver = importlib.import_module("dnb_edge.train.driver")
learn = importlib.import_module("dnb_edge.train.driver_learn")
export = importlib.import_module("dnb_edge.train.driver_export")
evaluate = importlib.import_module("dnb_edge.train.driver_evaluate")

TASK = LoopTask(seed=77, laps=9, place="table")


@pytest.fixture(scope="module")
def lessons():
    """Of one short drive."""
    return data.drive_lessons(TASK, pictures=90)


@pytest.fixture(scope="module")
def small_run(tmp_path_factory):
    """The command in its smallest form: the path of the model."""
    out = tmp_path_factory.mktemp("driver")
    small = "--seed 3 --drives 1 --rounds 1 --round-drives 1 --pictures 40 --round-steps 2 --last-steps 2 --held-out 0"
    return driver.run(["--out", str(out), *small.split()])


def test_lessons_are_the_same_for_a_seed(lessons):
    """The same task gives the same bytes."""
    again = data.drive_lessons(TASK, pictures=90)
    assert np.array_equal(lessons.pixels, again.pixels)
    assert np.array_equal(lessons.wanted, again.wanted)
    assert lessons.pixels.shape == (90, 60, 80, 3)
    assert np.abs(lessons.wanted).max() <= 1.0


def test_pushes_go_both_ways_and_let_go():
    """The expert's steering is pushed to either side for a part of the time, and for the rest passed on as it is."""
    pushes, right = data._Pushes(np.random.default_rng(1)), Control(steering=0.1, throttle=0.4)
    by = np.array([pushes.pushed(right).steering - 0.1 for _ in range(2000)])
    assert 0.2 < np.mean(by == 0.0) < 0.8
    assert (by > 0.2).any()
    assert (by < -0.2).any()


def test_a_lesson_ends_where_the_student_leaves_the_lane(lessons):
    """A student that steers off is stopped, and what it saw out there is not kept; what is kept is the expert's word."""

    def off(_: Sight) -> Control:
        return Control(steering=-1.0, throttle=0.6)

    astray = data.drive_lessons(TASK, pictures=300, student=off, share=1.0)
    assert 8 < len(astray) < 120
    assert astray.wanted[-5:, 0].mean() > 0.5


def test_the_students_pixels_are_what_a_driver_is_given(small_run, lessons):
    """Lessons make pictures smaller exactly as any model's driver does."""
    bgr = np.random.default_rng(1).integers(0, 256, (120, 160, 3)).astype(np.uint8)
    session = open_onnx_driver(small_run)
    model = session._model
    fit = importlib.import_module("dnb_edge.nut.fit")
    assert np.array_equal(fit.picture_input(model).tensor(bgr)[0], data.to_pixels(bgr))


def test_varied_lessons_mirror_picture_and_steering_together(lessons):
    """Without light and noise: each row is the lesson, or its mirror image with the steering turned about."""
    random = np.random.default_rng(5)
    rows = np.arange(40)
    noise = np.zeros((1, 60, 80, 3), np.float32)
    varied = learn.varied(lessons, rows, noise, random)
    turned = 0
    for row in rows:
        plain, mirror = lessons.pixels[row].astype(float), lessons.pixels[row, :, ::-1].astype(float)
        fits = [float(np.corrcoef(varied.pixels[row].ravel(), one.ravel())[0, 1]) for one in (plain, mirror)]
        is_turned = fits[1] > fits[0]
        turned += is_turned
        assert max(fits) > 0.95
        assert varied.wanted[row, 0] == pytest.approx(-lessons.wanted[row, 0] if is_turned else lessons.wanted[row, 0])
        assert varied.wanted[row, 1] == lessons.wanted[row, 1]
    assert 5 < turned < 35


def test_a_small_run_gives_a_driver_with_a_card(small_run):
    """The command writes a model that opens as a driver and answers; the card says how, without private paths."""
    opened = open_onnx_driver(small_run)
    assert opened.name == "dnb-edge-driver-v1"
    card = json.loads(small_run.with_suffix(".json").read_text())
    assert card["sha256"] == opened._model.sha256
    assert card["command"].startswith("python -m dnb_edge.train.driver --out OUT --seed 3 --drives 1")
    assert str(small_run.parent) not in json.dumps(card)
    assert small_run.stat().st_size <= 1_000_000


def test_int8_answers_as_the_network_does(lessons, tmp_path):
    """The quantised file and the network in float32 agree on lessons to a few hundredths."""
    torch.manual_seed(1)
    network = importlib.import_module("dnb_edge.train.driver_network").DriverNet()
    learn.learn(network, lessons, steps=30, seed=1, report=lambda *_: None)
    path = tmp_path / "one.onnx"
    export.quantise_driver(network, path, export.some_of(lessons, 40))
    model = open_onnx_driver(path)._model
    with torch.inference_mode():
        wanted = network(torch.from_numpy(lessons.pixels), torch.from_numpy(lessons.speed)).numpy()
    got = np.concatenate(
        [
            model.run({"pixels": pixels[None], "speed": speed[None]})[0]
            for pixels, speed in zip(lessons.pixels, lessons.speed, strict=True)
        ]
    )
    assert np.abs(got - wanted).mean() < 0.03
    assert np.abs(got - wanted).max() < 0.15


def test_figures_count_laps_over_all_drives():
    """A drive that ended early lacks its laps; the mean is over laps driven."""
    common = {"laps_wanted": 2, "collisions": 1, "off_lane_s": 0.5, "answer_ms": 1.0}
    drives = [
        evaluate.Driven(seed=1, lap_times_s=(8.0, 9.0), ended="laps", **common),
        evaluate.Driven(seed=2, lap_times_s=(10.0,), ended="left", **common),
    ]
    told = evaluate.figures(drives)
    assert (told["laps_wanted"], told["laps_driven"], told["laps_percent"]) == (4, 3, 75.0)
    assert (told["drives_completed"], told["collisions"], told["lap_time_mean_s"]) == (1, 2, 9.0)


def test_wrong_numbers_are_refused():
    """Counts below one, a negative seed: InputError before any work."""
    for wrong in (["--drives", "0"], ["--last-steps", "0"], ["--seed", "-1"]):
        with pytest.raises(InputError, match="must"):
            driver.run(["--out", "unused", *wrong])
