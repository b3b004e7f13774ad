"""One drive of a campaign: a simulated vehicle under a driver, timed, judged and recorded by the appliance as a real one is.

Knows how a task becomes a configuration and an open source, and what is kept of a run beside its recording. Knows nothing of
other drives.
"""

from __future__ import annotations

import hashlib
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import yaml

from dnb_edge import wire
from dnb_edge.cli.demo import course_config
from dnb_edge.config.load import load_config
from dnb_edge.config.loop_task import DriveTask, load_task
from dnb_edge.config.schema import Config
from dnb_edge.daemon.appliance import RunOptions, run_appliance, stop_signals
from dnb_edge.errors import InputError
from dnb_edge.nut.campaign import Trial, TrialLap, TrialResult, key_of, result_text
from dnb_edge.nut.closed_loop import ClosedLoopSource
from dnb_edge.nut.open import SHIPPED, open_driver
from dnb_edge.report.files import write_whole
from dnb_edge.sim.camera import PinholeCamera
from dnb_edge.sim.circuit import Circuit
from dnb_edge.sim.control import DriverFailed
from dnb_edge.sim.files import course_files
from dnb_edge.sim.rig import TrueLap
from dnb_edge.sim.task import LoopTask
from dnb_edge.sim.witness import LoopTruth
from dnb_edge.truth.campaign import code_sha256, model_sha256
from dnb_edge.values import Crossing, Event, Frame, FrameDetections, Incident, IncidentKind, Lap, PassStatus

SCRATCH_PREFIX = ".driving-"
"""Folders of drives that are not finished, in the campaign's directory."""

_SAME_LAP_S = 0.25
"""The appliance's lap and the simulator's are the same where they ended so near each other, seconds: no lap is shorter."""


def drive_trial(trial: Trial) -> TrialResult | None:
    """Drives `trial`, keeps its recording and its result, and returns that; None where it was interrupted, and nothing is kept.

    A driver that fails is a result. Raises `InputError` where driver, task or configuration are wrong, `WorkError` where the
    recording failed.
    """
    task = load_task(trial.task)
    loop = task.loop(trial.seed, trial.laps)
    with tempfile.TemporaryDirectory(dir=trial.directory, prefix=SCRATCH_PREFIX) as scratch, stop_signals() as stop:
        began_s = time.monotonic()
        source = ClosedLoopSource(loop, open_driver(trial.driver))
        world, heard, failure = source.world, _Heard(), None
        config = _config(Path(scratch), task, loop, trial, world.circuit, world.camera)
        options = RunOptions(source_uri=source.info.uri, record_directory=Path(scratch), resume_within_s=0.0)
        try:
            run_appliance(config, options, listeners=[heard], source=source, stop=stop)
        except DriverFailed as error:
            failure = " ".join(str(error).split())
        if stop.is_set():
            return None
        (recording,) = Path(scratch).glob("*.mcap")
        result = _result(
            trial, task.name, loop, heard, world.truth(), failure=failure, wall_s=time.monotonic() - began_s
        )
        recording.replace(trial.recording)
        write_whole(trial.result, result_text(trial, result).encode())
        return result


def trial_key(word: str, task: DriveTask, loop: LoopTask, entry: str, overrides: Sequence[str]) -> str | None:
    """Stands for all that a drive follows from; None for a driver from outside: nobody knows whether it has changed."""
    driver = word.partition("=")[2] or word
    if driver in SHIPPED:
        content = driver
    elif driver.lower().endswith(".onnx") and ":" not in driver:
        content = hashlib.sha256(Path(driver).read_bytes()).hexdigest()
    else:
        return None
    return key_of(
        {
            "driver": content,
            "entry": entry,
            "task": wire.to_dict(loop),
            "judged": task.judged,
            "overrides": list(overrides),
            "code": code_sha256(),
            "detector": model_sha256(),
        }
    )


def one_thread() -> None:
    """OpenCV's own threads take longer to begin than such small pictures take to draw."""
    cv2.setNumThreads(1)


