"""A float file becomes an int8 one, calibrated on footage, with a card that the detector accepts."""

import json
from pathlib import Path

import numpy as np
import pytest

from dnb_edge.detect.onnx import default_model_path, load_builtin_model, load_model, open_model
from dnb_edge.errors import InputError
from dnb_edge.train.calibration import Listening, as_float, leans, watch

onnx = pytest.importorskip("onnx")
torch = pytest.importorskip("torch")


@pytest.fixture
def float_model(tmp_path: Path) -> Path:
    """A network of ours with weights drawn by lot."""
    from dnb_edge.train.network import CentreNet  # noqa: PLC0415
    from dnb_edge.train.quantise import export_float  # noqa: PLC0415

    torch.manual_seed(1)
    network = CentreNet()
    for module in network.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            torch.nn.init.normal_(module.bias, 0.0, 0.2)
    export_float(network, tmp_path / "mine.float.onnx")
    return tmp_path / "mine.float.onnx"


def test_a_network_that_listens_answers_alike_and_remembers_evenly():
    """Its answers are the network's own; of too many inputs of a shape it keeps every second, fourth ... and each shape."""
    network = load_builtin_model()
    listening = Listening(network, most=4)
    pixels = np.random.default_rng(1).integers(0, 256, (10, 32, 32, 4), dtype=np.uint8)
    for one in pixels:
        assert np.array_equal(listening(one).values, network(one).values)
    listening(np.zeros((16, 48, 4), np.uint8))
    kept = listening.inputs()
    assert [one.shape for one in kept] == [(32, 32, 4)] * (len(kept) - 1) + [(16, 48, 4)]
    assert all(np.array_equal(one, pixels[4 * number]) for number, one in enumerate(kept[:-1]))
    assert 2 <= len(kept) - 1 <= 4


def test_what_is_held_out_does_not_calibrate():
    """A fifth of the inputs is for the comparison only, and stills calibrate, too."""
    images = np.random.default_rng(2).integers(0, 256, (6, 96, 128, 3), dtype=np.uint8)
    seen = watch(load_builtin_model(), images, stills=True, most=60)
    total = len(seen.calibration) + len(seen.held_out)
    assert len(seen.held_out) == total // 5 > 0
    assert not any(one is other for one in seen.held_out for other in seen.calibration)


def test_inputs_of_the_float_network():
    """Channels first, 0..1, with the lean's two bytes behind where there is one; every other lean is not known."""
    pixels = np.arange(32, dtype=np.uint8).reshape(2, 4, 4)
    plain, told = as_float(pixels), as_float(pixels, (255, 0))
    assert (plain.shape, told.shape) == ((1, 4, 2, 4), (1, 6, 2, 4))
    assert plain[0, 1, 0, 0] == np.float32(1 / 255)
    assert (told[0, 4] == 1.0).all()
    assert (told[0, 5] == 0.0).all()
    assert [lean == (0, 0) for lean in leans(4, 1)] == [False, True, False, True]


def test_quantise_writes_a_network_that_loads(float_model, capsys):
    """Our float network becomes a smaller file with a card that fits, all convolutions int8, and answers much alike."""
    from dnb_edge.cli.model_quantize import quantize  # noqa: PLC0415

    quantize(float_model, footage="sim:?laps=1", frames=30)
    target = float_model.with_name("mine.int8.onnx")
    card = json.loads(target.with_suffix(".json").read_text())
    assert target.stat().st_size < 0.4 * float_model.stat().st_size
    assert load_model(target).card == card
    assert card["calibration"]["inputs"] > 4 * card["comparison"]["inputs"] - 10
    assert card["comparison"]["output_largest"] < 1.0
    assert [one["pass"] for one in card["comparison"]["times"]] == ["window", "full_frame"]
    assert open_model(target).inputs[0].kind == "tensor(uint8)"
    assert not list(target.parent.glob(".*"))
    assert ("no car found" in capsys.readouterr().err) == (card["comparison"]["finds"] == 0)


def test_an_int8_network_is_not_quantised_again(tmp_path):
    """The shipped network as the float one: refused in one line, and nothing appears."""
    from dnb_edge.cli.model_quantize import quantize  # noqa: PLC0415

    with pytest.raises(InputError, match="it is in int8 already"):
        quantize(default_model_path(), footage="sim:?laps=1", out=tmp_path / "again.onnx")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("model", [".", "/"])
def test_a_folder_is_no_network(model):
    """A folder, whose path may have no name at all, is refused as a model that cannot be read."""
    from dnb_edge.cli.model_quantize import quantize  # noqa: PLC0415

    with pytest.raises(InputError, match="the model cannot be read"):
        quantize(Path(model), footage="sim:?laps=1")
