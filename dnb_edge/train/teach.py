"""Teaching the detector a car: labels, a look at them, fine-tuning, int8, before and after, a model that `run` takes.

Knows the order of the work and the files; the steps are in `teach_*`. Imports PyTorch only where it learns, so that wrong input
is told without it. Nothing appears in the output folder before the new model has been found no worse than the old one.
"""

from __future__ import annotations

import importlib.util
import os
import platform
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.detect.onnx import CentreNetwork, load_model
from dnb_edge.errors import InputError, WorkError
from dnb_edge.report.files import write_whole
from dnb_edge.train.card import file_sha256, write_card
from dnb_edge.train.teach_compare import Figures, HeldOutDrive, figures, worse
from dnb_edge.train.teach_drive import Drive
from dnb_edge.train.teach_labels import (
    HELD_OUT_SHARE,
    LEAST_LABELS,
    LabelledPicture,
    count_cars,
    evenly,
    split_stills,
)
from dnb_edge.train.teach_points import DriveLabels
from dnb_edge.train.teach_sheet import LabelPlace, draw_sheet, shown_places, without_rejected

if TYPE_CHECKING:
    from dnb_edge.train.teach_tune import Tuned

MOST_BYTES = 800_000_000
"""Pictures kept in memory, all together, before compression."""
_MOST_LEARNT = 240
_MOST_HELD_OUT = 90
_DRAWN = 256
_CALIBRATION = 96

Tell = Callable[[str, float], None]
"""Hears the name of a step and the share of it that is done."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TeachSettings:
    """How to teach."""

    minutes: float = 14.0
    iterations: int = 6000
    seed: int = 1
    drawn: int = _DRAWN
    """Drawn scenes that are mixed in against forgetting."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Material:
    """What there is to learn from and to compare on."""

    learn: tuple[LabelledPicture, ...]
    held_out: tuple[LabelledPicture, ...]
    drives: tuple[HeldOutDrive, ...] = ()
    sources: tuple[str, ...] = ()
    """Names of the files, for the card."""


def check_torch() -> None:
    """Raises InputError where the extra `train` is not installed."""
    missing = [name for name in ("torch", "onnx") if importlib.util.find_spec(name) is None]
    if missing:
        raise InputError(f"teaching needs {missing[0]}: pip install 'dnb-edge[train]'")


def check_base(base: Path) -> None:
    """Raises InputError where the model in `base` cannot be taught: no such model, or no weights of this kind of network."""
    from dnb_edge.train.weights import load_weights, weights_path  # noqa: PLC0415 PyTorch is loaded only where it learns

    load_model(base)
    load_weights(weights_path(base))


def check_out(out: Path) -> None:
    """Raises InputError where the folder `out` can neither be made nor be written to; makes nothing."""
    nearest = next(place for place in (out, *out.absolute().parents) if place.exists())
    if not nearest.is_dir() or not os.access(nearest, os.W_OK | os.X_OK):
        raise InputError(f"{out}: no folder can be made or written to there: choose another --out")


