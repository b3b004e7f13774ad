"""The file of weights: what goes in comes out, anything else is refused in one line. Skipped where torch is not installed."""

import importlib

import numpy as np
import pytest

from dnb_edge.errors import InputError

torch = pytest.importorskip("torch", reason="training needs the extra 'train' (torch)")


@pytest.fixture(scope="module")
def weights():
    return importlib.import_module("dnb_edge.train.weights")


@pytest.fixture(scope="module")
def network():
    """A network of random weights with statistics that are not the initial ones."""
    torch.manual_seed(5)
    made = importlib.import_module("dnb_edge.train.network").CentreNet()
    with torch.no_grad():
        for name, value in made.state_dict().items():
            if name.endswith(("running_mean", "running_var")):
                value.add_(torch.rand_like(value))
    return made.eval()


def test_the_network_comes_back_as_it_was_to_half_precision(weights, network, tmp_path):
    """Every weight and statistic of the loaded network equals the stored one rounded to float16; so do the answers, nearly."""
    path = tmp_path / "model.weights.npz"
    weights.save_weights(path, network)
    loaded = weights.load_weights(path)
    assert not loaded.training
    for name, value in network.state_dict().items():
        if value.dtype.is_floating_point:
            assert torch.equal(loaded.state_dict()[name], value.to(torch.float16).to(torch.float32)), name
    picture = torch.rand(1, importlib.import_module("dnb_edge.train.network").INPUT_CHANNELS, 64, 64)
    with torch.no_grad():
        for one, other in zip(network(picture), loaded(picture), strict=True):
            assert torch.allclose(one, other, atol=0.05)
    assert [entry.name for entry in tmp_path.iterdir()] == ["model.weights.npz"]


def test_weights_lie_beside_their_model(weights, tmp_path):
    """NAME.onnx has its weights in NAME.weights.npz."""
    assert weights.weights_path(tmp_path / "dnb-edge-centre-v1.onnx").name == "dnb-edge-centre-v1.weights.npz"


def _stored(weights, network, tmp_path):
    path = tmp_path / "model.weights.npz"
    weights.save_weights(path, network)
    with np.load(path) as stored:
        return path, dict(stored)


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda arrays: arrays.pop(next(iter(arrays))), "is missing"),
        (lambda arrays: arrays.update(surplus=np.zeros(3, np.float16)), "surplus is not known"),
        (lambda arrays: arrays.update({next(iter(arrays)): np.zeros((2, 2), np.float16)}), r"is \(2, 2\), not"),
        (lambda arrays: arrays.update({n: np.full(a.shape, np.nan, np.float16) for n, a in arrays.items()}), "finite"),
        (lambda arrays: arrays.update({n: a.astype(np.float64) for n, a in arrays.items()}), "float16"),
    ],
)
def test_weights_of_another_network_are_refused(weights, network, tmp_path, spoil, says):
    """A missing or surplus name, another shape, NaN and another dtype are an InputError that names the file."""
    path, arrays = _stored(weights, network, tmp_path)
    spoil(arrays)
    with path.open("wb") as file:
        np.savez(file, **arrays)
    with pytest.raises(InputError, match=says) as caught:
        weights.load_weights(path)
    assert str(path) in str(caught.value)


def test_a_missing_or_torn_file_is_refused(weights, network, tmp_path):
    """No file, half a file and a picture are an InputError that names the file."""
    path, _ = _stored(weights, network, tmp_path)
    torn = tmp_path / "torn.weights.npz"
    torn.write_bytes(path.read_bytes()[:5000])
    words = tmp_path / "words.weights.npz"
    words.write_text("not weights")
    for bad in (tmp_path / "none.weights.npz", torn, words):
        with pytest.raises(InputError, match=bad.name):
            weights.load_weights(bad)


def test_what_float16_cannot_hold_is_not_written(weights, tmp_path):
    """A weight beyond float16 raises instead of becoming infinite in silence, and leaves no file."""
    large = importlib.import_module("dnb_edge.train.network").CentreNet()
    with torch.no_grad():
        next(iter(large.parameters())).mul_(0).add_(1e6)
    with pytest.raises(ValueError, match="float16"):
        weights.save_weights(tmp_path / "large.weights.npz", large)
    assert not list(tmp_path.iterdir())
