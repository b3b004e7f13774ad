"""Tiny ONNX models for tests: the mean of each colour, times a matrix; anything about their ends can be bent."""

from pathlib import Path

import pytest

FLOAT, BYTES = 1, 2  # onnx.TensorProto's numbers for float32 and uint8


def write_model(
    path: Path,
    *,
    shape=(1, 3, 12, 16),
    kind=FLOAT,
    nhwc=False,
    weights=((1.0, 0.0), (0.0, 1.0), (0.0, 0.0)),
    speed=None,
    log=False,
    more_inputs=(),
    out_shape=None,
) -> Path:
    """A model whose answer is (mean red, mean green) @ weights, plus the speed on both where it takes one.

    `log` takes the logarithm of the answer, which is no number below zero.
    """
    onnx = pytest.importorskip("onnx")
    helper, numpy_helper = onnx.helper, onnx.numpy_helper
    np = pytest.importorskip("numpy")
    matrix = np.array(weights, dtype=np.float32)
    nodes = [helper.make_node("Cast", ["image"], ["pixels"], to=FLOAT)]
    sides = [1, 2] if nhwc else [2, 3]
    nodes += [
        helper.make_node("ReduceMean", ["pixels"], ["means"], axes=sides, keepdims=0),
        helper.make_node("MatMul", ["means", "matrix"], ["answer"]),
    ]
    last = "answer"
    inputs = [helper.make_tensor_value_info("image", kind, shape)]
    if speed is not None:
        inputs.append(helper.make_tensor_value_info("speed", FLOAT, speed))
        nodes.append(helper.make_node("Add", [last, "speed"], ["faster"]))
        last = "faster"
    for number, more in enumerate(more_inputs):
        inputs.append(helper.make_tensor_value_info(f"more{number}", FLOAT, more))
    if log:
        nodes.append(helper.make_node("Log", [last], ["logged"]))
        last = "logged"
    nodes.append(helper.make_node("Identity", [last], ["control"]))
    outputs = [helper.make_tensor_value_info("control", FLOAT, out_shape or (1, matrix.shape[1]))]
    graph = helper.make_graph(nodes, "driver", inputs, outputs, [numpy_helper.from_array(matrix, "matrix")])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    path.write_bytes(model.SerializeToString())
    return path