def _config(
    directory: Path, task: DriveTask, loop: LoopTask, trial: Trial, circuit: Circuit, camera: PinholeCamera
) -> Config:
    """The configuration that a user would have made of that track under that camera, written into `directory` as one would.

    Raises `InputError`.
    """
    data = course_config(course_files(directory, circuit, camera), circuit.name)
    vehicle = loop.vehicle
    race: dict[str, Any] = {"car_length_m": vehicle.length_m, "car_width_m": vehicle.width_m}
    race["obstacles"] = [{"at_m": list(one.track_m), "radius_m": one.radius_m} for one in loop.obstacles]
    judged = dict(task.judged)
    data["race"] = race | judged.pop("race", {}) | {"laps": loop.laps}
    data["score"] = data["score"] | judged.pop("score", {})
    data |= judged
    driver = trial.driver.partition("=")[2] or trial.driver
    is_file = driver.lower().endswith(".onnx") and ":" not in driver
    data["entry"] = {"name": trial.entry} | ({"checkpoint": str(Path(driver).resolve())} if is_file else {})
    data["session"] = task.name
    path = directory / "closed-loop.yaml"
    path.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    return load_config(path, trial.overrides)


class _Heard:
    """Listens to a run and keeps what its result is made of."""

    warnings: tuple[str, ...] = ()

    def __init__(self) -> None:
        self.laps: list[Lap] = []
        self.incidents: list[Incident] = []
        self.began_s: float | None = None

    def frame(self, frame: Frame, found: FrameDetections) -> None:
        """Nothing is kept of frames."""

    def event(self, event: Event) -> None:
        """Keeps laps, incidents, and when the first lap began."""
        if isinstance(event, Lap):
            self.laps.append(event)
        elif isinstance(event, Incident):
            self.incidents.append(event)
        elif isinstance(event, Crossing) and event.status is PassStatus.START and self.began_s is None:
            self.began_s = event.t_s


def _result(
    trial: Trial, task: str, loop: LoopTask, heard: _Heard, truth: LoopTruth, *, failure: str | None, wall_s: float
) -> TrialResult:
    def count(kind: IncidentKind) -> int:
        return sum(one.kind is kind for one in heard.incidents)

    over = truth.ended or ("laps" if truth.completed else "race")
    return TrialResult(
        driver=trial.driver,
        entry=trial.entry,
        task=task,
        seed=trial.seed,
        wanted_laps=loop.laps,
        laps=tuple(_lap(lap, truth.laps) for lap in heard.laps),
        collisions=count(IncidentKind.COLLISION),
        true_collisions=len(truth.collisions),
        off_track=count(IncidentKind.OFF_TRACK),
        to_start_s=heard.began_s,
        true_laps=len(truth.laps),
        completed=truth.completed,
        ended="failed" if failure is not None else over,
        failure=failure,
        simulated_s=truth.duration_s,
        wall_s=wall_s,
        recording=trial.recording.name,
    )


def _lap(lap: Lap, true_laps: Sequence[TrueLap]) -> TrialLap:
    end_s = lap.start_s + lap.time_s
    true = min(true_laps, key=lambda one: abs(one.end_s - end_s), default=None)
    known = true is not None and abs(true.end_s - end_s) <= _SAME_LAP_S
    return TrialLap(
        number=lap.number,
        time_s=lap.time_s,
        sigma_s=lap.sigma_s,
        official_s=lap.time_s if lap.official_time_s is None else lap.official_time_s,
        valid=lap.valid,
        similarity_percent=lap.similarity_percent,
        penalty_factor=lap.penalty_factor,
        true_s=true.time_s if known and true is not None else None,
    )


def checked_driver(word: str) -> str:
    """The name of the driver that `word` means, which can be opened. Raises `InputError` where it cannot."""
    driver = open_driver(word)
    try:
        return driver.name
    finally:
        driver.close()


def checked_entry(name: str) -> str:
    """A driver's name as it can stand in file names. Raises `InputError` where nothing of it can."""
    kept = "".join(letter if letter.isalnum() or letter in "._+-" else "-" for letter in name).strip("-.")
    if not kept:
        raise InputError(f"driver {name!r}: give it a name in tables: --driver NAME={name}")
    return kept
