"""`dnb-edge table`: the paper's Table I for any set of recordings, compared under identical conditions or not at all."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import track

from dnb_edge.archive.comparable import check_comparable
from dnb_edge.archive.replayed import replay
from dnb_edge.archive.rescore import Wanted
from dnb_edge.archive.trials import Raced, raced
from dnb_edge.cli.replay_options import WithEdits
from dnb_edge.cli.results import Runs, recordings
from dnb_edge.record.chain import continued
from dnb_edge.report.table import RowsBy, result_table
from dnb_edge.report.table_files import as_csv, as_json_lines
from dnb_edge.report.table_latex import as_latex
from dnb_edge.report.table_text import as_text


class TableFormat(StrEnum):
    """How a table is printed."""

    TEXT = "text"
    CSV = "csv"
    JSON = "json"
    LATEX = "latex"


_WRITERS = {
    TableFormat.TEXT: as_text,
    TableFormat.CSV: as_csv,
    TableFormat.JSON: as_json_lines,
    TableFormat.LATEX: as_latex,
}


def table(
    runs: Runs,
    *,
    form: Annotated[TableFormat, typer.Option("--format", help="How to print it.")] = TableFormat.TEXT,
    as_json: Annotated[bool, typer.Option("--json", help="Short for --format json.")] = False,
    by: Annotated[RowsBy, typer.Option(help="One row for each entry, or for each run.")] = RowsBy.ENTRY,
    rules: Annotated[
        str | None,
        typer.Option(
            help="One rule set for all of them: a name (`dnb-edge config rules`) or a file.", metavar="NAME|FILE"
        ),
    ] = None,
    overrides: Annotated[
        list[str] | None,
        typer.Option("--set", help="One value of a key for all, such as race.min_lap_s=3. May be given several times."),
    ] = None,
    edits: WithEdits = True,
) -> None:
    """Print the paper's Table I for any set of runs: entry, path similarity, completion time, and who is alike.

    Runs on other tracks, in another direction or under other rules are refused; --rules or --set scores all by the same ones.
    Where an entry has several runs, each run counts alike. See docs/trials.md for what the intervals mean.
    """
    found = _raced(runs, Wanted(rules=rules, overrides=tuple(overrides or ())), edits=edits)
    console = Console(stderr=True, markup=False)
    told = (f"{run.path}: {warning}" for run in found for warning in run.warnings)
    for warning in (*check_comparable(found), *told):
        console.print(f"dnb-edge: {warning}", highlight=False, soft_wrap=True)
    made = result_table((trial for run in found for trial in run.trials), by)
    typer.echo(_WRITERS[TableFormat.JSON if as_json else form](made).rstrip("\n"))


def _raced(runs: list[Path], wanted: Wanted, *, edits: bool) -> list[Raced]:
    """Each recording once, however often it is named; one that is gone on with in another of them is read with that."""
    named = {path.resolve(): path for path in recordings(runs)}
    gone_on = continued(named)
    files = [path for real, path in named.items() if real not in gone_on]
    console = Console(stderr=True)
    shown = track(files, "Scoring", console=console, transient=True, disable=len(files) < 2 or not console.is_terminal)
    return [raced(replay(path, edits=edits, changed=wanted.change(path))) for path in shown]
