"""From a float ONNX file to an int8 one: static, QDQ, U8S8, per channel, MinMax over the inputs that are handed in.

Knows ONNX graphs of ours and of Ultralytics; nothing of footage and of training. Needs the extra `train`.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnxruntime.quantization import CalibrationDataReader, CalibrationMethod, QuantFormat, QuantType, quantize_static
from onnxruntime.quantization.shape_inference import quant_pre_process

from dnb_edge.train.graph import join_heads, take_bytes

FloatInput = NDArray[np.floating[Any]]


class _Inputs(CalibrationDataReader):
    """Inputs for the calibration, one after the other."""

    def __init__(self, name: str, inputs: Sequence[FloatInput]) -> None:
        self._name = name
        self._left: Iterator[FloatInput] = iter(inputs)

    def get_next(self) -> dict[str, FloatInput] | None:
        following = next(self._left, None)
        return None if following is None else {self._name: following}


def is_quantised(path: Path) -> bool:
    """True where the network in `path` computes with int8 or another whole number already."""
    graph = onnx.load(str(path), load_external_data=False).graph
    return any(node.op_type in {"QuantizeLinear", "DequantizeLinear", "DynamicQuantizeLinear"} for node in graph.node)


def quantise_centre(plain: Path, path: Path, inputs: Sequence[NDArray[np.float32]]) -> None:
    """Write our float network in `plain` in int8 to `path`: bytes in, all heads in one output `maps`.

    `inputs` are (1, channels, h, w) float32 in 0..1.
    """
    first = inputs[0].copy()
    first[:, :, 0, :2] = (0.0, 1.0)  # so that the input's scale is 1/255 whatever the pictures
    _quantise(plain, path, "pixels", [first, *inputs[1:]])
    model = onnx.load(str(path))
    take_bytes(model)
    join_heads(model)
    onnx.checker.check_model(model)
    del model.metadata_props[:]
    model.doc_string = ""
    onnx.save(model, str(path))


def quantise_boxes(plain: Path, path: Path, inputs: Sequence[FloatInput]) -> None:
    """Write a float network that Ultralytics exported in int8 to `path`; inputs, outputs and metadata stay as they are.

    Only convolutions become int8: the last steps put boxes of hundreds of px and confidences below 1 into one tensor, for which
    one scale of 256 levels would be far too coarse.
    """
    model = onnx.load(str(plain))
    name = model.graph.input[0].name
    _quantise(plain, path, name, inputs, op_types_to_quantize=["Conv"], nodes_to_exclude=_after_softmax(model.graph))
    quantised = onnx.load(str(path))
    del quantised.metadata_props[:]
    quantised.metadata_props.extend(model.metadata_props)
    onnx.save(quantised, str(path))


def _after_softmax(graph: onnx.GraphProto) -> list[str]:
    """Convolutions that weigh a softmax's answer (the boxes' edges): they are tiny, and all of the precision is there."""
    made = {output: node for node in graph.node for output in node.output}

    def source(node: onnx.NodeProto) -> onnx.NodeProto | None:
        before = made.get(node.input[0])
        while before is not None and before.op_type in {"Transpose", "Reshape"}:
            before = made.get(before.input[0])
        return before

    return [
        node.name
        for node in graph.node
        if node.op_type == "Conv" and (before := source(node)) is not None and before.op_type == "Softmax"
    ]


def _quantise(plain: Path, path: Path, name: str, inputs: Sequence[FloatInput], **more: Any) -> None:
    with tempfile.TemporaryDirectory() as folder:
        ready = Path(folder) / "ready.onnx"
        quant_pre_process(str(plain), str(ready), skip_symbolic_shape=True)
        quantize_static(
            str(ready),
            str(path),
            _Inputs(name, inputs),
            quant_format=QuantFormat.QDQ,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
            per_channel=True,
            calibrate_method=CalibrationMethod.MinMax,
            **more,
        )
