"""Values to plain JSON objects and back, exactly: floats go by their shortest round-trip text, so nothing is lost.

One generic codec for the frozen dataclasses of `values`: the command line's JSON lines and the recording's JSON channels
are the same text. `event` names the type. Knows no file and no stream.
"""

from __future__ import annotations

import dataclasses
import json
import types
import typing
from collections.abc import Hashable
from enum import Enum
from functools import cache
from typing import Any, TypeVar

from dnb_edge import values

T = TypeVar("T")

EVENT_NAMES: dict[type, str] = {
    values.Observation: "observation",
    values.Target: "target",
    values.Crossing: "crossing",
    values.Incident: "incident",
    values.Lap: "lap",
    values.Score: "score",
    values.Running: "running",
    values.RaceState: "race",
    values.Standings: "standings",
    values.Health: "health",
    values.RunSummary: "run",
}
"""The `event` member of each kind of event's JSON object."""


def to_dict(value: object) -> dict[str, Any]:
    """`value`, a dataclass instance, as a dict of plain JSON types, nested dataclasses included."""
    assert dataclasses.is_dataclass(value), value
    return {field.name: _plain(getattr(value, field.name)) for field in dataclasses.fields(value)}


def event_to_json(event: values.Event) -> str:
    """One line of JSON without line feed; first member `event`, then the event's fields in order."""
    return json.dumps({"event": EVENT_NAMES[type(event)], **to_dict(event)}, allow_nan=False)


def from_dict(cls: type[T], data: dict[str, Any]) -> T:
    """The instance of dataclass `cls` that `to_dict` made `data` from. Unknown members are ignored, so that newer
    recordings stay readable; a missing member without a default raises `ValueError`."""
    kinds = _field_types(typing.cast("Hashable", cls))
    known = {name: _typed(kinds[name], data[name]) for name in kinds if name in data}
    try:
        return cls(**known)
    except TypeError as error:
        raise ValueError(f"{cls.__name__}: {error}") from error


def json_schema(cls: type) -> dict[str, Any]:
    """A JSON Schema (2020-12) object for the dataclass `cls`, as Foxglove's JSON channels want it."""
    kinds = _field_types(cls)
    return {
        "title": cls.__name__,
        "type": "object",
        "description": (cls.__doc__ or "").strip(),
        "properties": {name: _schema_of(kind) for name, kind in kinds.items()},
    }


@cache
def _field_types(cls: Any) -> dict[str, Any]:
    return typing.get_type_hints(cls)


def _plain(value: object) -> Any:
    if dataclasses.is_dataclass(value):
        return to_dict(value)
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    return value


def _typed(kind: Any, value: Any) -> Any:
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (types.UnionType, typing.Union):
        if value is None:
            return None
        (kind,) = (argument for argument in arguments if argument is not type(None))
        return _typed(kind, value)
    if origin is tuple:
        if len(arguments) == 2 and arguments[1] is Ellipsis:
            return tuple(_typed(arguments[0], item) for item in value)
        return tuple(_typed(argument, item) for argument, item in zip(arguments, value, strict=True))
    if dataclasses.is_dataclass(kind):
        assert isinstance(kind, type)
        return from_dict(kind, value)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return kind(value)
    return float(value) if kind is float else value


def _schema_of(kind: Any) -> dict[str, Any]:
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (types.UnionType, typing.Union):
        return {"anyOf": [_schema_of(argument) for argument in arguments]}
    if origin is tuple:
        return {"type": "array", "items": _schema_of(arguments[0])}
    if dataclasses.is_dataclass(kind):
        assert isinstance(kind, type)
        return json_schema(kind)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return {"type": "string", "enum": [member.value for member in kind]}
    names = {float: "number", int: "integer", str: "string", bool: "boolean", type(None): "null"}
    return {"type": names[kind]}
