"""Tiny ONNX files that look like exports of Ultralytics: the metadata, the layouts, and an answer that the test chooses."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import onnx
from onnx import helper, numpy_helper

NAMES = {0: "car", 1: "cone", 2: "person"}


def metadata(
    *, task: str = "detect", nms: bool = False, size: tuple[int, int] = (96, 128), **changed: object
) -> dict[str, str]:
    """What an export writes; `changed` replaces keys, None removes one."""
    told: dict[str, object] = {
        "description": "Ultralytics YOLO11n model",
        "author": "Ultralytics",
        "version": "8.4.190",
        "stride": 32,
        "task": task,
        "batch": 1,
        "imgsz": list(size),
        "names": NAMES,
        "args": {"batch": 1, "nms": nms, "dynamic": False},
        "channels": 3,
        "end2end": False,
    }
    return {key: str(value) for key, value in (told | changed).items() if value is not None}


def write_constant(
    path: Path,
    answer: np.ndarray,
    told: Mapping[str, str],
    *,
    side: tuple[int | str, int | str] = (96, 128),
    **kinds: int,
) -> Path:
    """A model that answers `answer` to every picture of `side` (height, width); text makes a side open."""
    batch, channels = kinds.get("batch", 1), kinds.get("channels", 3)
    nodes = [
        helper.make_node("Cast", ["images"], ["float"], to=onnx.TensorProto.FLOAT),
        helper.make_node("ReduceMean", ["float"], ["mean"], keepdims=0),
        helper.make_node("Mul", ["mean", "nought"], ["nothing"]),
        helper.make_node("Add", ["constant", "nothing"], ["output0"]),
    ]
    constants = [_constant("constant", answer.astype(np.float32)), _constant("nought", np.float32(0))]
    kind = kinds.get("kind", onnx.TensorProto.FLOAT)
    given = helper.make_tensor_value_info("images", kind, [batch, channels, *side])
    return _write(path, nodes, constants, given, list(answer.shape), told)


def write_red_finder(path: Path, *, side: int = 320, cell: int = 8) -> Path:
    """A model that finds red things: one candidate a cell, as sure as it and half its neighbours are redder than green."""
    count = side // cell
    middles = (np.arange(count) + 0.5) * cell
    v, u = np.meshgrid(middles, middles, indexing="ij")
    boxes = np.stack([u.ravel(), v.ravel(), np.full(count**2, 22.0), np.full(count**2, 12.0)])[None]
    weights = np.array([1.0, -1.0, 0.0], np.float32).reshape(1, 3, 1, 1)
    nodes = [
        helper.make_node(
            "AveragePool", ["images"], ["cells"], kernel_shape=[2 * cell] * 2, strides=[cell] * 2, pads=[cell // 2] * 4
        ),
        helper.make_node("Conv", ["cells", "redness"], ["red"]),
        helper.make_node("Relu", ["red"], ["sure"]),
        helper.make_node("Reshape", ["sure", "flat"], ["scores"]),
        helper.make_node("Concat", ["boxes", "scores"], ["output0"], axis=1),
    ]
    constants = [
        _constant("redness", weights),
        _constant("flat", np.array([1, 1, count**2], np.int64)),
        _constant("boxes", boxes.astype(np.float32)),
    ]
    given = helper.make_tensor_value_info("images", onnx.TensorProto.FLOAT, [1, 3, side, side])
    told = metadata(size=(side, side), names={0: "red"})
    return _write(path, nodes, constants, given, [1, 5, count**2], told)


def _constant(name: str, value: np.ndarray | np.float32) -> onnx.TensorProto:
    return numpy_helper.from_array(np.asarray(value), name)


def _write(path, nodes, constants, given, shape, told) -> Path:
    out = helper.make_tensor_value_info("output0", onnx.TensorProto.FLOAT, shape)
    graph = helper.make_graph(nodes, "model", [given], [out], constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    for key, value in told.items():
        entry = model.metadata_props.add()
        entry.key, entry.value = key, value
    path.write_bytes(model.SerializeToString())
    return path
