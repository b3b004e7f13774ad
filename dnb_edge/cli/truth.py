"""`dnb-edge truth`: the accuracy certificate, from simulated races whose truth is known exactly."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Annotated, Any

import cv2
import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from dnb_edge.errors import WorkError
from dnb_edge.report.files import write_whole
from dnb_edge.report.truth import render_certificate
from dnb_edge.truth.campaign import Plan, Unit, results_folder, run_campaign, units
from dnb_edge.truth.certificate import FULL_LAPS, FULL_RENDERED_LAPS, FULL_TRIALS, certificate

CERTIFICATE_JSON = "certificate.json"
CERTIFICATE_HTML = "certificate.html"
_QUICK_LAPS, _QUICK_RENDERED_LAPS, _QUICK_TRIALS = 40, 6, 1


def truth(
    full: Annotated[
        bool,
        typer.Option(
            "--full/--quick",
            help=f"All laps of a certificate ({FULL_LAPS}, of rendered scenarios {FULL_RENDERED_LAPS}), or a first look.",
        ),
    ] = False,
    laps: Annotated[int | None, typer.Option(min=1, help="Laps of each main scenario; others get their share.")] = None,
    rendered: Annotated[
        int | None, typer.Option(min=0, help="Laps of each main rendered scenario; 0 leaves all rendered ones out.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Another seed, other drives.")] = 1,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes at work; all processors by default.")] = None,
    directory: Annotated[
        Path, typer.Option("--out", help="Directory for the certificate and each drive's results.")
    ] = Path("truth"),
    only: Annotated[
        list[str] | None, typer.Option("--only", help="Only this scenario or counted case; may be given again.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="The certificate as JSON on stdout.")] = False,
) -> None:
    """Measure how accurate the laps are: simulated races through the real rooms, against what was truly driven.

    Writes certificate.json and certificate.html. Ctrl-C loses nothing: the same command goes on. Exit code 1 where a limit is
    missed.
    """
    plan = Plan(
        seed=seed,
        laps=laps or (FULL_LAPS if full else _QUICK_LAPS),
        rendered_laps=rendered if rendered is not None else (FULL_RENDERED_LAPS if full else _QUICK_RENDERED_LAPS),
        trials=FULL_TRIALS if full else _QUICK_TRIALS,
        only=tuple(only or ()),
    )
    cv2.setNumThreads(1)
    console = Console(stderr=True, markup=False)
    try:
        results = _with_progress(plan, directory, jobs or os.cpu_count() or 1, console)
    except KeyboardInterrupt:
        console.print(f"Interrupted: what is finished stays in {directory}; the same command goes on.", soft_wrap=True)
        raise typer.Exit(130) from None
    made = certificate(plan, results)
    write_whole(directory / CERTIFICATE_HTML, render_certificate(made).encode())
    text = json.dumps(made, allow_nan=False, indent=1)
    write_whole(directory / CERTIFICATE_JSON, (text + "\n").encode())
    if as_json:
        sys.stdout.write(text + "\n")
    else:
        _say(made, directory, console)
    if not made["holds"]:
        judged = len(made["limits"]) + len(made["counts"])
        raise WorkError(f"{made['missed_limits']} of {judged} limits are missed: see {directory / CERTIFICATE_HTML}")


def _with_progress(plan: Plan, directory: Path, jobs: int, console: Console) -> dict[str, list[dict[str, Any]]]:
    total = sum(unit.work for unit in units(plan))
    results_folder(directory)
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:3.0f} %"))
    with Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=console, transient=True) as progress:
        task = progress.add_task("Driving", total=total)

        def done(unit: Unit) -> None:
            progress.update(task, advance=unit.work, description=f"{unit.name} {unit.number}")

        return run_campaign(plan, directory, jobs=jobs, done=done)


def _say(made: dict[str, Any], directory: Path, console: Console) -> None:
    """Every limit, a line each, and where the certificate lies."""
    for row in made["limits"]:
        console.print(_limit_line(row), soft_wrap=True, highlight=False)
    for count in made["counts"]:
        told = ", ".join(map(str, count["told"]))
        mark = "holds " if count["holds"] else "MISSED"
        console.print(
            f"{mark} {count['title']}: {count['expected']} laps, told {told}", soft_wrap=True, highlight=False
        )
    if not made["enough_laps"]:
        console.print("Fewer laps than a certificate needs: --full drives them all.", highlight=False)
    console.print(f"Certificate: {directory / CERTIFICATE_HTML}", soft_wrap=True, highlight=False)


def _limit_line(row: dict[str, Any]) -> str:
    mark = "holds " if row["holds"] else "MISSED"
    value = "none" if row["value"] is None else f"{row['value']:.3g}"
    least, most = row["least"], row["most"]
    bounds = " to ".join(f"{bound:g}" for bound in (least, most) if bound is not None)
    words = "between" if least is not None and most is not None else "at most" if least is None else "above"
    return f"{mark} {row['scenario']}: {row['figure']} {value} ({words} {bounds}; {row['laps']} laps)"
