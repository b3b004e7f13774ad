"""The campaign: which drives are due, several processes that do them, and files that let an interrupted one go on.

Knows units of work, their cache and the processes. Each unit's result is a file of its own under its name, with a key of all
that it depends on: the unit itself, the code and the detector's model. A result with another key is done anew. Knows no
figures.
"""

from __future__ import annotations

import hashlib
import json
import math
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import cv2

from dnb_edge.detect.onnx import default_model_path
from dnb_edge.errors import InputError, WorkError
from dnb_edge.report.files import write_whole
from dnb_edge.truth.counts import CountCase, cases, counted
from dnb_edge.truth.measure import measured
from dnb_edge.truth.scenarios import Scenario, catalogue
from dnb_edge.truth.watch import watch

DRIVES_FOLDER = "drives"
_RENDERED_FRAME = 30.0
"""Work of one rendered frame, of one that is only drawn from the model: about."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What a campaign is to do."""

    seed: int
    laps: int
    """Laps of a fast scenario with the share 1."""
    rendered_laps: int
    """Laps of a rendered scenario with the share 1; 0 for none."""
    trials: int
    """Trials of each counted case."""
    only: tuple[str, ...] = ()
    """Names of scenarios and counted cases; empty for all."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Unit:
    """One drive of a scenario, or one trial of a counted case: done by one process in one go."""

    name: str
    number: int
    laps: int
    """0 for a counted case."""
    seed: int
    work: float
    """About how much, in fast frames."""

    @property
    def file_name(self) -> str:
        """Name of its result's file."""
        return f"{self.name}-{self.number:03d}.json"


def scenario_laps(scenario: Scenario, plan: Plan) -> int:
    """Laps that the plan wants of a scenario: its share, in whole drives of at least one lap; 0 for none."""
    wanted = plan.rendered_laps if scenario.rendered else plan.laps
    return max(1, math.ceil(wanted * scenario.share)) if wanted else 0


def units(plan: Plan) -> tuple[Unit, ...]:
    """All units of the plan, the longest first. Raises `InputError` where `only` names what is not there."""
    chosen, counts = chosen_of(plan)
    every: list[Unit] = []
    for scenario in chosen:
        left, number = scenario_laps(scenario, plan), 0
        while left > 0:
            laps = min(left, scenario.laps_per_drive)
            work = laps * _lap_s(scenario) * scenario.fps * (_RENDERED_FRAME if scenario.rendered else 1.0)
            every.append(Unit(name=scenario.name, number=number, laps=laps, seed=plan.seed, work=work))
            left, number = left - laps, number + 1
    for case in counts:
        rendered = case.scenario is not None and case.scenario.rendered
        work = 20_000.0 if rendered else 9_000.0 if case.name.startswith("parked") else 1_000.0
        every += [Unit(name=case.name, number=k, laps=0, seed=plan.seed, work=work) for k in range(plan.trials)]
    return tuple(sorted(every, key=lambda unit: (-unit.work, unit.name, unit.number)))


def chosen_of(plan: Plan) -> tuple[tuple[Scenario, ...], tuple[CountCase, ...]]:
    """The scenarios and counted cases of the plan. Raises `InputError` where `only` names what is not there."""
    scenarios, counts = catalogue(), cases()
    names = [*(scenario.name for scenario in scenarios), *(case.name for case in counts)]
    unknown = [name for name in plan.only if name not in names]
    if unknown:
        raise InputError(f"--only {unknown[0]}: no such scenario or case; there are {', '.join(names)}")
    kept_scenarios = tuple(one for one in scenarios if not plan.only or one.name in plan.only)
    kept_counts = tuple(
        one
        for one in counts
        if (not plan.only or one.name in plan.only)
        and (plan.rendered_laps or one.scenario is None or not one.scenario.rendered)
    )
    return tuple(one for one in kept_scenarios if scenario_laps(one, plan)), kept_counts


