"""Under what conditions a run was driven, in three short digests: runs are compared under identical ones only.

Knows which parts of the core's setup make the track, the calibration and the rules. Digests are always computed from the
recorded setup, never taken from a file that an older version wrote.
"""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import asdict, dataclass
from typing import Any

from dnb_edge import wire
from dnb_edge.core import CoreSetup
from dnb_edge.race.crossing import CrossingSettings
from dnb_edge.race.rules import FormatRules, LapRules, PenaltyRules, StartRules
from dnb_edge.score.similarity import ScoreSettings

_DIGITS = 12
"""Hexadecimal digits of a digest."""

_SIGNIFICANT = 7
"""Digits of a number that count: a map or a route that another processor computed differs in the last ones."""

_TRIFLE = 1e-9

_NO_RULE = {("race", "laps"), ("start", "seed")}
"""How long a run was to be, and its dice: by these no lap is judged."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """SHA-256 of each condition's canonical JSON, its first 12 hexadecimal digits."""

    track: str
    """Of the centreline and the lines, and so of the direction."""
    calibration: str
    """Of the map from the picture to the floor."""
    rules: str
    """Of everything by which laps are judged, penalised and scored: `CoreSetup.rules_digest`."""

    def to_dict(self) -> dict[str, str]:
        """The digests by name."""
        return asdict(self)


def identity_of(setup: CoreSetup) -> Identity:
    """The digests of the conditions that `setup` fixes."""
    track = setup.track.to_dict()
    return Identity(
        track=_digest({name: track[name] for name in ("centreline", "start_line", "sector_lines", "finish_line")}),
        calibration=_digest(
            [view.ground.to_dict() for view in setup.views] if setup.further else setup.ground.to_dict()
        ),
        rules=setup.rules_digest,
    )


def rules_of(setup: CoreSetup) -> dict[str, dict[str, Any]]:
    """What laps are timed, judged, penalised and scored by, where it is not the default: by section and key as in a
    configuration, plain JSON types. Laps of two runs for which it is equal can be compared one by one, though one run was to be
    longer or its start was diced otherwise, and so its rules have another digest. Of obstacles only their number counts: each
    seed of a task stands them elsewhere.
    """
    sections = {
        "race": (setup.laps, LapRules()),
        "start": (setup.start, StartRules()),
        "format": (setup.format, FormatRules()),
        "penalties": (setup.penalties, PenaltyRules()),
        "score": (setup.score, ScoreSettings()),
        "crossing": (setup.crossing, CrossingSettings()),
    }
    changed = {}
    for name, (used, usual) in sections.items():
        plain, default = wire.to_dict(used), wire.to_dict(usual)
        for rules in (plain, default) if name == "race" else ():
            rules["obstacles"] = len(rules["obstacles"])
        changed[name] = {
            key: value for key, value in plain.items() if value != default[key] and (name, key) not in _NO_RULE
        }
    return {name: keys for name, keys in changed.items() if keys}


def _digest(value: object) -> str:
    text = json.dumps(_canonical(value), sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:_DIGITS]


def _canonical(value: object) -> object:
    """`value` without absent members and with all numbers as floats of `_SIGNIFICANT` digits."""
    if isinstance(value, dict):
        return {str(key): _canonical(item) for key, item in value.items() if item is not None}
    if isinstance(value, list | tuple):
        return [_canonical(item) for item in value]
    if isinstance(value, bool) or not isinstance(value, int | float):
        return value
    if not math.isfinite(value):
        return str(value)
    return float(f"{value:.{_SIGNIFICANT}g}") if abs(value) > _TRIFLE else 0.0
