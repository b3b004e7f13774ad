"""Changed copies of frozen values, made for every car in every frame. Knows slots; knows nothing of cars."""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import fields
from functools import cache
from typing import Any, TypeVar

T = TypeVar("T")
Writer = Callable[[object, object], None]


def changed(value: T, **changes: Any) -> T:
    """As `dataclasses.replace`, in half its time, for a slotted dataclass of several fields that checks nothing when it is
    made."""
    kind: Any = type(value)
    read, writers, by_name = _slots(kind)
    copy: T = _new(kind)
    for write, item in zip(writers, read(value)):  # noqa: B905 - as many as there are fields, and strictness costs time
        write(copy, item)
    for name, item in changes.items():
        by_name[name](copy, item)
    return copy


_new = object.__new__


@cache
def _slots(kind: Any) -> tuple[Callable[[object], tuple[Any, ...]], tuple[Writer, ...], dict[str, Writer]]:
    """What reads all fields of the dataclass `kind` at once, and what writes each, in their order and by name."""
    by_name = {field.name: getattr(kind, field.name).__set__ for field in fields(kind)}
    return operator.attrgetter(*by_name), tuple(by_name.values()), by_name
