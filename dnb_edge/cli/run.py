"""`dnb-edge run`: the appliance itself, on a camera, a clip, a recording or the simulator."""

from __future__ import annotations

import json
import os
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from dnb_edge import __version__
from dnb_edge.assembly import check_checkpoint
from dnb_edge.config.load import load_config
from dnb_edge.config.schema import Config
from dnb_edge.daemon.appliance import RunOptions, run_appliance
from dnb_edge.daemon.keep_trying import keep_trying
from dnb_edge.daemon.last_good import LastGood
from dnb_edge.daemon.live_run import LiveRun
from dnb_edge.daemon.resume import RESUME_WITHIN_S
from dnb_edge.daemon.sinks import JsonSink, LiveJsonSink
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.display.terminal import BoardConsole, TerminalDisplay
from dnb_edge.errors import InputError
from dnb_edge.live.server import LiveServer
from dnb_edge.values import RunSummary

SYSTEM_CONFIG = Path("/etc/dnb-edge/dnb-edge.yaml")
"""Where the service's configuration lies; used where --config is not given and it is there."""

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
    changes = [*(overrides or []), *_shorthands(laps, model, entry)]

    def attempt(notifier: ServiceNotifier, server: LiveServer | None) -> None:
        config, fault = _config_or_last_good(config_file, changes, last_good)
        options = RunOptions(
            source_uri=_source_uri(source, config),
            record_directory=record,
            display_uri=display if display is not None else config.display.uri,
            last_good=last_good,
            config_fault=fault,
            resume_within_s=resume_within if resume else 0.0,
        )
        live_run = None if server is None else LiveRun(server)
        if live_run is not None:
            live_run.starts(options.source_uri)
        _race(config, options, notifier, live_run, as_json=as_json, observations=observations)

    path = live if live is not None else _service_socket()
    with nullcontext() if path is None else LiveServer(path, version=__version__) as server:
        keep_trying(lambda notifier: attempt(notifier, server), ServiceNotifier())


def _service_socket() -> Path | None:
    """Where the socket is as a service: in the directory that the service manager made; None where there is none."""
    given = os.environ.get("RUNTIME_DIRECTORY", "").split(":")[0]
    return Path(given) / "live.sock" if given else None


LIVE_SCHEMES = ("v4l2:", "libcamera:")
"""Sources that lose frames where anybody makes them wait."""


def _race(
    config: Config,
    options: RunOptions,
    notifier: ServiceNotifier,
    live: LiveRun | None,
    *,
    as_json: bool,
    observations: bool,
) -> None:
    """One run with its listeners: JSON lines, or the board."""
    if as_json:
        with _json_lines(options.source_uri, observations=observations) as lines:
            run_appliance(config, options, listeners=[lines], notifier=notifier, live=live)
        return
    console = BoardConsole(markup=False)
    with TerminalDisplay(console) as board:
        summary = run_appliance(config, options, displays=[board], notifier=notifier, live=live)
    if board.stuck:
        # The recording is finished, and Python would wait for the terminal for ever.
        os._exit(1)
    say_summary(console, summary)


def _json_lines(source_uri: str, *, observations: bool) -> LiveJsonSink | nullcontext[JsonSink]:
    if source_uri.startswith(LIVE_SCHEMES):
        return LiveJsonSink(sys.stdout.fileno(), observations=observations)
    return nullcontext(JsonSink(sys.stdout, observations=observations))


def _source_uri(source: str | None, config: Config) -> str:
    uri = source if source is not None else config.capture.source
    if uri is None:
        raise InputError("no source: give --source, or capture.source in the configuration")
    return uri


def _config_or_last_good(
    config_file: Path | None, changes: list[str], last_good: Path | None
) -> tuple[Config, str | None]:
    """The user's configuration; where it is damaged the last good one, and what is wrong with the user's."""
    try:
        config = load_run_config(config_file, changes)
        check_checkpoint(config)
    except InputError as error:
        if last_good is None:
            raise
        try:
            return LastGood(last_good).load(), str(error)
        except InputError:
            # Of two faults the user can mend the first.
            raise error from None
    return config, None


def load_run_config(config_file: Path | None, overrides: list[str]) -> Config:
    """The configuration of a run. Raises `InputError` where there is none."""
    if config_file is None and not SYSTEM_CONFIG.exists():
        raise InputError("no configuration: give --config FILE (examples are in configs/), or try `dnb-edge demo`")
    return load_config(config_file if config_file is not None else SYSTEM_CONFIG, overrides)


def say_summary(console: Console, summary: RunSummary) -> None:
    """The last line of a run for people."""
    console.print(
        f"{summary.laps} laps; the car was found in {summary.detected_frames} of {summary.frames} frames.",
        highlight=False,
    )
    if summary.bad_pictures:
        console.print(
            f"The picture was {', '.join(summary.bad_pictures)}: no car was looked for then.", highlight=False
        )
    if summary.recording is not None:
        console.print(f"Recording: {summary.recording}", highlight=False, soft_wrap=True)


def _shorthands(laps: int | None, model: Path | None, entry: str | None) -> list[str]:
    given = [] if laps is None else [f"race.laps={laps}"]
    if model is not None:
        given.append(f"detector.model={model.resolve()}")
    if entry is not None:
        if not entry.strip():
            raise InputError("--entry: the name is blank: say who or what drives")
        # Quoted, so that a name like 12 stays text; both keys, since either may stand in the file.
        given += [f"{key}={json.dumps(entry, ensure_ascii=False)}" for key in ("name", "entry.name")]
    return given
