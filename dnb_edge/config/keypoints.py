"""Keypoint pairs from a YAML file, the form that a person writes.

    image_size: [3840, 2160]        # of the picture on which the camera points were clicked; may be left out
    pairs:
      - {name: north gate, camera_px: [1158, 1227], twin_px: [2324, 999]}
      - ...

Knows YAML and the file's form; what makes pairs good is `view.keypoints`' knowledge.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import yaml
from pydantic import BaseModel, Field, ValidationError

from dnb_edge.config.load import ConfigLoader
from dnb_edge.config.sections import STRICT, Number, Whole
from dnb_edge.errors import InputError
from dnb_edge.view.keypoints import KeypointPairs

_FORM = "it must hold pairs, a list of {name: ..., camera_px: [u, v], twin_px: [u, v]}"


class _Pair(BaseModel):
    model_config = STRICT

    name: str | Whole | None = None
    camera_px: tuple[Number, Number]
    twin_px: tuple[Number, Number]


class _File(BaseModel):
    model_config = STRICT

    image_size: tuple[Annotated[Whole, Field(gt=0)], Annotated[Whole, Field(gt=0)]] | None = None
    pairs: tuple[_Pair, ...]


def load_yaml_pairs(path: Path) -> KeypointPairs:
    """The pairs in the YAML file `path`. Raises `InputError` naming the file, and the line or key at fault."""
    try:
        data = yaml.load(path.read_text(encoding="utf-8"), Loader=ConfigLoader)  # noqa: S506 a safe loader
    except OSError as error:
        raise InputError(f"{path}: cannot read the keypoints ({error.strerror}): check the path") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text: {_FORM}") from error
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark else ""
        raise InputError(f"{path}{where}: not valid YAML: {getattr(error, 'problem', None) or error}") from error
    except (TypeError, RecursionError) as error:
        raise InputError(f"{path}: not plain YAML: {error}; {_FORM}") from error
    if not isinstance(data, dict):
        raise InputError(f"{path}: no keypoints in it: {_FORM}")
    try:
        file = _File.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise InputError(f"{path}: {key}: {_what(first['type'], str(first['msg']))}; {_FORM}") from error
    for k, pair in enumerate(file.pairs):
        if isinstance(pair.name, str) and not (pair.name.strip() and pair.name.isprintable()):
            raise InputError(f"{path}: pairs.{k}.name: {pair.name!r} cannot be told in a line: use letters and digits")
    return KeypointPairs(
        camera_px=tuple(pair.camera_px for pair in file.pairs),
        twin_px=tuple(pair.twin_px for pair in file.pairs),
        names=tuple(str(k if pair.name is None else pair.name) for k, pair in enumerate(file.pairs, start=1)),
        source=str(path),
        image_size_px=file.image_size,
    )


def _what(kind: str, message: str) -> str:
    return {"extra_forbidden": "unknown key", "missing": "is missing"}.get(kind, message[:1].lower() + message[1:])
