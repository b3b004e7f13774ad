"""`dnb-edge web`: the pages and the API, a process of its own without any device."""

from __future__ import annotations

import logging
import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from dnb_edge.config.web import WebConfig, load_web
from dnb_edge.errors import InputError
from dnb_edge.web.app import make_app
from dnb_edge.web.box import WebSettings
from dnb_edge.web.server import addresses, listeners, serve

SYSTEM_CONFIG = Path("/etc/dnb-edge/dnb-edge.yaml")
SYSTEM_SOCKET = Path("/run/dnb-edge/live.sock")
SETUP_CONFIG = "dnb-edge.yaml"


def web(
    config_file: Annotated[
        Path | None,
        typer.Option(
            "--config",
            "-c",
            help=f"Configuration file (YAML) with a section web. Default: {SYSTEM_CONFIG}, or {SETUP_CONFIG} in --setup.",
        ),
    ] = None,
    host: Annotated[str | None, typer.Option(help="Address to listen at. Default: web.host, or all of them.")] = None,
    port: Annotated[int | None, typer.Option(min=1, max=65535, help="Port. Default: web.port, or 8080.")] = None,
    runs: Annotated[Path, typer.Option(help="Directory with the recordings.")] = Path("runs"),
    setup: Annotated[Path, typer.Option(help="Directory that the set-up pages write.")] = Path("setup"),
    cache: Annotated[
        Path | None,
        typer.Option(
            help="Directory for what is made on the way to a browser. Default: $CACHE_DIRECTORY, or dnb-edge-web in the user's."
        ),
    ] = None,
    live: Annotated[Path, typer.Option("--socket", help="The live socket of dnb-edge run.")] = SYSTEM_SOCKET,
) -> None:
    """Serve the board, the set-up pages, the runs and the API to browsers.

    Runs until Ctrl-C is pressed. Watching is for all; changing something needs the code that is logged, and shown on the box's
    displays, when somebody opens the log-in page.
    """
    found = _section(config_file, setup)
    host, port = found.host if host is None else host, found.port if port is None else port
    settings = WebSettings(
        socket=live,
        runs=runs,
        setup=setup,
        cache=_cache() if cache is None else cache,
        host=host,
        port=port,
        names=found.names,
        most_downloads=found.most_downloads,
        download_mb_per_s=found.download_mb_per_s,
    )
    listening = listeners(host, port)
    try:
        app = make_app(settings)
        for address in addresses(host, port):
            typer.echo(address)
        sys.stdout.flush()
        serve(app, listening)
    finally:
        for one in listening:
            one.close()


def _cache() -> Path:
    """The service manager's cache directory, or the user's."""
    given = os.environ.get("CACHE_DIRECTORY")
    if given:
        return Path(given)
    user = os.environ.get("XDG_CACHE_HOME")
    return (Path(user) if user else Path.home() / ".cache") / "dnb-edge-web"


def _section(config_file: Path | None, setup: Path) -> WebConfig:
    """The section `web`; of a file that was not asked for by name only as far as it can be read."""
    if config_file is not None:
        return load_web(config_file)
    path = next((path for path in (SYSTEM_CONFIG, setup / SETUP_CONFIG) if path.exists()), None)
    if path is None:
        return WebConfig()
    try:
        return load_web(path)
    except InputError as error:
        # These pages are there to mend it.
        logging.getLogger(__name__).warning("%s", error)
        return WebConfig()
