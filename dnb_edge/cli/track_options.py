"""The options of `track build` that say where the route goes."""

from __future__ import annotations

from typing import Annotated, TypeAlias

import typer

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
