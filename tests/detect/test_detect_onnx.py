"""Loading a model: checksum first, clear faults, int8 all through, any multiple of 16."""

import hashlib
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import onnxruntime as ort
import pytest

from dnb_edge.detect.onnx import default_model_path, load_builtin_model, load_model, session_options
from dnb_edge.errors import InputError


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    """A copy of the shipped model and its card."""
    for suffix in (".onnx", ".json"):
        shutil.copy(default_model_path().with_suffix(suffix), tmp_path / f"m{suffix}")
    return tmp_path / "m.onnx"


def test_one_flipped_bit_is_found(copied):
    """A model damaged in one bit is refused by its checksum, with its name and what to do."""
    content = bytearray(copied.read_bytes())
    content[len(content) // 2] ^= 1
    copied.write_bytes(content)
    with pytest.raises(InputError, match=r"m\.onnx: damaged.*install the model again"):
        load_model(copied)


@pytest.mark.parametrize(
    ("card", "message"),
    [
        (None, r"m\.json: the model's card cannot be read"),
        ("{", r"m\.json: not a model card"),
        ("[" * 100_000, r"m\.json: not a model card"),
        ("[]", r"m\.json: the card has no 'sha256'"),
        ("{}", r"m\.json: the card has no 'sha256'"),
        ('{"sha256": 5}', r"m\.json: the card has no 'sha256'"),
        ('{"sha256": "00"}', r"m\.onnx: damaged"),
    ],
)
def test_a_missing_or_wrong_card_is_refused(copied, card, message):
    """Without a card that holds the right checksum no model is run."""
    if card is None:
        copied.with_suffix(".json").unlink()
    else:
        copied.with_suffix(".json").write_text(card)
    with pytest.raises(InputError, match=message):
        load_model(copied)


def test_a_missing_model_is_named(tmp_path):
    """A path where nothing is gives an InputError that names it."""
    with pytest.raises(InputError, match=r"none\.onnx: the model cannot be read"):
        load_model(tmp_path / "none.onnx")


def test_a_file_that_is_no_network_is_refused(copied):
    """Right checksum, wrong content: ONNX Runtime's complaint becomes one line that names the file."""
    copied.write_bytes(b"not a network")
    copied.with_suffix(".json").write_text(json.dumps({"sha256": hashlib.sha256(b"not a network").hexdigest()}))
    with pytest.raises(InputError, match=r"m\.onnx: ONNX Runtime cannot load it") as caught:
        load_model(copied)
    assert "\n" not in str(caught.value)


def test_a_network_of_another_shape_is_refused(tmp_path):
    """A sound ONNX file with other inputs or outputs is not taken for a centre network."""
    onnx = pytest.importorskip("onnx")
    helper = onnx.helper
    image = helper.make_tensor_value_info("image", onnx.TensorProto.FLOAT, [1, 3, 16, 16])
    out = helper.make_tensor_value_info("out", onnx.TensorProto.FLOAT, [1, 3, 16, 16])
    graph = helper.make_graph([helper.make_node("Relu", ["image"], ["out"])], "other", [image], [out])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    path = tmp_path / "other.onnx"
    path.write_bytes(model.SerializeToString())
    path.with_suffix(".json").write_text(json.dumps({"sha256": hashlib.sha256(path.read_bytes()).hexdigest()}))
    with pytest.raises(InputError, match=r"other\.onnx: not a centre network"):
        load_model(path)


def _written(path: Path, graph: object) -> Path:
    """The graph as a model with its card."""
    onnx = pytest.importorskip("onnx")
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=9)
    path.write_bytes(model.SerializeToString())
    path.with_suffix(".json").write_text(json.dumps({"sha256": hashlib.sha256(path.read_bytes()).hexdigest()}))
    return path


def _bytes_to_maps(path: Path, *, channels: int, batch: int | str = "n") -> Path:
    """A network that takes bytes (n, h, w, 4) and answers `maps`, each channel the mean of the blue channel over a cell."""
    onnx = pytest.importorskip("onnx")
    helper, kind = onnx.helper, onnx.TensorProto
    given = helper.make_tensor_value_info("pixels", kind.UINT8, [batch, "h", "w", 4])
    answer = helper.make_tensor_value_info("maps", kind.FLOAT, [batch, channels, "gh", "gw"])
    weight = np.zeros((channels, 4, 4, 4), np.float32)
    weight[:, 0] = 1 / 16
    nodes = [
        helper.make_node("Cast", ["pixels"], ["real"], to=kind.FLOAT),
        helper.make_node("Transpose", ["real"], ["planes"], perm=[0, 3, 1, 2]),
        helper.make_node("Conv", ["planes", "weight"], ["maps"], kernel_shape=[4, 4], strides=[4, 4]),
    ]
    constant = onnx.numpy_helper.from_array(weight, "weight")
    return _written(path, helper.make_graph(nodes, "maps", [given], [answer], [constant]))


