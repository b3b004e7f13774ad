"""Text such as `700,100` to numbers, points and lines. Knows twin pixels; knows no picture."""

from __future__ import annotations

import math
from collections.abc import Sequence

from dnb_edge.errors import InputError
from dnb_edge.track.build import LinePx
from dnb_edge.values import PointPx


def numbers(option: str, text: str, count: int) -> tuple[float, ...]:
    """The `count` finite numbers in `text`. Raises `InputError` that names `option` where it holds others."""
    try:
        found = tuple(float(part) for part in text.split(","))
    except ValueError:
        found = ()
    if len(found) != count or not all(math.isfinite(number) for number in found):
        raise InputError(f"{option} {text}: must be {count} numbers with commas between them")
    return found


def point(option: str, text: str) -> PointPx:
    """The twin px `u,v`."""
    u, v = numbers(option, text, 2)
    return u, v


def line(option: str, text: str) -> LinePx:
    """The line `u,v,u,v`, twin px."""
    u0, v0, u1, v1 = numbers(option, text, 4)
    return (u0, v0), (u1, v1)


def points(option: str, texts: Sequence[str] | None) -> tuple[PointPx, ...]:
    """Each text's twin px."""
    return tuple(point(option, text) for text in texts or ())


def lines(option: str, texts: Sequence[str] | None) -> tuple[LinePx, ...]:
    """Each text's line."""
    return tuple(line(option, text) for text in texts or ())
