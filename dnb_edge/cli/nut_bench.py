"""`dnb-edge nut bench`: how fast a network under test is on this machine, kept as a card."""

from __future__ import annotations

import json
import os
import platform
import re
from datetime import UTC, datetime
from importlib import metadata
from itertools import islice
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer
from rich.console import Console
from rich.progress import Progress

from dnb_edge import __version__
from dnb_edge.assembly.sources import source_of
from dnb_edge.capture.decode import decode_bgr
from dnb_edge.capture.source import KNOWN_SCHEMES
from dnb_edge.errors import InputError
from dnb_edge.machine.state import read_machine
from dnb_edge.nut.bench import Effort, fps_of, latency_of, start_cold, time_passes
from dnb_edge.nut.bench_card import BenchCard, Latency, WarmUp, card_name, card_object, card_text
from dnb_edge.nut.fit import MOST_SIDE_PX, aside_inputs, picture_input
from dnb_edge.nut.host import read_host
from dnb_edge.nut.onnx import Model, load_model
from dnb_edge.report.files import write_whole
from dnb_edge.values import BgrImage

BUSY_SHARE = 0.5
"""Of the cores: a load beyond it is told, since it lies in the times."""
WIDE = 26
"""Characters of a percentile with its spread."""
MOST_PICTURES = 60
"""Of a clip, taken from its beginning: all are kept in memory."""


def bench(
    model_file: Annotated[Path, typer.Argument(metavar="MODEL.onnx", help="An ONNX model that takes one picture.")],
    frames: Annotated[
        str | None, typer.Option(help="Take pictures of this clip or recording, and time pre-processing, too.")
    ] = None,
    threads: Annotated[int, typer.Option(min=1, max=64, help="Threads within the network.")] = 1,
    repeats: Annotated[int, typer.Option(min=2, max=1000, help="How often the passes are repeated.")] = 5,
    passes: Annotated[int, typer.Option(min=10, max=100_000, help="Timed passes in each repeat.")] = 200,
    size: Annotated[
        str | None, typer.Option(help="WIDTHxHEIGHT in pixels, for a model that leaves its picture's size open.")
    ] = None,
    entry: Annotated[str | None, typer.Option(help="The entry's name in tables. Default: the file's.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="File or directory for the card. Default: ENTRY.nut.json, here.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="The card on stdout instead of a table.")] = False,
) -> None:
    """Time a network under test on this machine: latency, throughput, memory, cold start; kept as ENTRY.nut.json.

    One picture at a time. Pictures are noise without --frames. Measure on the computer that drives the car, with nothing else
    running: the spread over the repeats shows whether it was so.
    """
    cv2.setNumThreads(1)
    console = Console(stderr=True, soft_wrap=True, highlight=False, markup=False)
    name = (model_file.stem if entry is None else entry).strip()
    if not name:
        raise InputError("--entry: give the entry's name")
    target = _target(out, name)
    effort = Effort(repeats=repeats, passes=passes)
    model = load_model(model_file, threads=threads)
    picture, asides = picture_input(model, parse_size(size)), aside_inputs(model)
    pictures = [] if frames is None else _pictures(frames)
    before, load = read_machine(), os.getloadavg()[0]
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        cold_task = progress.add_task("Cold starts", total=effort.cold_starts)
        pass_task = progress.add_task("Passes", total=effort.warm_up + repeats * passes)
        cold_start, memory = start_cold(
            model,
            picture,
            asides,
            threads=threads,
            starts=effort.cold_starts,
            done=lambda: progress.advance(cold_task),
        )
        timed = time_passes(model, picture, asides, effort, pictures=pictures, done=lambda: progress.advance(pass_task))
    after = read_machine()
    card = BenchCard(
        entry=name,
        model_file=model_file.name,
        model_sha256=model.sha256,
        model_bytes=model.size_bytes,
        input_shape=picture.shape,
        input_type=picture.kind,
        host=read_host(
            temperature_before_c=before.temperature_c,
            temperature_after_c=after.temperature_c,
            throttled=after.throttled,
            load=load,
        ),
        threads=threads,
        measured_at=datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        software=_software(),
        repeats=repeats,
        passes=passes,
        warm_up=WarmUp(passes=effort.warm_up, first_ms=round(timed.first_ms, 4)),
        inference=latency_of(timed.inference_ms),
        fps=fps_of(timed.inference_ms),
        memory=memory,
        cold_start=cold_start,
        cpu_p50_ms=round(float(np.median(timed.cpu_ms)), 4),
        frames=frames,
        preprocessing=None if timed.preprocessing_ms is None else latency_of(timed.preprocessing_ms),
    )
    write_whole(target, card_text(card).encode())
    console.print(f"Card: {target}")
    if load > BUSY_SHARE * card.host.cores:
        console.print(
            f"The machine was busy with other work (load {load:.1f} on {_count(card.host.cores, 'core')}): the times are too "
            "long. End it and measure again."
        )
    if as_json:
        typer.echo(json.dumps(card_object(card)))
    else:
        _print(card, model)


