"""`dnb-edge report`, and which recordings a command line means."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dnb_edge.archive.reported import reported
from dnb_edge.archive.rescore import Wanted
from dnb_edge.cli.replay_options import WithEdits
from dnb_edge.errors import InputError
from dnb_edge.record.chain import continued
from dnb_edge.record.durable import PART_SUFFIX

Runs = Annotated[list[Path], typer.Argument(help="Recordings (.mcap), or directories of them.", metavar="RUN...")]


OtherRules = Annotated[
    str | None,
    typer.Option("--rules", help="Another rule set: a name (`dnb-edge config rules`) or a file.", metavar="NAME|FILE"),
]
"""This and the next three: what of a recording's setup can be changed after the fact; see `cli.rescore`."""
OtherLines = Annotated[
    list[str] | None,
    typer.Option(
        "--line",
        help="Another line: start, finish or any sector's name, then its ends on the twin (px), a place on the route "
        "(NAME=AT:u,v) or none. Or a file of lines. May be given several times.",
        metavar="NAME=u,v:u,v",
    ),
]
OtherTrack = Annotated[
    Path | None, typer.Option("--track", help="Another track file of the same twin.", metavar="FILE")
]
OtherValues = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="Another value for one key, such as race.min_lap_s=3. May be given several times.",
        metavar="KEY=VALUE",
    ),
]


def report(
    run: Annotated[Path, typer.Argument(help="A recording (.mcap).")],
    *,
    out: Annotated[Path | None, typer.Option(help="Directory for the report. Default: beside the recording.")] = None,
    rules: OtherRules = None,
    lines: OtherLines = None,
    track: OtherTrack = None,
    overrides: OtherValues = None,
    edits: WithEdits = True,
) -> None:
    """Write a report with pictures of one run: one HTML file that needs nothing else.

    With --line, --set, --rules or --track, of what these would have given, as in `score`; the recording never changes.
    """
    wanted = Wanted(rules=rules, track=track, lines=tuple(lines or ()), overrides=tuple(overrides or ()))
    typer.echo(f"Report: {make_report(run, out, edits=edits, wanted=wanted)}")


def make_report(run: Path, out: Path | None, *, edits: bool = True, wanted: Wanted | None = None) -> Path:
    """Writes the report of the recording `run` into `out`, by default beside it; returns the report's path.

    With a judge's edits unless they are not wanted, and under the setup that `wanted` makes of the recorded one.
    """
    from dnb_edge.report.html import write_report  # noqa: PLC0415 Matplotlib is slow to import

    result = reported(run, edits=edits, wanted=wanted).result
    return write_report(result, out if out is not None else run.parent, file_name=f"{run.stem}.html")


def recordings(runs: list[Path]) -> list[Path]:
    """The recordings that `runs` names, those in directories sorted by name. Raises `InputError` where there are none.

    Of a run in a directory that was cut short and gone on with only the last file, which is read with those before it.
    """
    files: list[Path] = []
    for run in runs:
        if not run.is_dir():
            files.append(run)
            continue
        found = sorted(run.glob("*.mcap"))
        if not found:
            parts = len(list(run.glob(f"*{PART_SUFFIX}")))
            hint = f"; {parts} unfinished ones: run `dnb-edge runs recover {run}`" if parts else ""
            raise InputError(f"{run}: no recordings (.mcap) in this directory{hint}")
        gone_on = continued(found)
        files += [path for path in found if path not in gone_on]
    return files
