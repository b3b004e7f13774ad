"""A judge's view of a recording: its laps and passes as they stand, and one more decision about them.

Knows runs and edits; knows nothing of who asks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from dnb_edge.archive.overlay import Overlaid
from dnb_edge.archive.replayed import Replayed, replay
from dnb_edge.errors import InputError
from dnb_edge.race.edit import Edit, LapKey
from dnb_edge.race.marshal import Marshalled, added_to, apply
from dnb_edge.record.edits import EditLog, append_edit, locked, read_edits
from dnb_edge.report.table import printable
from dnb_edge.values import Crossing


@dataclass(frozen=True, slots=True, kw_only=True)
class Judge:
    """Who decides, and why."""

    name: str
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A run as the judge finds it."""

    raced: Replayed
    """As the race said it, without edits."""
    log: EditLog
    now: Marshalled
    """The laps after the edits so far."""

    @property
    def passes(self) -> tuple[Crossing, ...]:
        """Every crossing of a line, in the order of time; a judge counts them from 1."""
        return passes_of(self.raced)

    def lap(self, number: int, car: int) -> LapKey:
        """The key of the lap that bears this number now. Raises `InputError` where there is none, or it is removed."""
        found = next((one.lap for one in self.now.laps if (one.lap.number, one.lap.car) == (number, car)), None)
        if found is not None:
            return LapKey.of(found)
        for gone in self.now.removed:
            if (gone.lap.number, gone.lap.car) == (number, car):
                edit = gone.edits[-1]
                raise InputError(f"lap {number} is removed already, by edit {edit.number} of {printable(edit.author)}: undo "
                                 "that to have it back")  # fmt: skip
        numbers = [one.lap.number for one in self.now.laps if one.lap.car == car]
        there = f"car {car} has laps {', '.join(map(str, numbers))}" if numbers else f"car {car} has no laps"
        raise InputError(f"{self.raced.path}: there is no lap {number}: {there}")

    def after(self, key: LapKey) -> LapKey:
        """The key of the car's next lap. Raises `InputError` where there is none."""
        later = [one.lap for one in self.now.laps if one.lap.car == key.car and one.lap.start_t_ns >= key.end_t_ns]
        if not later:
            raise InputError(f"{self.raced.path}: there is no lap after lap {key.number} to merge it with")
        return LapKey.of(later[0])


def passes_of(raced: Replayed) -> tuple[Crossing, ...]:
    """Every crossing of a line, in the order of time."""
    crossings = [event for event in raced.events if isinstance(event, Crossing)]
    return tuple(sorted(crossings, key=lambda one: (one.t_ns, one.car)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """What one edit does to a run's results."""

    case: Case
    """As it was."""
    edit: Edit
    before: Overlaid
    after: Overlaid


def open_case(run: Path, *, raced: Replayed | None = None) -> Case:
    """The run and the edits so far, to look at. Raises `InputError` where one of them cannot be read.

    `raced`: the run as `replay` gives it without edits, where it is there already.
    """
    if raced is None:
        raced = replay(run, edits=False)
    return _case(raced, read_edits(run, raced.run))


def decide(
    run: Path,
    judge: Judge,
    what: Callable[[Case], dict[str, Any]],
    *,
    dry_run: bool = False,
    raced: Replayed | None = None,
) -> Decision:
    """Makes the edit that `what` describes (the fields of an `Edit` but for number, time, author and reason), and saves it
    unless `dry_run`. `raced` as for `open_case`.

    Raises `InputError` where it makes no sense for this run as it stands, and `WorkError` where it cannot be saved.
    """
    if not judge.name.strip():
        raise InputError("--by: is blank: say who decides")
    if not judge.reason.strip():
        raise InputError("--because: is blank: say why, for those who read the results")
    if raced is None:
        raced = replay(run, edits=False)
    with locked(run):
        case = _case(raced, read_edits(run, raced.run))
        edit = Edit(
            number=case.log.next_number,
            time=datetime.now(UTC).isoformat(timespec="seconds").replace("+00:00", "Z"),
            author=judge.name.strip(),
            reason=judge.reason.strip(),
            **what(case),
        )
        added_to(raced.raw_laps, case.log.edits, edit, case.passes)
        before, after = raced.overlaid(case.log.edits), raced.overlaid((*case.log.edits, edit))
        if not dry_run:
            append_edit(case.log, edit, raced.run)
    return Decision(case=case, edit=edit, before=before, after=after)


def _case(raced: Replayed, log: EditLog) -> Case:
    return Case(raced=raced, log=log, now=apply(raced.raw_laps, log.edits, passes_of(raced)))
