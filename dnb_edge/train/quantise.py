"""From the trained network to the shipped file: ONNX with dynamic sides, then static int8 (QDQ, U8S8, per channel, MinMax).

Knows export and quantisation; nothing of training. Calibrates on batches handed in, so on synthetic pictures only.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from dnb_edge.train.network import INPUT_CHANNELS, OUTPUT_CHANNELS, CentreNet
from dnb_edge.train.quantise_file import quantise_centre

OPSET = 17


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
    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / "float.onnx"
        export_float(network, plain)
        quantise_centre(plain, path, calibration)
