"""The codec that builds its readers once gives what the plain walk over the types gives, for every value that is recorded."""

from __future__ import annotations

import dataclasses
import json
import math
import types
import typing
from enum import Enum
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnb_edge import values, wire

KINDS = (values.FrameDetections, *wire.EVENT_NAMES)


def slow_from_dict(cls: Any, data: Any) -> Any:
    """The reference: walks the types anew for each value."""
    kinds = typing.get_type_hints(cls)
    if not isinstance(data, dict):
        raise TypeError(f"{data} is no object")
    known = {name: _typed(kinds[name], data[name]) for name in kinds if name in data}
    try:
        return cls(**known)
    except TypeError as error:
        raise ValueError(f"{cls.__name__}: {error}") from error


def _typed(kind: Any, value: Any) -> Any:
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (types.UnionType, typing.Union):
        (kind,) = (argument for argument in arguments if argument is not type(None))
        return None if value is None else _typed(kind, value)
    if origin is tuple:
        if not isinstance(value, list):
            raise TypeError(f"{value} is no list")
        if len(arguments) == 2 and arguments[1] is Ellipsis:
            return tuple(_typed(arguments[0], item) for item in value)
        return tuple(_typed(argument, item) for argument, item in zip(arguments, value, strict=True))
    if dataclasses.is_dataclass(kind):
        return slow_from_dict(kind, value)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return kind(value)
    wanted = (int, float) if kind is float else kind
    if kind in (float, int, str, bool) and (
        not isinstance(value, wanted) or (kind is not bool and isinstance(value, bool))
    ):
        raise TypeError(f"{value} is no {kind}")
    if isinstance(value, int | float) and not abs(value) < (math.inf if isinstance(value, float) else 2**63):
        raise ValueError(f"{value} is too large")
    return float(value) if kind is float else value


def slow_plain(value: Any) -> Any:
    """The reference: walks the value."""
    if dataclasses.is_dataclass(value):
        return {field.name: slow_plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, tuple | list):
        return [slow_plain(item) for item in value]
    return value


def tame(value: Any) -> Any:
    """`value` with numbers that can be recorded: finite ones, and whole ones of 64 bits."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return type(value)(**{field.name: tame(getattr(value, field.name)) for field in dataclasses.fields(value)})
    if isinstance(value, tuple):
        return tuple(tame(item) for item in value)
    if isinstance(value, float):
        return value if math.isfinite(value) else 0.5
    return value % 2**63 if type(value) is int else value


ANY_VALUE: st.SearchStrategy[Any] = st.sampled_from(KINDS).flatmap(st.from_type).map(tame)


@given(value=ANY_VALUE)
@settings(max_examples=300, deadline=None)
def test_every_recorded_value_survives_the_way_to_text_and_back(value: Any) -> None:
    """Writing is what the plain walk writes, and reading its text gives back the value, types included."""
    plain = wire.to_dict(value)
    assert repr(plain) == repr(slow_plain(value))
    again = wire.from_dict(type(value), json.loads(json.dumps(plain)))
    assert again == value
    assert repr(again) == repr(value)


JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3) | st.sampled_from(["forward", "lap"]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=6,
)


@given(value=ANY_VALUE, data=st.data())
@settings(max_examples=500, deadline=None)
def test_whatever_a_message_holds_is_read_or_refused_as_by_the_plain_walk(value: Any, data: st.DataObject) -> None:
    """Members left out, added, or of any other kind: the same value, or refused by both."""
    kind, members = type(value), wire.to_dict(value)
    for name in data.draw(st.lists(st.sampled_from(sorted(members)), unique=True, max_size=3)):
        if data.draw(st.booleans()):
            del members[name]
        else:
            members[name] = data.draw(JSON_VALUES)
    members["of_another_version"] = 1
    assert _outcome(wire.from_dict, kind, members) == _outcome(slow_from_dict, kind, members)


def _outcome(read: Any, kind: type, members: Any) -> str:
    try:
        return repr(read(kind, members))
    except (ValueError, TypeError, KeyError, AttributeError):
        # Which of these it is may differ where more than one thing is wrong; the reader of recordings knows them all.
        return "refused"


def test_a_missing_member_is_named() -> None:
    """A message without a member that has no default is refused, with the value's name and the member's."""
    with pytest.raises(ValueError, match=r"FrameDetections: .*'sequence'"):
        wire.from_dict(values.FrameDetections, {"t_ns": 1, "detections": [], "full_frame": True})


@pytest.mark.parametrize(
    ("member", "value", "says"),
    [
        ("confidence", "0.5", "'0.5' where a number is wanted"),
        ("confidence", True, "True where a number is wanted"),
        ("confidence", math.nan, "nan where a finite number is wanted"),
        ("confidence", 10**400, "inf where a finite number is wanted"),
        ("camera_px", "ab", "'ab' where a list is wanted"),
        ("moving", 1, "int where true or false is wanted"),
    ],
)
def test_a_member_of_another_kind_is_refused(member: str, value: Any, says: str) -> None:
    """What is damaged or hostile goes no further than the codec: the core need not look at types."""
    detection = {"camera_px": [1.0, 2.0], "sigma_px": 1.0, "length_px": 9.0, "confidence": 0.5, member: value}
    with pytest.raises(ValueError, match=says):
        wire.from_dict(values.Detection, detection)


@pytest.mark.parametrize("t_ns", [1.0, 2**63, 10**400, "1", None, True])
def test_a_stamp_is_a_whole_number_of_64_bits(t_ns: Any) -> None:
    """Nothing else is a stamp: a huge one would stop the core's arithmetic."""
    with pytest.raises(ValueError, match="where a whole number is wanted"):
        wire.from_dict(values.FrameDetections, {"sequence": 1, "t_ns": t_ns, "detections": [], "full_frame": True})


def test_a_message_nested_without_end_is_refused() -> None:
    """Python's own limit of recursion is told as what it is: a message that is wrong."""
    with pytest.raises(ValueError, match="nested too deeply"):
        wire.from_json(values.FrameDetections, b"[" * 100_000)


@pytest.mark.parametrize("point", [[1.0], [1.0, 2.0, 3.0], []])
def test_a_point_has_two_numbers(point: list[float]) -> None:
    """A tuple of another length than its type's is refused."""
    detection = {"camera_px": point, "sigma_px": 1.0, "length_px": 9.0, "confidence": 0.5}
    with pytest.raises(ValueError, match="2"):
        wire.from_dict(values.Detection, detection)


@given(
    text=st.binary(max_size=20)
    | JSON_VALUES.map(lambda value: f" {json.dumps(value)}".encode())
    | st.text().map(str.encode)
)
@pytest.mark.parametrize("around", [b"", b" ", b"\xef\xbb\xbf"])
def test_text_is_read_as_by_the_standard_library(around: bytes, text: bytes) -> None:
    """Whatever stands in a message: read or refused as `json.loads` does, in any of its encodings, with blanks round it."""
    for one in (text, text.strip(), around + text, text + around, json.dumps(text.decode("latin-1")).encode("utf-16")):
        assert _outcome(lambda _, given: wire._loaded(given), dict, one) == _outcome(
            lambda _, given: json.loads(given), dict, one
        )