def parse_size(text: str | None) -> tuple[int, int] | None:
    """(width, height) from a text such as `160x120`. Raises InputError for anything else."""
    if text is None:
        return None
    found = re.fullmatch(r"([0-9]{1,5})x([0-9]{1,5})", text)
    size = (int(found[1]), int(found[2])) if found else (0, 0)
    if not all(1 <= side <= MOST_SIDE_PX for side in size):
        raise InputError(f"--size {text}: give WIDTHxHEIGHT in pixels, such as 160x120, at most {MOST_SIDE_PX} each")
    return size


def _target(out: Path | None, entry: str) -> Path:
    """Where the card goes; what cannot be is told before the long work."""
    target = Path(card_name(entry)) if out is None else out / card_name(entry) if out.is_dir() else out
    if not target.parent.is_dir():
        raise InputError(f"{target}: there is no directory {target.parent}: make it first")
    return target


def _pictures(frames: str) -> list[BgrImage]:
    """The first pictures of a clip, by its path or as the URI of a source. Raises InputError where it has none."""
    schemes = {scheme.partition(":")[0] for scheme in KNOWN_SCHEMES}
    if frames.partition(":")[0] not in schemes or ":" not in frames:
        frames = f"{'mcap' if frames.endswith('.mcap') else 'file'}:{frames}"
    source = source_of(frames, None)
    try:
        found = [
            picture for frame in islice(source.frames(), MOST_PICTURES) if (picture := decode_bgr(frame)) is not None
        ]
    finally:
        source.close()
    if not found:
        raise InputError(f"--frames {frames}: holds no picture: give a clip, or a recording with pictures")
    return found


def _software() -> dict[str, str]:
    return {
        "dnb-edge": __version__,
        "onnxruntime": metadata.version("onnxruntime"),
        "numpy": np.__version__,
        "opencv": cv2.__version__,
        "python": platform.python_version(),
    }


def _print(card: BenchCard, model: Model) -> None:
    host = card.host
    typer.echo(f"{card.entry}: {card.model_file}, {card.model_bytes / 1e6:.2f} MB, SHA-256 {card.model_sha256[:12]}...")
    typer.echo(f"input {model.inputs[0].name} {card.input_type} {card.input_shape}, {_count(card.threads, 'thread')}")
    governor = "" if host.governor is None else f", governor {host.governor}"
    heat = "" if host.temperature_after_c is None else f", {host.temperature_after_c:.0f} C"
    typer.echo(f"{host.words}{governor}{heat}{', slowed down' if host.throttled else ''}\n")
    typer.echo(f"{'':15}{'p50 ms':>{WIDE}}{'p95 ms':>{WIDE}}{'p99 ms':>{WIDE}}{'mean ms':>10}{'max ms':>10}")
    _row("inference", card.inference)
    if card.preprocessing is not None:
        _row("pre-processing", card.preprocessing)
    cold, memory = card.cold_start, card.memory
    typer.echo(
        f"\nthroughput  {card.fps:.1f} pictures/s, the network alone, one at a time; "
        f"p50 by processor time {card.cpu_p50_ms:.3f} ms"
    )
    typer.echo(
        f"cold start  {cold.total_ms:.0f} ms: process {cold.process_ms:.0f}, import {cold.import_ms:.0f}, "
        f"load {cold.load_ms:.0f}, first answer {cold.first_answer_ms:.1f}; median of {cold.starts}"
    )
    typer.echo(
        f"memory      {memory.grown_bytes / 1e6:.1f} MB for the model, {memory.peak_bytes / 1e6:.1f} MB the process"
    )
    typer.echo(
        f"warm-up     {card.warm_up.passes} passes, the first {card.warm_up.first_ms:.2f} ms; then {card.repeats} x "
        f"{card.passes}, with the least and the greatest of a repeat in brackets"
    )


def _row(name: str, latency: Latency) -> None:
    percentiles = [
        f"{one.all_ms:.3f} ({one.least_ms:.3f}-{one.most_ms:.3f})" for one in (latency.p50, latency.p95, latency.p99)
    ]
    cells = "".join(f"{one:>{WIDE}}" for one in percentiles)
    typer.echo(f"{name:15}{cells}{latency.mean_ms:10.3f}{latency.max_ms:10.3f}")


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'s' * (number != 1)}"
