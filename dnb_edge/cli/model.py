"""`dnb-edge model`: judge a detector's model on labelled pictures, quantise one, and time it."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import cv2
import typer
from rich.console import Console
from rich.progress import track
from rich.table import Table

from dnb_edge.assembly import detector_of
from dnb_edge.cli.model_bench import bench
from dnb_edge.cli.model_files import labelled_pictures, read_picture
from dnb_edge.cli.model_quantize import quantize
from dnb_edge.cli.run import Override
from dnb_edge.config.load import load_config
from dnb_edge.config.schema import DetectorConfig
from dnb_edge.detect import check as judging
from dnb_edge.detect.centre import CentreDetector, CentreDetectorSettings
from dnb_edge.detect.onnx import default_model_path, load_model
from dnb_edge.detect.still import look_at_still
from dnb_edge.detect.ultralytics import UltralyticsDetector
from dnb_edge.errors import InputError
from dnb_edge.report.files import write_whole
from dnb_edge.report.model_check import BoxMark, Case, FindMark, encoded_sheet
from dnb_edge.train.teach_labels import read_yolo
from dnb_edge.values import BgrImage, Detection

app = typer.Typer(help="Check, quantise and time the detector's model.", no_args_is_help=True)
app.command("bench")(bench)
app.command("quantize")(quantize)

MOST_SHOWN = 12
"""Pictures on the sheet of the worst cases."""

Look: TypeAlias = Callable[[BgrImage], Sequence[Detection]]


@app.command("check")
def check(
    images: Annotated[
        Path, typer.Option(help="Folder of pictures with YOLO labels: text beside them, or images/ and labels/.")
    ],
    model: Annotated[
        Path | None,
        typer.Argument(help="Our network with its card, or one that Ultralytics exported. Default: the shipped one."),
    ] = None,
    config_file: Annotated[
        Path | None, typer.Option("--config", "-c", help="Configuration whose detector settings are used.")
    ] = None,
    overrides: Override = None,
    confidence: Annotated[
        float | None,
        typer.Option(min=0.001, max=0.999, help="Only finds so sure count. Default: all that the detector reports."),
    ] = None,
    worst: Annotated[Path | None, typer.Option(help="Write a picture (PNG) of the worst cases.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout instead of a table.")] = False,
) -> None:
    """How well a model finds the cars in labelled pictures: precision, recall, error of the point.

    Each picture is looked at as a still scene at the start of a race, without a background: everything that the detector would
    report there counts, right where its point lies inside a label's box, one find a box. Every class of label is a car;
    pictures without a label file are left out. The error is the distance to the box's centre.
    """
    cv2.setNumThreads(1)
    console = Console(stderr=True, soft_wrap=True, highlight=False, markup=False)
    if worst is not None and (not worst.parent.is_dir() or worst.suffix.lower() != ".png"):
        raise InputError(f"{worst}: give a file NAME.png in a folder that exists")
    labelled, unlabelled = labelled_pictures(images)
    config = _detector_config(model, config_file, overrides)
    path = config.model or default_model_path()
    look, least = make_look(config, confidence)
    for _, labels in labelled:
        read_yolo(labels, 1, 1)  # a bad label is told before the long work
    judged = []
    for picture, labels in track(labelled, "Looking", console=console, transient=True, disable=not console.is_terminal):
        image = read_picture(picture)
        boxes = [car.box_px for car in read_yolo(labels, image.shape[1], image.shape[0]) if car.box_px is not None]
        judged.append(judging.judge(look(image), boxes))
    if unlabelled:
        console.print(f"{images}: {unlabelled} pictures without a label file left out.")
    result = judging.figures(judged, least)
    if worst is not None:
        numbers = judging.worst(judged, least, MOST_SHOWN)
        write_whole(worst, encoded_sheet([_case(labelled[number][0], judged[number], least) for number in numbers]))
        console.print(f"Worst cases: {worst}")
    if as_json:
        typer.echo(json.dumps({"model": str(path), **plain(result), "unlabelled": unlabelled}))
    else:
        _print(path, result)


def _detector_config(model: Path | None, config_file: Path | None, overrides: Sequence[str] | None) -> DetectorConfig:
    """The detector's section, with the model of the command line where one is given."""
    if config_file is None and overrides:
        raise InputError("--set needs a configuration to change: give --config")
    config = DetectorConfig() if config_file is None else load_config(config_file, overrides or []).detector
    return config if model is None else config.model_copy(update={"model": model})


