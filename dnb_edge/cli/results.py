"""`dnb-edge report`, and which recordings a command line means."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from dnb_edge.cli.replayed import replay
from dnb_edge.errors import InputError
from dnb_edge.record.durable import PART_SUFFIX
from dnb_edge.record.reader import iter_frames
from dnb_edge.report.evidence import thumbnails

Runs = Annotated[list[Path], typer.Argument(help="Recordings (.mcap), or directories of them.", metavar="RUN...")]


def report(
    run: Annotated[Path, typer.Argument(help="A recording (.mcap).")],
    out: Annotated[Path | None, typer.Option(help="Directory for the report. Default: beside the recording.")] = None,
) -> None:
    """Write a report with pictures of one run: one HTML file that needs nothing else."""
    typer.echo(f"Report: {make_report(run, out)}")


def make_report(run: Path, out: Path | None) -> Path:
    """Writes the report of the recording `run` into `out`, by default beside it; returns the report's path."""
    from dnb_edge.report.html import write_report  # noqa: PLC0415 Matplotlib is slow to import

    result = replay(run).result()
    if result.incidents:
        result = replace(result, thumbnails=thumbnails(result.incidents, iter_frames(run)))
    return write_report(result, out if out is not None else run.parent, file_name=f"{run.stem}.html")


def recordings(runs: list[Path]) -> list[Path]:
    """The recordings that `runs` names, those in directories sorted by name. Raises `InputError` where there are none."""
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
        files += found
    return files