def drive_material(labels: DriveLabels, drive: Drive, *, most_bytes: int = MOST_BYTES) -> Material:
    """Pictures of a labelled drive: the last fifth by time is held out.

    Raises InputError where too little of the drive could be labelled on either side.
    """
    numbers = sorted(labels.cars)
    border_s = (1.0 - HELD_OUT_SHARE) * labels.duration_s
    early = [number for number in numbers if labels.times_s[number] < border_s]
    late = [number for number in numbers if labels.times_s[number] >= border_s]
    room = max(2 * LEAST_LABELS, most_bytes // labels.floor.nbytes)
    most_late = min(_MOST_HELD_OUT, max(LEAST_LABELS, room // 4))
    early = [early[index] for index in evenly(len(early), min(_MOST_LEARNT, room - most_late))]
    late = [late[index] for index in evenly(len(late), most_late)]
    if not late or not early:
        when = "first four fifths" if not early else "last fifth"
        raise InputError(f"{labels.name}: no car was found in its {when}: record a drive in which the car keeps moving")
    wanted = {*early, *late}
    pictures: dict[int, LabelledPicture] = {}
    for shot in drive():
        if shot.number in wanted:
            pictures[shot.number] = LabelledPicture(
                name=f"{labels.name} at {shot.t_s:.2f} s",
                bgr=shot.bgr,
                background=labels.floor,
                cars=labels.cars[shot.number],
                number=shot.number,
                lean=labels.lean,
            )
    held_out = tuple(pictures[number] for number in late)
    first = min(number for number, t_s in labels.times_s.items() if t_s >= border_s)
    end = HeldOutDrive(
        drive=drive, first=first, cars={number: labels.cars[number] for number in late}, lean=labels.lean
    )
    return Material(
        learn=tuple(pictures[number] for number in early), held_out=held_out, drives=(end,), sources=(labels.name,)
    )


def still_material(pictures: Sequence[LabelledPicture], seed: int, source: str) -> Material:
    """Hand-labelled pictures: a fifth, drawn by the seed, is held out."""
    learn, held_out = split_stills(pictures, seed)
    return Material(learn=tuple(learn), held_out=tuple(held_out), sources=(source,))


def joined(materials: Sequence[Material]) -> Material:
    """All of several materials."""
    return Material(
        learn=tuple(one for material in materials for one in material.learn),
        held_out=tuple(one for material in materials for one in material.held_out),
        drives=tuple(one for material in materials for one in material.drives),
        sources=tuple(one for material in materials for one in material.sources),
    )


def check_enough(material: Material) -> None:
    """Raises InputError, naming the sources, where there are too few labels to learn from or none to compare on."""
    names = ", ".join(material.sources)
    count = count_cars(material.learn) + count_cars(material.held_out)
    if count < LEAST_LABELS:
        raise InputError(
            f"{names}: {count} labelled cars are too few to teach from: at least {LEAST_LABELS} are needed"
        )
    if not count_cars(material.learn) or not count_cars(material.held_out):
        raise InputError(f"{names}: all labels are on one side of the split into learning and comparing: add more")


def write_sheet(material: Material, path: Path) -> list[LabelPlace]:
    """Write the contact sheet of all labels; which labels it shows, in order. Raises InputError where it cannot be written."""
    pictures = [*material.learn, *material.held_out]
    shown = shown_places(pictures)
    made, encoded = cv2.imencode(path.suffix, draw_sheet(pictures, shown))
    assert made, "what was drawn can be encoded"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise InputError(f"{path.parent}: cannot be made ({fault.strerror}): choose another --out") from fault
    write_whole(path, encoded.tobytes())
    return shown


def rejecting(material: Material, shown: Sequence[LabelPlace], rejected: set[int]) -> Material:
    """The material without the rejected labels and those that they stand for."""
    if not rejected:
        return material
    kept = without_rejected([*material.learn, *material.held_out], shown, rejected)
    learn, held_out = tuple(kept[: len(material.learn)]), tuple(kept[len(material.learn) :])
    drives, first = [], 0
    for drive in material.drives:  # the held-out pictures of drives come first, drive by drive
        own = [one for one in held_out if one.number is not None][first : first + len(drive.cars)]
        first += len(drive.cars)
        drives.append(replace(drive, cars={one.number: one.cars for one in own if one.number is not None}))
    return replace(material, learn=learn, held_out=held_out, drives=tuple(drives))


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What teaching gave."""

    model: Path | None
    """The new model; None where it was worse and so not kept."""
    before: Figures
    after: Figures
    worse: list[str] = field(default_factory=list)
    iterations: int = 0
    seconds: float = 0.0
    interrupted: bool = False


def teach(
    material: Material,
    base: Path,
    out: Path,
    *,
    name: str,
    settings: TeachSettings,
    command: str,
    force: bool = False,
    tell: Tell = lambda _step, _share: None,
) -> Outcome:
    """Fine-tune the model in `base` on `material` and write it to `out` as NAME.onnx, .json and .weights.npz.

    A model that is worse on the held-out pictures is not written, unless `force`. Raises InputError for a base without weights.
    """
    from dnb_edge.train.quantise import quantise  # noqa: PLC0415 PyTorch is loaded only where it learns
    from dnb_edge.train.teach_tune import TuneSettings, fine_tune  # noqa: PLC0415
    from dnb_edge.train.teach_windows import WindowMaker, drawn_samples  # noqa: PLC0415
    from dnb_edge.train.weights import load_weights, save_weights, weights_path  # noqa: PLC0415

    present = load_model(base)
    network = load_weights(weights_path(base))
    tell("Measuring the present model", 0.0)
    before = figures(present, material.held_out, material.drives)
    tell("Drawing scenes against forgetting", 0.0)
    maker = WindowMaker(pictures=material.learn, drawn=drawn_samples(settings.drawn, settings.seed))
    tuned = fine_tune(
        network,
        maker,
        TuneSettings(minutes=settings.minutes, iterations=settings.iterations, seed=settings.seed),
        lambda share: tell("Learning", share),
    )
    tell("Quantising", 0.0)
    calibration = maker.batch(_CALIBRATION, np.random.default_rng([settings.seed, 93])).inputs
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out, prefix=".teach-") as folder:
        path = Path(folder) / f"{name}.onnx"
        quantise(tuned.network, path, [_as_input(one) for one in calibration])
        save_weights(weights_path(path), tuned.network)
        write_card(path, {"sha256": file_sha256(path)})
        tell("Measuring the new model", 0.0)
        after = figures(load_model(path), material.held_out, material.drives)
        reasons = worse(before, after)
        outcome = Outcome(
            model=None if reasons and not force else out / path.name,
            before=before,
            after=after,
            worse=reasons,
            iterations=tuned.iterations,
            seconds=tuned.seconds,
            interrupted=tuned.interrupted,
        )
        if outcome.model is not None:
            card = taught_card(path, present, base, material, settings, tuned, command, outcome)
            write_card(path, card)
            _move(path, out)
    return outcome


def _as_input(window: NDArray[np.uint8]) -> NDArray[np.float32]:
    """A window (h, w, 4) as `quantise` calibrates on it: (1, 4, h, w) in 0..1."""
    return np.ascontiguousarray(window.transpose(2, 0, 1)[None], dtype=np.float32) / np.float32(255.0)


def _move(path: Path, out: Path) -> None:
    """Put the finished files in place; the model last, since its card tells what must lie beside it."""
    own = [file for file in path.parent.iterdir() if file.name.startswith(f"{path.stem}.")]
    files = sorted(own, key=lambda file: file.suffix == ".onnx")
    try:
        for file in files:
            file.replace(out / file.name)
    except OSError as fault:
        raise WorkError(f"{out}: the model cannot be put there ({fault.strerror}); nothing else was lost") from fault


def taught_card(
    path: Path,
    present: CentreNetwork,
    base: Path,
    material: Material,
    settings: TeachSettings,
    tuned: Tuned,
    command: str,
    outcome: Outcome,
) -> dict[str, Any]:
    """The card of a taught model: the base's, with what is its own."""
    own = {
        "name": path.stem,
        "sha256": file_sha256(path),
        "bytes": path.stat().st_size,
        "licence": "GPL-3.0-or-later, as the model that it was taught from; the pictures that taught it are their owner's",
        "base": {"name": present.card.get("name", base.stem), "sha256": file_sha256(base)},
        "quantisation": "static int8, QDQ, U8S8, per channel, MinMax on windows of the user's pictures and drawn ones",
        "seed": settings.seed,
        "iterations": tuned.iterations,
        "samples": len(material.learn),
        "command": command,
        "data": {
            "sources": list(material.sources),
            "pictures_learnt": len(material.learn),
            "cars_learnt": count_cars(material.learn),
            "pictures_held_out": len(material.held_out),
            "cars_held_out": count_cars(material.held_out),
            "drawn_scenes": settings.drawn,
        },
        "packages": {
            name: version(name) for name in ("torch", "onnx", "onnxruntime", "numpy", "opencv-python-headless")
        },
        "python": platform.python_version(),
        "metrics": {"before": asdict(outcome.before), "after": asdict(outcome.after), "worse": outcome.worse},
    }
    kept = {key: value for key, value in present.card.items() if key not in {"history", "metrics"}}
    return {**kept, **own}
