"""`dnb-edge judge`: a judge's decisions about the laps of a recording, which itself never changes.

Each verb adds one line to `RUN.edits.jsonl` beside the recording. Registered by `cli.main` as a sub-app.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from dnb_edge import wire
from dnb_edge.archive.case import Case, Judge, open_case
from dnb_edge.archive.decisions import (
    adding,
    forgiving,
    judges_penalty,
    merging,
    noting,
    penalising,
    removing,
    undoing,
)
from dnb_edge.archive.replayed import edit_warning
from dnb_edge.cli.judge_case import lap_words, login_name, say_decision, say_warnings
from dnb_edge.report.table import printable
from dnb_edge.values import IncidentKind

app = typer.Typer(
    help="A judge's decisions: add, remove and merge laps, give and forgive penalties, take notes. The recording never "
    "changes: decisions are kept beside it with author, time and reason, and any of them can be undone.",
    no_args_is_help=True,
)

Run = Annotated[Path, typer.Argument(help="The recording (.mcap).", metavar="RUN")]
Lap = Annotated[int, typer.Option("--lap", help="Number of the lap, as `judge list` shows it.")]
Car = Annotated[int, typer.Option("--car", min=1, help="Number of the car, in races of several.")]
By = Annotated[str | None, typer.Option("--by", help="Who decides. Default: your login name.", metavar="NAME")]
Because = Annotated[str, typer.Option("--because", help="Why, for those who read the results.", metavar="TEXT")]
DASHES = "--"
"""Before the names of options in complaints."""

DryRun = Annotated[bool, typer.Option("--dry-run", help="Show what would be, and save nothing.")]


@app.command("list")
def list_edits(
    run: Run,
    *,
    passes: Annotated[bool, typer.Option("--passes", help="Also every pass of a line, with its number.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object a line: laps, edits, passes.")] = False,
) -> None:
    """Show the laps of RUN as they count now, and all decisions so far."""
    case = open_case(run)
    say_warnings([*case.log.warnings, *(edit_warning(one) for one in (*case.now.without_effect, *case.now.moved))])
    if as_json:
        for line in _json_lines(case, passes=passes):
            typer.echo(json.dumps(line))
        return
    console = Console(markup=False)
    console.print(_laps(case))
    if case.log.edits:
        console.print(_edits(case))
    else:
        console.print("no edits", highlight=False)
    if passes:
        console.print(_passes(case))


@app.command()
def add(
    run: Run,
    *,
    start: Annotated[
        str, typer.Option("--from", help="Its start: seconds from the first frame, or pass:N of `judge list --passes`.")
    ],
    end: Annotated[str, typer.Option("--to", help="Its end, likewise.")],
    because: Because,
    by: By = None,
    car: Car = 1,
    dry_run: DryRun = False,
) -> None:
    """Add a lap that the race missed.

    Its similarity is computed from what was seen of the car in that time.
    """
    say_decision(run, _judge(by, because), adding(start, end, car, dashes=DASHES), dry_run=dry_run)


@app.command()
def remove(run: Run, *, lap: Lap, because: Because, by: By = None, car: Car = 1, dry_run: DryRun = False) -> None:
    """Take a lap away that was none; it stays listed, with the reason.

    dnb-edge judge remove RUN --lap 3 --because "the car was carried"
    """
    say_decision(run, _judge(by, because), removing(lap, car), dry_run=dry_run)


@app.command()
def merge(run: Run, *, lap: Lap, because: Because, by: By = None, car: Car = 1, dry_run: DryRun = False) -> None:
    """Make one lap of a lap and the next: the crossing between them was none."""
    say_decision(run, _judge(by, because), merging(lap, car), dry_run=dry_run)


@app.command()
def penalty(
    run: Run,
    *,
    lap: Lap,
    because: Because,
    seconds: Annotated[float, typer.Option(help="Added to the lap's time.")] = 0.0,
    factor: Annotated[float, typer.Option(help="By which the score is multiplied, 0..1.")] = 1.0,
    invalid: Annotated[bool, typer.Option("--invalid", help="The lap does not count.")] = False,
    dnf: Annotated[
        bool, typer.Option("--dnf", help="The car's race ends with this lap: later ones do not count.")
    ] = False,
    by: By = None,
    car: Car = 1,
    dry_run: DryRun = False,
) -> None:
    """Give a lap a penalty: seconds, a factor on its score, that it does not count, or the end of the car's race.

    dnb-edge judge penalty RUN --lap 3 --seconds 5 --because "touched car 2"
    """
    given = judges_penalty(seconds=seconds, factor=factor, invalid=invalid, dnf=dnf, reason=because, dashes=DASHES)
    say_decision(run, _judge(by, because), penalising(lap, car, given), dry_run=dry_run)


@app.command()
def forgive(
    run: Run,
    *,
    lap: Lap,
    because: Because,
    offence: Annotated[
        IncidentKind | None, typer.Option(help="Only what the rules gave for this. Default: all of it.")
    ] = None,
    by: By = None,
    car: Car = 1,
    dry_run: DryRun = False,
) -> None:
    """Take away what the rules gave a lap: its penalties, and that it does not count.

    A judge's own penalties are taken back with `undo`.
    """
    say_decision(run, _judge(by, because), forgiving(lap, car, offence), dry_run=dry_run)


@app.command()
def note(
    run: Run,
    *,
    text: Annotated[str, typer.Option("--text", help="The note.", metavar="TEXT")],
    lap: Annotated[int | None, typer.Option(help="The lap that it is about. Default: the whole run.")] = None,
    by: By = None,
    car: Car = 1,
    dry_run: DryRun = False,
) -> None:
    """Write a note beside a lap, or beside the run."""
    say_decision(run, _judge(by, text), noting(lap, car), dry_run=dry_run)


@app.command()
def undo(
    run: Run,
    *,
    edit: Annotated[int, typer.Option("--edit", help="Number of the decision, as `judge list` shows it.")],
    because: Because,
    by: By = None,
    dry_run: DryRun = False,
) -> None:
    """Take a decision back. It stays listed; an undo can be undone, too."""
    say_decision(run, _judge(by, because), undoing(edit), dry_run=dry_run)


def _judge(by: str | None, reason: str) -> Judge:
    return Judge(name=login_name() if by is None else by, reason=reason)


def _laps(case: Case) -> Table:
    table = Table(box=None)
    for heading in ("lap", "car", "start", "time", "decided"):
        table.add_column(heading, overflow="fold")
    for one in case.now.laps:
        table.add_row(
            *_lap_cells(one.lap.number, one.lap.car, one.lap.start_s), lap_words(one.lap), _numbers(one.edits)
        )
    for one in case.now.removed:
        cells = _lap_cells(one.lap.number, one.lap.car, one.lap.start_s)
        table.add_row(*cells, f"removed ({lap_words(one.lap)})", _numbers(one.edits))
    return table


def _lap_cells(number: int, car: int, start_s: float) -> tuple[str, str, str]:
    return str(number), str(car), f"{start_s:.3f} s"


def _numbers(edits: Any) -> str:
    return f"edit {', '.join(str(edit.number) for edit in edits)}" if edits else ""


def _edits(case: Case) -> Table:
    states = {edit.number: "undone" for edit in case.now.undone}
    states |= {told.edit.number: "without effect" for told in case.now.without_effect}
    table = Table(box=None)
    for heading in ("edit", "time", "by", "what", "because", ""):
        table.add_column(heading, overflow="fold")
    for edit in case.log.edits:
        cells = (f"{edit.action.value} {edit.subject}", printable(edit.reason), states.get(edit.number, ""))
        table.add_row(str(edit.number), printable(edit.time), printable(edit.author), *cells)
    return table


def _passes(case: Case) -> Table:
    table = Table(box=None)
    for heading in ("pass", "car", "at", "line", "direction", "what"):
        table.add_column(heading, overflow="fold")
    for number, one in enumerate(case.passes, start=1):
        what = one.reason or (one.status.value if one.status is not None else "")
        cells = (str(one.car), f"{one.t_s:.4f} s", one.line, one.direction.value, what)
        table.add_row(str(number), *cells)
    return table


def _json_lines(case: Case, *, passes: bool) -> list[dict[str, Any]]:
    lines: list[dict[str, Any]] = []
    for counts, laps in ((True, case.now.laps), (False, case.now.removed)):
        for one in laps:
            numbers = [edit.number for edit in one.edits]
            lines.append({"event": "lap" if counts else "removed", **wire.to_dict(one.lap), "edited_by": numbers})
    undone = {edit.number for edit in case.now.undone}
    idle = {told.edit.number: told.text for told in case.now.without_effect}
    lines += [
        {
            "event": "edit",
            **wire.to_dict(edit),
            "undone": edit.number in undone,
            "without_effect": idle.get(edit.number),
        }
        for edit in case.log.edits
    ]
    if passes:
        lines += [{"event": "crossing", "pass": n, **wire.to_dict(one)} for n, one in enumerate(case.passes, start=1)]
    return lines
