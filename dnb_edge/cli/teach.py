"""`dnb-edge teach`: the detector learns one user's car, from a drive that labels itself or from hand-labelled pictures."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from dnb_edge.assembly import assemble, make_source
from dnb_edge.capture.source import FrameSource
from dnb_edge.cli.run import Override
from dnb_edge.config.load import load_config
from dnb_edge.config.schema import Config
from dnb_edge.core import CoreSetup
from dnb_edge.detect.lean import LeanField
from dnb_edge.detect.onnx import default_model_path, load_model
from dnb_edge.errors import InputError, WorkError
from dnb_edge.train.teach import (
    MOST_BYTES,
    Material,
    Outcome,
    TeachSettings,
    check_base,
    check_enough,
    check_out,
    check_torch,
    drive_material,
    joined,
    rejecting,
    still_material,
    write_sheet,
)
from dnb_edge.train.teach import teach as run_teach
from dnb_edge.train.teach_drive import lane_mask, shots
from dnb_edge.train.teach_labels import read_labelled
from dnb_edge.train.teach_points import label_drive
from dnb_edge.train.teach_sheet import LabelPlace, parse_rejected
from dnb_edge.view.lean import floor_lean

SHEET = "contact-sheet.png"
_ROWS = {
    "recall": "still pictures: recall",
    "precision": "still pictures: precision",
    "recall_at_no_false": "still pictures: recall without a false find",
    "error_p50_px": "still pictures: error p50, px",
    "error_p95_px": "still pictures: error p95, px",
    "followed": "following: share found",
    "follow_error_p50_px": "following: error p50, px",
    "follow_error_p95_px": "following: error p95, px",
}


def teach(
    drives: Annotated[
        list[str] | None, typer.Argument(help="Recordings (.mcap) or clips of about a minute in which the car drives.")
    ] = None,
    config_file: Annotated[
        Path | None,
        typer.Option("--config", "-c", help="Configuration of the track: only what moves on its lane counts."),
    ] = None,
    overrides: Override = None,
    labels: Annotated[
        Path | None,
        typer.Option(help="Folder of hand-labelled pictures: YOLO text beside them, or images/ and labels/."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the contact sheet and the new model.")] = Path("taught"),
    name: Annotated[str, typer.Option(help="Name of the new model's files.")] = "my-car",
    model: Annotated[
        Path | None, typer.Option(help="Model to start from, with its weights beside it. Default: the shipped one.")
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Accept the labels without asking.")] = False,
    reject: Annotated[
        str | None,
        typer.Option(help="Numbers or letters of the contact sheet to reject, such as 3,17 or B; accept the rest."),
    ] = None,
    minutes: Annotated[float, typer.Option(min=0.1, max=600, help="Longest time to learn.")] = 14.0,
    iterations: Annotated[int, typer.Option(min=1, help="Learning ends after so many steps at the latest.")] = 6000,
    seed: Annotated[int, typer.Option(min=0, help="Of everything that is drawn by lot.")] = 1,
    force: Annotated[bool, typer.Option("--force", help="Write the new model even where it is worse.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Before and after as JSON on stdout.")] = False,
) -> None:
    """Teach the detector your car: labels, contact sheet, fine-tuning, int8, before and after, a model for `run --model`.

    A drive labels itself by what moves in it; the camera must stand still. A recording holds a few pictures a second only: a
    clip of the same drive teaches more. Ctrl-C while it learns ends the learning and keeps what was learnt.
    """
    console = Console(stderr=True, soft_wrap=True, highlight=False, markup=False)
    if not drives and labels is None:
        raise InputError("nothing to teach from: give a clip or a recording of a drive, or --labels DIR")
    if not name or Path(name).name != name or name.startswith("."):
        raise InputError(f"--name {name}: give a plain file name without a folder")
    cv2.setNumThreads(1)
    check_out(out)
    base = model if model is not None else default_model_path()
    config = None if config_file is None else load_config(config_file, overrides or [])
    with _progress(console) as tell:
        material, notes = _material(drives or [], labels, base, config, seed, tell)
    check_enough(material)
    for note in notes:
        console.print(note)
    sheet = out / SHEET
    shown = write_sheet(material, sheet)
    console.print(f"Contact sheet: {sheet}")
    material = rejecting(material, shown, _rejected(material, shown, sheet, yes=yes, reject=reject, console=console))
    check_enough(material)
    settings = TeachSettings(minutes=minutes, iterations=iterations, seed=seed)
    given = [*(Path(drive).name for drive in drives or []), *([] if labels is None else ["--labels", labels.name])]
    bounds = ["--seed", str(seed), "--minutes", f"{minutes:g}", "--iterations", str(iterations)]
    command = shlex.join(["dnb-edge", "teach", *given, *bounds])
    with _progress(console) as tell:
        outcome = run_teach(material, base, out, name=name, settings=settings, command=command, force=force, tell=tell)
    _tell_outcome(outcome, out / f"{name}.onnx", console, as_json=as_json)


def _material(
    drives: Sequence[str],
    labels: Path | None,
    base: Path,
    config: Config | None,
    seed: int,
    tell: Callable[[str, float], None],
) -> tuple[Material, list[str]]:
    """All that the user gave, read and labelled, and what to tell of it."""
    parts: list[Material] = []
    notes: list[str] = []
    most_bytes = MOST_BYTES // (len(drives) + (labels is not None))
    uris = [_uri(given) for given in drives]
    for uri in uris:
        make_source(uri, None).close()  # a wrong path is told before the long work
    if labels is not None:
        folder = read_labelled(labels, most_bytes=most_bytes)
        left_out = f"; {folder.unlabelled} without a label file left out" if folder.unlabelled else ""
        notes.append(f"{labels}: {len(folder.pictures)} labelled pictures{left_out}.")
        parts.append(still_material(folder.pictures, seed, labels.name))
    if not uris:
        check_enough(joined(parts))
    check_torch()
    check_base(base)  # before the long work
    for uri in uris:
        network = load_model(base)
        source_name = Path(uri.partition(":")[2]).name or uri
        lane = lean = None
        if config is not None:
            lane, lean = partial(_lane, uri, config), partial(_lean, uri, config)
        drive = partial(shots, partial(make_source, uri, None))
        found = label_drive(
            source_name,
            drive,
            network,
            lane=lane,
            lean=lean,
            tell=partial(tell, f"Looking for what moves in {source_name}"),
        )
        own = f"{found.by_model} of {found.paths} paths with the present model's ground points, the others by the mask"
        notes.append(f"{source_name}: {len(found.cars)} of {len(found.times_s)} pictures labelled; {own}.")
        parts.append(drive_material(found, drive, most_bytes=most_bytes))
    return joined(parts), notes


def _uri(given: str) -> str:
    """A source from what was typed: a URI, a recording or a clip."""
    if given.partition(":")[0] in {"file", "mcap", "sim"} and ":" in given:
        return given
    return f"mcap:{given}" if given.endswith(".mcap") else f"file:{given}"


def _lane(uri: str, config: Config, width_px: int, height_px: int) -> NDArray[np.bool_]:
    return lane_mask(_setup(uri, config), width_px, height_px)


def _lean(uri: str, config: Config, width_px: int, height_px: int) -> LeanField | None:
    ground = _setup(uri, config).ground.scaled_to(width_px, height_px)
    return floor_lean(ground, height_m=config.view.camera_height_m)


def _setup(uri: str, config: Config) -> CoreSetup:
    source: FrameSource = make_source(uri, config)
    try:
        return assemble(config, source.info).setup
    finally:
        source.close()


def _rejected(
    material: Material, shown: Sequence[LabelPlace], sheet: Path, *, yes: bool, reject: str | None, console: Console
) -> set[int]:
    """What of the sheet the user rejects. Raises InputError where nobody can be asked."""
    pictures = list(chain(material.learn, material.held_out))
    if reject is not None:
        return parse_rejected(reject, pictures, shown)
    if yes:
        return set()
    if not sys.stdin.isatty():
        raise InputError(f"{sheet}: look at the labels, then give --yes, or --reject with the numbers that are wrong")
    while True:
        console.print("Numbers or letters that are wrong, such as 3,17 or B; Enter where all are right: ", end="")
        try:
            return parse_rejected(input(), pictures, shown)
        except EOFError as end:
            raise InputError("the labels were neither accepted nor rejected: nothing was taught") from end
        except InputError as mistake:
            console.print(str(mistake))


@contextmanager
def _progress(console: Console) -> Iterator[Callable[[str, float], None]]:
    """A bar a step, with the time that is left."""
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(elapsed_when_finished=True),
    )
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        tasks: dict[str, TaskID] = {}

        def tell(step: str, share: float) -> None:
            if step not in tasks:
                for task in tasks.values():
                    progress.update(task, completed=1.0)
                tasks[step] = progress.add_task(step, total=1.0)
            progress.update(tasks[step], completed=min(share, 1.0))

        yield tell


def _tell_outcome(outcome: Outcome, path: Path, console: Console, *, as_json: bool) -> None:
    """Before and after, and where the model is. Raises WorkError where it was not kept."""
    if as_json:
        said: dict[str, Any] = {
            "model": None if outcome.model is None else str(outcome.model),
            "before": asdict(outcome.before),
            "after": asdict(outcome.after),
            "worse": outcome.worse,
            "iterations": outcome.iterations,
            "interrupted": outcome.interrupted,
        }
        typer.echo(json.dumps(said))
    else:
        table = Table(
            title=f"{outcome.before.cars} held-out cars, {outcome.iterations} iterations in {outcome.seconds:.0f} s"
        )
        for heading in ("", "before", "after"):
            table.add_column(heading, justify="left" if not heading else "right")
        for field, title in _ROWS.items():
            old, new = getattr(outcome.before, field), getattr(outcome.after, field)
            if old is not None or new is not None:
                table.add_row(title, _text(old), _text(new))
        Console(highlight=False).print(table)
    if outcome.model is None:
        raise WorkError(f"{path}: not written, the new model is worse: {'; '.join(outcome.worse)}; --force writes it")
    if outcome.worse:
        console.print(f"Worse, and written all the same: {'; '.join(outcome.worse)}")
    console.print(f"Model: {outcome.model} (with its card and weights). Try it: dnb-edge run --model {outcome.model}")


def _text(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"
