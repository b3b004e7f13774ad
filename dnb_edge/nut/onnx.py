"""Loads the model of a network under test and runs it: the only place of this room that imports ONNX Runtime.

Knows files, checksums and tensors; nothing of pictures or vehicles. Imports nothing that a fresh process would not need, since
a cold start is measured with it.
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError, WorkError

os.environ["ORT_DISABLE_TELEMETRY"] = "1"  # read at import by builds that report home

import onnxruntime as ort

VERSION: str = ort.__version__

_STATE = ort.capi.onnxruntime_pybind11_state
FAULTS: tuple[type[Exception], ...] = (
    _STATE.EPFail,
    _STATE.EngineError,
    _STATE.Fail,
    _STATE.InvalidArgument,
    _STATE.InvalidGraph,
    _STATE.InvalidProtobuf,
    _STATE.NoModel,
    _STATE.NoSuchFile,
    _STATE.NotImplemented,
    _STATE.RuntimeException,
)

Shape = tuple[int | str | None, ...]
"""Sides that are open when the model is loaded are a name or None."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tensor:
    """What a model says of one of its inputs or outputs."""

    name: str
    shape: Shape
    kind: str
    """Such as `float32`; ONNX Runtime's own name for what is no plain tensor."""

    @property
    def words(self) -> str:
        """Name, type and shape in one phrase."""
        return f"{self.name} {self.kind} {shape_words(self.shape)}"


def shape_words(shape: Shape) -> str:
    """The shape as people write it: `(1, 3, ?, ?)`."""
    sides = ", ".join("?" if side is None else str(side) for side in shape)
    return f"({sides},)" if len(shape) == 1 else f"({sides})"


class Model:
    """A loaded model. Not shared between threads."""

    def __init__(self, session: ort.InferenceSession, path: Path, sha256: str, size_bytes: int) -> None:
        self._session = session
        self.path = path
        self.sha256 = sha256
        self.size_bytes = size_bytes
        self.inputs, self.outputs = (
            tuple(Tensor(name=one.name, shape=tuple(one.shape), kind=_kind(one.type)) for one in ends)
            for ends in (session.get_inputs(), session.get_outputs())
        )

    def run(self, feeds: dict[str, NDArray[Any]]) -> list[NDArray[Any]]:
        """All outputs, in their order. Raises WorkError, in one line, where the network fails on what it is fed."""
        try:
            return [np.asarray(output) for output in self._session.run(None, feeds)]
        except FAULTS as fault:
            fed = ", ".join(f"{name} {shape_words(tensor.shape)}" for name, tensor in feeds.items())
            raise WorkError(f"{self.path}: the network failed on {fed}: {_first_line(fault)}") from fault


def load_model(path: Path, *, threads: int = 1) -> Model:
    """The model in `path`, on `threads` threads. Raises InputError where it cannot be read or loaded.

    Weights that lie in files of their own beside it are found; the checksum is that of `path` alone.
    """
    try:
        content = path.read_bytes()
    except OSError as fault:
        raise InputError(
            f"{path}: the model cannot be read ({fault.strerror}): give the path of a .onnx file"
        ) from fault
    try:
        session = ort.InferenceSession(str(path), _options(threads), providers=["CPUExecutionProvider"])
    except FAULTS as fault:
        raise InputError(f"{path}: ONNX Runtime cannot load it ({_first_line(fault)}): give another model") from fault
    return Model(session, path, hashlib.sha256(content).hexdigest(), len(content))


def _options(threads: int) -> ort.SessionOptions:
    """As the appliance's own detector: threads that sleep, not spin, between pictures."""
    options = ort.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.execution_mode = ort.ExecutionMode.ORT_SEQUENTIAL
    options.graph_optimization_level = ort.GraphOptimizationLevel.ORT_ENABLE_ALL
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 4
    return options


def _kind(told: str) -> str:
    """NumPy's name of an ONNX Runtime's type: `tensor(float)` is float32."""
    inner = told.removeprefix("tensor(").removesuffix(")")
    return {"float": "float32", "double": "float64"}.get(inner, inner)


def _first_line(fault: Exception) -> str:
    text = str(fault).strip()
    return text.splitlines()[0] if text else type(fault).__name__
