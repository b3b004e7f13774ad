"""Whether recordings may stand in one table: the same track, direction, rules and task, and which calibration.

Knows conditions; knows no lap.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dnb_edge.archive.trials import USUAL_TASK, Raced
from dnb_edge.config.rules import SECTIONS
from dnb_edge.errors import InputError
from dnb_edge.record.identity import rules_of
from dnb_edge.report.table import printable
from dnb_edge.track.model import Track
from dnb_edge.values import Points, path_points
from dnb_edge.view.ground import GroundMap

_SAME_M = 1e-4
"""What lies nowhere further apart is the same, metres: a track and a calibration come of linear algebra, whose last digits are
another processor's or another library's, and then so are the digests."""

_SAME_ROUTE_M = 0.05
"""A route that lies nowhere further from another is that one, maybe the other way round."""


def check_comparable(runs: Sequence[Raced], *, advice: str = "") -> tuple[str, ...]:
    """Warnings about runs that may be compared with care. Raises `InputError` naming two recordings and what differs, with
    `advice` at its end.

    Neither depends on the order of `runs`.
    """
    ordered = _ordered(runs)
    for run in ordered[1:]:
        found = _difference(ordered[0], run)
        if found is not None:
            raise InputError(f"{ordered[0].path} and {run.path}: {found.text}: {found.remedy}{advice}")
    sessions: dict[str | None, Raced] = {}
    for run in ordered:
        known = sessions.setdefault(run.session, run)
        if run.session is not None and not _same_calibration(run, known):
            raise InputError(
                f"{known.path} and {run.path}: different calibrations ({known.identity.calibration}, "
                f"{run.identity.calibration}) in one session, {run.session!r}: give the runs after the new one another "
                "session's name, or leave one out"
            )
    twice = _twice(ordered)
    first = ordered[0] if ordered else None
    other = next((run for run in ordered if first and not _same_calibration(run, first)), None)
    if first is None or other is None:
        return twice
    digests = f"({first.identity.calibration}, {other.identity.calibration})"
    told = "what they measure differs a little for that alone"
    return (f"{first.path} and {other.path}: different calibrations {digests}: {told}", *twice)


def _twice(ordered: Sequence[Raced]) -> tuple[str, ...]:
    """Closed-loop drives of one entry and seed: a drive and its copy are one trial, and would be counted for two."""
    seen: dict[object, Raced] = {}
    told = []
    for run in ordered:
        for trial in run.trials:
            known = seen.setdefault((trial.entrant.key, trial.seed), run) if trial.seed is not None else run
            if known is not run:
                name = printable(trial.entry.name)
                told.append(
                    f"{known.path} and {run.path}: both are seed {printable(trial.seed or '')} of {name}: leave one out"
                )
    return tuple(told)


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """Recordings under the same conditions."""

    conditions: str
    """What they are, on one line; no two groups have the same."""
    runs: tuple[Raced, ...]


def grouped(runs: Sequence[Raced]) -> tuple[Group, ...]:
    """`runs` in groups of which each may stand in one table, the same whatever their order.

    Each is named by its track, task and rules.
    """
    members: list[list[Raced]] = []
    for run in _ordered(runs):
        group = next((group for group in members if _difference(group[0], run) is None), None)
        if group is None:
            members.append([run])
        else:
            group.append(run)
    named: dict[str, list[Raced]] = {}
    for group in members:
        title = _title(group)
        if title in named:
            unlike = _difference(named[title][0], group[0])
            assert unlike is not None, "else it were one group"
            title += f" (group {sum(other.startswith(title) for other in named) + 1}: {unlike.text})"
        named[title] = group
    return tuple(Group(conditions=title, runs=tuple(named[title])) for title in sorted(named))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Difference:
    text: str
    remedy: str


def _ordered(runs: Sequence[Raced]) -> list[Raced]:
    return sorted(runs, key=lambda run: str(run.path))


def _difference(one: Raced, other: Raced) -> _Difference | None:
    """Why two recordings are not to be compared; None where they are."""
    if one.identity.track != other.identity.track and not _same_track(one.setup.track, other.setup.track):
        text = _track_difference(one.setup.track, other.setup.track)
        return _Difference(text=text, remedy="compare one track at a time")
    if one.task != other.task:
        text = f"different tasks ({one.task} and {other.task})"
        return _Difference(text=text, remedy="compare one task at a time")
    rules = rules_of(one.setup), rules_of(other.setup)
    if rules[0] != rules[1]:
        key, first, second = _rule_difference(*rules)
        text = f"different rules, {key} is {first} and {second}"
        return _Difference(text=text, remedy=f"score both by one {_remedy(key)}")
    return None


def _title(runs: Sequence[Raced]) -> str:
    """The conditions of comparable runs: track with its length, task, rules, and whether nobody really drove."""
    run = runs[0]
    track = run.setup.track
    task = "" if run.task == USUAL_TASK else f", {printable(run.task)}"
    world = ", in simulation" if all(trial.simulated for one in runs for trial in one.trials) else ""
    rules = f"rules {printable(run.setup.rules)} {run.setup.rules_version}"
    return f"Track {printable(track.name)!r} ({track.centreline.length_m:.2f} m){task}{world}, {rules}"


def _same_track(one: Track, other: Track) -> bool:
    """Whether two tracks have the same centreline, widths and lines."""
    routes = one.centreline, other.centreline
    lines = [{line.name: (line.start_m, line.end_m) for line in track.lines} for track in (one, other)]
    return (
        routes[0].closed == routes[1].closed
        and all(
            _near(getattr(routes[0], name), getattr(routes[1], name))
            for name in ("points_m", "half_left_m", "half_right_m")
        )
        and list(lines[0]) == list(lines[1])
        and _near(list(lines[0].values()), list(lines[1].values()))
    )


def _same_calibration(one: Raced, other: Raced) -> bool:
    """Whether every camera's picture lies the same on the floor in two runs, all along the route."""
    if one.identity.calibration == other.identity.calibration:
        return True
    views, route_m = (one.setup.views, other.setup.views), one.setup.track.centreline.points_m
    return len(views[0]) == len(views[1]) and all(
        _same_map(first.ground, second.ground, route_m) for first, second in zip(*views, strict=True)
    )


def _same_map(first: GroundMap, second: GroundMap, route_m: Points) -> bool:
    if (first.width_px, first.height_px) != (second.width_px, second.height_px):
        return False
    seen = [(px, point) for point in route_m.tolist() if (px := first.point_to_camera_px(point)) is not None]
    picture_px = path_points([px for px, _ in seen])
    floor_m = path_points([point for _, point in seen])
    return bool(second.sees_ground(picture_px).all()) and _near(second.to_track_m(picture_px), floor_m)


def _near(one: ArrayLike, other: ArrayLike) -> bool:
    first, second = np.asarray(one, dtype=np.float64), np.asarray(other, dtype=np.float64)
    return first.shape == second.shape and bool(np.all(np.abs(first - second) <= _SAME_M))


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


def _remedy(key: str) -> str:
    section = key.partition(".")[0]
    return "rule set with --rules" if section in SECTIONS else f"value with --set {key}=VALUE"


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
