"""`python -m dnb_edge.train.driver`: drive, learn, drive again where the network strayed, quantise, measure, write the card."""

from __future__ import annotations

import argparse
import logging
import os
import platform
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch

from dnb_edge.errors import DnbEdgeError, InputError
from dnb_edge.nut.model import open_onnx_driver
from dnb_edge.sim.light import LightChange
from dnb_edge.sim.places import place
from dnb_edge.sim.task import LoopTask, TaskKind, obstacles_beside
from dnb_edge.train.card import file_sha256, write_card
from dnb_edge.train.driver_data import Lessons, drive_lessons, joined, lesson_task
from dnb_edge.train.driver_evaluate import driven, figures
from dnb_edge.train.driver_export import quantise_driver, some_of
from dnb_edge.train.driver_learn import Student, learn
from dnb_edge.train.driver_network import HEIGHT_PX, WIDTH_PX, DriverNet, parameter_count

_LOG = logging.getLogger("dnb_edge.train")
_FIRST_SEED = 1_000_000
"""Seeds of lessons begin here; those below are for measuring."""
_CALIBRATION = 300


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """How much is driven and learnt."""

    drives: int = 36
    """Of the expert, before the network drives."""
    rounds: int = 3
    """In which the network drives and learns again."""
    round_drives: int = 20
    pictures: int = 300
    """At most, of one drive."""
    round_steps: int = 500
    """Batches learnt before the network drives, and in each round."""
    last_steps: int = 4500
    """Batches learnt at the end, from everything."""
    held_out: int = 30
    """Seeds to measure on."""


def _arguments(arguments: Sequence[str] | None) -> tuple[Path, str, int, Course]:
    parser = argparse.ArgumentParser(
        prog="python -m dnb_edge.train.driver", description="Train the network that drives, in the closed loop's world."
    )
    parser.add_argument("--out", type=Path, required=True, help="folder for the model and its card")
    parser.add_argument("--name", default="dnb-edge-driver-v1")
    parser.add_argument("--seed", type=int, default=1)
    course = Course()
    for name in Course.__dataclass_fields__:
        parser.add_argument(f"--{name.replace('_', '-')}", type=int, default=getattr(course, name))
    given = parser.parse_args(arguments)
    chosen = replace(course, **{name: getattr(given, name) for name in Course.__dataclass_fields__})
    if min(chosen.drives, chosen.round_drives, chosen.pictures, chosen.round_steps, chosen.last_steps) < 1:
        raise InputError("--drives, --round-drives, --pictures, --round-steps and --last-steps must be at least 1")
    if min(chosen.rounds, chosen.held_out, given.seed) < 0:
        raise InputError("--rounds, --held-out and --seed must not be negative")
    return given.out, given.name, given.seed, chosen


def taught(seed: int, course: Course) -> tuple[DriverNet, Lessons]:
    """The trained network, and all lessons that it had."""
    torch.manual_seed(seed)
    network = DriverNet()
    first = _FIRST_SEED * (seed + 1)
    lessons = joined([drive_lessons(lesson_task(first + k), pictures=course.pictures) for k in range(course.drives)])
    _LOG.info("the expert drove %d pictures", len(lessons))
    learn(network, lessons, steps=course.round_steps, seed=first, report=_report)
    for number in range(course.rounds):
        begin = first + course.drives + number * course.round_drives
        more = [
            drive_lessons(lesson_task(begin + k), pictures=course.pictures, student=Student(network), share=0.8)
            for k in range(course.round_drives)
        ]
        lessons = joined([lessons, *more])
        _LOG.info("round %d: drives of %s pictures", number + 1, ", ".join(str(len(one)) for one in more))
        steps = course.round_steps if number < course.rounds - 1 else course.last_steps
        learn(network, lessons, steps=steps, seed=begin, report=_report)
    return network, lessons


def _report(step: int, loss: float) -> None:
    _LOG.info("%6d  loss %.4f", step, loss)


