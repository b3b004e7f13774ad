"""The way along the lanes from the first waypoint through all others, in their order, to the last.

Knows a graph in twin px. Knows no picture, no lane width beyond the reach it is told, and no metres.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dnb_edge.errors import InputError
from dnb_edge.track.graph import LaneGraph
from dnb_edge.track.walk import (
    HalfEdge,
    Stop,
    Walk,
    as_travelled,
    branches,
    ends_text,
    leaving,
    pieces,
    place_on,
    stop_at,
    straight_on,
    turn_cost_px,
)
from dnb_edge.values import PointPx, Points


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Way:
    """The best way so far to a stop, in one direction of its stretch."""

    cost_px: float
    points: Points


def path_through(
    graph: LaneGraph, waypoints_px: tuple[PointPx, ...], *, reach_px: float, far_px: float, source: str
) -> Points:
    """The shortest way from the first waypoint through the others, in their order, to the last: a polyline (n, 2), twin px.

    It turns round nowhere, and may use a stretch of lane more than once. Turns at junctions count as `turn_cost_px` says. But a
    lane that crosses itself is driven as it was drawn, straight over every crossing, where that uses every stretch of it once
    and passes the waypoints in their order.

    Raises `InputError` for fewer than two waypoints, one further than `far_px` from every lane's middle, and where no way
    leads from one to the next.
    """
    if len(waypoints_px) < 2:
        ends = ends_text(graph.dead_ends()).replace(": it", "; the lane")
        raise InputError(f"{source}: a route from point to point needs at least two waypoints, its two ends{ends}: give "
                         "them (--waypoint u,v, waypoints_px)")  # fmt: skip
    stops = [stop_at(graph, waypoint, far_px=far_px, source=source) for waypoint in waypoints_px]
    ways = {
        forward: _Way(
            cost_px=0.0, points=as_travelled(graph, (stops[0].edge, forward)).points[[_index(graph, stops[0], forward)]]
        )
        for forward in (True, False)
    }
    drawn = _drawn_way(graph, stops, reach_px)
    if drawn is not None:
        return drawn
    for here, there in pairwise(stops):
        ways = _next_ways(graph, ways, here, there, reach_px)
        if not ways:
            (u0, v0), (u1, v1) = here.waypoint_px, there.waypoint_px
            raise InputError(f"{source}: no way along the lanes leads on from waypoint ({u0:g}, {v0:g}) to waypoint "
                             f"({u1:g}, {v1:g}) twin px{ends_text(graph.dead_ends())}: move the waypoints, or draw the lane "
                             "through")  # fmt: skip
    best = min(ways.values(), key=lambda way: way.cost_px).points
    if np.hypot(*np.diff(best, axis=0).T).sum() < 4 * reach_px:
        raise InputError(f"{source}: the route from the first to the last waypoint is shorter than two lane widths: move "
                         "them apart")  # fmt: skip
    return best


def _drawn_way(graph: LaneGraph, stops: Sequence[Stop], reach_px: float) -> Points | None:
    """The way that goes straight over every crossing and uses every stretch of the piece of lane once; None where it does
    not, or does not pass the stops in their order from the first stretch to the last.
    """
    piece = next(piece for piece in pieces(graph) if stops[0].edge in piece)
    order = branches(graph, reach_px)
    for forward in (True, False):
        walk: list[HalfEdge] = [(stops[0].edge, forward)]
        while (onward := straight_on(graph, order, walk[-1], reach_px)) is not None and onward not in walk:
            walk.append(onward)
        if sorted(i for i, _ in walk) != piece or {stop.edge for stop in stops} - set(piece):
            continue
        places = [place_on(graph, tuple(walk), stop) for stop in stops]
        if places != sorted(places) or places[-1][0] != len(walk) - 1 or len(walk) < 2:
            continue
        parts = [as_travelled(graph, half).points for half in walk]
        last = parts[-1][1 : places[-1][1] + 1]
        return np.vstack((parts[0][places[0][1] :], *(part[1:] for part in parts[1:-1]), last))
    return None


def _index(graph: LaneGraph, stop: Stop, forward: bool) -> int:
    """The stop's point on its stretch as travelled."""
    return stop.index if forward else len(graph.edges[stop.edge].points) - 1 - stop.index


def _next_ways(graph: LaneGraph, ways: dict[bool, _Way], here: Stop, there: Stop, reach_px: float) -> dict[bool, _Way]:
    """The best way to the next stop in each direction of its stretch."""
    found: dict[bool, _Way] = {}
    for forward, way in ways.items():
        for leg in _legs(graph, (here.edge, forward), here, there, reach_px):
            points = np.vstack((way.points, leg.points[1:]))
            longer = _Way(cost_px=way.cost_px + leg.cost_px, points=points)
            if leg.forward not in found or longer.cost_px < found[leg.forward].cost_px:
                found[leg.forward] = longer
    return found


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Leg:
    cost_px: float
    points: Points
    forward: bool
    """The direction in which it arrives on the next stop's stretch."""


def _legs(graph: LaneGraph, start: HalfEdge, here: Stop, there: Stop, reach_px: float) -> list[_Leg]:
    """The shortest way from one stop, in the direction of `start`, to the next in each direction that it can be reached."""
    first = as_travelled(graph, start).points
    at = _index(graph, here, start[1])
    legs = []
    walks = _shortest_walks(graph, start, _length(first[at:]), reach_px)
    for forward in (True, False):
        to = _index(graph, there, forward)
        if start == (there.edge, forward) and to >= at:
            legs.append(_Leg(cost_px=_length(first[at : to + 1]), points=first[at : to + 1], forward=forward))
            continue
        if (there.edge, forward) not in walks:
            continue
        cost_px, walk = walks[there.edge, forward]
        last = as_travelled(graph, walk[-1]).points[: to + 1]
        between = [as_travelled(graph, half).points[1:] for half in walk[1:-1]]
        points = np.vstack((first[at:], *between, last[1:]))
        legs.append(_Leg(cost_px=cost_px + _length(last), points=points, forward=forward))
    return legs


def _shortest_walks(
    graph: LaneGraph, start: HalfEdge, left_px: float, reach_px: float
) -> dict[HalfEdge, tuple[float, Walk]]:
    """For each stretch that can be entered after `start`, of which `left_px` are left: cost up to its beginning, and the
    walk with both (Dijkstra's algorithm over directed stretches).
    """
    onward = leaving(graph)
    found: dict[HalfEdge, tuple[float, Walk]] = {}
    queue: list[tuple[float, Walk]] = []

    def spread(cost_px: float, walk: Walk) -> None:
        i, forward = walk[-1]
        for half in onward[as_travelled(graph, walk[-1]).b]:
            if half != (i, not forward) and half not in found:
                heapq.heappush(queue, (cost_px + turn_cost_px(graph, walk[-1], half, reach_px), (*walk, half)))

    spread(left_px, (start,))
    while queue:
        cost_px, walk = heapq.heappop(queue)
        if walk[-1] not in found:
            found[walk[-1]] = cost_px, walk
            spread(cost_px + graph.edges[walk[-1][0]].length, walk)
    return found


def _length(points: Points) -> float:
    return math.fsum(np.hypot(*np.diff(points, axis=0).T).tolist())
