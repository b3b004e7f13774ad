"""One decision of a judge, from the recording to the file of edits: checked, shown before and after, saved.

Knows recordings, edits and the terminal; which edit it is to be, `cli.judge` says.
"""

from __future__ import annotations

import getpass
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import zip_longest
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from dnb_edge.cli.replayed import Replayed, replay
from dnb_edge.cli.standing_words import last_standings, standing_words
from dnb_edge.display.picture import seconds
from dnb_edge.errors import InputError
from dnb_edge.race.edit import Edit, LapKey
from dnb_edge.race.marshal import Marshalled, MarshalledLap, added_to, apply
from dnb_edge.record.edits import EditLog, append_edit, edits_path, locked, read_edits
from dnb_edge.report.table import printable
from dnb_edge.values import Crossing, Event, Lap


@dataclass(frozen=True, slots=True, kw_only=True)
class Judge:
    """Who decides, and why."""

    name: str
    reason: str
    dry_run: bool = False
    """True to show what would be, and save nothing."""


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


def login_name() -> str:
    """Who is logged in. Raises `InputError` where the system does not say."""
    try:
        return getpass.getuser()
    except (OSError, KeyError) as error:
        raise InputError("nobody knows who you are: say it with --by NAME") from error


def open_case(run: Path) -> Case:
    """The run and the edits so far, to look at. Raises `InputError` where one of them cannot be read."""
    raced = replay(run, edits=False)
    return _case(raced, read_edits(run, raced.run))


def decide(run: Path, judge: Judge, what: Callable[[Case], dict[str, Any]]) -> None:
    """Makes the edit that `what` describes (the fields of an `Edit` but for number, time, author and reason), and saves it.

    Raises `InputError` where it makes no sense for this run as it stands, and `WorkError` where it cannot be saved.
    """
    if not judge.name.strip():
        raise InputError("--by: is blank: say who decides")
    if not judge.reason.strip():
        raise InputError("--because: is blank: say why, for those who read the results")
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
        if not judge.dry_run:
            append_edit(case.log, edit, raced.run)
    say_warnings(case.log.warnings)
    console = Console(markup=False)
    console.print(before_and_after(before.marshalled, after.marshalled))
    if len(raced.facts.results) > 1:
        console.print(standings_before_and_after(before.events, after.events))
    done = "would be" if judge.dry_run else "is"
    text = f"edit {edit.number} ({edit.action.value} {edit.subject}) {done} in {edits_path(run)}"
    console.print(text, highlight=False, soft_wrap=True)


def _case(raced: Replayed, log: EditLog) -> Case:
    return Case(raced=raced, log=log, now=apply(raced.raw_laps, log.edits, passes_of(raced)))


def say_warnings(warnings: Sequence[str]) -> None:
    """One line each on stderr."""
    console = Console(stderr=True, markup=False)
    for warning in warnings:
        console.print(f"dnb-edge: {warning}", highlight=False, soft_wrap=True)


def before_and_after(before: Marshalled, after: Marshalled) -> Table:
    """The laps that one edit changes, and what counts in all."""
    was, will = _by_lap(before), _by_lap(after)
    cars = len({car for car, _ in (*was, *will)})
    table = Table(box=None)
    for heading in ("lap", "before", "after"):
        table.add_column(heading, overflow="fold")
    changed = [key for key in dict.fromkeys((*was, *will)) if was.get(key) != will.get(key)]
    for car, number in sorted(changed):
        name = str(number) if cars == 1 else f"{number} of car {car}"
        table.add_row(name, _words(was.get((car, number))), _words(will.get((car, number))))
    same = len({*was, *will}) - len(changed)
    if same:
        table.add_row("", f"{same} {'other ' if changed else ''}lap{'' if same == 1 else 's'}", "as before")
    table.add_row("all", _sum(before), _sum(after))
    return table


def standings_before_and_after(before: Sequence[Event], after: Sequence[Event]) -> Table:
    """The last standings of both, a line a place."""
    table = Table(box=None)
    for heading in ("place", "before", "after"):
        table.add_column(heading, overflow="fold")
    for k, (was, will) in enumerate(
        zip_longest(_standing_words(before), _standing_words(after), fillvalue="-"), start=1
    ):
        table.add_row(str(k), was, will)
    return table


def _standing_words(events: Sequence[Event]) -> list[str]:
    last = last_standings(events)
    return [] if last is None else [standing_words(row, last.unit) for row in last.rows]


def lap_words(lap: Lap) -> str:
    """A lap in a few words: its time, what penalties add, whether it counts."""
    words = [seconds(lap.time_s, lap.sigma_s)]
    if lap.penalty_s and lap.official_time_s is not None:
        words.append(f"+ {lap.penalty_s:g} s = {lap.official_time_s:.3f} s")
    if lap.penalty_factor != 1:
        words.append(f"score x {lap.penalty_factor:g}")
    if any(penalty.dnf for penalty in lap.penalties):
        words.append("DNF")
    if not lap.valid:
        words.append("NOT VALID: " + printable("; ".join(lap.reasons)))
    return ", ".join(words)


def _by_lap(marshalled: Marshalled) -> dict[tuple[int, int], tuple[Lap, bool, int]]:
    """(lap, whether it counts, its number of edits) by car and number."""

    def entry(one: MarshalledLap, *, counts: bool) -> tuple[Lap, bool, int]:
        return one.lap, counts, len(one.edits)

    gone = {(one.lap.car, one.lap.number): entry(one, counts=False) for one in marshalled.removed}
    return gone | {(one.lap.car, one.lap.number): entry(one, counts=True) for one in marshalled.laps}


def _words(entry: tuple[Lap, bool, int] | None) -> str:
    if entry is None:
        return "-"
    lap, counts, _ = entry
    return lap_words(lap) if counts else f"removed ({lap_words(lap)})"


def _sum(marshalled: Marshalled) -> str:
    valid = [lap for lap in marshalled.kept if lap.valid]
    best = min((lap.official_time_s or lap.time_s for lap in valid), default=None)
    text = f"{len(marshalled.kept)} laps, {len(valid)} valid"
    return text if best is None else f"{text}, best {best:.3f} s"
