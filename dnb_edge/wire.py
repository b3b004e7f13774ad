"""Values to plain JSON objects and back, exactly: floats go by their shortest round-trip text, so nothing is lost.

One generic codec for the frozen dataclasses of `values`: the command line's JSON lines and the recording's JSON channels
are the same text. `event` names the type. Knows no file and no stream.
"""

from __future__ import annotations

import dataclasses
import json
import math
import types
import typing
from collections.abc import Callable, Hashable, Sequence
from enum import Enum
from functools import cache
from typing import Any, TypeAlias, TypeVar

from dnb_edge import values

T = TypeVar("T")
Read: TypeAlias = Callable[[Any], Any]

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
    values.VehicleReport: "vehicle",
    values.RunSummary: "run",
}
"""The `event` member of each kind of event's JSON object."""

_JSON = json.JSONDecoder()

_ATOMS = frozenset({float, int, str, bool, type(None)})
"""Types whose values are plain JSON already."""


def to_dict(value: object) -> dict[str, Any]:
    """`value`, a dataclass instance, as a dict of plain JSON types, nested dataclasses included."""
    names = _field_names(typing.cast("Hashable", type(value)))
    return {name: _plain(getattr(value, name)) for name in names}


def event_to_json(event: values.Event) -> str:
    """One line of JSON without line feed; first member `event`, then the event's fields in order."""
    return json.dumps({"event": EVENT_NAMES[type(event)], **to_dict(event)}, allow_nan=False)


def from_dict(cls: type[T], data: dict[str, Any]) -> T:
    """The instance of dataclass `cls` that `to_dict` made `data` from. Unknown members are ignored, so that newer
    recordings stay readable; a missing member without a default, one of another type, a number that is not finite and a whole
    number beyond 64 bits raise `ValueError`."""
    made: T = _reader(typing.cast("Hashable", cls))(data)
    return made


def member(kind: Any, data: dict[str, Any], name: str) -> Any:
    """Member `name` of `data`, plain JSON types, read as a dataclass's member of the type `kind` is.

    Raises `KeyError` where there is none, `ValueError` naming it where it is of another kind.
    """
    read, value = _reader_of(kind), data[name]
    try:
        return value if read is None else read(value)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from error


def from_json(cls: type[T], text: bytes) -> T:
    """The instance of dataclass `cls` behind one JSON object in UTF-8. Raises `ValueError` where that is none, and as
    `from_dict` does."""
    try:
        return from_dict(cls, _loaded(text))
    except RecursionError as error:
        raise ValueError("nested too deeply") from error


def json_schema(cls: type) -> dict[str, Any]:
    """A JSON Schema (2020-12) object for the dataclass `cls`, as Foxglove's JSON channels want it."""
    kinds = _field_types(cls)
    return {
        "title": cls.__name__,
        "type": "object",
        "description": (cls.__doc__ or "").strip(),
        "properties": {name: _schema_of(kind) for name, kind in kinds.items()},
    }


def _loaded(text: bytes) -> Any:
    """As `json.loads`, which takes half as long again for what is the rule: UTF-8 and nothing round the value."""
    try:
        value, end = _JSON.raw_decode(text.decode())
    except ValueError:
        return json.loads(text)
    return value if end == len(text) else json.loads(text)


@cache
def _field_types(cls: Any) -> dict[str, Any]:
    return typing.get_type_hints(cls)


@cache
def _field_names(cls: Any) -> tuple[str, ...]:
    assert dataclasses.is_dataclass(cls), cls
    return tuple(field.name for field in dataclasses.fields(cls))


def _plain(value: object) -> Any:
    if value.__class__ in _ATOMS:
        return value
    if isinstance(value, tuple | list):
        return [item if item.__class__ in _ATOMS else _plain(item) for item in value]
    if isinstance(value, Enum):
        return value.value
    return to_dict(value) if dataclasses.is_dataclass(value) else value


