"""`dnb-edge score` and `report`: what finished recordings say, computed again from their detections."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from dnb_edge.cli.replayed import replay
from dnb_edge.daemon.sinks import JsonSink
from dnb_edge.display.picture import lap_line
from dnb_edge.errors import InputError
from dnb_edge.record.durable import PART_SUFFIX
from dnb_edge.values import Lap, RunSummary

Runs = Annotated[list[Path], typer.Argument(help="Recordings (.mcap), or directories of them.", metavar="RUN...")]


def score(
    runs: Runs,
    *,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON object a line, as `run --json` prints them.")
    ] = False,
    observations: Annotated[
        bool, typer.Option("--observations", help="With --json: one line a frame as well.")
    ] = False,
) -> None:
    """Compute laps and scores of recordings again, from the recorded detections: the same numbers as the live run."""
    console = Console(markup=False)
    for path in recordings(runs):
        replayed = replay(path)
        sink = JsonSink(sys.stdout, observations=observations)
        if not as_json:
            console.print(f"{path}  ({replayed.header.name})", highlight=False, soft_wrap=True)
        for event in replayed.events:
            if as_json:
                sink.event(event)
            elif isinstance(event, Lap):
                console.print(f"  {lap_line(event)}", highlight=False, soft_wrap=True)
            elif isinstance(event, RunSummary):
                console.print(f"  {event.laps} laps in {event.frames} frames", highlight=False)
        for warning in replayed.warnings:
            Console(stderr=True, markup=False).print(f"  {warning}", highlight=False, soft_wrap=True)


def report(
    run: Annotated[Path, typer.Argument(help="A recording (.mcap).")],
    out: Annotated[Path | None, typer.Option(help="Directory for the report. Default: beside the recording.")] = None,
) -> None:
    """Write a report with pictures of one run: one HTML file that needs nothing else."""
    typer.echo(f"Report: {make_report(run, out)}")


def make_report(run: Path, out: Path | None) -> Path:
    """Writes the report of the recording `run` into `out`, by default beside it; returns the report's path."""
    from dnb_edge.report.html import write_report  # noqa: PLC0415 Matplotlib is slow to import

    return write_report(replay(run).result(), out if out is not None else run.parent, file_name=f"{run.stem}.html")


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
