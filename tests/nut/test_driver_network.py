"""The driving network that is shipped: its file and card, and that it drives."""

from __future__ import annotations

import dataclasses
import json
import shutil

import numpy as np
import onnx
import pytest

from dnb_edge.errors import InputError
from dnb_edge.nut.model import OnnxDriver
from dnb_edge.nut.network import MODEL, network_driver
from dnb_edge.nut.onnx import load_model
from dnb_edge.nut.open import open_driver
from dnb_edge.sim.task import LoopTask
from dnb_edge.sim.world import World


@pytest.fixture
def copy(tmp_path):
    """A copy of the model with its card."""
    path = tmp_path / MODEL.name
    shutil.copy(MODEL, path)
    shutil.copy(MODEL.with_suffix(".json"), path.with_suffix(".json"))
    return path


def test_shipped_model_is_small_and_computes_in_int8():
    """At most 1 MB; every convolution takes what was quantised; the card's figures say 95 % of laps or more."""
    assert MODEL.stat().st_size <= 1_000_000
    graph = onnx.load(str(MODEL)).graph
    made = {output: node.op_type for node in graph.node for output in node.output}
    convolutions = [node for node in graph.node if node.op_type == "Conv"]
    assert len(convolutions) == 4
    assert all(made[one] == "DequantizeLinear" for node in convolutions for one in node.input[:2])
    card = json.loads(MODEL.with_suffix(".json").read_text())
    assert card["metrics"]["lane_following"]["laps_percent"] >= 95.0
    assert card["bytes"] == MODEL.stat().st_size


def test_drives_a_lap_on_its_lane_the_same_way_twice():
    """With a seed that taught nobody, on the lane all the way; the second drive is the first, to the bit."""
    laps = []
    for _ in range(2):
        world, driver = World(LoopTask(seed=41, laps=1)), open_driver("network")
        driver.start(world.brief(driver))
        index = 0
        while world.ended is None:
            world.drive_until(world.front_t_ns(index), driver)
            index += 1
        driver.close()
        assert world.ended == "laps"
        assert world.truth().off_lane_s == 0.0
        laps.append(world.truth().laps[0].time_s)
    assert laps[0] == laps[1]
    assert (driver.name, driver.knows_truth) == ("network", False)


def test_sees_the_lane():
    """Mirrored pictures are answered with mirrored steering, roughly: what it answers comes from the picture."""

    class Both(OnnxDriver):
        """Drives by the picture, and is asked about its mirror image too."""

        def drive(self, sight):
            mirrored = dataclasses.replace(sight, bgr=np.ascontiguousarray(sight.bgr[:, ::-1]))
            wanted = super().drive(sight)
            answers.append((wanted.steering, super().drive(mirrored).steering))
            return wanted

    world, driver, answers = World(LoopTask(seed=42, laps=1)), Both(load_model(MODEL), name="both"), []
    driver.start(world.brief(driver))
    world.drive_until(5_000_000_000, driver)
    one, other = np.array(answers).T
    assert np.corrcoef(one, -other)[0, 1] > 0.9
    assert one.std() > 0.1


def test_a_damaged_model_or_card_is_refused(copy):
    """One flipped byte, another model's card, no card: each is an InputError in one line that names the file."""
    assert network_driver(copy).name == "network"
    content = bytearray(copy.read_bytes())
    place = content.find(b"QuantizeLinear") // 2
    content[place] ^= 1
    copy.write_bytes(content)
    with pytest.raises(InputError, match=r"driver-v1\.onnx"):
        network_driver(copy)
    shutil.copy(MODEL, copy)
    card = copy.with_suffix(".json")
    card.write_text(json.dumps({"sha256": "0" * 64}))
    with pytest.raises(InputError, match="damaged"):
        network_driver(copy)
    for text in ("{", "[]", "{}"):
        card.write_text(text)
        with pytest.raises(InputError, match="model card"):
            network_driver(copy)
    card.unlink()
    with pytest.raises(InputError, match="model card"):
        network_driver(copy)
