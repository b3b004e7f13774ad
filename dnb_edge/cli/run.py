"""`dnb-edge run`: the appliance itself, on a camera, a clip, a recording or the simulator."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from dnb_edge.assembly import check_checkpoint
from dnb_edge.config.load import load_config
from dnb_edge.config.schema import Config
from dnb_edge.daemon.appliance import RunOptions, run_appliance
from dnb_edge.daemon.sinks import JsonSink
from dnb_edge.display.terminal import BoardConsole, TerminalDisplay
from dnb_edge.errors import InputError
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
    config = load_run_config(config_file, [*(overrides or []), *_shorthands(laps, model, entry)])
    check_checkpoint(config)
    uri = source if source is not None else config.capture.source
    if uri is None:
        raise InputError("no source: give --source, or capture.source in the configuration")
    options = RunOptions(
        source_uri=uri, record_directory=record, display_uri=display if display is not None else config.display.uri
    )
    if as_json:
        run_appliance(config, options, listeners=[JsonSink(sys.stdout, observations=observations)])
        return
    console = BoardConsole(markup=False)
    with TerminalDisplay(console) as board:
        summary = run_appliance(config, options, displays=[board])
    say_summary(console, summary)


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
