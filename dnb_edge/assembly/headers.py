"""What a recording says about itself: the configuration, the files that decide what is measured, who drives."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from dnb_edge import wire
from dnb_edge.assembly.setups import Assembly
from dnb_edge.config.paths import names_a_file
from dnb_edge.config.schema import Config
from dnb_edge.detect.onnx import default_model_path
from dnb_edge.errors import InputError
from dnb_edge.record.header import RunHeader, software_versions
from dnb_edge.record.identity import identity_of
from dnb_edge.values import Clock, EntryInfo, SourceInfo


def make_header(config: Config, assembly: Assembly, info: SourceInfo, further: Sequence[SourceInfo] = ()) -> RunHeader:
    """What the recording says about itself: all that is needed to score it again, and where it came from."""
    monotonic = info.clock is Clock.MONOTONIC
    entry, inputs = make_entry(config), _inputs(config)
    return RunHeader(
        name=entry.name,
        entry=entry,
        session=config.session,
        identity=identity_of(assembly.setup).to_dict(),
        setup={
            "core": assembly.setup.to_dict(),
            "calibration": wire.to_dict(assembly.calibration) | {"sigma_m": assembly.view_sigma_m},
            "sha256": {_name(path, inputs): _sha256(path) for path in inputs},
        },
        config=plain_config(config),
        source=info,
        further_sources=tuple(further),
        versions=software_versions(),
        wall_offset_ns=time.time_ns() - time.monotonic_ns() if monotonic else None,
    )


def make_entry(config: Config) -> EntryInfo:
    """Who drives, with the hash of the checkpoint. Raises `InputError` naming the file where that cannot be read."""
    path = config.entry.checkpoint
    if path is None:
        return config.driver
    check_checkpoint(config)
    try:
        return replace(config.driver, checkpoint_sha256=_sha256(path))
    except OSError as error:
        raise InputError(f"entry.checkpoint: {path} cannot be read: {error.strerror}") from error


def check_checkpoint(config: Config) -> None:
    """Raises `InputError` where the entry's checkpoint is no file: found out before a run, recorded or not, begins."""
    path = config.entry.checkpoint
    if path is not None and not path.is_file():
        raise InputError(f"entry.checkpoint: there is no file {path}: give the network's weights, or leave it out")


def _inputs(config: Config) -> list[Path]:
    """The files that decide what the run measures."""
    views = (config.view, *(camera.view for camera in config.further_cameras))
    model = config.detector.model
    if model is None and config.detector.kind != "markers":
        model = default_model_path()
    pairs = [
        path
        for view in views
        for path in (view.calibration, view.keypoints, view.keypoints_camera, view.keypoints_twin)
    ]
    rules = Path(config.rules) if names_a_file(config.rules) else None
    paths = (config.track.file, config.track.image, *pairs, model, rules)
    return [path for path in paths if path is not None]


def _name(path: Path, inputs: Sequence[Path]) -> str:
    """What an input is called: its file's name, with its folder's where another input has the same."""
    same = sum(other.name == path.name for other in set(inputs))
    return path.name if same == 1 else f"{path.parent.name}/{path.name}"


def _sha256(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def plain_config(config: Config) -> dict[str, Any]:
    """The configuration in force as plain JSON types."""
    plain: dict[str, Any] = json.loads(config.model_dump_json())
    return plain
