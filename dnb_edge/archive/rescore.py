"""A recording's setup under other lines, thresholds or rules: what `score` changes, and how it says so.

Knows the core's setup and the options' forms; the recording itself is never changed.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ValidationError

from dnb_edge import wire
from dnb_edge.archive.rescore_lines import Place, lines_px, other_track, parse_line_options, with_lines
from dnb_edge.config.faults import explain
from dnb_edge.config.load import START_MODE, parse_override, set_key
from dnb_edge.config.rules import SECTIONS, RuleSet, load_rule_set, with_rules
from dnb_edge.config.schema import Crossing, Format, Laps, Motion, Penalties, Scoring, Start
from dnb_edge.config.sections import STRICT, to_settings
from dnb_edge.config.text import KeyPath
from dnb_edge.config.track_file import load_track
from dnb_edge.core import CoreSetup
from dnb_edge.errors import InputError
from dnb_edge.motion.settings import MotionSettings
from dnb_edge.race.crossing import CrossingSettings
from dnb_edge.race.rules import FormatRules, LapRules, PenaltyRules, Ranking, StartRules, check_together
from dnb_edge.score.similarity import ScoreSettings
from dnb_edge.track.model import Track
from dnb_edge.values import Points

_PARTS: dict[str, tuple[str, type]] = {
    "race": ("laps", LapRules),
    "start": ("start", StartRules),
    "format": ("format", FormatRules),
    "penalties": ("penalties", PenaltyRules),
    "score": ("score", ScoreSettings),
    "crossing": ("crossing", CrossingSettings),
    "motion": ("motion", MotionSettings),
}
"""Section of the configuration: the setup's member that it makes, and of what kind."""

_KEPT = ("laps", "car_length_m", "car_width_m", "obstacles")
"""Keys of `race` that are of the run, not of its rules: another rule set leaves them unless it gives them itself."""


