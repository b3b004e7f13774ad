"""Whether recordings may stand in one table: the same track, the same direction, the same rules, and which calibration.

Knows conditions; knows no lap.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from dnb_edge.cli.trials import Raced
from dnb_edge.errors import InputError
from dnb_edge.record.identity import rules_of
from dnb_edge.track.model import Track

_SAME_ROUTE_M = 0.05
"""A route that lies nowhere further from another is that one, maybe the other way round."""


def check_comparable(runs: Sequence[Raced]) -> tuple[str, ...]:
    """Warnings about runs that may be compared with care. Raises `InputError` naming two recordings and what differs.

    Neither depends on the order of `runs`.
    """
    ordered = sorted(runs, key=lambda run: str(run.path))
    for run in ordered[1:]:
        _check_pair(ordered[0], run)
    sessions: dict[str | None, Raced] = {}
    for run in ordered:
        known = sessions.setdefault(run.session, run)
        if run.session is not None and run.identity.calibration != known.identity.calibration:
            raise InputError(
                f"{known.path} and {run.path}: different calibrations ({known.identity.calibration}, "
                f"{run.identity.calibration}) in one session, {run.session!r}: give the runs after the new one another "
                "session's name, or leave one out"
            )
    first = ordered[0] if ordered else None
    other = next((run for run in ordered if first and run.identity.calibration != first.identity.calibration), None)
    if first is None or other is None:
        return ()
    digests = f"({first.identity.calibration}, {other.identity.calibration})"
    told = "what they measure differs a little for that alone"
    return (f"{first.path} and {other.path}: different calibrations {digests}: {told}",)


def _check_pair(one: Raced, other: Raced) -> None:
    where = f"{one.path} and {other.path}"
    if one.identity.track != other.identity.track:
        raise InputError(
            f"{where}: {_track_difference(one.setup.track, other.setup.track)}: compare one track at a time"
        )
    rules = rules_of(one.setup), rules_of(other.setup)
    if rules[0] != rules[1]:
        key, first, second = _rule_difference(*rules)
        raise InputError(
            f"{where}: different rules, {key} is {first} and {second}: score both by one rule set with --rules"
        )


def _track_difference(one: Track, other: Track) -> str:
    """Whether two tracks are one that is driven in two directions, one with other lines, or two."""
    s_m, d_m = other.centreline.locate(one.centreline.points_m)
    _, back_d_m = one.centreline.locate(other.centreline.points_m)
    if max(float(np.abs(d_m).max()), float(np.abs(back_d_m).max())) > _SAME_ROUTE_M:
        return f"different tracks ({one.name!r} and {other.name!r})"
    if sum(other.centreline.step_m(a, b) for a, b in pairwise(s_m.tolist())) < 0:
        return f"opposite directions round the track {one.name!r}"
    return f"different lines or widths of the track {one.name!r}"


def _rule_difference(one: Mapping[str, Any], other: Mapping[str, Any]) -> tuple[str, str, str]:
    """The first key, in order, in which two sets of rules differ, and its two values."""
    first, second = _flat(one), _flat(other)
    key = next(key for key in sorted(first | second) if first.get(key) != second.get(key))
    return key, _said(first, key), _said(second, key)


def _said(rules: Mapping[str, Any], key: str) -> str:
    return json.dumps(rules[key]) if key in rules else "the default"


def _flat(value: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, item in value.items():
        if isinstance(item, Mapping):
            flat |= _flat(item, f"{prefix}{key}.")
        else:
            flat[prefix + key] = item
    return flat
