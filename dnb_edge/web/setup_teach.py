"""A detector taught to one's own car: how to teach one elsewhere, and how what was taught comes onto the box.

Teaching takes a quarter of an hour of a computer's whole power and its labels want to be looked at before, so it is a command
and nothing that a page starts on a box that races. What it wrote, a model and its card, is given to the page, tried as the race
would use it, and raced with once the set-up is saved. Knows files, the draft and the detectors; knows no network.
"""

from __future__ import annotations

import hashlib
import json
import shlex
from pathlib import Path

from dnb_edge.assembly import detector_of
from dnb_edge.config.schema import DetectorConfig
from dnb_edge.errors import InputError
from dnb_edge.web.setup_draft import Draft, DraftStore, StoredModel
from dnb_edge.web.setup_models import TeachAnswer
from dnb_edge.web.setup_save import CONFIG

MOST_CARD_BYTES = 64 * 1024
_SUFFIX = ".mcap"
_FIRST = "Record a drive of about a minute first, with the camera standing still: save, then let the car drive."
_HOW = (
    "Teaching takes a quarter of an hour of a computer with the extra `train` installed, better another one than this box: "
    "download the recording from the runs' page. The command shows its labels on a contact sheet, asks which are wrong, and "
    "says before and after. A clip of the same drive teaches more than a recording. Then give the box the two files that it "
    "wrote, the model and its card."
)


def how(runs: Path, setup: Path) -> TeachAnswer:
    """The commands, with the newest finished recording in `runs` and the configuration in `setup` in them."""
    newest = _newest(runs)
    if newest is None:
        return TeachAnswer(recording=None, text=_FIRST, commands=[])
    teach = ["dnb-edge", "teach", newest.name, "--config", str(setup / CONFIG), "--out", "taught"]
    return TeachAnswer(recording=newest.stem, text=_HOW, commands=["pip install 'dnb-edge[train]'", shlex.join(teach)])


def keep_card(store: DraftStore, data: bytes) -> Draft:
    """Keeps a model's card (JSON, as `dnb-edge teach` writes it). Raises `InputError` where it is none."""
    if len(data) > MOST_CARD_BYTES:
        raise InputError("the model's card: is too long for one: give the .json that `dnb-edge teach` wrote")
    try:
        card = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise InputError(
            f"the model's card: is no JSON ({error}): give the .json that `dnb-edge teach` wrote"
        ) from error
    sha256 = card.get("sha256") if isinstance(card, dict) else None
    if not isinstance(sha256, str) or len(sha256) != 64 or not sha256.isalnum():
        raise InputError("the model's card: has no `sha256` of its model: give the .json that `dnb-edge teach` wrote")
    store.write(f"model-{sha256[:16].lower()}.json", data)
    return store.load()


def keep_model(store: DraftStore, data: bytes) -> Draft:
    """Keeps a model (ONNX) that the race can look with. Raises `InputError` where it cannot, saying why."""
    sha256 = hashlib.sha256(data).hexdigest()
    file = f"model-{sha256[:16]}.onnx"
    store.write(file, data)
    path = store.folder / file
    try:
        detector_of(DetectorConfig(model=path))
    except InputError as error:
        path.unlink(missing_ok=True)
        raise InputError(_in_words(str(error), path)) from error
    model = StoredModel(file=file, sha256=sha256, with_card=path.with_suffix(".json").exists())
    return store.change(lambda draft: draft.model_copy(update={"model": model}))


def forget_model(store: DraftStore) -> Draft:
    """Back to the model that came with the box."""
    return store.change(lambda draft: draft.model_copy(update={"model": None}))


def _in_words(fault: str, path: Path) -> str:
    """The fault without paths of this box, which nobody at a page knows."""
    card = path.with_suffix(".json")
    for place, name in ((card, "the model's card"), (path, "the model"), (card.name, "its .json"), (path.name, "it")):
        fault = fault.replace(str(place), name)
    return fault


def _newest(runs: Path) -> Path | None:
    """The newest finished recording; None where there is none."""
    if not runs.is_dir():
        return None
    found = [(path.stat().st_mtime_ns, path) for path in runs.iterdir() if path.suffix == _SUFFIX and path.is_file()]
    return max(found)[1] if found else None
