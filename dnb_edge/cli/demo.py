"""`dnb-edge demo`: a simulated race, live in the terminal, recorded and reported; no camera and no configuration needed."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
import yaml

from dnb_edge.cli.demo_web import SETUP_NAME, race_with_pages
from dnb_edge.cli.results import make_report
from dnb_edge.cli.run_means import say_summary
from dnb_edge.config.load import load_config
from dnb_edge.daemon.appliance import RunOptions, run_appliance
from dnb_edge.daemon.last_good import CONFIG_NAME as CONFIGURED_NAME
from dnb_edge.daemon.sinks import JsonSink
from dnb_edge.display.terminal import BoardConsole, TerminalDisplay
from dnb_edge.errors import InputError
from dnb_edge.report.files import write_whole
from dnb_edge.sim.car import Paint
from dnb_edge.sim.files import DemoFiles, demo_files
from dnb_edge.sim.rig import Rig
from dnb_edge.sim.traffic import MOST_CARS

CONFIG_NAME = "demo.yaml"
LAPS = 3
WEB_LAPS = 50
"""Five minutes: time to look round."""


def demo(
    directory: Annotated[Path, typer.Option("--out", help="Directory for everything that the demo writes.")] = Path(
        "runs/demo"
    ),
    laps: Annotated[
        int | None, typer.Option(min=1, max=50, help="Complete laps to drive. Default: 3; with --web 50.")
    ] = None,
    cars: Annotated[int, typer.Option(min=1, max=MOST_CARS, help="Cars that race each other.")] = 1,
    seed: Annotated[int, typer.Option(help="Another seed, another drive.")] = 1,
    fast: Annotated[bool, typer.Option("--fast", help="As fast as this machine can, instead of in real time.")] = False,
    web: Annotated[
        bool, typer.Option("--web", help="Board, runs and set-up in a browser on this machine as well, until Ctrl-C.")
    ] = False,
    port: Annotated[int, typer.Option(min=1, max=65535, help="With --web: the pages' port.")] = 8080,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON object a line on stdout instead of the board.")
    ] = False,
) -> None:
    """Race a simulated car, or several, on our own track: live board, recording and report, with nothing to set up.

    It writes a twin, keypoints and a configuration first, as a user would: look at them to see what your own track needs.
    """
    if web and fast:
        raise InputError("--fast: leave it out with --web, whose pages show the race as it is driven")
    laps = (WEB_LAPS if web else LAPS) if laps is None else laps
    console = BoardConsole(stderr=as_json, markup=False)
    console.print("Drawing the track and setting up the simulated camera ...", highlight=False)
    rig = Rig(seed=seed, laps=laps, cars=cars)
    if web:
        write_demo_config(directory / SETUP_NAME, rig, CONFIGURED_NAME)
        uri = f"sim:?laps={laps}&cars={cars}&seed={seed}&pace=1"
        race_with_pages(directory, uri, laps=laps, port=port, as_json=as_json)
        return
    config_file = write_demo_config(directory, rig)
    config = load_config(config_file, [f"race.laps={laps}"])
    uri = f"sim:?laps={laps}&cars={cars}&seed={seed}" + ("" if fast else "&pace=1")
    options = RunOptions(source_uri=uri, record_directory=directory)
    if as_json:
        summary = run_appliance(config, options, listeners=[JsonSink(sys.stdout, observations=False)])
    else:
        with TerminalDisplay(console) as board:
            summary = run_appliance(config, options, displays=[board])
    say_summary(console, summary)
    if summary.recording is not None and summary.laps:
        report = make_report(Path(summary.recording), directory)
        console.print(f"Report:    {report}", highlight=False, soft_wrap=True)
    console.print(f"Your own track needs a file like {config_file}", highlight=False, soft_wrap=True)


def write_demo_config(directory: Path, rig: Rig, name: str = CONFIG_NAME) -> Path:
    """Writes the demo's twin, keypoints and configuration into `directory`; returns the configuration's path."""
    files = demo_files(directory, rig)
    path = directory / name
    text = "# Written by `dnb-edge demo`: what a configuration of your own track looks like.\n"
    text += yaml.safe_dump(_config(files, rig.paints), sort_keys=False)
    write_whole(path, text.encode())
    return path


def course_config(files: DemoFiles, track_name: str) -> dict[str, Any]:
    """Track, view and score of a configuration for a simulated course, plain YAML types; `files` lie beside it."""
    return {
        "track": {
            "name": track_name,
            "image": files.twin.name,
            "lane_hsv": list(files.lane_hsv),
            "measured": {
                "from_px": list(files.measured_from_px),
                "to_px": list(files.measured_to_px),
                "length_m": files.measured_length_m,
            },
            "start_line_px": [list(point) for point in files.start_line_px],
        },
        "view": {
            "keypoints_camera": files.camera_keypoints.name,
            "keypoints_twin": files.twin_keypoints.name,
            "image_size_px": list(files.keypoints_image_size_px),
            "max_mean_error_m": 0.02,
        },
        "score": {"metric": "dtw", "clamp_m": 0.5, "baseline_m": 0.5},
    }


def _config(files: DemoFiles, paints: Sequence[Paint]) -> dict[str, Any]:
    name = "simulated cars" if paints else "simulated car"
    cars = {"cars": [{"name": paint.name, "colour": paint.hex} for paint in paints]} if paints else {}
    return {"name": name} | course_config(files, "demo track") | cars
