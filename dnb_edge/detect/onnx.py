"""Loads a centre network, or any other one, and runs it: the only place that imports ONNX Runtime.

Knows files, checksums and tensors; nothing of frames, windows or backgrounds. A model is two files: NAME.onnx and its card
NAME.json, whose `sha256` must be the model's, since one flipped weight byte loads without an error and answers wrongly.
"""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError, WorkError

os.environ["ORT_DISABLE_TELEMETRY"] = "1"  # read at import by builds that report home

import onnxruntime as ort

FloatArray = NDArray[np.float32]

OUTPUT_CHANNELS = {"heat": 1, "offset": 2, "size": 1, "heading": 2, "spread": 1}
"""Name and channels of each output, (1, channels, h / 4, w / 4); `dnb_edge.train.network` says what they mean."""
STRIDE_PX = 4
SIDE_MULTIPLE_PX = 16
"""Heights and widths of inputs are multiples of this."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CentreMaps:
    """The network's answer over its grid of cells of 4x4 input px."""

    heat: FloatArray
    """Logit that a car's ground point lies in the cell, (rows, columns)."""
    offset: FloatArray
    """From the cell's centre to the ground point, (2, rows, columns): (u, v) in cells."""
    size: FloatArray
    """Log of the car's length over 32 input px, (rows, columns)."""
    heading: FloatArray
    """Cosine and sine of the heading, v up, (2, rows, columns)."""
    spread: FloatArray
    """Log of one standard deviation of the ground point along an axis, in cells, (rows, columns)."""


class CentreNetwork:
    """A loaded network. Not shared between threads."""

    def __init__(self, session: ort.InferenceSession, card: dict[str, Any]) -> None:
        self._session = session
        self._input = session.get_inputs()[0].name
        self._outputs = list(OUTPUT_CHANNELS)
        self.card = card
        """The model's card, as read."""

    def __call__(self, pixels: NDArray[np.uint8]) -> CentreMaps:
        """Maps for `pixels`, (h, w, 4) uint8: blue, green, red, difference from the background; h, w multiples of 16."""
        height, width, channels = pixels.shape
        if channels != 4 or height % SIDE_MULTIPLE_PX or width % SIDE_MULTIPLE_PX:
            raise ValueError(
                f"input of shape {pixels.shape}: needs 4 channels and sides that are multiples of {SIDE_MULTIPLE_PX}"
            )
        tensor = np.multiply(pixels.transpose(2, 0, 1), np.float32(1 / 255.0), dtype=np.float32)[None]
        try:
            heat, offset, size, heading, spread = self._session.run(self._outputs, {self._input: tensor})
        except _RUNTIME_FAULTS as fault:
            raise WorkError(
                f"the detector's network failed on a {width}x{height} input: {_first_line(fault)}"
            ) from fault
        return CentreMaps(heat=heat[0, 0], offset=offset[0], size=size[0, 0], heading=heading[0], spread=spread[0, 0])


_RUNTIME_FAULTS = (
    ort.capi.onnxruntime_pybind11_state.Fail,
    ort.capi.onnxruntime_pybind11_state.InvalidArgument,
    ort.capi.onnxruntime_pybind11_state.InvalidGraph,
    ort.capi.onnxruntime_pybind11_state.InvalidProtobuf,
    ort.capi.onnxruntime_pybind11_state.NoSuchFile,
    ort.capi.onnxruntime_pybind11_state.NotImplemented,
    ort.capi.onnxruntime_pybind11_state.RuntimeException,
)


def _first_line(fault: Exception) -> str:
    return str(fault).strip().splitlines()[0] if str(fault).strip() else type(fault).__name__


def session_options(threads: int) -> ort.SessionOptions:
    """Options for `threads` intra-op threads that sleep, not spin, between frames."""
    options = ort.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.execution_mode = ort.ExecutionMode.ORT_SEQUENTIAL
    options.graph_optimization_level = ort.GraphOptimizationLevel.ORT_ENABLE_ALL
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 3
    return options


