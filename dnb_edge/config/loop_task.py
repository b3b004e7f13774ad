"""Tasks for closed-loop drives: YAML files that say where a driver drives, under what conditions, and how its laps are judged.

Knows the tasks that come with the package, those of users, and what a seed makes of one. Knows no driver and runs nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, Field, ValidationError

from dnb_edge.config.faults import explain
from dnb_edge.config.paths import names_a_file, resolve_rules
from dnb_edge.config.rules import load_rule_set
from dnb_edge.config.schema import DEFAULT_RULES, Crossing, Format, Laps, Penalties, Scoring
from dnb_edge.config.sections import STRICT, Name, Number, Whole, section, to_settings
from dnb_edge.config.text import KeyPath, parse_lines
from dnb_edge.errors import InputError
from dnb_edge.sim.circuit import Circuit
from dnb_edge.sim.control import Obstacle
from dnb_edge.sim.light import LightChange
from dnb_edge.sim.places import place
from dnb_edge.sim.task import LoopTask, TaskKind, obstacles_beside
from dnb_edge.sim.vehicle import VehicleSettings

TASKS = tuple(kind.value for kind in TaskKind)
"""The tasks that come with the package."""

_JUDGED = ("race", "format", "penalties", "score", "crossing")
"""The sections of a configuration that a task may have."""

Light = section(LightChange)
Vehicle = section(VehicleSettings)

_STANDARD = LoopTask()


class StandingObstacle(BaseModel):
    """A round thing on the floor."""

    model_config = STRICT

    at_m: tuple[Number, Number]
    """Its centre on the track plane, metres."""
    radius_m: Annotated[Number, Field(gt=0, le=1)]
    """Its radius, metres."""
    height_m: Annotated[Number, Field(gt=0, le=1)] = 0.10
    """Its height, metres."""


class TaskFile(BaseModel):
    """The form of a task's file."""

    model_config = STRICT

    name: Name
    """What results call it."""
    about: str = ""
    """What it asks of a driver; its first line is shown in lists."""
    kind: TaskKind
    """Which of the five it is, or is nearest to."""
    place: str = _STANDARD.place
    """The track and the overhead camera."""
    laps: Annotated[Whole, Field(ge=1, le=1000)] = _STANDARD.laps
    """Laps to drive."""
    obstacles: Annotated[Whole, Field(ge=0)] | tuple[StandingObstacle, ...] = 0
    """What stands on the lane: so many, where each seed puts them, or these for every seed."""
    light: Light = Light()  # type: ignore[valid-type]
    """How the light changes."""
    delay_s: Annotated[Number, Field(ge=0, le=2)] = _STANDARD.delay_s
    """Between a front picture and the moment at which the control made of it takes hold, seconds."""
    wrong_way: bool = _STANDARD.wrong_way
    """Whether the car stands against the direction of travel at the start."""
    size_px: tuple[Whole, Whole] = _STANDARD.size_px
    """Width and height of the overhead pictures."""
    fps: Number = _STANDARD.fps
    """Overhead frames per second."""
    front_size_px: tuple[Whole, Whole] = _STANDARD.front_size_px
    """Width and height of the pictures that the driver gets."""
    front_fps: Number = _STANDARD.front_fps
    """Pictures per second that the driver gets."""
    time_limit_s: Annotated[Number, Field(gt=0)] | None = None
    """Simulated seconds after which the drive ends; none for as long as a slow driver needs."""
    vehicle: Vehicle = Vehicle()  # type: ignore[valid-type]
    """What drives."""
    rules: Annotated[str, BeforeValidator(resolve_rules)] = DEFAULT_RULES
    """The rule set by which laps are judged; the sections below win over it, as in a configuration."""
    race: Laps = Laps()  # type: ignore[valid-type]
    format: Format = Format()  # type: ignore[valid-type]
    penalties: Penalties = Penalties()  # type: ignore[valid-type]
    score: Scoring = Scoring()  # type: ignore[valid-type]
    crossing: Crossing = Crossing()  # type: ignore[valid-type]


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveTask:
    """A task as its file gives it."""

    origin: str
    """What errors call it."""
    file: TaskFile
    judged: dict[str, Any]
    """The rule set and the keys of the configuration that it gives, plain YAML types."""

    @property
    def name(self) -> str:
        """What results call it."""
        return self.file.name

    def loop(self, seed: int, laps: int | None = None) -> LoopTask:
        """What `seed` makes of it; `laps` instead of its own. Raises `InputError` where that is no drive."""
        file = self.file
        try:
            light, vehicle = to_settings(LightChange, file.light), to_settings(VehicleSettings, file.vehicle)
            task = LoopTask(
                kind=file.kind, seed=seed, laps=file.laps if laps is None else laps, place=file.place, light=light,
                delay_s=file.delay_s, wrong_way=file.wrong_way, size_px=file.size_px, fps=file.fps,
                front_size_px=file.front_size_px, front_fps=file.front_fps, time_limit_s=file.time_limit_s,
                vehicle=vehicle,
            )  # fmt: skip
            return replace(task, obstacles=self._obstacles(place(task.place).circuit, seed))
        except ValueError as error:
            raise InputError(f"{self.origin}: {error}") from error

    def _obstacles(self, circuit: Circuit, seed: int) -> tuple[Obstacle, ...]:
        wanted = self.file.obstacles
        if isinstance(wanted, int):
            return obstacles_beside(circuit, count=wanted, seed=seed)
        return tuple(Obstacle(track_m=one.at_m, radius_m=one.radius_m, height_m=one.height_m) for one in wanted)


def load_task(word: str) -> DriveTask:
    """The task of that name, one of `TASKS`, or in the YAML file of that path.

    Raises `InputError`, one line, where there is none, or naming file, line and key where something in it is wrong.
    """
    if names_a_file(word):
        path = Path(word).expanduser()
        try:
            return _checked(path, path.read_text(encoding="utf-8-sig"), origin=str(path))
        except (OSError, UnicodeDecodeError) as error:
            reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
            raise InputError(f"{path}: cannot read the task: {reason}") from error
    if word not in TASKS:
        raise InputError(f"no task is called {word!r}: there are {', '.join(TASKS)} (or give the path of a .yaml file)")
    text = resources.files("dnb_edge.config").joinpath("loop_tasks", f"{word}.yaml").read_text(encoding="utf-8")
    return _checked(Path(f"{word}.yaml"), text, origin=f"task {word}")


def _checked(path: Path, text: str, *, origin: str) -> DriveTask:
    data, lines = parse_lines(path, text, what="the task")

    def where(key: KeyPath, _unknown: bool = False) -> str:
        line = next((lines[key[:n]] for n in range(len(key), 0, -1) if key[:n] in lines), None)
        return origin if line is None else f"{origin}, line {line}"

    try:
        file = TaskFile.model_validate(data, context={"base": path.resolve().parent})
    except ValidationError as error:
        raise InputError(explain(error, TaskFile, where, root="the task")) from error
    try:
        load_rule_set(file.rules)
    except InputError as error:
        raise InputError(f"{where(('rules',))}: rules: {error}") from error
    judged = {name: data[name] for name in _JUDGED if name in data}
    task = DriveTask(origin=origin, file=file, judged={"rules": file.rules} | judged)
    # What no seed can make a drive of is told now.
    task.loop(1)
    return task
