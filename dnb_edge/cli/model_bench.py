"""`dnb-edge model bench`: the time of the networks alone, in turns, so that their ratios are fair on a busy machine."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress

from dnb_edge.detect.centre import CentreDetectorSettings
from dnb_edge.detect.onnx import SIDE_MULTIPLE_PX, default_model_path, open_model
from dnb_edge.detect.timing import Pass, Ratio, Timing, in_turns, passes_of, ratio_to
from dnb_edge.errors import InputError

MOST_THREADS = 16


def bench(
    models: Annotated[
        list[Path] | None, typer.Argument(help="Networks of ours, int8 or float. Default: the shipped one.")
    ] = None,
    against: Annotated[
        Path | None, typer.Option(help="A network to compare with, such as YOLO11n exported at 640 in float.")
    ] = None,
    threads: Annotated[str, typer.Option(help="Numbers of threads, such as 1,2.")] = "1,2",
    turns: Annotated[int, typer.Option(min=2, max=10000, help="Turns of five timed passes each.")] = 40,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout instead of a table.")] = False,
) -> None:
    """Time the network alone over a window and over the full frame at its reduced size, medians with p99.

    All networks take turns, so what else the machine does hits all alike: ratios to --against hold where times do not. On a
    busy machine trust those by processor time, which leaves interruptions out.
    `dnb-edge bench` times the whole way from the camera's JPEG to the core's events.
    """
    sizes = CentreDetectorSettings()
    full_frame_px = (sizes.whole_width_px, _rounded(sizes.whole_width_px * 9 / 16))
    counts = parse_threads(threads)
    window_px = (sizes.window_px, sizes.window_px)

    def passes(path: Path) -> list[Pass]:
        return [
            one
            for count in counts
            for one in passes_of(
                open_model(path, threads=count), threads=count, window_px=window_px, full_frame_px=full_frame_px
            )
        ]

    own = [one for path in models or [default_model_path()] for one in passes(path)]
    other = [] if against is None else passes(against)
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task("Timing", total=turns)
        timings = in_turns([*own, *other], turns, lambda: progress.advance(task))
    rows, compared = timings[: len(own)], timings[len(own) :]
    if as_json:
        told = [{**asdict(row), "ratio": _plain(ratio_to(row, compared))} for row in rows]
        typer.echo(json.dumps({"passes": told, "against": [asdict(row) for row in compared]}))
    else:
        _print(rows, compared)


def parse_threads(text: str) -> list[int]:
    """Numbers of threads from a text such as `1,2`. Raises InputError for anything else."""
    words = [word.strip() for word in text.split(",")]
    if not all(word.isascii() and word.isdigit() and 1 <= int(word) <= MOST_THREADS for word in words):
        raise InputError(f"--threads {text}: give numbers from 1 to {MOST_THREADS}, such as 1,2")
    return sorted({int(word) for word in words})


def _rounded(side_px: float) -> int:
    """The side as the network gets it."""
    return round(-(-side_px // SIDE_MULTIPLE_PX) * SIDE_MULTIPLE_PX)


def _plain(ratio: Ratio | None) -> dict[str, float] | None:
    return None if ratio is None else asdict(ratio)


def _print(rows: Sequence[Timing], compared: Sequence[Timing]) -> None:
    width = max(len(row.model) for row in (*rows, *compared))
    typer.echo(f"{'network':{width}}  {'pass':10}  {'input':>9}  threads    p50 ms    p99 ms    CPU ms")
    for row in (*rows, *compared):
        size = f"{row.width_px}x{row.height_px}"
        times = "".join(f"{value:10.3f}" for value in (row.p50_ms, row.p99_ms, row.cpu_p50_ms))
        typer.echo(f"{row.model:{width}}  {row.name:10}  {size:>9}  {row.threads:7}{times}")
    for row in rows:
        ratio = ratio_to(row, compared)
        if ratio is not None:
            typer.echo(
                f"{row.model}, {row.threads} thread{'s' * (row.threads > 1)}: {row.name.replace('_', ' ')} 1/{ratio.wall:.0f} "
                f"of {compared[0].model} (1/{ratio.cpu:.0f} by processor time)"
            )
