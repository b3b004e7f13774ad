"""Changed copies of frozen values, made for every car in every frame. Knows slots; knows nothing of cars."""

from __future__ import annotations

import operator
from collections.abc import Callable, Hashable
from dataclasses import fields
from functools import cache
from typing import Any, TypeVar, cast

T = TypeVar("T")
Setter = Callable[[object, object], None]


def changed(value: T, **changes: Any) -> T:
    """As `dataclasses.replace`, in half its time, for a slotted dataclass that checks nothing when it is made."""
    kind = type(value)
    get, setters = _slots(cast("Hashable", kind))
    copy = object.__new__(kind)
    for put, item in zip(setters.values(), get(value), strict=True):
        put(copy, item)
    for name, item in changes.items():
        setters[name](copy, item)
    return copy


@cache
def _slots(kind: Any) -> tuple[Callable[[object], tuple[Any, ...]], dict[str, Setter]]:
    """What reads all fields of the dataclass `kind` at once, and what writes each."""
    names = [field.name for field in fields(kind)]
    return operator.attrgetter(*names), {name: getattr(kind, name).__set__ for name in names}
