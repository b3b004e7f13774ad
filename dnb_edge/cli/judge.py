"""`dnb-edge judge`: a judge's decisions about the laps of a recording, which itself never changes.

Each verb adds one line to `RUN.edits.jsonl` beside the recording. Registered by `cli.main` as a sub-app.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from dnb_edge import wire
from dnb_edge.archive.case import Case, Judge, open_case
from dnb_edge.archive.replayed import edit_warning
from dnb_edge.cli.judge_case import lap_words, login_name, say_decision, say_warnings
from dnb_edge.errors import InputError
from dnb_edge.race.crossing import lap_sigma_s
from dnb_edge.race.edit import JUDGE, Action, AddedLap, LapKey
from dnb_edge.report.table import printable
from dnb_edge.values import Crossing, IncidentKind, Penalty

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
DryRun = Annotated[bool, typer.Option("--dry-run", help="Show what would be, and save nothing.")]

HAND_SIGMA_S = 0.05
"""One standard deviation of an instant that a judge gives in seconds: a frame or two of a clip that is stepped through."""

MOST_SECONDS = 86_400.0
"""A penalty of more seconds than a day has is a slip of the finger."""


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
    say_decision(run, _judge(by, because), lambda case: _added(case, start, end, car), dry_run=dry_run)


@app.command()
def remove(run: Run, *, lap: Lap, because: Because, by: By = None, car: Car = 1, dry_run: DryRun = False) -> None:
    """Take a lap away that was none; it stays listed, with the reason.

    dnb-edge judge remove RUN --lap 3 --because "the car was carried"
    """
    say_decision(
        run, _judge(by, because), lambda case: {"action": Action.REMOVE, "laps": (case.lap(lap, car),)}, dry_run=dry_run
    )


@app.command()
def merge(run: Run, *, lap: Lap, because: Because, by: By = None, car: Car = 1, dry_run: DryRun = False) -> None:
    """Make one lap of a lap and the next: the crossing between them was none."""

    def what(case: Case) -> dict[str, Any]:
        first = case.lap(lap, car)
        return {"action": Action.MERGE, "laps": (first, case.after(first))}

    say_decision(run, _judge(by, because), what, dry_run=dry_run)


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
    if not 0 <= seconds <= MOST_SECONDS:
        raise InputError(f"--seconds {seconds:g}: must lie between 0 and {MOST_SECONDS:g}")
    if not 0 <= factor <= 1:
        raise InputError(f"--factor {factor:g}: must lie between 0 and 1")
    if not (seconds or factor < 1 or invalid or dnf):
        raise InputError("a penalty must cost something: give --seconds, --factor, --invalid or --dnf")
    given = Penalty(offence=JUDGE, seconds=seconds, factor=factor, invalid=invalid, dnf=dnf, reason=because.strip())

    def what(case: Case) -> dict[str, Any]:
        return {"action": Action.PENALTY, "laps": (case.lap(lap, car),), "penalty": given}

    say_decision(run, _judge(by, because), what, dry_run=dry_run)


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

    def what(case: Case) -> dict[str, Any]:
        kind = None if offence is None else offence.value
        return {"action": Action.FORGIVE, "laps": (case.lap(lap, car),), "offence": kind}

    say_decision(run, _judge(by, because), what, dry_run=dry_run)


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

    def what(case: Case) -> dict[str, Any]:
        return {"action": Action.NOTE, "laps": () if lap is None else (case.lap(lap, car),)}

    say_decision(run, _judge(by, text), what, dry_run=dry_run)


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
    say_decision(run, _judge(by, because), lambda _: {"action": Action.UNDO, "undoes": edit}, dry_run=dry_run)


def _judge(by: str | None, reason: str) -> Judge:
    return Judge(name=login_name() if by is None else by, reason=reason)


def _added(case: Case, start: str, end: str, car: int) -> dict[str, Any]:
    """The fields of an edit that adds a lap. Raises `InputError` where its ends are no instants of this car's run."""
    first, last = _instant(case, "--from", start, car), _instant(case, "--to", end, car)
    ends_ns = [one.t_ns if isinstance(one, Crossing) else _stamp(case, one) for one in (first, last)]
    if not ends_ns[0] < ends_ns[1]:
        raise InputError(f"--to {end}: must be later than --from {start}")
    if isinstance(first, Crossing) and isinstance(last, Crossing):
        sigma_s = lap_sigma_s(first, last)
    else:
        sigma_s = math.hypot(*(one.sigma_s if isinstance(one, Crossing) else HAND_SIGMA_S for one in (first, last)))
    laps = [*(one.lap for one in (*case.now.laps, *case.now.removed)), *case.raced.raw_laps]
    highest = max((lap.number for lap in laps if lap.car == car), default=0)
    earlier = [edit.added.key.number for edit in case.log.edits if edit.added is not None and edit.added.key.car == car]
    key = LapKey(car=car, number=max([highest, *earlier]) + 1, start_t_ns=ends_ns[0], end_t_ns=ends_ns[1])
    start_s = first.t_s if isinstance(first, Crossing) else first
    return {"action": Action.ADD, "added": AddedLap(key=key, start_s=start_s, sigma_s=sigma_s)}


def _instant(case: Case, option: str, text: str, car: int) -> Crossing | float:
    """The pass that is meant, or seconds from the first frame."""
    kind, colon, number = text.partition(":")
    if kind == "pass" and colon:
        if not (number.isdecimal() and 1 <= int(number) <= len(case.passes)):
            raise InputError(
                f"{option} {text}: there are passes 1 to {len(case.passes)}: see `dnb-edge judge list --passes`"
            )
        one = case.passes[int(number) - 1]
        if one.car != car:
            raise InputError(f"{option} {text}: that pass is car {one.car}'s: say --car {one.car}, or choose another")
        return one
    try:
        t_s = float(text)
    except ValueError:
        t_s = math.nan
    frames = case.raced.facts.frames_t_ns
    longest_s = (frames[-1] - frames[0]) * 1e-9 if frames else 0.0
    if not 0 <= t_s <= longest_s:
        raise InputError(f"{option} {text}: must be seconds from the first frame, 0 to {longest_s:.3f}, or pass:N")
    return t_s


def _stamp(case: Case, t_s: float) -> int:
    return case.raced.facts.frames_t_ns[0] + round(t_s * 1e9)


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