@cache
def _reader(cls: Any) -> Read:
    """What makes an instance of the dataclass `cls` of a dict: the types are looked at here, once, and not for each value."""
    readers = {name: _reader_of(kind) for name, kind in _field_types(cls).items()}
    names = readers.keys()
    typed = tuple((name, read) for name, read in readers.items() if read is not None)

    def read_instance(data: Any) -> Any:
        if not isinstance(data, dict):
            raise ValueError(f"{_shown(data)} where a {cls.__name__} is wanted")  # noqa: TRY004 one kind of error
        known = data.copy() if data.keys() == names else {name: data[name] for name in names if name in data}
        for name, read in typed:
            if name in known:
                known[name] = read(known[name])
        try:
            return cls(**known)
        except TypeError as error:
            raise ValueError(f"{cls.__name__}: {error}") from error

    return read_instance


def _reader_of(kind: Any) -> Read | None:
    """What makes a value of the type `kind` of plain JSON; None where that is the same."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (types.UnionType, typing.Union):
        (kind,) = (argument for argument in arguments if argument is not type(None))
        read = _reader_of(kind)
        return None if read is None else _optional(read)
    if origin is tuple:
        if len(arguments) == 2 and arguments[1] is Ellipsis:
            return _row(_reader_of(arguments[0]))
        return _fixed_row([_reader_of(argument) for argument in arguments])
    if dataclasses.is_dataclass(kind):
        return _reader(typing.cast("Hashable", kind))
    if isinstance(kind, type) and issubclass(kind, Enum):
        return kind
    return _READERS.get(origin if origin is dict else kind)


def _optional(read: Read) -> Read:
    return lambda value: None if value is None else read(value)


def _row(read: Read | None) -> Read:
    """Of a tuple of any length, all of one type."""
    return lambda value: tuple(_listed(value) if read is None else map(read, _listed(value)))


def _fixed_row(reads: Sequence[Read | None]) -> Read:
    """Of a tuple with a type for each place. Raises `ValueError` where there are more or fewer items than places."""
    if all(read is _number for read in reads):
        count = len(reads)

        def floats(value: Any) -> tuple[float, ...]:
            if len(_listed(value)) != count:
                raise ValueError(f"{len(value)} numbers where {count} are wanted")
            return tuple(map(_number, value))

        return floats
    return lambda value: tuple(
        item if read is None else read(item) for read, item in zip(reads, _listed(value), strict=True)
    )


def _listed(value: Any) -> Any:
    """`value`, a list. Raises `ValueError` where it is none."""
    if value.__class__ is not list and not isinstance(value, list | tuple):
        raise ValueError(f"{_shown(value)} where a list is wanted")
    return value


def _number(value: Any) -> float:
    """A finite number. Raises `ValueError` for anything else."""
    if value.__class__ is not float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"{_shown(value)} where a number is wanted")
        value = float(value) if abs(value) < _BEYOND_WHOLE else math.inf
    if value - value != 0.0:
        raise ValueError(f"{value} where a finite number is wanted")
    return typing.cast("float", value)


def _whole(value: Any) -> int:
    """A whole number of 64 bits. Raises `ValueError` for anything else."""
    if value.__class__ is not int or not -_BEYOND_WHOLE < value < _BEYOND_WHOLE:
        raise ValueError(f"{_shown(value)} where a whole number is wanted")
    return value


def _text(value: Any) -> str:
    """Text. Raises `ValueError` for anything else."""
    if not isinstance(value, str):
        raise ValueError(f"{_shown(value)} where text is wanted")  # noqa: TRY004 one kind of error
    return value


def _truth(value: Any) -> bool:
    """True or False. Raises `ValueError` for anything else."""
    if not isinstance(value, bool):
        raise ValueError(f"{_shown(value)} where true or false is wanted")  # noqa: TRY004 one kind of error
    return value


def _mapping(value: Any) -> dict[str, Any]:
    """A copy of an object of plain JSON. Raises `ValueError` for anything else."""
    if not isinstance(value, dict):
        raise ValueError(f"{_shown(value)} where an object is wanted")  # noqa: TRY004 one kind of error
    return dict(value)


def _shown(value: Any) -> str:
    """`value` as an error tells it."""
    text = repr(value) if isinstance(value, str | float | bool | None) else type(value).__name__
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."


_READERS: dict[Any, Read] = {float: _number, int: _whole, str: _text, bool: _truth, dict: _mapping}
_BEYOND_WHOLE = 2**63
_SHOWN = 60


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
