"""Last steps on a quantised graph of ours: bytes in, and all heads as one convolution.

Knows the graph that ONNX Runtime's `quantize_static` writes for `CentreNet`; nothing of training. Both steps change the model
in place and leave its answers alone (the second up to one quantisation level). They save a tenth of a window's time: the
picture's bytes are the first activation already, and five 1x1 convolutions cost more than one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import helper, numpy_helper

from dnb_edge.train.network import INPUT_CHANNELS, OUTPUT_CHANNELS

Values = dict[str, NDArray[np.generic]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Head:
    """One head's integers as `quantize_static` left them."""

    weight: NDArray[np.int8]
    weight_scale: NDArray[np.float64]
    bias: NDArray[np.int32]
    scale: float
    zero: int
    features: str
    feature_scale: float


def _values(graph: onnx.GraphProto) -> Values:
    return {one.name: numpy_helper.to_array(one) for one in graph.initializer}


def _prune(graph: onnx.GraphProto) -> None:
    """Drop nodes and constants that nothing uses."""
    while True:
        used = {name for node in graph.node for name in node.input} | {one.name for one in graph.output}
        dead = [node for node in graph.node if not any(name in used for name in node.output)]
        if not dead:
            break
        for node in dead:
            graph.node.remove(node)
    used = {name for node in graph.node for name in node.input}
    for one in [one for one in graph.initializer if one.name not in used]:
        graph.initializer.remove(one)
    del graph.value_info[:]


def take_bytes(model: onnx.ModelProto) -> None:
    """Make `pixels` uint8 (n, h, w, 6). Raises ValueError where the calibration gave it another scale than 1/255."""
    graph, values = model.graph, _values(model.graph)
    node = next(one for one in graph.node if one.op_type == "QuantizeLinear" and one.input[0] == "pixels")
    scale, zero = float(values[node.input[1]].item()), int(values[node.input[2]].item())
    if abs(scale * 255.0 - 1.0) > 1e-5 or zero != 0:
        raise ValueError(
            f"input quantised with scale {scale}, zero {zero}: calibrate with pictures that hold both 0 and 255"
        )
    quantised = node.output[0]
    graph.node.remove(node)
    del graph.input[:]
    graph.input.append(helper.make_tensor_value_info("pixels", onnx.TensorProto.UINT8, ["n", "h", "w", INPUT_CHANNELS]))
    graph.node.insert(0, helper.make_node("Transpose", ["pixels"], [quantised], perm=[0, 3, 1, 2], name="to_nchw"))
    for output in graph.output:
        output.type.tensor_type.shape.dim[0].dim_param = "n"
    del graph.value_info[:]


def _head(name: str, made: dict[str, onnx.NodeProto], values: Values) -> _Head:
    quantise = made[made[name].input[0]]
    conv = made[quantise.input[0]]
    weight = made[conv.input[1]]
    integers = values[weight.input[0]].astype(np.int8)
    return _Head(
        weight=integers,
        weight_scale=np.broadcast_to(values[weight.input[1]], (len(integers),)).astype(np.float64),
        bias=values[made[conv.input[2]].input[0]].astype(np.int32),
        scale=float(values[quantise.input[1]].item()),
        zero=int(values[quantise.input[2]].item()),
        features=conv.input[0],
        feature_scale=float(values[made[conv.input[0]].input[1]].item()),
    )


def _joined(heads: list[_Head]) -> dict[str, NDArray[np.generic]]:
    """Constants of the joined convolution.

    Its output has scale 1 and zero 128 for all channels: a head's own scale goes into its weights', its zero into its bias.
    """
    scales = np.concatenate([np.full(len(head.weight), head.scale) for head in heads])
    zeros = np.concatenate([np.full(len(head.weight), head.zero) for head in heads])
    shifts = [
        np.rint((head.zero - 128) * head.scale / (head.feature_scale * head.weight_scale)).astype(np.int32)
        for head in heads
    ]
    weight_scale = (np.concatenate([head.weight_scale for head in heads]) / scales).astype(np.float32)
    return {
        "maps.weight": np.concatenate([head.weight for head in heads]),
        "maps.weight_scale": weight_scale,
        "maps.weight_zero": np.zeros(len(scales), np.int8),
        "maps.bias": np.concatenate([head.bias + shift for head, shift in zip(heads, shifts, strict=True)]).astype(
            np.int32
        ),
        "maps.bias_scale": weight_scale * np.float32(heads[0].feature_scale),
        "maps.bias_zero": np.zeros(len(scales), np.int32),
        "maps.one": np.array(1.0, np.float32),
        "maps.middle": np.array(128, np.uint8),
        "maps.scale": scales.astype(np.float32),
        "maps.zero": zeros.astype(np.uint8),
    }


def join_heads(model: onnx.ModelProto) -> None:
    """One 1x1 convolution for all heads and one float output `maps` (n, channels, h / 4, w / 4) in OUTPUT_CHANNELS' order."""
    graph, values = model.graph, _values(model.graph)
    made = {name: node for node in graph.node for name in node.output}
    heads = [_head(name, made, values) for name in OUTPUT_CHANNELS]
    graph.initializer.extend(numpy_helper.from_array(value, name) for name, value in _joined(heads).items())
    node = helper.make_node
    graph.node.extend(
        [
            node("DequantizeLinear", ["maps.weight", "maps.weight_scale", "maps.weight_zero"], ["maps.w"], axis=0),
            node("DequantizeLinear", ["maps.bias", "maps.bias_scale", "maps.bias_zero"], ["maps.b"], axis=0),
            node("Conv", [heads[0].features, "maps.w", "maps.b"], ["maps.real"], kernel_shape=[1, 1], name="maps"),
            node("QuantizeLinear", ["maps.real", "maps.one", "maps.middle"], ["maps.bytes"]),
            node("DequantizeLinear", ["maps.bytes", "maps.scale", "maps.zero"], ["maps"], axis=1),
        ]
    )
    del graph.output[:]
    channels = sum(OUTPUT_CHANNELS.values())
    graph.output.append(helper.make_tensor_value_info("maps", onnx.TensorProto.FLOAT, ["n", channels, "gh", "gw"]))
    _prune(graph)
