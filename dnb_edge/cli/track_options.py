"""Text of options to numbers, points and lines, and the options of `track build` that say where the route goes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, TypeAlias

import typer

from dnb_edge.errors import InputError
from dnb_edge.track.build import LinePx
from dnb_edge.values import PointPx

Waypoints: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        help="A twin px u,v on a lane that the route takes; repeat it, in the order of the route. None: the only loop, or the "
        "outer one of several that hang together."
    ),
]
OpenRoute: TypeAlias = Annotated[
    bool, typer.Option("--open", help="From the first waypoint to the last instead of round.")
]
StartLine: TypeAlias = Annotated[
    str | None, typer.Option(help="Twin px u,v,u,v; cars cross it to the left of its direction.")
]
StartAt: TypeAlias = Annotated[
    str | None, typer.Option(help="Instead: a twin px u,v on the route; the line is drawn across the lane there.")
]
FinishLine: TypeAlias = Annotated[
    str | None,
    typer.Option(help="Twin px u,v,u,v: where a lap ends. None: at the start line, or near the end of the route."),
]
FinishAt: TypeAlias = Annotated[str | None, typer.Option(help="Instead: a twin px u,v on the route.")]
SectorLines: TypeAlias = Annotated[
    list[str] | None, typer.Option(help="Twin px u,v,u,v of a line whose crossings are told; repeat it.")
]
SectorsAt: TypeAlias = Annotated[list[str] | None, typer.Option(help="Instead: a twin px u,v on the route; repeat it.")]


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