def make_look(config: DetectorConfig, confidence: float | None) -> tuple[Look, float]:
    """What finds cars in a still picture, and the confidence from which its finds count.

    Without `confidence` that is the detector's own: all that it reports counts. Raises InputError where a model cannot be used.
    """
    detector = detector_of(config)
    if isinstance(detector, UltralyticsDetector):
        if confidence is not None and confidence < config.min_confidence:
            detector = detector_of(config.model_copy(update={"min_confidence": confidence}))
        boxes = detector
        return (lambda image: boxes.detect(image, sequence=0, t_ns=0, windows=()).detections), (
            config.min_confidence if confidence is None else confidence
        )
    if not isinstance(detector, CentreDetector):
        raise InputError(f"detector.kind: the detector `{config.kind}` has no model to check")
    network = load_model(config.model or default_model_path(), threads=config.threads)
    own = CentreDetectorSettings()
    settings = replace(own, acquire_confidence=min(own.acquire_confidence, confidence or 1.0))
    return (lambda image: look_at_still(network, image, settings)), confidence or own.acquire_confidence


def plain(result: judging.Figures) -> dict[str, Any]:
    """The figures as `--json` tells them."""
    return {
        "precision": result.at.precision,
        "recall": result.at.recall,
        "images": result.images,
        "centre_error_px": {"p50": None, "p95": None}
        if result.centre_error_px is None
        else asdict(result.centre_error_px),
        "confidence": result.at.confidence,
        "f1": result.at.f1,
        "cars": result.cars,
        "found": result.found,
        "false": result.false,
        "mean_offset_px": result.mean_offset_px,
        "best": None if result.best is None else _plain_rates(result.best),
        "thresholds": [_plain_rates(one) for one in result.table],
    }


def _plain_rates(rates: judging.Rates) -> dict[str, Any]:
    return {**asdict(rates), "f1": rates.f1}


def _case(path: Path, judged: judging.Judged, confidence: float) -> Case:
    """A picture of the sheet, with what counts at `confidence`."""
    kept = judging.above(judged, confidence)
    missed = judging.missed(kept)
    return Case(
        name=path.name,
        bgr=read_picture(path),
        boxes=tuple(BoxMark(box_px=box, found=number not in missed) for number, box in enumerate(kept.boxes)),
        finds=tuple(
            FindMark(
                camera_px=find.camera_px,
                length_px=find.length_px,
                confidence=find.confidence,
                right=find.box is not None,
            )
            for find in kept.finds
        ),
    )


def _print(path: Path, result: judging.Figures) -> None:
    out = Console(highlight=False, soft_wrap=True, markup=False)
    at = result.at
    out.print(
        f"{path.name} on {result.images} pictures with {result.cars} cars, from a confidence of {at.confidence:g}:"
    )
    out.print(
        f"precision {_share(at.precision)}, recall {_share(at.recall)} ({result.found} found, {result.false} false)"
    )
    if result.centre_error_px is not None and result.mean_offset_px is not None:
        error, (u, v) = result.centre_error_px, result.mean_offset_px
        out.print(f"distance to the box's centre: p50 {error.p50:.1f} px, p95 {error.p95:.1f} px")
        out.print(f"mean offset from it: {u:+.1f} px to the right, {v:+.1f} px down")
    table = Table("confidence", "precision", "recall", "F1", title="Where only surer finds count")
    for column in table.columns:
        column.justify = "right"
    rows = [("", one) for one in result.table] + ([] if result.best is None else [("best ", result.best)])
    for mark, one in rows:
        table.add_row(f"{mark}{one.confidence:.2f}", _share(one.precision), _share(one.recall), f"{one.f1:.3f}")
    out.print(table)


def _share(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"
