"""Writing a calibration and the picture of its view: what every verb of `calibrate` that makes one does at its end."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import cv2

from dnb_edge.config.calibration_file import calibration_file
from dnb_edge.errors import InputError
from dnb_edge.report.files import write_whole
from dnb_edge.values import BgrImage
from dnb_edge.view.calibration import Calibration, InputFile


def check_calibration_path(path: Path) -> None:
    """Raises `InputError` where `path` is no name for a calibration file. Call it before the work."""
    if path.suffix.lower() not in (".yaml", ".yml"):
        raise InputError(f"--out {path}: the name of a calibration file must end in .yaml")
    if not path.parent.is_dir():
        raise InputError(f"--out {path}: there is no directory {path.parent}: make it first")
    if path.is_dir():
        raise InputError(f"--out {path}: is a directory: name a file")


def check_places(written: Mapping[str, Path | None], *, reads: Iterable[Path | None]) -> None:
    """Raises `InputError` where a file would be written over one that is read, or over another one.

    `written`: paths by their options. Call it before the work. The picture kept beside `--out` counts as written; to read it,
    as when an old calibration is made anew, is right.
    """
    sources = {path.resolve() for path in reads if path is not None}
    taken: dict[Path, str] = {}
    out = written.get("--out")
    if out is not None:
        taken[reference_path(out).resolve()] = "--out's picture of the view"
    for option, path in written.items():
        if path is None:
            continue
        place = path.resolve()
        if place in sources:
            raise InputError(f"{option} {path}: is read, too, and would be lost: name another file")
        if place in taken:
            raise InputError(f"{option} {path}: {taken[place]} goes there, too: name another file")
        taken[place] = option


def reference_path(out: Path) -> Path:
    """Where the picture of the view is kept: beside its calibration file."""
    return out.with_name(f"{out.stem}.reference.png")


def save_calibration(path: Path, calibration: Calibration, reference: BgrImage | None = None) -> Calibration:
    """Writes the calibration file and, beside it, the picture of the view; returns what was written.

    The date is set to now. Raises `InputError` or `WorkError` as `write_whole` does.
    """
    check_calibration_path(path)
    saved = replace(calibration, made_at=datetime.now().astimezone().isoformat(timespec="seconds"))
    if reference is not None:
        ok, data = cv2.imencode(".png", reference)
        assert ok, "OpenCV encodes any 8-bit picture as PNG"
        beside = reference_path(path)
        write_whole(beside, data.tobytes())
        saved = replace(saved, reference=InputFile(name=beside.name, sha256=hashlib.sha256(data.tobytes()).hexdigest()))
    write_whole(path, calibration_file(saved))
    return saved


def input_file(path: Path) -> InputFile:
    """The name and SHA-256 of a file that a calibration is made from. Raises `InputError` where it cannot be read."""
    try:
        return InputFile(name=path.name, sha256=hashlib.sha256(path.read_bytes()).hexdigest())
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}): check the path") from error
