"""Rule sets: YAML files that say how a race is timed, judged and won, apart from track and camera.

Knows the rule sets that come with the package, those of users, and how a configuration's own keys win over them. Knows
nothing of what the rules do.
"""

from __future__ import annotations

import copy
import difflib
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from dnb_edge import wire
from dnb_edge.config.faults import explain
from dnb_edge.config.paths import names_a_file
from dnb_edge.config.schema import Format, Laps, Penalties, Scoring, Start
from dnb_edge.config.sections import STRICT, Name, Whole
from dnb_edge.config.text import KeyPath, parse_lines
from dnb_edge.errors import InputError
from dnb_edge.race.rules import PenaltyRules, StartMode

PRESETS = ("practice", "laps", "time-limit", "paper", "roboracer", "deepracer", "aido", "carla")
"""The rule sets that come with the package."""

SECTIONS = ("race", "start", "format", "penalties", "score")
"""The sections of a configuration that a rule set may have."""


class NoSuchRules(InputError):
    """No rule set has that name."""


class RuleSetFile(BaseModel):
    """The form of a rule set's file."""

    model_config = STRICT

    name: Name
    """What results call it."""
    version: Whole | str = 1
    """To be raised with each change that makes results another thing."""
    about: str = ""
    """What it is for; its first line is shown in lists."""
    race: Laps = Laps()  # type: ignore[valid-type]
    start: Start = Start()  # type: ignore[valid-type]
    format: Format = Format()  # type: ignore[valid-type]
    penalties: Penalties = Penalties()  # type: ignore[valid-type]
    score: Scoring = Scoring()  # type: ignore[valid-type]


@dataclass(frozen=True, slots=True, kw_only=True)
class RuleSet:
    """A rule set as its file gives it, checked by itself."""

    name: str
    version: str
    about: str
    text: str
    """The whole file."""
    origin: str
    """What errors call it."""
    sections: dict[str, dict[str, Any]]
    """The keys that it gives, plain YAML types, by section."""
    lines: dict[KeyPath, int]
    """The line of each of its keys."""


def load_rule_set(name: str, base: Path | None = None) -> RuleSet:
    """The rule set `name` of the package, or in the file of that path, relative to `base`.

    Raises `InputError` where there is none, or where something in it is wrong by itself, naming file, line and key.
    """
    if names_a_file(name):
        path = (base or Path.cwd()) / Path(name).expanduser()
        try:
            return _checked(path, path.read_text(encoding="utf-8-sig"), origin=str(path))
        except (OSError, UnicodeDecodeError) as error:
            reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
            raise InputError(f"{path}: cannot read the rule set: {reason}") from error
    if name not in PRESETS:
        close = difflib.get_close_matches(name, PRESETS, n=1)
        hint = f"did you mean {close[0]}?" if close else f"there are {', '.join(PRESETS)}"
        raise NoSuchRules(f"no rule set is called {name!r}: {hint} (or give the path of a .yaml file)")
    text = resources.files("dnb_edge.config").joinpath("rule_sets", f"{name}.yaml").read_text(encoding="utf-8")
    return _checked(Path(f"{name}.yaml"), text, origin=f"rule set {name}")


def with_rules(data: dict[str, Any], rules: RuleSet, *, start_mode: Any = None) -> dict[str, Any]:
    """The configuration `data` with what `rules` says where it says nothing itself; `data` is left as it is.

    Of the penalties each kind is one key: who gives `off_track: {}` gives all of it. A start in another mode than the rule
    set's takes nothing from its start; `start_mode` is that mode where it is not `data` that decides it.
    """
    merged = copy.deepcopy(data)
    for section in SECTIONS:
        own = merged.get(section, {})
        if not isinstance(own, dict):
            continue  # for the schema to refuse
        below = copy.deepcopy(rules.sections.get(section, {}))
        if section == "penalties":
            below = wire.to_dict(PenaltyRules()) | below
        if section == "start" and (start_mode or own.get("mode", _mode(below))) != _mode(below):
            below = {}
        merged[section] = below | own
    return merged


def _mode(start: dict[str, Any]) -> Any:
    return start.get("mode", StartMode.ROLLING.value)


def _checked(path: Path, text: str, *, origin: str) -> RuleSet:
    data, lines = parse_lines(path, text, what="the rule set")

    def where(key: KeyPath, _unknown: bool) -> str:
        line = next((lines[key[:n]] for n in range(len(key), 0, -1) if key[:n] in lines), None)
        return origin if line is None else f"{origin}, line {line}"

    try:
        file = RuleSetFile.model_validate(data)
    except ValidationError as error:
        raise InputError(explain(error, RuleSetFile, where, root="the rule set")) from error
    return RuleSet(
        name=file.name,
        version=str(file.version),
        about=file.about.strip(),
        text=text,
        origin=origin,
        sections={section: data[section] for section in SECTIONS if section in data},
        lines=lines,
    )
