"""A judge's edit: what was decided about which lap, by whom, when and why.

Knows values only: no file, no clock, and nothing of how laps come about. Edits never change what was recorded; they are an
overlay that `race.marshal` lays over the laps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from dnb_edge.values import Lap, Penalty

JUDGE = "judge"
"""The offence of a penalty that a judge gave."""


class Action(StrEnum):
    """What a judge can do."""

    ADD = "add"
    """A lap that the race missed."""
    REMOVE = "remove"
    """A lap that was none."""
    MERGE = "merge"
    """Two laps that were one: the crossing between them was none."""
    PENALTY = "penalty"
    FORGIVE = "forgive"
    """Takes away what the rules themselves gave: penalties, and that the lap is not valid."""
    NOTE = "note"
    UNDO = "undo"
    """Takes back another edit, which stays in the list."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LapKey:
    """Which lap an edit is about: by its time, so that it is found again when the recording is scored under other rules."""

    car: int
    number: int
    """As it was when the edit was made; for people."""
    start_t_ns: int
    end_t_ns: int

    @classmethod
    def of(cls, lap: Lap) -> LapKey:
        """The key of `lap`."""
        return cls(car=lap.car, number=lap.number, start_t_ns=lap.start_t_ns, end_t_ns=lap.end_t_ns)

    def __post_init__(self) -> None:
        if not self.start_t_ns < self.end_t_ns:
            raise ValueError(f"lap {self.number}: its end must be later than its start")

    def likeness(self, lap: Lap) -> float:
        """0..1: the time that is in this lap and in `lap`, as a share of the time that is in either; 0 for another car's."""
        shared_ns = min(self.end_t_ns, lap.end_t_ns) - max(self.start_t_ns, lap.start_t_ns)
        if self.car != lap.car or shared_ns <= 0:
            return 0.0
        either_ns = max(self.end_t_ns, lap.end_t_ns) - min(self.start_t_ns, lap.start_t_ns)
        return shared_ns / either_ns


@dataclass(frozen=True, slots=True, kw_only=True)
class AddedLap:
    """A lap that a judge adds."""

    key: LapKey
    start_s: float
    """Its start, seconds from the first frame."""
    sigma_s: float
    """One standard deviation of its time, seconds."""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.start_s) and math.isfinite(self.sigma_s) and self.sigma_s >= 0):
            raise ValueError("an added lap needs a finite start_s and a sigma_s that is not negative")


@dataclass(frozen=True, slots=True, kw_only=True)
class Edit:
    """One decision of a judge."""

    number: int
    """From 1, in the order in which they were made."""
    time: str
    """When it was made: UTC, ISO 8601."""
    author: str
    action: Action
    reason: str
    laps: tuple[LapKey, ...] = ()
    """The laps that it is about: one; two for a merge; none for an added lap, an undo and a note about the whole run."""
    added: AddedLap | None = None
    penalty: Penalty | None = None
    offence: str | None = None
    """What is forgiven: the kind of incident; None for everything."""
    undoes: int | None = None
    """Number of the edit that is taken back."""

    def __post_init__(self) -> None:
        """Raises `ValueError` where it lacks what its action needs, or has what it does not."""
        if self.number < 1 or not self.author.strip() or not self.reason.strip():
            raise ValueError(f"edit {self.number}: needs a number from 1, an author and a reason")
        wanted = _LAPS_OF[self.action]
        if len(self.laps) not in wanted:
            raise ValueError(
                f"edit {self.number}: {self.action.value} is about {wanted[-1]} laps, not {len(self.laps)}"
            )
        for name, action in (("added", Action.ADD), ("penalty", Action.PENALTY), ("undoes", Action.UNDO)):
            if (getattr(self, name) is not None) != (self.action is action):
                raise ValueError(f"edit {self.number}: {name} belongs to {action.value}, and to nothing else")
        if self.offence is not None and self.action is not Action.FORGIVE:
            raise ValueError(f"edit {self.number}: offence belongs to forgive, and to nothing else")

    @property
    def subject(self) -> str:
        """What it is about, such as `lap 3`, `laps 3 and 4 of car 2`, `edit 7`, `the run`."""
        if self.undoes is not None:
            return f"edit {self.undoes}"
        keys = self.laps if self.added is None else (self.added.key,)
        if not keys:
            return "the run"
        car = "" if keys[0].car == 1 else f" of car {keys[0].car}"
        return f"{'laps' if len(keys) > 1 else 'lap'} {' and '.join(str(key.number) for key in keys)}{car}"


_LAPS_OF: dict[Action, tuple[int, ...]] = {
    Action.ADD: (0,),
    Action.REMOVE: (1,),
    Action.MERGE: (2,),
    Action.PENALTY: (1,),
    Action.FORGIVE: (1,),
    Action.NOTE: (0, 1),
    Action.UNDO: (0,),
}
"""How many laps an edit of each kind can be about."""


def undone(edits: Sequence[Edit]) -> frozenset[int]:
    """Numbers of the edits that were taken back. An undo can itself be undone; then the edit holds again."""
    gone: set[int] = set()
    for edit in reversed(edits):
        if edit.undoes is not None and edit.number not in gone:
            gone.add(edit.undoes)
    return frozenset(gone)
