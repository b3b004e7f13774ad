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

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError, WorkError

os.environ["ORT_DISABLE_TELEMETRY"] = "1"  # read at import by builds that report home

import onnxruntime as ort

FloatArray = NDArray[np.float32]

HEADS = ("heat", "offset", "size", "heading", "spread")
"""The heads in the order of their channels; `dnb_edge.train.network` says what they mean."""
HEAD_CHANNELS: dict[str, tuple[int, ...]] = {
    "heat": (1,),
    "offset": (2,),
    "size": (1,),
    "heading": (2, 4),
    "spread": (1,),
}
"""Channels that each head may have, (n, channels, h / 4, w / 4) where it is an output by its own name."""
MAPS_CHANNELS = (7, 9)
"""Channels that the one output `maps` may have, which holds all heads."""
PICTURE_CHANNELS = 4
"""Blue, green, red, difference from the background."""
LEAN_CHANNELS = 2
STRIDE_PX = 4
SIDE_MULTIPLE_PX = 16
"""Heights and widths of inputs are multiples of this."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CentreMaps:
    """The network's answer over its grid of cells of 4x4 input px."""

    values: FloatArray
    """All heads, (7 or 9, rows, columns), in the order of the properties below."""

    @property
    def heat(self) -> FloatArray:
        """Logit that a car's ground point lies in the cell, (rows, columns)."""
        heat: FloatArray = self.values[0]
        return heat

    @property
    def offset(self) -> FloatArray:
        """From the cell's centre to the ground point, (2, rows, columns): (u, v) in cells."""
        return self.values[1:3]

    @property
    def size(self) -> FloatArray:
        """Log of the car's length over 32 input px, (rows, columns)."""
        size: FloatArray = self.values[3]
        return size

    @property
    def heading(self) -> FloatArray:
        """Of the heading a, v up, (2 or 4, rows, columns): cos a, sin a; or cos 2a, sin 2a, cos a, sin a."""
        return self.values[4:-1]

    @property
    def spread(self) -> FloatArray:
        """Log of one standard deviation of the ground point along an axis, in cells, (rows, columns)."""
        spread: FloatArray = self.values[-1]
        return spread


class CentreNetwork:
    """A loaded network. Not shared between threads."""

    def __init__(self, session: ort.InferenceSession, card: dict[str, Any]) -> None:
        self._session = session
        given = session.get_inputs()[0]
        self._input = given.name
        self._takes_bytes = given.type == "tensor(uint8)"
        self._takes_many = not isinstance(given.shape[0], int)
        self.takes_lean = given.shape[3 if self._takes_bytes else 1] == PICTURE_CHANNELS + LEAN_CHANNELS
        """True where the network is told how things lean: see `dnb_edge.detect.lean`."""
        joined = [output.name for output in session.get_outputs()] == ["maps"]
        self._outputs = ["maps"] if joined else list(HEADS)
        self.card = card
        """The model's card, as read."""

    def __call__(self, pixels: NDArray[np.uint8]) -> CentreMaps:
        """Maps for `pixels`, (h, w, 4) uint8: blue, green, red, difference from the background; h, w multiples of 16."""
        return self.many(pixels[None])[0]

    def many(self, pixels: NDArray[np.uint8], *, leans: NDArray[np.uint8] | None = None) -> list[CentreMaps]:
        """Maps for each of `pixels`, (n, h, w, 4) uint8. Raises WorkError where the network fails on them.

        `leans` (n, h, w, 2) uint8 tell a network that takes them how things lean; None where that is not known.
        """
        if (
            pixels.ndim != 4
            or pixels.shape[3] != PICTURE_CHANNELS
            or any(s % SIDE_MULTIPLE_PX for s in pixels.shape[1:3])
        ):
            raise ValueError(
                f"input of shape {pixels.shape}: needs 4 channels and sides that are multiples of {SIDE_MULTIPLE_PX}"
            )
        if self.takes_lean:
            pixels = _with_lean(pixels, leans)
        if self._takes_many:
            return [CentreMaps(values=values) for values in self._run(pixels)]
        return [CentreMaps(values=self._run(pixels[i : i + 1])[0]) for i in range(len(pixels))]

    def _run(self, pixels: NDArray[np.uint8]) -> FloatArray:
        tensor: NDArray[Any] = pixels
        if not self._takes_bytes:
            tensor = np.multiply(pixels.transpose(0, 3, 1, 2), np.float32(1 / 255.0), dtype=np.float32, order="C")
        try:
            heads = self._session.run(self._outputs, {self._input: tensor})
        except _RUNTIME_FAULTS as fault:
            raise WorkError(
                f"the detector's network failed on a {pixels.shape[2]}x{pixels.shape[1]} input: {_first_line(fault)}"
            ) from fault
        return heads[0] if len(heads) == 1 else np.concatenate(heads, axis=1)


def _with_lean(pixels: NDArray[np.uint8], leans: NDArray[np.uint8] | None) -> NDArray[np.uint8]:
    """The pictures (n, h, w, 4) with the lean's two channels behind; zeros, not known, where there are none."""
    count, height, width, _ = pixels.shape
    out = np.zeros((count, height, width, PICTURE_CHANNELS + LEAN_CHANNELS), dtype=np.uint8)
    for number in range(count):  # several times faster than numpy's own copying into every sixth byte
        parts = [pixels[number]] if leans is None else [pixels[number], leans[number]]
        channels = range(PICTURE_CHANNELS if leans is None else PICTURE_CHANNELS + LEAN_CHANNELS)
        cv2.mixChannels(parts, [out[number]], [end for channel in channels for end in (channel, channel)])
    return out


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
    except (ValueError, RecursionError) as fault:
        raise InputError(f"{card_path}: not a model card in JSON ({fault}); install the model again") from fault
    if not isinstance(card, dict) or not isinstance(card.get("sha256"), str):
        raise InputError(f"{card_path}: the card has no 'sha256' of the model; install the model again")
    return card


def _check_shapes(session: ort.InferenceSession, path: Path) -> None:
    inputs, outputs = session.get_inputs(), {output.name: output.shape for output in session.get_outputs()}
    if not (len(inputs) == 1 and _fits_input(inputs[0].shape, inputs[0].type) and _fits_outputs(outputs)):
        wanted = ", ".join(f"{name} ({' or '.join(map(str, counts))})" for name, counts in HEAD_CHANNELS.items())
        raise InputError(
            f"{path}: not a centre network: needs one input, uint8 (n, h, w, 4 or 6) or float (n, 4 or 6, h, w), and the "
            f"outputs {wanted}, or one output maps ({' or '.join(map(str, MAPS_CHANNELS))}); choose another model"
        )


def _fits_input(shape: list[int | str | None], kind: str) -> bool:
    channel = {"tensor(uint8)": 3, "tensor(float)": 1}.get(kind)
    return channel is not None and len(shape) == 4 and shape[channel] in (4, 6)


def _fits_outputs(outputs: dict[str, list[int | str | None]]) -> bool:
    wanted = {"maps": MAPS_CHANNELS} if list(outputs) == ["maps"] else HEAD_CHANNELS
    return all(
        name in outputs and len(outputs[name]) == 4 and outputs[name][1] in counts for name, counts in wanted.items()
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
    return Path(__file__).parent / "models" / "dnb-edge-centre-v2.onnx"


def load_builtin_model(*, threads: int = 1) -> CentreNetwork:
    """The shipped network. Raises InputError where the installation is damaged."""
    return load_model(default_model_path(), threads=threads)
