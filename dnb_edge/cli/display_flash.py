"""`dnb-edge display flash`: the firmware onto a display's microcontroller."""

from __future__ import annotations

import json
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import Progress

from dnb_edge.display import flash as flashing
from dnb_edge.display.panel.board.settings import DEFAULTS, PANELS


def flash(
    port: Annotated[
        str | None, typer.Argument(help="The board's port; found by itself where one board is plugged in.")
    ] = None,
    *,
    panel: Annotated[str | None, typer.Option(help=f"What hangs on it: {', '.join(PANELS)}.")] = None,
    brightness: Annotated[
        int | None, typer.Option(help=f"0 to 15, {DEFAULTS['brightness']} where it is not said.")
    ] = None,
    upside_down: Annotated[
        bool | None, typer.Option("--upside-down/--upright", help="The panel hangs the other way up.")
    ] = None,
    turn: Annotated[
        int | None, typer.Option(help="MAX7219: each matrix is turned on its board: 0, 90, 180 or 270 degrees.")
    ] = None,
    reverse: Annotated[
        bool | None, typer.Option("--reverse/--no-reverse", help="MAX7219: the first module is the leftmost.")
    ] = None,
    mirror: Annotated[
        bool | None, typer.Option("--mirror/--no-mirror", help="MAX7219: each matrix shows letters mirrored.")
    ] = None,
    checksums: Annotated[
        bool | None, typer.Option("--checksums/--by-hand", help="Whether lines without a checksum are dropped.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Say what was done as JSON.")] = False,
) -> None:
    """Write the display's firmware onto a microcontroller with MicroPython (1.22 or newer), and start it.

    dnb-edge display flash --panel max7219-32x8

    What it has is left alone, settings that are not said among it; a new board's are those of a MAX7219 matrix of 32 x 8.
    How MicroPython gets onto a board: docs/wiring.md.
    """
    told: dict[str, Any] = {
        "panel": panel,
        "brightness": brightness,
        "upside_down": upside_down,
        "turn": turn,
        "reverse": reverse,
        "mirror": mirror,
        "checksums": checksums,
    }
    chosen = {key: value for key, value in told.items() if value is not None}
    if chosen:
        flashing.checked_settings(chosen)
    place = port or flashing.find_port()
    console = Console(stderr=True)
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task(place, total=None)
        done = flashing.flash(
            place,
            chosen or None,
            tell=lambda path, at, count: progress.update(task, completed=at, total=count, description=path or place),
        )
    if as_json:
        typer.echo(json.dumps({"port": done.port, "micropython": done.micropython, "written": done.written,
                               "unchanged": done.unchanged, "removed": done.removed}))  # fmt: skip
        return
    typer.echo(
        f"{done.port}: MicroPython {done.micropython}, {len(done.written)} files written, {len(done.unchanged)} as they were,"
        f" {len(done.removed)} removed. The display starts with its self-test."
    )