def _lap_s(scenario: Scenario) -> float:
    """About how long a lap takes, seconds: for the progress bar only."""
    length_m = {"table": 2.7, "table-paper": 2.7, "hairpin": 13.2}.get(scenario.place, 7.4)
    style = scenario.styles[0]
    return length_m / (0.5 * (style.top_mps + style.lowest_mps))


def run_unit(unit: Unit) -> dict[str, Any]:
    """The result of one unit, plain JSON types."""
    if unit.laps == 0:
        (case,) = (one for one in cases() if one.name == unit.name)
        return counted(case, seed=unit.seed, trial=unit.number)
    (scenario,) = (one for one in catalogue() if one.name == unit.name)
    watched = watch(scenario, laps=unit.laps, seed=unit.seed, number=unit.number)
    return measured(watched, series=scenario.rendered)


def run_campaign(
    plan: Plan, directory: Path, *, jobs: int, done: Callable[[Unit], None]
) -> dict[str, list[dict[str, Any]]]:
    """Does what is not done yet and returns all results by name, each in the order of its units' numbers.

    `done` is told of each finished unit, those from before included. Where it is interrupted, what is finished
    stays. Raises `InputError` where `directory` cannot be used, `WorkError` where a process dies.
    """
    folder = results_folder(directory)
    code, model = code_sha256(), model_sha256()
    found: dict[str, list[tuple[int, dict[str, Any]]]] = {}
    due = []
    for unit in units(plan):
        known = _kept(folder / unit.file_name, _key(unit, code, model))
        if known is None:
            due.append(unit)
            continue
        found.setdefault(unit.name, []).append((unit.number, known))
        done(unit)
    for unit, result in _results(due, jobs):
        text = json.dumps({"key": _key(unit, code, model), "result": result}, allow_nan=False)
        write_whole(folder / unit.file_name, text.encode())
        # What was kept is read back in the same form, whether the campaign was interrupted or not.
        found.setdefault(unit.name, []).append((unit.number, json.loads(text)["result"]))
        done(unit)
    return {name: [result for _, result in sorted(some, key=lambda one: one[0])] for name, some in found.items()}


def results_folder(directory: Path) -> Path:
    """The folder for the units' results, made if missing. Raises `InputError` where it cannot be."""
    folder = directory / DRIVES_FOLDER
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: the results cannot be kept there: {error.strerror}") from error
    return folder


def _results(due: Sequence[Unit], jobs: int) -> Iterator[tuple[Unit, dict[str, Any]]]:
    """The results as they come."""
    if jobs <= 1 or len(due) <= 1:
        for unit in due:
            yield unit, run_unit(unit)
        return
    # Fresh processes, not copies of this one: ONNX Runtime and OpenCV do not survive being copied.
    pool = ProcessPoolExecutor(min(jobs, len(due)), mp_context=get_context("spawn"), initializer=_begin_process)
    try:
        waiting = {pool.submit(run_unit, unit): unit for unit in due}
        for future in as_completed(waiting):
            yield waiting[future], future.result()
    except BrokenProcessPool as error:
        raise WorkError(
            f"a process of the campaign died ({error}): the same command goes on where it stopped"
        ) from error
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _begin_process() -> None:
    """One thread a process, and Ctrl-C ends it without a word: what it was at is not finished, and is done again."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    cv2.setNumThreads(1)


def _kept(path: Path, key: str) -> dict[str, Any] | None:
    """The result in the file at `path`; None where there is none, or one that something else led to."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        return None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}; remove it") from error
    if not isinstance(data, dict) or data.get("key") != key or not isinstance(data.get("result"), dict):
        return None
    result: dict[str, Any] = data["result"]
    return result


def _key(unit: Unit, code: str, model: str) -> str:
    about = {"unit": asdict(unit), "code": code, "model": model}
    return hashlib.sha256(json.dumps(about, sort_keys=True).encode()).hexdigest()


def code_sha256() -> str:
    """SHA-256 over all of the package's Python files: results of other code are no results of this one."""
    root = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(str(path.relative_to(root)).encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


def model_sha256() -> str:
    """SHA-256 of the shipped detector's model."""
    return hashlib.sha256(default_model_path().read_bytes()).hexdigest()
