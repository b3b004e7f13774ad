"""Saving: the draft becomes setup/dnb-edge.yaml and the files that it names.

All files are written first, each under a name with its content's hash; the configuration is loaded and assembled as the daemon
would; only then it takes its name, and the one before stays as dnb-edge.yaml.bak. Parts of that one which the set-up knows
nothing of, such as rules and displays, are taken over. Knows the draft and the configuration; knows no daemon.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import yaml

from dnb_edge.assembly import assemble, check_detector, check_source
from dnb_edge.config.calibration_file import calibration_file
from dnb_edge.config.load import load_config
from dnb_edge.config.text import parse_lines
from dnb_edge.errors import InputError, WorkError
from dnb_edge.report.files import write_whole
from dnb_edge.values import Clock, SourceInfo
from dnb_edge.view.calibration import InputFile
from dnb_edge.web.setup_draft import Draft, DraftStore, StoredModel, StoredPicture
from dnb_edge.web.setup_steps import Understood, unready

CONFIG = "dnb-edge.yaml"
BACKUP = f"{CONFIG}.bak"
_TRIED = "dnb-edge.new.yaml"
_OURS = re.compile(r"(?:twin|view|keypoints|reference|model)-[0-9a-f]{16}\.(?:png|jpg|yaml|onnx|json)")
_HEAD = (
    "# Written by the set-up page. What stands outside of track, view and capture may be changed by hand and stays.\n"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Saved:
    """What was put in place."""

    config: Path
    files: tuple[str, ...]
    note: str | None = None
    """What the user should know of it."""


def save(known: Understood, setup: Path, store: DraftStore, *, source: str | None) -> Saved:
    """Puts the draft in place. `source`: the camera that the daemon has, for a draft that names none.

    Raises `InputError` where something is missing or does not fit together, `WorkError` where the disk refuses; what was in
    place before is in place then, too.
    """
    missing = unready(known)
    if missing:
        raise InputError(f"this cannot be saved yet: {missing[0]}")
    draft, track, found = known.draft, known.track, known.keypoints.found
    assert draft.twin is not None, "ready drafts have a twin"
    assert draft.photo is not None, "ready drafts have a picture"
    assert track.scale is not None, "ready drafts have a scale"
    assert found is not None, "ready drafts have a map"
    twin = _put(setup, "twin", _suffix(draft.twin), _read(store, draft.twin))
    reference = _put(setup, "reference", _suffix(draft.photo), _read(store, draft.photo))
    keypoints = _put(setup, "keypoints", ".yaml", _keypoints_file(draft))
    calibration = replace(
        found.fit.calibration,
        made_at=datetime.now().astimezone().isoformat(timespec="seconds"),
        inputs=(keypoints, twin),
        reference=reference,
        notes=found.notes,
    )
    view = _put(setup, "view", ".yaml", calibration_file(calibration))
    models = _put_model(setup, store, draft.model)
    before, note = _before(setup / CONFIG)
    config = {**before, **_sections(draft, track.scale.metres_per_px, twin.name, view.name, source, before)}
    config = {**config, **_detector(draft.model, before)}
    text = _HEAD + yaml.safe_dump(config, sort_keys=False, allow_unicode=True, width=128)
    _try(setup, text, draft.photo)
    old = _text(setup / CONFIG)
    if old is not None:
        _write(setup / BACKUP, old)
    _write(setup / CONFIG, text.encode())
    _sweep(setup)
    files = (CONFIG, twin.name, view.name, keypoints.name, reference.name, *models)
    return Saved(config=setup / CONFIG, files=files, note=note)


def _sections(
    draft: Draft, metres_per_px: float, twin: str, view: str, source: str | None, before: dict[str, Any]
) -> dict[str, Any]:
    """The sections that the set-up writes, plain YAML types."""
    assert draft.lane is not None, "ready drafts have a lane"
    lane: dict[str, Any] = (
        {"lane_hsv": list(draft.lane.hsv)} if draft.lane.hsv is not None else {"lane": str(draft.lane.shade)}
    )
    track = {"name": draft.name, "image": twin, **lane, "metres_per_px": metres_per_px}
    if not draft.route.closed:
        track["closed"] = False
    lines = draft.lines
    for key, value in (
        ("waypoints_px", draft.route.waypoints_px),
        ("close_gap_px", draft.route.close_gap_px),
        ("start_line_px", lines.start_px),
        ("finish_line_px", lines.finish_px),
        ("sector_lines_px", lines.sectors_px),
    ):
        if value:
            track[key] = _plain(value)
    own = before.get("capture")
    capture = dict(own) if isinstance(own, dict) else {}
    asked = draft.camera.model_dump(exclude_none=True)
    capture |= asked
    if "source" not in asked and source is not None:
        capture["source"] = source
    if draft.photo is not None and draft.photo.from_camera:
        # The mode in which the keypoints were clicked is the one to race in.
        capture |= {"width_px": draft.photo.width_px, "height_px": draft.photo.height_px}
    own = before.get("view")
    height = {"camera_height_m": own["camera_height_m"]} if isinstance(own, dict) and "camera_height_m" in own else {}
    sections = {
        "version": 1,
        "track": track,
        "view": {"calibration": view, "max_mean_error_m": draft.limit_mm / 1000.0, **height},
    }
    return sections | ({"capture": capture} if capture else {})


def _put_model(setup: Path, store: DraftStore, model: StoredModel | None) -> tuple[str, ...]:
    """Copies the model's files under their names, which hold the model's hash; their names."""
    names = () if model is None else model.files
    for name in names:
        data = _text(store.folder / name)
        if data is None:
            raise InputError("the model of the draft is gone from the box's disk: give it anew")
        _write(setup / name, data)
    return names


def _detector(model: StoredModel | None, before: dict[str, Any]) -> dict[str, Any]:
    """The section `detector` where the set-up has a say in it: a model that was given, or one of ours that is not any more."""
    own = before.get("detector")
    detector = dict(own) if isinstance(own, dict) else {}
    if model is not None:
        return {"detector": detector | {"model": model.file}}
    if _OURS.fullmatch(str(detector.get("model"))) is None:
        return {}
    del detector["model"]
    return {"detector": detector}


def _plain(value: Any) -> Any:
    return [_plain(one) for one in value] if isinstance(value, tuple) else value


def _keypoints_file(draft: Draft) -> bytes:
    assert draft.photo is not None, "ready drafts have a picture"
    pairs = [
        {"name": pair.name, "camera_px": list(pair.camera_px), "twin_px": list(pair.twin_px)}
        for pair in draft.pairs
        if pair.camera_px is not None and pair.twin_px is not None
    ]
    document = {"image_size": [draft.photo.width_px, draft.photo.height_px], "pairs": pairs}
    return yaml.safe_dump(document, sort_keys=False, default_flow_style=None, allow_unicode=True, width=128).encode()


def _before(path: Path) -> tuple[dict[str, Any], str | None]:
    """The configuration that is in place, and what to say of it; nothing where there is none, or none that can be read."""
    text = _text(path)
    if text is None:
        return {}, None
    try:
        data, _ = parse_lines(path, text.decode(), what="the configuration")
    except (InputError, UnicodeDecodeError):
        return {}, f"The configuration that was in place could not be read: it is kept as {BACKUP}."
    return data, None


def _try(setup: Path, text: str, photo: StoredPicture) -> None:
    """Raises `InputError` where the daemon would not take the configuration for frames of the picture's size."""
    path = setup / _TRIED
    _write(path, text.encode())
    try:
        config = load_config(path)
        check_source(config.capture)
        check_detector(config.detector)
        assemble(
            config,
            SourceInfo(
                uri=config.capture.source or "the picture",
                width_px=photo.width_px,
                height_px=photo.height_px,
                nominal_fps=None,
                clock=Clock.MONOTONIC,
                live=False,
            ),
        )
    except InputError as error:
        raise InputError(str(error).replace(str(path), CONFIG)) from error
    finally:
        path.unlink(missing_ok=True)


