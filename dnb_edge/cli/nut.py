"""`dnb-edge nut`: networks under test, how fast they are by themselves and how they drive."""

from __future__ import annotations

import typer

from dnb_edge.cli.nut_bench import bench
from dnb_edge.cli.nut_drive import drive

app = typer.Typer(help="Networks under test: their own speed, and their driving in simulation.", no_args_is_help=True)
app.command("bench")(bench)
app.command("drive")(drive)


@app.callback()
def nut() -> None:
    """Networks under test: their own speed, and their driving in simulation."""
