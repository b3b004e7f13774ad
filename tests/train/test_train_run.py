"""The training command end to end, in its smallest form. Skipped where torch is not installed."""

import importlib
import json

import numpy as np
import pytest

from dnb_edge.detect.onnx import load_model
from dnb_edge.errors import InputError
from dnb_edge.train.assets import NO_ASSETS
from dnb_edge.train.shards import write_shard

torch = pytest.importorskip("torch", reason="training needs the extra 'train' (torch)")


@pytest.fixture(scope="module")
def small_run(tmp_path_factory):
    """Two iterations on one shard: the path of the model."""
    run = importlib.import_module("dnb_edge.train.__main__").run
    out = tmp_path_factory.mktemp("train")
    (out / "shards").mkdir()
    # a ready shard of few scenes is kept by the run: no processes have to draw 128
    write_shard(out / "shards", 0, 3, NO_ASSETS, samples=6)
    arguments = ["--out", str(out), "--seed", "3", "--iterations", "2", "--shards", "1", "--batch", "2"]
    return run([*arguments, "--held-out", "2", "--workers", "1", "--checkpoint-every", "1"])


def test_a_two_iteration_run_gives_a_loadable_int8_model(small_run):
    """The command writes a model that loads by its card's checksum, in integers, and answers in the right shapes."""
    maps = load_model(small_run)(np.zeros((160, 160, 4), np.uint8))
    assert maps.heat.shape == (40, 40)
    assert small_run.stat().st_size < 1_000_000


def test_the_card_tells_how_the_model_was_made(small_run):
    """The card holds seed, iterations, parameter count, a command without private paths, and figures on held-out scenes."""
    card = json.loads(small_run.with_suffix(".json").read_text())
    assert (card["seed"], card["iterations"]) == (3, 2)
    assert card["command"].startswith("python -m dnb_edge.train --out OUT --seed 3")
    assert str(small_run.parent) not in json.dumps(card)
    assert 150_000 < card["parameters"] < 400_000
    assert card["metrics"]["held_out_samples"] == 2
    assert card["attributions"] == []


def test_a_run_goes_on_from_its_checkpoint(small_run):
    """The checkpoint of the last iteration is there to go on from."""
    state = torch.load(small_run.parent / "checkpoint.pt")
    assert state["step"] == 2


def test_wrong_numbers_are_refused():
    """Counts below one are an InputError before any work."""
    run = importlib.import_module("dnb_edge.train.__main__").run
    with pytest.raises(InputError, match="at least 1"):
        run(["--out", "unused", "--iterations", "0"])


def test_scaling_the_sigmas_moves_nothing_else():
    """Three times the sigma adds log 3 to the spread everywhere and leaves every other output as it was."""
    networks = importlib.import_module("dnb_edge.train.network")
    network = networks.CentreNet().eval()
    pixels = torch.rand(1, networks.INPUT_CHANNELS, 64, 64)
    with torch.no_grad():
        *before, spread = network(pixels)
        networks.scale_sigma(network, 3.0)
        *after, wider = network(pixels)
    assert torch.allclose(wider - spread, torch.tensor(3.0).log(), atol=1e-5)
    assert all(torch.equal(one, other) for one, other in zip(before, after, strict=True))
