"""What a judge wishes, turned into the edit that it means for a run as it stands: one function for each action.

Each gives what `case.decide` takes, which is asked while no other judge can decide. Knows runs and edits; knows neither the
command line nor the pages, which say its names in their own way.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeAlias

from dnb_edge.archive.case import Case
from dnb_edge.errors import InputError
from dnb_edge.race.crossing import lap_sigma_s
from dnb_edge.race.edit import JUDGE, Action, AddedLap, LapKey
from dnb_edge.values import Crossing, IncidentKind, Penalty

HAND_SIGMA_S = 0.05
"""One standard deviation of an instant that a judge gives in seconds: a frame or two of a clip that is stepped through."""

MOST_SECONDS = 86_400.0
"""A penalty of more seconds than a day has is a slip of the finger."""

MOST_DIGITS = 9
"""Of the number of a pass."""

What: TypeAlias = Callable[[Case], dict[str, Any]]
"""The fields of an `Edit` but for number, time, author and reason. Raises `InputError` where they make no sense."""


def adding(start: str, end: str, car: int, *, dashes: str = "") -> What:
    """A lap that the race missed, from `start` to `end`: seconds from the first frame, or `pass:N` with N from 1.

    `dashes` stand before the names of the two in complaints.
    """

    def what(case: Case) -> dict[str, Any]:
        first = _instant(case, f"{dashes}from", start, car)
        last = _instant(case, f"{dashes}to", end, car)
        ends_ns = [one.t_ns if isinstance(one, Crossing) else _stamp(case, one) for one in (first, last)]
        if not ends_ns[0] < ends_ns[1]:
            raise InputError(f"{dashes}to {end}: must be later than {dashes}from {start}")
        if isinstance(first, Crossing) and isinstance(last, Crossing):
            sigma_s = lap_sigma_s(first, last)
        else:
            sigma_s = math.hypot(*(one.sigma_s if isinstance(one, Crossing) else HAND_SIGMA_S for one in (first, last)))
        key = LapKey(car=car, number=_free_number(case, car), start_t_ns=ends_ns[0], end_t_ns=ends_ns[1])
        start_s = first.t_s if isinstance(first, Crossing) else first
        return {"action": Action.ADD, "added": AddedLap(key=key, start_s=start_s, sigma_s=sigma_s)}

    return what


def removing(lap: int, car: int) -> What:
    """Lap `lap` of car `car` was none."""
    return lambda case: {"action": Action.REMOVE, "laps": (case.lap(lap, car),)}


def merging(lap: int, car: int) -> What:
    """The lap and the next were one."""

    def what(case: Case) -> dict[str, Any]:
        first = case.lap(lap, car)
        return {"action": Action.MERGE, "laps": (first, case.after(first))}

    return what


def penalising(lap: int, car: int, penalty: Penalty) -> What:
    """The lap gets `penalty`, as `judges_penalty` makes it."""
    return lambda case: {"action": Action.PENALTY, "laps": (case.lap(lap, car),), "penalty": penalty}


def judges_penalty(
    *, seconds: float, factor: float, invalid: bool, dnf: bool, reason: str, dashes: str = ""
) -> Penalty:
    """A judge's penalty. Raises `InputError` where it costs nothing or more than there is; `dashes` as for `adding`."""
    if not 0 <= seconds <= MOST_SECONDS:
        raise InputError(f"{dashes}seconds {seconds:g}: must lie between 0 and {MOST_SECONDS:g}")
    if not 0 <= factor <= 1:
        raise InputError(f"{dashes}factor {factor:g}: must lie between 0 and 1")
    if not (seconds or factor < 1 or invalid or dnf):
        raise InputError(
            f"a penalty must cost something: give {dashes}seconds, {dashes}factor, {dashes}invalid or {dashes}dnf"
        )
    return Penalty(offence=JUDGE, seconds=seconds, factor=factor, invalid=invalid, dnf=dnf, reason=reason.strip())


def forgiving(lap: int, car: int, offence: IncidentKind | None) -> What:
    """What the rules gave the lap is taken away: for `offence`, or all of it."""
    kind = None if offence is None else offence.value
    return lambda case: {"action": Action.FORGIVE, "laps": (case.lap(lap, car),), "offence": kind}


def noting(lap: int | None, car: int) -> What:
    """A note about the lap; about the whole run for None."""
    return lambda case: {"action": Action.NOTE, "laps": () if lap is None else (case.lap(lap, car),)}


def undoing(edit: int) -> What:
    """Edit number `edit` is taken back."""
    return lambda _: {"action": Action.UNDO, "undoes": edit}


def _free_number(case: Case, car: int) -> int:
    """A number that no lap of the car has, or had."""
    laps = [*(one.lap for one in (*case.now.laps, *case.now.removed)), *case.raced.raw_laps]
    highest = max((lap.number for lap in laps if lap.car == car), default=0)
    earlier = [edit.added.key.number for edit in case.log.edits if edit.added is not None and edit.added.key.car == car]
    return max([highest, *earlier]) + 1


def _instant(case: Case, name: str, text: str, car: int) -> Crossing | float:
    """The pass that is meant, or seconds from the first frame."""
    kind, colon, number = text.partition(":")
    if kind == "pass" and colon:
        if not (number.isdecimal() and len(number) <= MOST_DIGITS and 1 <= int(number) <= len(case.passes)):
            raise InputError(
                f"{name} {text}: there are passes 1 to {len(case.passes)}: see `dnb-edge judge list --passes`"
            )
        one = case.passes[int(number) - 1]
        if one.car != car:
            option = "--car" if name.startswith("-") else "car"
            raise InputError(f"{name} {text}: that pass is car {one.car}'s: say {option} {one.car}, or choose another")
        return one
    try:
        t_s = float(text)
    except ValueError:
        t_s = math.nan
    frames = case.raced.facts.frames_t_ns
    longest_s = (frames[-1] - frames[0]) * 1e-9 if frames else 0.0
    if not 0 <= t_s <= longest_s:
        raise InputError(f"{name} {text}: must be seconds from the first frame, 0 to {longest_s:.3f}, or pass:N")
    return t_s


def _stamp(case: Case, t_s: float) -> int:
    return case.raced.facts.frames_t_ns[0] + round(t_s * 1e9)
