"""`dnb-edge doctor`: looks at everything that a race needs and says of each fault what to type."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import cv2
import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from dnb_edge import __version__
from dnb_edge.cli.run import Override
from dnb_edge.cli.run_means import SYSTEM_CONFIG
from dnb_edge.cli.web import SYSTEM_SOCKET
from dnb_edge.doctor.box import Box, Where
from dnb_edge.doctor.check import Check
from dnb_edge.doctor.checks import CHECKS, chosen
from dnb_edge.doctor.verdict import Status, Verdict
from dnb_edge.errors import InputError

RUNS, SETUP = Where().runs, Where().setup
_STYLES = {Status.OK: "green", Status.WARN: "yellow", Status.FAIL: "bold red", Status.SKIP: "dim"}
Made = tuple[Check[Any], Verdict]


def doctor(
    config_file: Annotated[
        Path | None,
        typer.Option(
            "--config",
            "-c",
            help=f"Configuration file (YAML). Default: {SYSTEM_CONFIG}, else what was set up on the pages.",
        ),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(help="Make this check alone, or those of this group. May be given several times."),
    ] = None,
    overrides: Override = None,
    seconds: Annotated[float, typer.Option(min=0.5, max=60.0, help="For how long the camera is watched.")] = 2.0,
    speed: Annotated[
        float, typer.Option(min=0.01, max=50.0, help="The cars', m/s: for the blur of the exposure.")
    ] = 2.0,
    live: Annotated[Path, typer.Option("--socket", help="The live socket of dnb-edge run.")] = SYSTEM_SOCKET,
    runs: Annotated[Path, typer.Option(help="Directory with the service's recordings.")] = RUNS,
    setup: Annotated[Path, typer.Option(help="Directory that the set-up pages write.")] = SETUP,
    list_checks: Annotated[bool, typer.Option("--list", help="List the checks and what each looks at.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Look at camera, picture, detector, disk, machine, display and services, and say of each fault what to type.

    Works beside a running service, whose camera it leaves alone. Exit code 0 where nothing fails (warnings are no failure), 1
    where something does.
    """
    checks = chosen(only)
    if list_checks:
        _list(checks, as_json=as_json)
        return
    if config_file is not None and not config_file.exists():
        raise InputError(f"{config_file}: there is no such file: give --config another one, or leave it out")
    cv2.setNumThreads(1)
    where = Where(
        config=SYSTEM_CONFIG if config_file is None else config_file, setup=setup, runs=runs, socket=live,
        overrides=tuple(overrides or ()), seconds=seconds, speed_mps=speed,
    )  # fmt: skip
    made = _make(checks, where)
    if as_json:
        typer.echo(json.dumps(facts(made)))
    else:
        _print(made)
    if any(verdict.status is Status.FAIL for _, verdict in made):
        raise typer.Exit(1)


def _make(checks: Sequence[Check[Any]], where: Where) -> list[Made]:
    """Each check's verdict; a terminal sees how far it is."""
    console = Console(stderr=True)
    made: list[Made] = []
    with console.status("Looking", spinner="dots") as status:

        def say(text: str) -> None:
            status.update(f"{len(made)}/{len(checks)}  {escape(text)} ...")

        box = Box(where, say)
        for check in checks:
            say(f"{check.group.value}: {check.name}")
            made.append((check, check.make(box)))
    return made


def facts(made: Sequence[Made]) -> dict[str, Any]:
    """The verdicts as `--json` tells them."""
    counts = Counter(verdict.status for _, verdict in made)
    return {
        "version": __version__,
        "well": counts[Status.FAIL] == 0,
        "counts": {status.value: counts[status] for status in Status},
        "checks": [
            {
                "name": check.name, "group": check.group.value, "status": verdict.status.value, "found": verdict.found,
                "fix": verdict.fix,
            }
            for check, verdict in made
        ],
    }  # fmt: skip


def _print(made: Sequence[Made]) -> None:
    out = Console(highlight=False)
    table = Table(box=None, pad_edge=False, show_header=False, padding=(0, 2, 0, 0))
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    group = None
    for check, verdict in made:
        if check.group is not group:
            group = check.group
            table.add_row("", f"[bold]{group.value}[/]", "")
        style = _STYLES[verdict.status]
        table.add_row(f"[{style}]{verdict.status.value.upper()}[/]", check.name, escape(verdict.found))
        if verdict.fix is not None:
            table.add_row("", "", f"[{style}]->[/] {escape(verdict.fix)}")
    out.print(table)
    counts = Counter(verdict.status for _, verdict in made)
    out.print(", ".join(f"{counts[status]} {status.value}" for status in Status))


def _list(checks: Sequence[Check[Any]], *, as_json: bool) -> None:
    if as_json:
        keys = ("name", "looks_at", "amiss", "remedy")
        typer.echo(
            json.dumps([{key: getattr(one, key) for key in keys} | {"group": one.group.value} for one in checks])
        )
        return
    width = max(len(check.name) for check in CHECKS)
    for check in checks:
        typer.echo(f"{check.name:<{width}}  {check.group.value:<8}  {check.looks_at}; {check.amiss}")
