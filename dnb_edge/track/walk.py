"""Walks over the lane graph: stretches taken in one of their two directions, the turns between them, and stops on them.

Knows a graph in twin px. Knows no choice of route.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dnb_edge.errors import InputError
from dnb_edge.track.graph import Edge, LaneGraph
from dnb_edge.values import PointPx, Points

HalfEdge = tuple[int, bool]
"""An edge's index and True where it is travelled from `a` to `b`."""

Walk = tuple[HalfEdge, ...]

_STRAIGHT_RAD = math.radians(60)
"""A lane that turns by more at a crossing does not go straight over it."""

_CLOSE = "draw the lane through, raise the widest gap that is closed (close_gap_px, --close-gap-px)"
MEND = f"{_CLOSE}, or, where the route is to go from point to point, say so (closed: false, --open) with waypoints at its ends"
"""What to do about a lane that is not closed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stop:
    """A waypoint's place on the lanes."""

    edge: int
    index: int
    """Of the edge's points."""
    waypoint_px: PointPx


def stop_at(graph: LaneGraph, waypoint_px: PointPx, *, far_px: float, source: str) -> Stop:
    """The place on the lanes' middle nearest to `waypoint_px`. Raises `InputError` where it is further than `far_px`."""
    found = [np.hypot(*(edge.points - waypoint_px).T) for edge in graph.edges]
    best = int(np.argmin([away.min() for away in found])) if found else -1
    if best < 0 or found[best].min() > far_px:
        away = f"{found[best].min():.0f} px from" if found else "not on"
        u, v = waypoint_px
        raise InputError(f"{source}: waypoint ({u:g}, {v:g}) twin px is {away} the middle of the nearest lane: put it on "
                         "the lane that the route shall take")  # fmt: skip
    return Stop(edge=best, index=int(np.argmin(found[best])), waypoint_px=waypoint_px)


def as_travelled(graph: LaneGraph, half: HalfEdge) -> Edge:
    """The stretch with its points in the order of travel."""
    return graph.edges[half[0]] if half[1] else graph.edges[half[0]].flipped()


def leaving(graph: LaneGraph) -> dict[int, list[HalfEdge]]:
    """The stretches that lead away from each node."""
    found: dict[int, list[HalfEdge]] = defaultdict(list)
    for i, edge in enumerate(graph.edges):
        found[edge.a].append((i, True))
        found[edge.b].append((i, False))
    return found


def branches(graph: LaneGraph, reach_px: float) -> dict[int, list[HalfEdge]]:
    """The stretches that lead away from each node, in the order of their directions."""

    def angle(half: HalfEdge) -> float:
        x, y = _direction(as_travelled(graph, half).points, reach_px)
        return math.atan2(y, x)

    return {node: [half for _, half in sorted((angle(half), half) for half in halves)]
            for node, halves in leaving(graph).items()}  # fmt: skip


def straight_on(graph: LaneGraph, order: dict[int, list[HalfEdge]], half: HalfEdge, reach_px: float) -> HalfEdge | None:
    """The stretch that goes straight on after `half`, over the crossing where that ends; None at a fork or a dead end, or
    where none goes straight on. `order` is what `branches` says.
    """
    i, forward = half
    around = order[as_travelled(graph, half).b]
    if len(around) % 2:
        return None
    onward = around[(around.index((i, not forward)) + len(around) // 2) % len(around)]
    if len(around) > 2 and turn_rad(graph, half, onward, reach_px) > _STRAIGHT_RAD:
        return None
    return onward


def turn_rad(graph: LaneGraph, arriving: HalfEdge, going: HalfEdge, reach_px: float) -> float:
    """Angle 0..pi by which the way turns from one stretch to the next; 0 is straight on."""
    x0, y0 = _direction(as_travelled(graph, (arriving[0], not arriving[1])).points, reach_px)
    x1, y1 = _direction(as_travelled(graph, going).points, reach_px)
    return math.acos(max(-1.0, min(1.0, -(x0 * x1 + y0 * y1))))


def turn_cost_px(graph: LaneGraph, arriving: HalfEdge, going: HalfEdge, reach_px: float) -> float:
    """Twin px that a turn at a junction counts for: one reach per radian, squared."""
    return reach_px * turn_rad(graph, arriving, going, reach_px) ** 2


def pieces(graph: LaneGraph) -> list[list[int]]:
    """The edges of each connected piece."""
    left, found = set(range(len(graph.edges))), []
    while left:
        piece, nodes = {min(left)}, {graph.edges[min(left)].a, graph.edges[min(left)].b}
        while True:
            more = {i for i in left - piece if {graph.edges[i].a, graph.edges[i].b} & nodes}
            if not more:
                break
            piece |= more
            nodes |= {node for i in more for node in (graph.edges[i].a, graph.edges[i].b)}
        left -= piece
        found.append(sorted(piece))
    return found


def place_on(graph: LaneGraph, walk: Walk, stop: Stop) -> tuple[int, int]:
    """Where along the walk the stop lies: which of its stretches, and which of that one's points as travelled."""
    at = next(k for k, (i, _) in enumerate(walk) if i == stop.edge)
    return at, stop.index if walk[at][1] else len(graph.edges[stop.edge].points) - 1 - stop.index


def polyline(graph: LaneGraph, walk: Sequence[HalfEdge]) -> Points:
    """The points of a closed walk, the first not repeated."""
    return np.vstack([as_travelled(graph, half).points[:-1] for half in walk])


def ends_text(ends: Sequence[PointPx]) -> str:
    """': it ends at (u, v) and (u, v) twin px', at most four of them; nothing where there are none."""
    if not ends:
        return ""
    return ": it ends at " + " and ".join(f"({u:.0f}, {v:.0f})" for u, v in ends[:4]) + " twin px"


def _direction(points: Points, reach_px: float) -> tuple[float, float]:
    """Unit vector from the first point to the one `reach_px` along, or a third of the way on a shorter edge."""
    steps = np.hypot(*np.diff(points, axis=0).T)
    along = np.concatenate(([0.0], np.cumsum(steps)))
    k = max(1, int(np.searchsorted(along, min(reach_px, along[-1] / 3))))
    x, y = points[k] - points[0]
    size = math.hypot(x, y) or 1.0
    return float(x) / size, float(y) / size
