"""`dnb-edge foxglove`: the race, live, in Foxglove; off unless somebody runs it."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path
from typing import Annotated

import typer

from dnb_edge.config.web import FoxgloveConfig, load_web
from dnb_edge.web.foxglove_layout import layout_text
from dnb_edge.web.foxglove_server import FoxgloveSettings, serve

SYSTEM_CONFIG = Path("/etc/dnb-edge/dnb-edge.yaml")
SYSTEM_SOCKET = Path("/run/dnb-edge/live.sock")


def foxglove(
    config_file: Annotated[
        Path | None,
        typer.Option(
            "--config", "-c", help=f"Configuration file (YAML) with a section web.foxglove. Default: {SYSTEM_CONFIG}."
        ),
    ] = None,
    host: Annotated[
        str | None,
        typer.Option(help="Address to listen at; 0.0.0.0 shows the camera to all in the network. Default: 127.0.0.1."),
    ] = None,
    port: Annotated[int | None, typer.Option(min=1, max=65535, help="Port. Default: 8765.")] = None,
    live: Annotated[Path, typer.Option("--socket", help="The live socket of dnb-edge run.")] = SYSTEM_SOCKET,
    layout: Annotated[
        bool, typer.Option("--layout", help="Print a layout to import into Foxglove, and serve nothing.")
    ] = False,
) -> None:
    """Serve the race to Foxglove, live: camera, track, cars, laps, health and log, as a recording has them.

    Runs until Ctrl-C is pressed. Whoever reaches the port sees all of it without a code, and can change nothing.
    """
    if layout:
        sys.stdout.write(layout_text())
        return
    found = _section(config_file)
    settings = FoxgloveSettings(
        socket=live,
        host=found.host if host is None else host,
        port=found.port if port is None else port,
        pictures_per_s=found.pictures_per_s,
    )
    asyncio.run(serve(settings, ready=_say))


def _section(config_file: Path | None) -> FoxgloveConfig:
    """The section `web.foxglove`. Raises `InputError`."""
    if config_file is None and not SYSTEM_CONFIG.exists():
        return FoxgloveConfig()
    return load_web(SYSTEM_CONFIG if config_file is None else config_file).foxglove


def _say(address: str) -> None:
    typer.echo(address)
    sys.stdout.flush()