def _read_card(path: Path) -> dict[str, Any]:
    card_path = path.with_suffix(".json")
    try:
        card = json.loads(card_path.read_text(encoding="utf-8"))
    except OSError as fault:
        raise InputError(
            f"{card_path}: the model's card cannot be read ({fault.strerror}); put it beside {path.name}"
        ) from fault
    except ValueError as fault:
        raise InputError(f"{card_path}: not a model card in JSON ({fault}); install the model again") from fault
    if not isinstance(card, dict) or not isinstance(card.get("sha256"), str):
        raise InputError(f"{card_path}: the card has no 'sha256' of the model; install the model again")
    return card


def _check_shapes(session: ort.InferenceSession, path: Path) -> None:
    inputs, outputs = session.get_inputs(), {output.name: output.shape for output in session.get_outputs()}
    fits = (
        len(inputs) == 1 and len(inputs[0].shape) == 4 and inputs[0].shape[1] == 4 and inputs[0].type == "tensor(float)"
    )
    fits = fits and all(
        name in outputs and len(outputs[name]) == 4 and outputs[name][1] == channels
        for name, channels in OUTPUT_CHANNELS.items()
    )
    if not fits:
        wanted = ", ".join(f"{name} ({channels})" for name, channels in OUTPUT_CHANNELS.items())
        raise InputError(
            f"{path}: not a centre network: needs one float input of 4 channels and the outputs {wanted}; choose another model"
        )


def _read_model(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as fault:
        raise InputError(
            f"{path}: the model cannot be read ({fault.strerror}); give the path of a .onnx file"
        ) from fault


def _session(content: bytes, path: Path, threads: int) -> ort.InferenceSession:
    try:
        return ort.InferenceSession(content, session_options(threads), providers=["CPUExecutionProvider"])
    except _RUNTIME_FAULTS as fault:
        raise InputError(f"{path}: ONNX Runtime cannot load it ({_first_line(fault)}); choose another model") from fault


@dataclass(frozen=True, slots=True, kw_only=True)
class TensorInfo:
    """What a model says of one of its inputs or outputs."""

    name: str
    shape: tuple[int | str | None, ...]
    """Sides that are open when the model is loaded are a name or None."""
    kind: str
    """ONNX Runtime's name of the type, such as `tensor(float)`."""


class OpenModel:
    """A loaded ONNX file of any kind, whose metadata its user interprets. Not shared between threads."""

    def __init__(self, session: ort.InferenceSession, path: Path) -> None:
        self._session = session
        self.path = path
        self.inputs, self.outputs = (
            tuple(TensorInfo(name=one.name, shape=tuple(one.shape), kind=one.type) for one in ends)
            for ends in (session.get_inputs(), session.get_outputs())
        )
        self.metadata: dict[str, str] = dict(session.get_modelmeta().custom_metadata_map)
        """The file's own metadata, as text."""

    def run(self, tensor: NDArray[Any]) -> NDArray[Any]:
        """The first output for `tensor` as the first input. Raises WorkError where the network fails on it."""
        try:
            return np.asarray(self._session.run([self.outputs[0].name], {self.inputs[0].name: tensor})[0])
        except _RUNTIME_FAULTS as fault:
            raise WorkError(
                f"{self.path}: the network failed on an input of shape {tensor.shape}: {_first_line(fault)}"
            ) from fault


def open_model(path: Path, *, threads: int = 1) -> OpenModel:
    """The ONNX file at `path`, without a card or checksum. Raises InputError where it cannot be read or loaded."""
    return OpenModel(_session(_read_model(path), path, threads), path)


def load_model(path: Path, *, threads: int = 1) -> CentreNetwork:
    """The network in `path`, after its checksum has been compared with the card beside it.

    Raises InputError, naming the file and what to do, for a missing or unreadable model or card, a wrong or missing checksum,
    and a network of other inputs or outputs.
    """
    content = _read_model(path)
    card = _read_card(path)
    found = hashlib.sha256(content).hexdigest()
    if found != card["sha256"].lower():
        raise InputError(
            f"{path}: damaged: its SHA-256 begins {found[:12]}, its card says {card['sha256'][:12]}; install the model again"
        )
    session = _session(content, path, threads)
    _check_shapes(session, path)
    return CentreNetwork(session, card)


def default_model_path() -> Path:
    """The model that the package ships."""
    return Path(__file__).parent / "models" / "dnb-edge-centre-v1.onnx"


def load_builtin_model(*, threads: int = 1) -> CentreNetwork:
    """The shipped network. Raises InputError where the installation is damaged."""
    return load_model(default_model_path(), threads=threads)
