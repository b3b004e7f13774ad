"""`dnb-edge model quantize`: a float network to int8, calibrated on the user's own footage, and both side by side."""

from __future__ import annotations

import importlib.util
import json
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import closing
from dataclasses import asdict
from importlib.metadata import version
from itertools import islice
from pathlib import Path
from typing import Annotated, Any

import cv2
import typer
from rich.console import Console
from rich.progress import track

from dnb_edge.assembly import make_source
from dnb_edge.capture.decode import decode_bgr
from dnb_edge.cli.model_files import pictures_in, read_picture
from dnb_edge.detect.centre import CentreDetectorSettings
from dnb_edge.detect.decode import peaks
from dnb_edge.detect.onnx import CentreMaps, CentreNetwork, OpenModel, load_model, open_model
from dnb_edge.detect.timing import in_turns, passes_of
from dnb_edge.detect.ultralytics import UltralyticsDetector
from dnb_edge.detect.ultralytics_decode import Boxes, letterbox, prepare
from dnb_edge.detect.ultralytics_file import is_ultralytics
from dnb_edge.errors import InputError
from dnb_edge.report.files import scratch_beside, write_whole
from dnb_edge.train.calibration import HELD_OUT_EVERY, as_float, leans, watch
from dnb_edge.train.card import file_sha256, write_card
from dnb_edge.train.quantise_compare import Apart, Spot, apart
from dnb_edge.train.teach_labels import evenly
from dnb_edge.values import BgrImage

MOST_INPUTS = 60
"""At most as many inputs of each size calibrate our network and compare it."""
MOST_PICTURES = 50
"""At most as many pictures do so with one of Ultralytics'."""
LEAST_INPUTS = 2 * HELD_OUT_EVERY
LEAST_CONFIDENCE = 0.3
"""Finds from here on are compared."""
REACH_PX = 8.0
"""Finds of one car lie at most so far apart, px of our network's input."""
TURNS = 10


def quantize(
    model: Annotated[
        Path, typer.Argument(help="Float network: ours (NAME.float.onnx) or one that Ultralytics exported.")
    ],
    footage: Annotated[
        str, typer.Option(help="Clip, recording or folder of pictures from the camera that the network is for.")
    ],
    out: Annotated[
        Path | None, typer.Option(help="The int8 network. Default: NAME.int8.onnx beside the float one.")
    ] = None,
    frames: Annotated[int, typer.Option(min=10, help="Watch at most so many frames.")] = 300,
    as_json: Annotated[bool, typer.Option("--json", help="The comparison as JSON on stdout.")] = False,
) -> None:
    """Quantise a float network to int8, calibrated on your own footage; write it with a card; compare both on held-out frames.

    Needs the extra `train`, as `teach` does. The footage should show the car, the floor and the light of the races.
    """
    check_extra()
    cv2.setNumThreads(1)
    opened = open_model(model)
    target = out if out is not None else model.with_name(f"{model.stem.removesuffix('.float')}.int8.onnx")
    if target.suffix != ".onnx" or target.resolve() == model.resolve() or not target.parent.is_dir():
        raise InputError(f"{target}: give --out another file, NAME.onnx, in a folder that exists")
    check_float(model)
    console = Console(stderr=True, soft_wrap=True, highlight=False, markup=False)
    images = track(
        islice(_images(footage), frames),
        "Watching",
        total=None,
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )
    boxes = is_ultralytics(opened.metadata)
    with scratch_beside(target) as scratch:
        work = scratch / target.name
        if boxes:
            result, used = _boxes(opened, work, images)
        else:
            result, used = _centre(model, work, images, stills=Path(footage).is_dir())
        told = {**asdict(result), **_sizes_and_times(model, work)}
        card = _card(model, work, target, footage=footage, used=used, told=told)
        card_path = card_of(target, boxes=boxes)
        card_path.unlink(missing_ok=True)  # beside a model of other bytes it would call it damaged
        work.replace(target)
    write_whole(card_path, (json.dumps(card, indent=2, ensure_ascii=False) + "\n").encode())
    if not told["finds"]:
        console.print(f"{footage}: no car found: the comparison says little, use footage that shows the car")
    if as_json:
        typer.echo(json.dumps(card))
    else:
        _print(target, told)


