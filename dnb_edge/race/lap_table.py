"""The states of one car's race, what can happen to it, and the table of which leads where.

Knows words only: `laps.py` decides which of them a crossing is.
"""

from __future__ import annotations

from enum import StrEnum

from dnb_edge.values import PassStatus


class LapState(StrEnum):
    """Where the car is in its race."""

    BEFORE_START = "before_start"
    """The start was not given yet."""
    OUT_LAP = "out_lap"
    """It races, and no lap runs."""
    LAP = "lap"
    GRACE = "grace"
    """The time is up; the running lap may be finished."""
    FINISHED = "finished"
    RETIRED = "retired"


class Passing(StrEnum):
    """What a crossing, or something from outside, means."""

    GO = "go"
    """The start was given."""
    JUMPED = "jumped"
    """The car moved before the start was given: it races from then on, and pays."""
    START = "start"
    LAP_DONE = "lap_done"
    """The line where laps begin and end: the next lap has begun."""
    ARRIVED = "arrived"
    """A finish line of its own: the lap is done, and no other has begun."""
    ANEW = "anew"
    """The start line before the finish line: the lap that was begun is given up for a new one."""
    TOO_LATE = "too_late"
    """The same after the time was up: the lap is given up, and no other begins."""
    RUN_DONE = "run_done"
    """The lap is done, and it was the last."""
    SECTOR = "sector"
    NOT_A_LAP = "not_a_lap"
    """A crossing that changes nothing."""
    TIME_UP = "time_up"
    """The time is up; a running lap may be finished."""
    CUT_OFF = "cut_off"
    """The time is up; a running lap is given up."""
    RETIRED = "retired"
    """The car was taken out of the race."""


RUNNING = (LapState.LAP, LapState.GRACE)
"""The states in which a lap runs."""

TRANSITIONS: dict[tuple[LapState, Passing], LapState] = {
    (LapState.BEFORE_START, Passing.GO): LapState.OUT_LAP,
    (LapState.BEFORE_START, Passing.JUMPED): LapState.OUT_LAP,
    (LapState.BEFORE_START, Passing.NOT_A_LAP): LapState.BEFORE_START,
    (LapState.BEFORE_START, Passing.RETIRED): LapState.RETIRED,
    (LapState.OUT_LAP, Passing.GO): LapState.OUT_LAP,
    (LapState.OUT_LAP, Passing.START): LapState.LAP,
    (LapState.OUT_LAP, Passing.NOT_A_LAP): LapState.OUT_LAP,
    (LapState.OUT_LAP, Passing.TIME_UP): LapState.FINISHED,
    (LapState.OUT_LAP, Passing.CUT_OFF): LapState.FINISHED,
    (LapState.OUT_LAP, Passing.RETIRED): LapState.RETIRED,
    (LapState.LAP, Passing.GO): LapState.LAP,
    (LapState.LAP, Passing.LAP_DONE): LapState.LAP,
    (LapState.LAP, Passing.ARRIVED): LapState.OUT_LAP,
    (LapState.LAP, Passing.ANEW): LapState.LAP,
    (LapState.LAP, Passing.RUN_DONE): LapState.FINISHED,
    (LapState.LAP, Passing.SECTOR): LapState.LAP,
    (LapState.LAP, Passing.NOT_A_LAP): LapState.LAP,
    (LapState.LAP, Passing.TIME_UP): LapState.GRACE,
    (LapState.LAP, Passing.CUT_OFF): LapState.FINISHED,
    (LapState.LAP, Passing.RETIRED): LapState.RETIRED,
    (LapState.GRACE, Passing.RUN_DONE): LapState.FINISHED,
    (LapState.GRACE, Passing.TOO_LATE): LapState.FINISHED,
    (LapState.GRACE, Passing.SECTOR): LapState.GRACE,
    (LapState.GRACE, Passing.NOT_A_LAP): LapState.GRACE,
    (LapState.GRACE, Passing.RETIRED): LapState.RETIRED,
    (LapState.FINISHED, Passing.NOT_A_LAP): LapState.FINISHED,
    (LapState.FINISHED, Passing.RETIRED): LapState.FINISHED,
    (LapState.RETIRED, Passing.GO): LapState.RETIRED,
    (LapState.RETIRED, Passing.JUMPED): LapState.RETIRED,
    (LapState.RETIRED, Passing.NOT_A_LAP): LapState.RETIRED,
    (LapState.RETIRED, Passing.RETIRED): LapState.RETIRED,
}
"""Every legal step; any other raises `KeyError`."""

STATUS = {
    Passing.START: PassStatus.START,
    Passing.ANEW: PassStatus.START,
    Passing.LAP_DONE: PassStatus.LAP,
    Passing.ARRIVED: PassStatus.ARRIVED,
    Passing.RUN_DONE: PassStatus.ARRIVED,
    Passing.SECTOR: PassStatus.SECTOR,
    Passing.NOT_A_LAP: PassStatus.IGNORED,
    Passing.TOO_LATE: PassStatus.IGNORED,
}
"""What a crossing's meaning is called in its status."""
