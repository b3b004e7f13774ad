"""One decision of a judge, from the recording to the file of edits: checked, shown before and after, saved.

Knows recordings, edits and the terminal; which edit it is to be, `cli.judge` says.
"""

from __future__ import annotations

import getpass
from collections.abc import Callable, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from dnb_edge.archive.case import Case, Judge, decide
from dnb_edge.cli.standing_words import last_standings, standing_words
from dnb_edge.display.picture import seconds
from dnb_edge.errors import InputError
from dnb_edge.race.marshal import Marshalled, MarshalledLap
from dnb_edge.record.edits import edits_path
from dnb_edge.report.table import printable
from dnb_edge.values import Event, Lap


def login_name() -> str:
    """Who is logged in. Raises `InputError` where the system does not say."""
    try:
        return getpass.getuser()
    except (OSError, KeyError) as error:
        raise InputError("nobody knows who you are: say it with --by NAME") from error


def say_decision(run: Path, judge: Judge, what: Callable[[Case], dict[str, Any]], *, dry_run: bool) -> None:
    """Makes the edit that `what` describes, and prints what it does. Raises as `decide` does."""
    decision = decide(run, judge, what, dry_run=dry_run)
    say_warnings(decision.case.log.warnings)
    console = Console(markup=False)
    console.print(before_and_after(decision.before.marshalled, decision.after.marshalled))
    if len(decision.case.raced.facts.results) > 1:
        console.print(standings_before_and_after(decision.before.events, decision.after.events))
    done = "would be" if dry_run else "is"
    edit = decision.edit
    text = f"edit {edit.number} ({edit.action.value} {edit.subject}) {done} in {edits_path(run)}"
    console.print(text, highlight=False, soft_wrap=True)


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