def card_of(model: Path, *, boxes: bool) -> Path:
    """Where the card lies: NAME.json beside our network, which is read with it; NAME.card.json beside another's."""
    return model.with_suffix(".card.json" if boxes else ".json")


def check_extra() -> None:
    """Raises InputError where the extra `train` is not installed."""
    missing = [name for name in ("onnx", "torch") if importlib.util.find_spec(name) is None]
    if missing:
        raise InputError(f"quantising needs {missing[0]}: pip install 'dnb-edge[train]'")


def check_float(model: Path) -> None:
    """Raises InputError for a network that is in int8 already."""
    from dnb_edge.train.quantise_file import is_quantised  # noqa: PLC0415 needs the extra

    if is_quantised(model):
        raise InputError(f"{model}: it is in int8 already: give the float network that it was made from")


def _images(footage: str) -> Iterator[BgrImage]:
    """The pictures of a folder, or of a clip or a recording."""
    folder = Path(footage)
    if folder.is_dir():
        yield from (read_picture(path) for path in pictures_in(folder))
        return
    uri = footage
    if footage.partition(":")[0] not in {"file", "mcap", "sim"}:
        uri = f"mcap:{footage}" if footage.endswith(".mcap") else f"file:{footage}"
    with closing(make_source(uri, None)) as source:
        for frame in source.frames():
            image = decode_bgr(frame)
            if image is not None:
                yield image


def _check_enough(count: int, what: str) -> None:
    if count < LEAST_INPUTS:
        raise InputError(f"the footage gives {count} {what}: at least {LEAST_INPUTS} are needed, use a longer piece")


def _centre(model: Path, target: Path, images: Iterable[BgrImage], *, stills: bool) -> tuple[Apart, int]:
    """Our network: calibrated on what it is shown while the detector follows the car; the comparison, and how many inputs."""
    from dnb_edge.train.quantise_file import quantise_centre  # noqa: PLC0415 needs the extra

    plain = _plain_network(model)
    seen = watch(plain, images, stills=stills, most=MOST_INPUTS)
    _check_enough(len(seen.calibration) + len(seen.held_out), "inputs of the network")
    told = leans(len(seen.calibration), 1) if plain.takes_lean else [None] * len(seen.calibration)
    quantise_centre(model, target, [as_float(*one) for one in zip(seen.calibration, told, strict=True)])
    write_card(target, {"sha256": file_sha256(target)})
    whole = load_model(target)
    answers = [(plain(one), whole(one)) for one in seen.held_out]
    spots = [(_spots(before), _spots(after)) for before, after in answers]
    return apart(spots, [(before.values, after.values) for before, after in answers]), len(seen.calibration)


def _plain_network(model: Path) -> CentreNetwork:
    """The float network, which needs no card of its own."""
    with tempfile.TemporaryDirectory() as scratch:
        copy = Path(scratch) / model.name
        shutil.copy(model, copy)
        write_card(copy, {"sha256": file_sha256(copy)})
        return load_model(copy)


def _spots(maps: CentreMaps) -> list[Spot]:
    found = peaks(maps, least_confidence=LEAST_CONFIDENCE, most=12)
    return [Spot(at_px=(one.u_px, one.v_px), reach_px=REACH_PX, confidence=one.confidence) for one in found]


