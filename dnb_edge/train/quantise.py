"""From the trained network to the shipped file: ONNX with dynamic sides, then static int8 (QDQ, U8S8, per channel, MinMax).

Knows export and quantisation; nothing of training. Calibrates on batches handed in, so on synthetic pictures only.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnxruntime.quantization import CalibrationDataReader, CalibrationMethod, QuantFormat, QuantType, quantize_static
from onnxruntime.quantization.shape_inference import quant_pre_process

from dnb_edge.train.graph import join_heads, take_bytes
from dnb_edge.train.network import INPUT_CHANNELS, OUTPUT_CHANNELS, CentreNet

OPSET = 17


class _Batches(CalibrationDataReader):
    def __init__(self, inputs: Sequence[NDArray[np.float32]]) -> None:
        self._left: Iterator[NDArray[np.float32]] = iter(inputs)

    def get_next(self) -> dict[str, NDArray[np.float32]] | None:
        batch = next(self._left, None)
        return None if batch is None else {"pixels": batch}


def export_float(network: CentreNet, path: Path) -> None:
    """Write the network in float32: input `pixels` (1, 6, h, w), outputs as in OUTPUT_CHANNELS."""
    dynamic = {name: {2: f"{name}_h", 3: f"{name}_w"} for name in ("pixels", *OUTPUT_CHANNELS)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the tracing exporter calls itself old; it is what quantisation handles best
        torch.onnx.export(
            network.eval().to(memory_format=torch.contiguous_format),
            (torch.zeros(1, INPUT_CHANNELS, 128, 128),),
            str(path),
            input_names=["pixels"],
            output_names=list(OUTPUT_CHANNELS),
            dynamic_axes=dynamic,
            opset_version=OPSET,
            dynamo=False,
        )


def quantise(network: CentreNet, path: Path, calibration: Sequence[NDArray[np.float32]]) -> None:
    """Write the network in int8 to `path`: input `pixels` uint8 (n, h, w, 6), output `maps` float32 (n, 9, h / 4, w / 4).

    `calibration` holds inputs (n, 6, h, w) float32 in 0..1 of n = 1 each.
    """
    first = calibration[0].copy()
    first[:, :, 0, :2] = (0.0, 1.0)  # so that the input's scale is 1/255 whatever the pictures
    with tempfile.TemporaryDirectory() as folder:
        plain, ready = Path(folder) / "float.onnx", Path(folder) / "ready.onnx"
        export_float(network, plain)
        quant_pre_process(str(plain), str(ready), skip_symbolic_shape=True)
        quantize_static(
            str(ready),
            str(path),
            _Batches([first, *calibration[1:]]),
            quant_format=QuantFormat.QDQ,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
            per_channel=True,
            calibrate_method=CalibrationMethod.MinMax,
        )
    model = onnx.load(str(path))
    take_bytes(model)
    join_heads(model)
    onnx.checker.check_model(model)
    del model.metadata_props[:]
    model.doc_string = ""
    onnx.save(model, str(path))
