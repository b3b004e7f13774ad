"""What an ONNX file exported by Ultralytics says about itself.

Knows the metadata that the export writes and checks it against the network's input and a trial run; nothing of frames or
boxes. The keys are those of Ultralytics 8.0 to 8.4 (`yolo export format=onnx`); their values are Python literals as text.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dnb_edge.detect.onnx import OpenModel
from dnb_edge.errors import InputError, WorkError

TASKS = ("detect", "obb")
"""The heads that give one box a car."""

_AGAIN = "export it again with `yolo export format=onnx`"
_KINDS: dict[str, np.dtype[Any]] = {"tensor(float)": np.dtype(np.float32), "tensor(float16)": np.dtype(np.float16)}
_LARGEST_SIDE_PX = 8192


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """How to feed the network and how to read its answer."""

    task: str
    """`detect`: upright boxes; `obb`: rotated ones."""
    names: tuple[str, ...]
    """Name of each class, by its number."""
    height_px: int
    """Height of the network's input; with `dynamic`, of the largest one."""
    width_px: int
    stride_px: int
    """Sides of the input are multiples of this."""
    dynamic: bool
    """True where the input may be smaller than `width_px` by `height_px`."""
    nms_inside: bool
    """True where the answer is a list of boxes, (1, n, 6 or 7); False where it is all candidates, (1, 4 + classes (+ 1), n)."""
    dtype: np.dtype[Any]
    """Type of the input's numbers."""

    @property
    def columns(self) -> int:
        """Numbers a box in the answer."""
        angle = 1 if self.task == "obb" else 0
        return (6 if self.nms_inside else 4 + len(self.names)) + angle


def is_ultralytics(metadata: Mapping[str, str]) -> bool:
    """True where the file's metadata says that Ultralytics exported it."""
    return metadata.get("author") == "Ultralytics" or metadata.get("description", "").startswith("Ultralytics")


def read_layout(model: OpenModel) -> Layout:
    """The layout that the file's metadata tells, confirmed by its inputs and a run on an empty picture.

    Raises InputError, naming the file and what to do, for metadata that is missing or cannot be understood, another task than
    `detect` or `obb`, and inputs or outputs that do not fit the metadata.
    """
    path, metadata = model.path, model.metadata
    if not is_ultralytics(metadata):
        raise InputError(f"{path}: its metadata does not say that Ultralytics exported it; {_AGAIN}")
    task = _field(metadata, "task", path)
    if task not in TASKS:
        raise InputError(
            f"{path}: a model for the task '{task}' gives no boxes of cars; use one for {' or '.join(TASKS)}"
        )
    names = _names(metadata, path)
    height_px, width_px = _size(metadata, path)
    stride_px = _literal(metadata, "stride", path)
    if type(stride_px) is not int or not 1 <= stride_px <= 1024:
        raise InputError(f"{path}: metadata 'stride' is {stride_px!r}, not a whole number of pixels; {_AGAIN}")
    dtype, dynamic = _input(model, height_px, width_px)
    layout = Layout(
        task=task,
        names=names,
        height_px=height_px,
        width_px=width_px,
        stride_px=stride_px,
        dynamic=dynamic,
        nms_inside=_nms_inside(metadata, path),
        dtype=dtype,
    )
    _try_out(model, layout)
    return layout


def _field(metadata: Mapping[str, str], key: str, path: Path) -> str:
    if key not in metadata:
        raise InputError(f"{path}: metadata '{key}' is missing; {_AGAIN}")
    return metadata[key]


def _literal(metadata: Mapping[str, str], key: str, path: Path) -> Any:
    text = _field(metadata, key, path)
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError) as fault:
        raise InputError(f"{path}: metadata '{key}' cannot be understood ({text[:40]!r}); {_AGAIN}") from fault


def _names(metadata: Mapping[str, str], path: Path) -> tuple[str, ...]:
    names = _literal(metadata, "names", path)
    if isinstance(names, list | tuple):
        names = dict(enumerate(names))
    if not isinstance(names, dict) or not names or sorted(map(repr, names)) != sorted(map(repr, range(len(names)))):
        raise InputError(f"{path}: metadata 'names' does not name classes 0, 1, 2 ...; {_AGAIN}")
    return tuple(str(names[number]) for number in range(len(names)))


def _size(metadata: Mapping[str, str], path: Path) -> tuple[int, int]:
    """Height and width of the input."""
    size = _literal(metadata, "imgsz", path)
    sides = [size, size] if type(size) is int else size
    if (
        not isinstance(sides, list | tuple)
        or len(sides) != 2
        or not all(type(side) is int and 1 <= side <= _LARGEST_SIDE_PX for side in sides)
    ):
        raise InputError(f"{path}: metadata 'imgsz' is {size!r}, not a height and a width in pixels; {_AGAIN}")
    return sides[0], sides[1]


def _nms_inside(metadata: Mapping[str, str], path: Path) -> bool:
    """True for an end-to-end head or with `nms=True`; exports from before there was either have neither key."""
    end2end = _literal(metadata, "end2end", path) if "end2end" in metadata else False
    arguments = _literal(metadata, "args", path) if "args" in metadata else {}
    return bool(end2end) or (isinstance(arguments, dict) and bool(arguments.get("nms")))


def _input(model: OpenModel, height_px: int, width_px: int) -> tuple[np.dtype[Any], bool]:
    """Type of the input's numbers, and whether its size is open."""
    path = model.path
    if len(model.inputs) != 1 or len(model.outputs) != 1 or len(model.inputs[0].shape) != 4:
        raise InputError(
            f"{path}: needs one picture (1, 3, height, width) as input and one output, as a detect or obb export has; {_AGAIN}"
        )
    (given,) = model.inputs
    if given.kind not in _KINDS:
        raise InputError(f"{path}: its input is of {given.kind}, not of floats; {_AGAIN}")
    batch, channels, *sides = given.shape
    if isinstance(batch, int) and batch != 1:
        raise InputError(f"{path}: exported for batches of {batch} pictures; {_AGAIN} and batch=1")
    if isinstance(channels, int) and channels != 3:
        raise InputError(f"{path}: wants pictures of {channels} channels; choose a model for colour pictures")
    wrong = [side for side, told in zip(sides, (height_px, width_px), strict=True) if side != told]
    if any(isinstance(side, int) for side in wrong):
        raise InputError(f"{path}: its input is {sides}, its metadata 'imgsz' says {[height_px, width_px]}; {_AGAIN}")
    return _KINDS[given.kind], bool(wrong)


def _try_out(model: OpenModel, layout: Layout) -> None:
    """Runs the network once, since only its answer tells its true shape."""
    path = model.path
    try:
        answer = model.run(np.full((1, 3, layout.height_px, layout.width_px), 114 / 255, dtype=layout.dtype))
    except WorkError as fault:
        raise InputError(f"{fault}; {_AGAIN}") from fault
    axis = 2 if layout.nms_inside else 1
    if answer.ndim != 3 or answer.shape[0] != 1 or answer.shape[axis] != layout.columns:
        wanted = f"(1, n, {layout.columns})" if layout.nms_inside else f"(1, {layout.columns}, n)"
        inside = "with" if layout.nms_inside else "without"
        raise InputError(
            f"{path}: its output is {answer.shape}, but its metadata ({layout.task}, {len(layout.names)} classes, "
            f"{inside} NMS) means {wanted}; {_AGAIN}"
        )
