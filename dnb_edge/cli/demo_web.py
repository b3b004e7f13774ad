"""`dnb-edge demo --web`: the simulated race with the pages beside it, as on a box, for this machine alone.

Knows how the two processes find each other. Knows no page and no race.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dnb_edge import __version__
from dnb_edge.cli.run_means import RunMeans
from dnb_edge.daemon.conductor import Conductor
from dnb_edge.daemon.last_good import CONFIG_NAME
from dnb_edge.daemon.notices import Notices
from dnb_edge.daemon.orders import Orders
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.display.terminal import BoardConsole
from dnb_edge.errors import InputError
from dnb_edge.live.server import LiveServer

SETUP_NAME = "setup"
_END_S = 5.0


def race_with_pages(directory: Path, source_uri: str, *, laps: int, port: int, as_json: bool) -> None:
    """Races `source_uri` with the configuration in the set-up's folder of `directory`, with the pages at `port`, until Ctrl-C.

    Raises `InputError` where the pages cannot be served.
    """
    setup = directory / SETUP_NAME
    means = RunMeans(
        # Named, so that no other configuration on this machine is taken; it is the one that the set-up page saves.
        config_file=setup / CONFIG_NAME,
        setup=setup,
        source=source_uri,
        record=directory,
        laps=laps,
        display=None,
        entry=None,
        model=None,
        overrides=(),
        last_good=None,
        resume_within_s=0.0,
        as_json=as_json,
        observations=False,
        notifier=ServiceNotifier(),
    )
    # A socket's path may have a hundred letters only.
    with tempfile.TemporaryDirectory(prefix="dnb-edge-") as place:
        path = Path(place) / "live.sock"
        notices = Notices()
        orders = Orders(notices, means.check)
        with LiveServer(path, version=__version__, on_order=orders) as server, _pages(directory, path, port) as address:
            console = BoardConsole(stderr=as_json, markup=False)
            console.print(f"Board:     {address}", highlight=False, soft_wrap=True)
            console.print(
                "Log in there to begin runs, to judge and to set up: the code then stands here.", highlight=False
            )
            console.print("Ctrl-C ends it.", highlight=False)
            Conductor(means, server, orders, notices, stays=True).conduct()
    means.leave()


@contextmanager
def _pages(directory: Path, live: Path, port: int) -> Iterator[str]:
    """`dnb-edge web` beside this process; gives its address once it listens."""
    words = ["--host", "127.0.0.1", "--port", str(port), "--socket", str(live), "--runs", str(directory)]
    words += ["--setup", str(directory / SETUP_NAME), "--cache", str(directory / "cache")]
    log = directory / "web.log"
    with (
        log.open("w") as said,
        subprocess.Popen(  # noqa: S603 our own interpreter and module; the rest is data
            [sys.executable, "-m", "dnb_edge", "web", *words], stdout=subprocess.PIPE, stderr=said, text=True
        ) as process,
    ):
        try:
            assert process.stdout is not None
            address = process.stdout.readline().strip()
            if not address:
                why = log.read_text().strip().splitlines()
                raise InputError(why[-1].removeprefix("dnb-edge: ") if why else f"the pages did not start: see {log}")
            yield address
        finally:
            process.terminate()
            try:
                process.wait(_END_S)
            except subprocess.TimeoutExpired:
                process.kill()
