"""From the trained driving network to the shipped file: ONNX, static int8 (QDQ, U8S8, per channel, MinMax).

Knows export and quantisation; nothing of training. Calibrates on lessons handed in.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnxruntime.quantization import CalibrationDataReader, CalibrationMethod, QuantFormat, QuantType, quantize_static
from onnxruntime.quantization.shape_inference import quant_pre_process

from dnb_edge.train.driver_data import Lessons
from dnb_edge.train.driver_network import HEIGHT_PX, WIDTH_PX, DriverNet

OPSET = 17


class _Inputs(CalibrationDataReader):
    """Lessons for the calibration, one after the other."""

    def __init__(self, lessons: Lessons) -> None:
        self._left: Iterator[tuple[NDArray[Any], NDArray[Any]]] = iter(zip(lessons.pixels, lessons.speed, strict=True))

    def get_next(self) -> dict[str, NDArray[Any]] | None:
        following = next(self._left, None)
        return None if following is None else {"pixels": following[0][None], "speed": following[1][None]}


def export_driver(network: DriverNet, path: Path) -> None:
    """Write the network in float32: in `pixels` uint8 (1, 60, 80, 3) and `speed` float32 (1, 1), out `control` (1, 2)."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the tracing exporter calls itself old; it is what quantisation handles best
        torch.onnx.export(
            network.eval(),
            (torch.zeros(1, HEIGHT_PX, WIDTH_PX, 3, dtype=torch.uint8), torch.zeros(1, 1)),
            str(path),
            input_names=["pixels", "speed"],
            output_names=["control"],
            opset_version=OPSET,
            dynamo=False,
        )


def quantise_driver(network: DriverNet, path: Path, calibration: Lessons) -> None:
    """Write the network in int8 to `path`, its inputs and output as `export_driver` has them.

    The last layer stays in float32: its 130 numbers are the answer, of which int8 would keep steps of a hundredth only.
    """
    with tempfile.TemporaryDirectory() as folder:
        plain, ready = Path(folder) / "float.onnx", Path(folder) / "ready.onnx"
        export_driver(network, plain)
        quant_pre_process(str(plain), str(ready), skip_symbolic_shape=True)
        last = [node.name for node in onnx.load(str(ready)).graph.node if node.op_type == "Gemm"][-1]
        quantize_static(
            str(ready),
            str(path),
            _Inputs(calibration),
            quant_format=QuantFormat.QDQ,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
            per_channel=True,
            calibrate_method=CalibrationMethod.MinMax,
            nodes_to_exclude=[last],
        )
    model = onnx.load(str(path))
    onnx.checker.check_model(model)
    del model.metadata_props[:]
    model.doc_string = ""
    onnx.save(model, str(path))


def some_of(lessons: Lessons, count: int) -> Lessons:
    """`count` of the lessons, evenly spread."""
    rows = np.linspace(0, len(lessons) - 1, count).astype(np.int64)
    return Lessons(pixels=lessons.pixels[rows], speed=lessons.speed[rows], wanted=lessons.wanted[rows])