def held_out_tasks(seed: int) -> dict[str, LoopTask]:
    """What is measured with `seed`, by the name of the figures: two laps of the demo track in each."""
    circuit = place("demo").circuit
    plain = LoopTask(seed=seed, laps=2)
    return {
        "lane_following": plain,
        "obstacles": replace(plain, kind=TaskKind.OBSTACLES, obstacles=obstacles_beside(circuit, count=3, seed=seed)),
        "changing_light": replace(plain, kind=TaskKind.CHANGING_LIGHT, light=LightChange(depth=0.5, step=0.25)),
        "camera_delay": replace(plain, kind=TaskKind.CAMERA_DELAY, delay_s=0.15),
    }


def _metrics(path: Path, seeds: int) -> dict[str, Any]:
    """By the name of the task; the time for one picture goes to the log only, it is this machine's."""
    metrics: dict[str, Any] = {}
    for name in held_out_tasks(0) if seeds else ():
        drives = [
            driven(held_out_tasks(seed)[name], open_onnx_driver(path, name="network")) for seed in range(1, seeds + 1)
        ]
        metrics[name] = figures(drives)
        _LOG.info("%s: %s; %.2f ms a picture", name, metrics[name], np.mean([one.answer_ms for one in drives]))
    return metrics


def driver_card(
    path: Path, *, seed: int, course: Course, pictures: int, parameters: int, metrics: dict[str, Any]
) -> dict[str, Any]:
    """The card of the driving network in `path`."""
    default = Course()
    changed = [
        f" --{name.replace('_', '-')} {getattr(course, name)}"
        for name in Course.__dataclass_fields__
        if getattr(course, name) != getattr(default, name)
    ]
    return {
        "name": path.stem,
        "sha256": file_sha256(path),
        "bytes": path.stat().st_size,
        "licence": "GPL-3.0-or-later",
        "task": "steering and throttle of a miniature car from its front camera and its wheels' speed",
        "input": f"pixels (1, {HEIGHT_PX}, {WIDTH_PX}, 3) uint8: red, green, blue; speed (1, 1) float32, m/s",
        "outputs": "control (1, 2) float32: steering, throttle; see dnb_edge/sim/control.py",
        "quantisation": "static int8, QDQ, U8S8, per channel, MinMax on its lessons; the last layer in float32",
        "parameters": parameters,
        "seed": seed,
        "pictures": pictures,
        "command": f"python -m dnb_edge.train.driver --out OUT --seed {seed}{''.join(changed)}",
        "data": "drives of pure pursuit and of the network itself in dnb_edge.sim.world, labelled by pure pursuit",
        "attributions": [],
        "packages": {
            name: version(name) for name in ("torch", "onnx", "onnxruntime", "numpy", "opencv-python-headless")
        },
        "python": platform.python_version(),
        "metrics": metrics,
    }


def run(arguments: Sequence[str] | None = None) -> Path:
    """Train as the arguments say; the path of the model. Raises InputError and WorkError."""
    out, name, seed, course = _arguments(arguments)
    cv2.setNumThreads(1)
    torch.set_num_threads(1)
    out.mkdir(parents=True, exist_ok=True)
    network, lessons = taught(seed, course)
    path = out / f"{name}.onnx"
    quantise_driver(network, path, some_of(lessons, _CALIBRATION))
    card = driver_card(
        path,
        seed=seed,
        course=course,
        pictures=len(lessons),
        parameters=parameter_count(network),
        metrics=_metrics(path, course.held_out),
    )
    write_card(path, card)
    _LOG.info("wrote %s, %d bytes", path, path.stat().st_size)
    return path


def main() -> None:
    """The command: exit code 2 for wrong input, 1 for failed work."""
    os.nice(5)  # minutes of work: let everything else go first
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s", stream=sys.stderr)
    try:
        run()
    except DnbEdgeError as fault:
        _LOG.error("%s", fault)
        sys.exit(2 if isinstance(fault, InputError) else 1)


if __name__ == "__main__":
    main()
