"""Many drives, one for each driver and seed: what each came to, processes that do them, and files that let a campaign go on.

Knows trials and their results as plain values. How a trial is driven it is told; it knows no recording's inside and no model.
"""

from __future__ import annotations

import hashlib
import json
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import cv2

from dnb_edge import wire
from dnb_edge.errors import InputError, WorkError

RESULT_SUFFIX = ".drive.json"
"""What a drive came to, beside its recording of the same name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One driver's drive of one seed."""

    driver: str
    """The word that means it, as for `open_driver`."""
    entry: str
    """What tables call it."""
    task: str
    """A task's name or file."""
    seed: int
    laps: int
    directory: str
    """Where its recording goes."""
    overrides: tuple[str, ...] = ()
    """Keys of the appliance's configuration, `key.path=value` each."""
    name: str
    """Of its recording and its result, without endings."""
    key: str | None = None
    """Stands for all that the result follows from; None where nobody can tell, and the drive is always done anew."""

    @property
    def recording(self) -> Path:
        """Where its recording lies once it is done."""
        return Path(self.directory) / f"{self.name}.mcap"

    @property
    def result(self) -> Path:
        """Where its result lies once it is done."""
        return Path(self.directory) / f"{self.name}{RESULT_SUFFIX}"


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialLap:
    """A lap as the appliance told it, beside what the simulator knows of it."""

    number: int
    time_s: float
    sigma_s: float
    official_s: float
    """With the penalties' seconds."""
    valid: bool
    similarity_percent: float | None
    penalty_factor: float
    true_s: float | None
    """The simulator's own time of that lap; None where it knows none that ended then."""

    @property
    def error_ms(self) -> float | None:
        """How much longer than it was the lap was told to be, ms."""
        return None if self.true_s is None else (self.time_s - self.true_s) * 1e3


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialResult:
    """What a drive came to."""

    driver: str
    entry: str
    task: str
    seed: int
    wanted_laps: int
    laps: tuple[TrialLap, ...]
    collisions: int
    """Hits that the appliance told."""
    true_collisions: int
    """Hits that the simulator knows of, up to the last frame."""
    off_track: int
    """Times that the appliance saw the car off the lane."""
    to_start_s: float | None
    """Simulated time until the first lap began; None where none did."""
    true_laps: int
    completed: bool
    """Whether all laps were driven, as the simulator knows."""
    ended: str
    """Why the drive was over: `laps`, `time`, `left`, `stuck`, `failed`, or `race` where the rules ended it."""
    failure: str | None
    """Why the driver failed; None where it did not."""
    simulated_s: float
    wall_s: float
    recording: str | None

    @property
    def score(self) -> float:
        """Mean path similarity of the wanted laps, percent, each times its penalties' factor; an invalid lap and one that was
        not driven count 0."""
        counted = self.laps[: self.wanted_laps]
        return (
            sum((lap.similarity_percent or 0.0) * lap.penalty_factor for lap in counted if lap.valid) / self.wanted_laps
        )

    @property
    def pace(self) -> float:
        """Valid laps a minute from the first lap's start on: penalties' seconds count as driven, and so does all the time in
        which no lap was completed."""
        counted = self.laps[: self.wanted_laps]
        seconds = sum(lap.official_s for lap in counted)
        if len(counted) < self.wanted_laps:
            unfinished_s = self.simulated_s - (self.to_start_s or 0.0) - sum(lap.time_s for lap in counted)
            seconds += max(unfinished_s, 0.0)
        return 60.0 * sum(lap.valid for lap in counted) / seconds if seconds > 0.0 else 0.0

    @property
    def worst_error_ms(self) -> float | None:
        """The greatest difference between a lap as it was told and as it was driven, ms."""
        errors = [abs(lap.error_ms) for lap in self.laps if lap.error_ms is not None]
        return max(errors, default=None)


Drive = Callable[[Trial], TrialResult | None]
"""Drives one trial, in any process; None where it was interrupted. A driver that fails is a result."""


def seeds_of(text: str) -> tuple[int, ...]:
    """The seeds in `1-30`, `7` or `1-3,8,20-22`, each once, in their order. Raises `InputError` for anything else."""
    seeds: dict[int, None] = {}
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        if not (first.isdecimal() and (last.isdecimal() or not dash)):
            raise InputError(f"--seeds {text}: write 1-30, or 1-3,8,20-22")
        low, high = int(first), int(last) if dash else int(first)
        if high < low or high >= 2**31 or high - low >= 100_000:
            raise InputError(f"--seeds {text}: {part.strip()} is no range of seeds")
        seeds |= dict.fromkeys(range(low, high + 1))
    return tuple(seeds)


def key_of(about: Mapping[str, Any]) -> str:
    """A key that stands for `about`, plain JSON types."""
    return hashlib.sha256(json.dumps(about, sort_keys=True, allow_nan=False).encode()).hexdigest()


def kept(trial: Trial) -> TrialResult | None:
    """The result of an earlier campaign, where the trial is the same and its recording is still there."""
    if trial.key is None or not trial.recording.is_file():
        return None
    try:
        data = json.loads(trial.result.read_text(encoding="utf-8"))
        return wire.from_dict(TrialResult, data["result"]) if data["key"] == trial.key else None
    except FileNotFoundError:
        return None
    except OSError as error:
        raise InputError(f"{trial.result}: cannot be read: {error.strerror}; remove it") from error
    except (ValueError, KeyError, TypeError):
        return None


def result_text(trial: Trial, result: TrialResult) -> str:
    """What goes into the trial's result file."""
    return json.dumps({"key": trial.key, "result": wire.to_dict(result)}, allow_nan=False, indent=1) + "\n"


def drive_all(trials: Sequence[Trial], drive: Drive, *, jobs: int) -> Iterator[tuple[Trial, TrialResult]]:
    """Each trial with its result, as they come: those that are kept first.

    `drive` must be importable by name; with `jobs` above 1 it is called in processes of their own. Raises `KeyboardInterrupt`
    where a drive was interrupted, `WorkError` where a process died.
    """
    due = []
    for trial in trials:
        known = kept(trial)
        if known is None:
            due.append(trial)
        else:
            yield trial, known
    if jobs <= 1 or len(due) <= 1:
        for trial in due:
            result = drive(trial)
            if result is None:
                raise KeyboardInterrupt
            yield trial, result
        return
    yield from _in_processes(due, drive, jobs)


def _in_processes(due: Sequence[Trial], drive: Drive, jobs: int) -> Iterator[tuple[Trial, TrialResult]]:
    # Fresh processes, not copies of this one: ONNX Runtime and OpenCV do not survive being copied.
    pool = ProcessPoolExecutor(min(jobs, len(due)), mp_context=get_context("spawn"), initializer=_begin_process)
    try:
        waiting = {pool.submit(drive, trial): trial for trial in due}
        for future in as_completed(waiting):
            result = future.result()
            if result is None:
                raise KeyboardInterrupt
            yield waiting[future], result
    except BrokenProcessPool as error:
        raise WorkError(
            f"a process of the campaign died ({error}): the same command goes on where it stopped"
        ) from error
    finally:
        # Those at work finish their recording or drop it; nobody begins another.
        pool.shutdown(wait=True, cancel_futures=True)


def _begin_process() -> None:
    """One thread a process; Ctrl-C reaches it as well as its parent, and ends what it is at."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    cv2.setNumThreads(1)