class _Changeable(BaseModel):
    """The sections of a configuration that can be changed after the fact: all that comes after the detections."""

    model_config = STRICT

    race: Laps = Laps()  # type: ignore[valid-type]
    start: Start = Start()  # type: ignore[valid-type]
    format: Format = Format()  # type: ignore[valid-type]
    penalties: Penalties = Penalties()  # type: ignore[valid-type]
    score: Scoring = Scoring()  # type: ignore[valid-type]
    crossing: Crossing = Crossing()  # type: ignore[valid-type]
    motion: Motion = Motion()  # type: ignore[valid-type]


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """What is to be changed, as the command line says it."""

    rules: str | None = None
    """A rule set's name or file."""
    track: Path | None = None
    lines: Sequence[str] = ()
    overrides: Sequence[str] = ()

    def change(self, recording: Path) -> Callable[[CoreSetup], CoreSetup] | None:
        """What makes the setup of `recording` what is wanted; None where nothing is to be changed."""
        if self == Wanted():
            return None
        return lambda setup: changed(setup, self.loaded(), recording)

    def loaded(self) -> Loaded:
        """The same with all files read. Raises `InputError` naming the option or the file that is wrong by itself."""
        return Loaded(
            rules=None if self.rules is None else load_rule_set(self.rules),
            track=None if self.track is None else (self.track, load_track(self.track)),
            lines=parse_line_options(self.lines),
            overrides=tuple(self.overrides),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Loaded:
    """What is to be changed, without a file left to read: it can be sent to another machine."""

    rules: RuleSet | None = None
    track: tuple[Path, Track] | None = None
    """With the file that it is from, for messages."""
    lines: Mapping[str, Place] = field(default_factory=dict)
    overrides: Sequence[str] = ()

    def with_overrides(self, overrides: Sequence[str]) -> Loaded:
        """The same with other single keys."""
        return replace(self, overrides=tuple(overrides))


def changed(setup: CoreSetup, wanted: Loaded, recording: Path) -> CoreSetup:
    """`setup` with another track, then other lines on it, then other rules, then single keys.

    Raises `InputError`, one line, where lines, rules or keys are wrong or do not fit the recording.
    """
    track = setup.track
    if wanted.track is not None:
        track = other_track(track, *wanted.track, recording)
    if wanted.lines:
        track = with_lines(track, wanted.lines)
    setup = replace(setup, track=track)
    if wanted.rules is None and not wanted.overrides:
        return setup
    data = {name: wire.to_dict(getattr(setup, member)) for name, (member, _) in _PARTS.items()}
    rules = wanted.rules
    if rules is not None:
        data |= _under(rules, data, dict(map(parse_override, wanted.overrides)).get(START_MODE))
        setup = replace(setup, rules=rules.name, rules_version=rules.version)
    return _with_sections(setup, data, wanted.overrides, rules)


def _under(rules: RuleSet, data: Mapping[str, dict[str, Any]], start_mode: Any) -> dict[str, dict[str, Any]]:
    """The five sections of rules as `rules` has them. What it does not say of scoring stays, since that goes by the track."""
    given = with_rules({}, rules, start_mode=start_mode)
    sections = {name: wire.to_dict(_PARTS[name][1]()) | given[name] for name in SECTIONS if name != "score"}
    # A race for survival has no wanted laps: see `check_together`.
    over = ("laps",) if given["format"].get("rank_by") == Ranking.SURVIVAL.value else ()
    kept = {key: data["race"][key] for key in _KEPT if key not in given["race"] and key not in over}
    return sections | {"race": sections["race"] | kept, "score": data["score"] | given["score"]}


def _with_sections(
    setup: CoreSetup, data: dict[str, dict[str, Any]], overrides: Sequence[str], rules: RuleSet | None
) -> CoreSetup:
    """The setup with the sections of `data`, which single keys change first."""
    given: dict[KeyPath, str] = {}
    for override in overrides:
        path, value = parse_override(override)
        if path[0] not in _PARTS:
            raise InputError(
                f"--set {override}: a recording holds what was detected: only {', '.join(_PARTS)} can be changed"
            )
        set_key(data, path, value, override)
        given[path] = override

    def where(path: KeyPath, unknown: bool) -> str:
        for at in [path[:n] for n in range(len(path), 0, -1)]:
            if at in given:
                return f"--set {given[at]}"
            if rules is not None and at in rules.lines:
                return f"{rules.origin}, line {rules.lines[at]}"
        below = (text for at, text in given.items() if unknown and at[: len(path)] == path)
        return next((f"--set {text}" for text in below), "the recording's setup")

    try:
        model = _Changeable.model_validate(data)
    except ValidationError as error:
        raise InputError(explain(error, _Changeable, where, root="the setup")) from error
    parts: dict[str, Any] = {member: to_settings(kind, getattr(model, name)) for name, (member, kind) in _PARTS.items()}
    setup = replace(setup, **parts)
    try:
        check_together(setup.laps, setup.start, setup.format, setup.penalties)
    except ValueError as error:
        raise InputError(f"the rules contradict one another: {error}") from error
    return setup


def changes(before: CoreSetup, after: CoreSetup) -> dict[str, dict[str, Any]]:
    """What differs, by key: `was` and `is`, plain JSON types. Lines are told by their ends, twin px."""
    was, now = _told(before), _told(after)
    return {
        key: {"was": was.get(key), "is": now.get(key)}
        for key in dict.fromkeys((*was, *now))
        if was.get(key) != now.get(key)
    }


def changes_text(before: CoreSetup, after: CoreSetup) -> str:
    """The same on one line, for people."""
    words = [_words(key, one["was"], one["is"], after) for key, one in changes(before, after).items()]
    return ", ".join(words) if words else "nothing, it was so already"


def _words(key: str, was: Any, now: Any, after: CoreSetup) -> str:
    if key == "track":
        return f"track {after.track.name!r}"
    if key.startswith("line "):
        return f"{key} {'added' if was is None else 'taken away' if now is None else 'moved'}"
    return f"{key} {json.dumps(now)} (was {json.dumps(was)})"


def _told(setup: CoreSetup) -> dict[str, Any]:
    """Every key that can be changed with its value."""
    route = setup.track.centreline
    told: dict[str, Any] = {"rules": setup.rules, "track": [setup.track.name, round(route.length_m, 2)]}
    if route.closed:
        told["direction"] = "anticlockwise" if _area_m2(route.points_m) > 0 else "clockwise"
    told |= {f"line {name}": ends for name, ends in lines_px(setup.track).items()}
    for name, (member, _) in _PARTS.items():
        told |= _flat(name, wire.to_dict(getattr(setup, member)))
    return told


def _area_m2(points_m: Points) -> float:
    """Area of the closed polygon (n, 2), by Gauss; positive where it goes anticlockwise."""
    x, y = points_m.T
    return float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2


def _flat(above: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """Values by their whole keys, such as `penalties.off_track.seconds`."""
    flat: dict[str, Any] = {}
    for key, value in values.items():
        flat |= _flat(f"{above}.{key}", value) if isinstance(value, Mapping) else {f"{above}.{key}": value}
    return flat
