"""`dnb-edge run`: the appliance itself, on a camera, a clip, a recording or the simulator."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from dnb_edge import __version__
from dnb_edge.cli.run_means import SYSTEM_CONFIG, RunMeans
from dnb_edge.daemon.conductor import Conductor
from dnb_edge.daemon.keep_trying import keep_trying
from dnb_edge.daemon.notices import Notices
from dnb_edge.daemon.orders import Orders
from dnb_edge.daemon.resume import RESUME_WITHIN_S
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.live.server import LiveServer

ConfigFile = Annotated[
    Path | None, typer.Option("--config", "-c", help=f"Configuration file (YAML). Default: {SYSTEM_CONFIG}.")
]
Override = Annotated[
    list[str] | None,
    typer.Option("--set", help="Set one configuration key, such as race.laps=5. May be given several times."),
]


def run(
    config_file: ConfigFile = None,
    source: Annotated[
        str | None,
        typer.Option(help="v4l2:/dev/video0, file:clip.mp4, mcap:run.mcap or sim:. Default: capture.source."),
    ] = None,
    record: Annotated[Path | None, typer.Option(help="Directory for the recording (MCAP).")] = None,
    laps: Annotated[int | None, typer.Option(min=1, help="End after so many complete laps.")] = None,
    display: Annotated[str | None, typer.Option(help="serial:/dev/ttyUSB0 for a lap display.")] = None,
    entry: Annotated[
        str | None, typer.Option(help="Who or what drives, instead of entry.name; the rest of the entry stays.")
    ] = None,
    model: Annotated[
        Path | None, typer.Option(help="Another detector model: .onnx with its card, or exported by Ultralytics.")
    ] = None,
    overrides: Override = None,
    last_good: Annotated[
        Path | None,
        typer.Option(
            help="Directory for a copy of the last configuration that raced; it is raced with where the current one is damaged."
        ),
    ] = None,
    resume_within: Annotated[
        float,
        typer.Option(
            min=0.0,
            metavar="SECONDS",
            help="Go on with the same race where it was cut short (killed, not stopped) no longer ago than this.",
        ),
    ] = RESUME_WITHIN_S,
    resume: Annotated[
        bool, typer.Option("--resume/--no-resume", help="Whether to go on with a race that was cut short.")
    ] = True,
    live: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH",
            help="Unix socket by which other processes on this box follow the race (`dnb-edge web`). Default: live.sock in "
            "$RUNTIME_DIRECTORY, as a service; else none.",
        ),
    ] = None,
    setup: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Directory where `dnb-edge web` sets the track up: its dnb-edge.yaml is used where there is no other "
            "configuration. The process stays behind a run's end, and gives pictures where none can begin.",
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON object a line on stdout, nothing else there.")
    ] = False,
    observations: Annotated[
        bool, typer.Option("--observations", help="With --json: one line a frame and the running laps as well.")
    ] = False,
) -> None:
    """Time and score laps, live.

    Runs until the source ends, the wanted laps are complete or Ctrl-C is pressed; the recording is finished in each case.
    """
    means = RunMeans(
        config_file=config_file,
        setup=setup,
        source=source,
        record=record,
        laps=laps,
        display=display,
        entry=entry,
        model=model,
        overrides=tuple(overrides or ()),
        last_good=last_good,
        resume_within_s=resume_within if resume else 0.0,
        as_json=as_json,
        observations=observations,
        notifier=ServiceNotifier(),
    )
    path = live if live is not None else _service_socket()
    if path is None:
        keep_trying(lambda _: means.race(None, None), means.notifier)
        return
    notices = Notices()
    orders = Orders(notices, means.check)
    with LiveServer(path, version=__version__, on_order=orders) as server:
        Conductor(means, server, orders, notices, stays=setup is not None).conduct()
    means.leave()


def _service_socket() -> Path | None:
    """Where the socket is as a service: in the directory that the service manager made; None where there is none."""
    given = os.environ.get("RUNTIME_DIRECTORY", "").split(":")[0]
    return Path(given) / "live.sock" if given else None