def _boxes(opened: OpenModel, target: Path, images: Iterable[BgrImage]) -> tuple[Apart, int]:
    """A network of Ultralytics': calibrated on whole frames, its boxes compared."""
    from dnb_edge.train.quantise_file import quantise_boxes  # noqa: PLC0415 needs the extra

    plain = UltralyticsDetector(opened)
    pictures = list(images)
    _check_enough(len(pictures), "pictures")
    pictures = [pictures[number] for number in evenly(len(pictures), MOST_PICTURES)]
    layout = plain.layout
    inputs = [
        prepare(image, letterbox(layout, image.shape[1], image.shape[0]), layout.dtype)
        for number, image in enumerate(pictures, 1)
        if number % HELD_OUT_EVERY
    ]
    quantise_boxes(opened.path, target, inputs)
    whole = UltralyticsDetector(open_model(target))
    held_out = pictures[HELD_OUT_EVERY - 1 :: HELD_OUT_EVERY]
    return apart([(_box_spots(plain.boxes(image)), _box_spots(whole.boxes(image))) for image in held_out]), len(inputs)


def _box_spots(boxes: Boxes) -> list[Spot]:
    rows = zip(boxes.centres_px.tolist(), boxes.sizes_px.tolist(), boxes.confidences.tolist(), strict=True)
    return [Spot(at_px=(u, v), reach_px=0.5 * max(size), confidence=confidence) for (u, v), size, confidence in rows]


def _sizes_and_times(plain: Path, whole: Path) -> dict[str, Any]:
    """Bytes of both files, and the times of their passes on one thread, in turns."""
    sizes = CentreDetectorSettings()
    window_px = (sizes.window_px, sizes.window_px)
    full_px = (sizes.whole_width_px, round(sizes.whole_width_px * 9 / 16 / 16) * 16)
    passes = [
        passes_of(open_model(one), threads=1, window_px=window_px, full_frame_px=full_px) for one in (plain, whole)
    ]
    timings = in_turns([one for both in passes for one in both], TURNS)
    count = len(passes[0])
    return {
        "float_bytes": plain.stat().st_size,
        "int8_bytes": whole.stat().st_size,
        "times": [
            {
                "pass": before.name,
                "input": [before.width_px, before.height_px],
                "float_p50_ms": before.p50_ms,
                "int8_p50_ms": after.p50_ms,
                "float_cpu_ms": before.cpu_p50_ms,
                "int8_cpu_ms": after.cpu_p50_ms,
            }
            for before, after in zip(timings[:count], timings[count:], strict=True)
        ],
    }


def _card(model: Path, work: Path, target: Path, *, footage: str, used: int, told: dict[str, Any]) -> dict[str, Any]:
    """What the int8 file is and how it was made; its licence is the float network's."""
    return {
        "name": target.stem,
        "sha256": file_sha256(work),
        "bytes": work.stat().st_size,
        "quantisation": "static int8, QDQ, U8S8, per channel, MinMax",
        "calibration": {"footage": Path(footage).name, "inputs": used},
        "float": {"name": model.name, "sha256": file_sha256(model)},
        "packages": {name: version(name) for name in ("onnx", "onnxruntime", "numpy")},
        "comparison": told,
    }


def _print(target: Path, told: dict[str, Any]) -> None:
    typer.echo(f"{target}: {told['int8_bytes'] / 1e3:.0f} kB, float {told['float_bytes'] / 1e3:.0f} kB")
    typer.echo(
        f"{told['inputs']} held-out inputs, {told['finds']} finds of float: {told['lost']} lost, {told['new']} new"
    )
    if told["moved_p95_px"] is not None:
        moved, confidence = told["moved_p95_px"], told["confidence_largest"]
        typer.echo(f"common finds: moved by {moved:.2f} px (p95), confidence by {confidence:.3f} at most")
    if told["output_largest"] is not None:
        typer.echo(f"raw output: largest difference {told['output_largest']:.3f}, mean {told['output_mean']:.4f}")
    for one in told["times"]:
        typer.echo(
            f"{one['pass'].replace('_', ' ')}: {one['int8_p50_ms']:.3f} ms, float {one['float_p50_ms']:.3f} ms "
            f"(processor time {one['int8_cpu_ms']:.3f} and {one['float_cpu_ms']:.3f} ms)"
        )