def _put(setup: Path, kind: str, suffix: str, data: bytes) -> InputFile:
    """Writes a file under its name with its content's hash, where it is not there yet."""
    sha256 = hashlib.sha256(data).hexdigest()
    name = f"{kind}-{sha256[:16]}{suffix}"
    if not (setup / name).is_file():
        _write(setup / name, data)
    return InputFile(name=name, sha256=sha256)


def _sweep(setup: Path) -> None:
    """Deletes files of ours that neither the configuration nor the one before needs."""
    told = b"".join(_text(path) or b"" for path in (setup / CONFIG, setup / BACKUP))
    named = set(_OURS.findall(told.decode(errors="replace")))
    named |= {f"{name.removesuffix('.onnx')}.json" for name in named if name.endswith(".onnx")}
    views = b"".join(_text(setup / name) or b"" for name in named if name.endswith(".yaml"))
    named |= set(_OURS.findall(views.decode(errors="replace")))
    for path in setup.iterdir():
        if _OURS.fullmatch(path.name) and path.name not in named:
            path.unlink(missing_ok=True)


def _suffix(picture: StoredPicture) -> str:
    return Path(picture.file).suffix


def _read(store: DraftStore, picture: StoredPicture) -> bytes:
    data = _text(store.path(picture))
    if data is None:
        raise InputError("a picture of the draft is gone from the box's disk: give the twin and take the picture anew")
    return data


def _text(path: Path) -> bytes | None:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise WorkError(f"{path}: cannot be read: {error.strerror or error}") from error


def _write(path: Path, data: bytes) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, data)
    except InputError as error:
        raise WorkError(str(error)) from error
    except OSError as error:
        raise WorkError(f"{path}: cannot be written: {error.strerror or error}") from error
