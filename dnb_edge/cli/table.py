"""`dnb-edge table`: the paper's Table I for any set of recordings, compared under identical conditions or not at all."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import track

from dnb_edge.archive.bench_cards import cards_beside, cards_named, with_cards
from dnb_edge.archive.comparable import Group, check_comparable, grouped
from dnb_edge.archive.rescore import Wanted
from dnb_edge.archive.trials import Raced, raced_file, told_apart
from dnb_edge.cli.replay_options import WithEdits
from dnb_edge.cli.results import FigureFormat, Runs, recordings
from dnb_edge.record.chain import continued
from dnb_edge.report.table import ResultTable, RowsBy, result_table
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
    group: Annotated[
        bool,
        typer.Option("--group", help="Runs under other conditions (track, task, rules) are groups, not refused."),
    ] = False,
    bench: Annotated[
        list[Path] | None,
        typer.Option(
            help="An entry's benchmark (`dnb-edge nut bench`), or a directory of them. Default: those beside the recordings.",
            metavar="FILE|DIR",
        ),
    ] = None,
    figures: Annotated[
        Path | None,
        typer.Option(help="Write box plots, radars and ranks into this directory, each a file.", metavar="DIR"),
    ] = None,
    picture_format: Annotated[FigureFormat, typer.Option("--figure-format", help="Of these files.")] = FigureFormat.PNG,
    html: Annotated[
        Path | None,
        typer.Option("--html", help="Write tables and pictures as a page that needs nothing else.", metavar="FILE"),
    ] = None,
    edits: WithEdits = True,
) -> None:
    """Print the paper's Table I for any set of runs, real or simulated: entry, path similarity, completion time, who is alike.

    Runs on other tracks, in another direction, under other rules or with another task are refused, or with --group told in
    groups of their own; --rules or --set scores all by the same ones. Where an entry has several runs, each run counts alike.
    See docs/trials.md for what the figures mean.
    """
    found = _raced(runs, Wanted(rules=rules, overrides=tuple(overrides or ())), edits=edits)
    cards = cards_named(bench) if bench else cards_beside(run.path for run in found)
    found, warnings = with_cards(told_apart(found), cards)
    told = [*warnings, *(f"{run.path}: {warning}" for run in found for warning in run.warnings)]
    groups = grouped(found) if group else (Group(conditions="", runs=tuple(found)),)
    advice = "" if group else ", or tell them in groups with --group"
    told = [warning for one in groups for warning in check_comparable(one.runs, advice=advice)] + told
    console = Console(stderr=True, markup=False)
    for warning in told:
        console.print(f"dnb-edge: {warning}", highlight=False, soft_wrap=True)
    parts = [([trial for run in one.runs for trial in run.trials], one.conditions or None) for one in groups]
    tables = [result_table(trials, by, conditions=conditions) for trials, conditions in parts]
    if figures is not None or html is not None:
        from dnb_edge.cli.table_out import write_pictures  # noqa: PLC0415 Matplotlib is slow to import

        drawn = [(made, trials) for made, (trials, _) in zip(tables, parts, strict=True)]
        for path in write_pictures(drawn, told, figures=figures, form=picture_format.value, html=html):
            console.print(f"Written: {path}", highlight=False, soft_wrap=True)
    typer.echo(_written(tables, TableFormat.JSON if as_json else form))


def _written(tables: Sequence[ResultTable], form: TableFormat) -> str:
    """All tables as one text: rows of all groups together where a program reads it, else one table below the other."""
    if form in {TableFormat.CSV, TableFormat.JSON}:
        tables = [ResultTable(rows=tuple(row for table in tables for row in table.rows), notes=())]
    return "\n\n".join(_WRITERS[form](table).rstrip("\n") for table in tables)


def _raced(runs: list[Path], wanted: Wanted, *, edits: bool) -> list[Raced]:
    """Each recording once, however often it is named; one that is gone on with in another of them is read with that."""
    named = {path.resolve(): path for path in recordings(runs)}
    gone_on = continued(named)
    files = [path for real, path in named.items() if real not in gone_on]
    console = Console(stderr=True)
    shown = track(files, "Scoring", console=console, transient=True, disable=len(files) < 2 or not console.is_terminal)
    return [raced_file(path, edits=edits, changed=wanted.change(path)) for path in shown]