@pytest.mark.parametrize("channels", [7, 9])
@pytest.mark.parametrize("batch", [1, "n"])
def test_bytes_in_and_one_map_out(tmp_path, channels, batch):
    """A network that takes bytes and answers one map is fed the pixels as they are, many at a time where it can."""
    network = load_model(_bytes_to_maps(tmp_path / "m.onnx", channels=channels, batch=batch))
    pixels = np.zeros((3, 32, 48, 4), np.uint8)
    pixels[:, :, :, 0] = np.array([10, 20, 30], np.uint8)[:, None, None]
    answers = network.many(pixels)
    assert [float(maps.heat[0, 0]) for maps in answers] == [10.0, 20.0, 30.0]
    assert answers[0].heading.shape == (channels - 5, 8, 12)


@pytest.mark.parametrize("channels", [6, 8])
def test_a_map_of_other_channels_is_refused(tmp_path, channels):
    """One map with neither 7 nor 9 channels is not a centre network's."""
    with pytest.raises(InputError, match=r"m\.onnx: not a centre network.*maps \(7 or 9\)"):
        load_model(_bytes_to_maps(tmp_path / "m.onnx", channels=channels))


def test_the_optimised_graph_is_int8_all_through(tmp_path):
    """After ONNX Runtime's optimisation every convolution is an integer one and nothing falls back to float in between."""
    onnx = pytest.importorskip("onnx")
    options = session_options(1)
    options.optimized_model_filepath = str(tmp_path / "optimised.onnx")
    ort.InferenceSession(str(default_model_path()), options, providers=["CPUExecutionProvider"])
    kinds = [node.op_type for node in onnx.load(str(tmp_path / "optimised.onnx")).graph.node]
    assert kinds.count("QLinearConv") > 10
    assert not {"Conv", "FusedConv", "Add", "Relu", "Clip"} & set(kinds)
    assert kinds.count("QuantizeLinear") <= 1  # of the input, where it is not bytes
    assert kinds.count("DequantizeLinear") <= 5  # of the outputs


def test_the_graph_knows_no_activation_but_relu():
    """Relu and Clip fold into an integer convolution for nothing; any other activation would cost time or drop to float."""
    onnx = pytest.importorskip("onnx")
    kinds = {node.op_type for node in onnx.load(str(default_model_path())).graph.node}
    plain = {"Conv", "Add", "Resize", "Concat", "Transpose", "Shape", "Slice", "Gather", "Constant", "Cast", "Identity"}
    assert kinds <= plain | {"QuantizeLinear", "DequantizeLinear", "Relu", "Clip"}


@pytest.mark.parametrize(("height", "width"), [(128, 128), (160, 160), (368, 640), (16, 48)])
def test_any_multiple_of_sixteen_goes(height, width):
    """One file serves windows, tiles and whole frames; the maps are a quarter of the input's size."""
    maps = load_builtin_model()(np.zeros((height, width, 4), np.uint8))
    shape = (height // 4, width // 4)
    assert (maps.heat.shape, maps.offset.shape, maps.size.shape) == (shape, (2, *shape), shape)
    assert (maps.heading.shape, maps.spread.shape) == ((4, *shape), shape)


@pytest.mark.parametrize("shape", [(150, 160, 4), (160, 160, 3)])
def test_other_shapes_are_a_programmers_mistake(shape):
    """The network's caller pads; a wrong shape is a ValueError."""
    with pytest.raises(ValueError, match="multiples of 16"):
        load_builtin_model()(np.zeros(shape, np.uint8))


def test_threads_do_not_change_the_answer():
    """Two intra-op threads give the same numbers as one."""
    pixels = np.random.default_rng(3).integers(0, 256, (160, 160, 4), dtype=np.uint8)
    one, two = load_builtin_model(threads=1)(pixels), load_builtin_model(threads=2)(pixels)
    assert np.array_equal(one.heat, two.heat)
    assert np.array_equal(one.offset, two.offset)


def test_the_shipped_model_is_small_and_says_what_it_is():
    """At most 1 MB, with a card that names seed, command, data, licence and attributions."""
    card = json.loads(default_model_path().with_suffix(".json").read_text())
    assert default_model_path().stat().st_size <= 1_000_000
    assert card["licence"] == "GPL-3.0-or-later"
    assert {"seed", "command", "data", "iterations", "parameters", "packages", "metrics", "attributions"} <= set(card)


def test_telemetry_is_off_before_the_runtime_is_imported():
    """The variable that stops ONNX Runtime's telemetry is set before the import, in a process that has not set it."""
    code = (
        "import os, sys, builtins; os.environ.pop('ORT_DISABLE_TELEMETRY', None); real = builtins.__import__\n"
        "def spy(name, *rest):\n"
        "    if name == 'onnxruntime' and 'onnxruntime' not in sys.modules: print(os.environ.get('ORT_DISABLE_TELEMETRY'))\n"
        "    return real(name, *rest)\n"
        "builtins.__import__ = spy\nimport dnb_edge.detect.onnx"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.splitlines()[0] == "1"
