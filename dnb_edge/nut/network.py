"""The driving network that comes with the package: a small convolutional one that learnt by imitation.

Knows where its file and card lie; how it was made says `dnb_edge.train.driver`. To the vehicle it is a model like any other.
"""

from __future__ import annotations

import json
from pathlib import Path

from dnb_edge.errors import InputError
from dnb_edge.nut.model import OnnxDriver
from dnb_edge.nut.onnx import load_model

NAME = "network"
MODEL = Path(__file__).parent / "models" / "dnb-edge-driver-v1.onnx"


def network_driver(path: Path = MODEL) -> OnnxDriver:
    """The driver. Raises InputError where the file in `path` is not the one that its card, NAME.json beside it, describes:
    one flipped weight byte loads without an error and drives wrongly."""
    card = path.with_suffix(".json")
    try:
        wanted = json.loads(card.read_text(encoding="utf-8"))["sha256"]
    except (OSError, ValueError, KeyError, TypeError) as fault:
        raise InputError(
            f"{card}: no model card with a sha256 ({type(fault).__name__}): install dnb-edge again"
        ) from fault
    model = load_model(path)
    if model.sha256 != wanted:
        raise InputError(f"{path}: damaged: its SHA-256 is not that of its card: install dnb-edge again")
    return OnnxDriver(model, name=NAME)
