"""A detector's model that was taught elsewhere comes onto the box through the set-up's page."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from setup_rig import Daemon, Wizard, state_of, view_of, with_everything

from dnb_edge.assembly import detector_of
from dnb_edge.config.load import load_config
from dnb_edge.detect.onnx import default_model_path
from dnb_edge.sim.rig import Rig

BYTES = "application/octet-stream"


@pytest.fixture(scope="module")
def rig() -> Rig:
    return Rig(seed=1, laps=1)


@pytest.fixture
def wizard(tmp_path: Path, rig: Rig) -> Wizard:
    return Wizard(tmp_path, Daemon(view_of(rig)))


def give(wizard: Wizard) -> dict:
    """The two files of a model, as the page sends them."""
    model = default_model_path()
    wizard.send("/model/card", model.with_suffix(".json").read_bytes(), BYTES)
    return wizard.send("/model", model.read_bytes(), BYTES)


def test_taught_model_is_raced_with_once_saved(wizard: Wizard, rig: Rig) -> None:
    """Model and card end beside the configuration, which names the model and whose detector loads it; forgotten and saved again
    the box is back at its own, other keys of the section stay, and the files go once nothing names them."""
    with_everything(wizard, rig)
    wizard.ask("POST", "/save")
    config = wizard.setup / "dnb-edge.yaml"
    config.write_text(config.read_text() + "detector: {threads: 2}\n")
    answer = give(wizard)
    assert state_of(answer, "teach")[0] == "done"
    assert state_of(answer, "save") == ("open", "Changed since it was saved: save again")
    saved = wizard.ask("POST", "/save")
    (model,) = wizard.setup.glob("model-*.onnx")
    assert {model.name, model.with_suffix(".json").name} <= set(saved["files"])
    found = load_config(config).detector
    assert found.model == model
    assert found.threads == 2
    assert detector_of(found) is not None
    answer = wizard.ask("DELETE", "/model")
    assert state_of(answer, "teach")[0] == "open"
    for _ in range(2):  # the configuration before names it, too
        wizard.ask("POST", "/save")
    assert load_config(config).detector.model is None
    assert load_config(config).detector.threads == 2
    assert not list(wizard.setup.glob("model-*"))


def test_what_is_no_model_is_refused_in_words(wizard: Wizard) -> None:
    """Rubbish, a model without its card, one that is not its card's: one line without this box's paths, and nothing kept."""
    model = default_model_path().read_bytes()
    bad = {
        "no card": ("/model", model),
        "rubbish": ("/model", b"rubbish"),
        "no json": ("/model/card", b"{"),
        "a long one": ("/model/card", b" " * 70_000 + b"{}"),
        "no sum": ("/model/card", b"{}"),
        "a path": ("/model/card", json.dumps({"sha256": "../" * 21 + "x"}).encode()),
    }
    for name, (path, data) in bad.items():
        text = wizard.send(path, data, BYTES, status=422)["error"]["text"]
        assert str(wizard.setup) not in text, name
        assert "\n" not in text, name
    assert wizard.ask("GET", "")["draft"]["model"] is None
    wizard.send("/model/card", default_model_path().with_suffix(".json").read_bytes(), BYTES)
    wizard.send("/model", model[:-1] + b"x", BYTES, status=422)
    assert not list((wizard.setup / "draft").glob("*.onnx"))
