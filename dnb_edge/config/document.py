"""Reading a YAML document of ours: one line for whatever is wrong with it, the same for every kind of file.

Knows YAML, a document's `format` and `version`, pydantic's complaints, and the parts that more than one kind of file has.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import yaml
from pydantic import BaseModel, Field, ValidationError

from dnb_edge.config.sections import STRICT, Number, Whole
from dnb_edge.config.text import plain
from dnb_edge.errors import InputError

Model = TypeVar("Model", bound=BaseModel)

Size = Annotated[Whole, Field(gt=0)]
"""A length of a picture, px."""


class Part(BaseModel):
    """A part of a document: no unknown keys."""

    model_config = STRICT


class CameraPart(Part):
    """Which camera, and the size of its pictures."""

    id: str | None
    width_px: Size
    height_px: Size


class LensPart(Part):
    """A `view.lens.Lens` but for the size of the pictures, which is the camera's."""

    model: Literal["pinhole", "fisheye"]
    fx_px: Number
    fy_px: Number
    cx_px: Number
    cy_px: Number
    distortion: tuple[Number, ...]


def read_mapping(path: Path, *, what: str, remedy: str) -> dict[str, Any]:
    """The mapping in the YAML file `path`. Raises `InputError` naming the file and, where it is known, the line.

    `what` says what the file should hold, as in "cannot read the lens file"; `remedy` what to do where it does not.
    """
    try:
        # A BOM is what some editors put before any text.
        text = path.read_text(encoding="utf-8-sig")
        data = plain(text)
    except OSError as error:
        raise InputError(f"{path}: cannot read the {what} ({error.strerror or error}): check the path") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a {what}, not even text: {remedy}") from error
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark else ""
        why = getattr(error, "problem", None) or error
        raise InputError(f"{path}{where}: not a {what}, not valid YAML ({why}): {remedy}") from error
    if not isinstance(data, dict):
        raise InputError(f"{path}: not a {what}: {remedy}")
    return data


def check_format(data: dict[str, Any], path: Path, *, what: str, file_format: str, version: int, remedy: str) -> None:
    """Raises `InputError` where the document says that it is something else, or of another version."""
    if data.get("format") != file_format:
        raise InputError(f"{path}: not a {what}: {remedy}")
    if data.get("version") != version:
        raise InputError(f"{path}: a {what} of version {data.get('version')!r}, known is {version}: {remedy}")


def validated(model: type[Model], data: dict[str, Any], path: Path, *, remedy: str) -> Model:
    """The document as `model`. Raises `InputError` naming the first key that is wrong."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise InputError(f"{path}: {first_fault(error)}: {remedy}") from error


def first_fault(error: ValidationError) -> str:
    """The first of pydantic's complaints as `key: what is wrong`."""
    first: Any = error.errors()[0]
    key = ".".join(str(part) for part in first["loc"])
    text = str(first["msg"]).removeprefix("Value error, ")
    words = {"extra_forbidden": "unknown key", "missing": "is missing"}
    return f"{key}: {words.get(first['type'], text[:1].lower() + text[1:])}"
