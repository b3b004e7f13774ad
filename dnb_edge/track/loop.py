"""The choice of one closed loop through the lane graph: the only one there is, or the one that passes the waypoints.

Knows a graph in twin px. Knows no picture, no lane width beyond the reach it is told, and no metres.

Where no waypoint says which loop is meant, each connected piece of lane offers its own (ADR 24): the walk that goes straight
on at every crossing, if it uses every stretch of the piece once, so that a lane that crosses itself is driven as it was
drawn; else the boundary of the piece, whatever branches lie within it; else, where that boundary passes a place twice (two
loops that touch, or that one lane joins), each of the loops that it is made of. One loop in all is the route; of several
none is taken: `SeveralLoops` names them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dnb_edge.errors import InputError
from dnb_edge.track.graph import Edge, LaneGraph
from dnb_edge.track.walk import (
    MEND,
    HalfEdge,
    Stop,
    Walk,
    as_travelled,
    branches,
    ends_text,
    leaving,
    pieces,
    place_on,
    polyline,
    stop_at,
    straight_on,
    turn_cost_px,
)
from dnb_edge.values import PointPx, Points

_SEARCH_LIMIT = 200_000
"""Steps of the search for a loop through waypoints; the paper's track needs 30."""

_MOST_NAMED = 6

_STUB_RADII = 3.0
"""A dead end up to this many half-widths long, which sticks out of the lane by no more than its width, is no lane that broke
off but something drawn beside it: the ends of a start line, or a mark."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loop:
    """One of several loops that the route may be."""

    letter: str
    points_px: Points
    """Shape (n, 2), twin px, along the skeleton; the last joins the first."""
    length_px: float
    """Along the skeleton, which is up to 8 % longer than the route."""
    waypoints_px: tuple[PointPx, ...]
    """With these the loop is chosen; the first lies in the middle of its longest stretch."""

    def __str__(self) -> str:
        """As the error names it."""
        waypoints = " and ".join(f"{u:.0f},{v:.0f}" for u, v in self.waypoints_px)
        plural = "s" if len(self.waypoints_px) > 1 else ""
        return f"{self.letter} (about {self.length_px:.0f} px long, waypoint{plural} {waypoints})"


class SeveralLoops(InputError):
    """The lanes form several loops and nothing says which one is the route."""

    def __init__(self, source: str, loops: tuple[Loop, ...]) -> None:
        named = ", ".join(str(loop) for loop in loops[:_MOST_NAMED])
        more = f" and {len(loops) - _MOST_NAMED} more" if len(loops) > _MOST_NAMED else ""
        super().__init__(f"{source}: the lanes form {len(loops)} loops, {named}{more}: choose the route by its waypoint "
                         "(--waypoint u,v, waypoints_px); --overlay draws the loops")  # fmt: skip
        self.loops = loops


def only_loop(graph: LaneGraph, *, reach_px: float, source: str) -> Points:
    """The loop that the lanes form, as a closed polyline (n, 2), twin px, the first point not repeated; see this module.

    `reach_px` is how far from a junction its branches' directions are taken: about one half-width. `source` names the
    picture in errors. Raises `InputError` where the lanes do not close to a loop, `SeveralLoops` where they form several.
    """
    walks = [walk for piece in pieces(graph) for walk in _loops_of(graph, piece, reach_px, source)]
    if not walks:
        raise InputError(f"{source}: the lane is not closed{ends_text(graph.dead_ends())}: {MEND}")
    if len(walks) > 1:
        raise SeveralLoops(source, tuple(_named(graph, walk, k, reach_px, source) for k, walk in enumerate(walks)))
    return polyline(graph, walks[0])


def loop_through(
    graph: LaneGraph, waypoints_px: tuple[PointPx, ...], *, reach_px: float, far_px: float, source: str
) -> Points:
    """The shortest closed loop that passes every waypoint's stretch of lane and no stretch twice, as `only_loop` does.

    It passes them in their order, in that direction, where a loop does, else in any order. Among loops of like length the one
    with the gentler turns is taken. Raises `InputError` for a waypoint further than `far_px` from every lane's middle, and
    where no loop passes them all.
    """
    stops = [stop_at(graph, waypoint, far_px=far_px, source=source) for waypoint in waypoints_px]
    walk = _shortest_trail(graph, stops, reach_px, source)
    if walk is None:
        where = ", ".join(f"({u:g}, {v:g})" for u, v in waypoints_px)
        raise InputError(f"{source}: no closed loop of lanes passes the waypoints {where} twin px"
                         f"{ends_text(graph.dead_ends())}: move the waypoints, or {MEND}")  # fmt: skip
    return polyline(graph, walk)


def _loops_of(graph: LaneGraph, piece: Sequence[int], reach_px: float, source: str) -> list[Walk]:
    """The loops that one connected piece of lane offers; none where it does not close."""
    order = branches(graph, reach_px)
    straight = _straight_walk(graph, piece, order, reach_px)
    if straight is not None:
        return [straight]
    # Of the two faces of a single loop only the outer one has a positive area.
    outer = max(_faces(piece, order), key=lambda walk: _area(graph, walk))
    if _area(graph, outer) < reach_px**2:
        return []
    seen = [i for i, _ in outer]
    twice = {i for i in seen if seen.count(i) > 1}
    lanes = [graph.edges[i] for i in twice if graph.edges[i].length > _STUB_RADII * reach_px]
    ends = [end for end in graph.dead_ends() if any(_has_end(edge, end) for edge in lanes)]
    if ends:
        raise InputError(f"{source}: the outer lane is not closed{ends_text(ends)}: {MEND}, or choose another loop by "
                         "waypoints")  # fmt: skip
    return _simple_loops(graph, [half for half in outer if half[0] not in twice])


def _straight_walk(
    graph: LaneGraph, piece: Sequence[int], order: dict[int, list[HalfEdge]], reach_px: float
) -> Walk | None:
    """The closed walk that goes straight over every crossing, where it uses every stretch of the piece; else None."""
    start = (piece[0], True)
    walk = [start]
    while True:
        onward = straight_on(graph, order, walk[-1], reach_px)
        if onward is None:
            return None
        if onward == start:
            break
        walk.append(onward)
    is_whole = len(walk) == len(piece) and sum(graph.edges[i].length for i in piece) > 4 * reach_px
    return tuple(walk) if is_whole else None


def _faces(piece: Sequence[int], order: dict[int, list[HalfEdge]]) -> list[Walk]:
    """Every face's boundary: at each node the walk leaves by the branch next in angle to the one it came by."""
    following: dict[HalfEdge, HalfEdge] = {}
    for around in order.values():
        for k, (i, forward) in enumerate(around):
            following[i, not forward] = around[(k + 1) % len(around)]
    faces, left = [], {(i, forward) for i in piece for forward in (True, False)}
    while left:
        start = min(left)
        walk = [start]
        while (half := following[walk[-1]]) != start:
            walk.append(half)
        left.difference_update(walk)
        faces.append(tuple(walk))
    return faces


def _area(graph: LaneGraph, walk: Walk) -> float:
    """Signed area that a face's boundary encloses: the outer face's is positive, all others' together its negative."""
    x, y = polyline(graph, walk).T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) / 2


def _simple_loops(graph: LaneGraph, halves: Sequence[HalfEdge]) -> list[Walk]:
    """The boundary's stretches cut where they pass a node again: loops that pass no node twice."""
    loops: list[Walk] = []
    open_halves: list[HalfEdge] = []
    for half in halves:
        open_halves.append(half)
        here = as_travelled(graph, half).b
        back = next((k for k, one in enumerate(open_halves) if as_travelled(graph, one).a == here), None)
        if back is not None:
            loops.append(tuple(open_halves[back:]))
            del open_halves[back:]
    return loops


def _named(graph: LaneGraph, walk: Walk, k: int, reach_px: float, source: str) -> Loop:
    """The loop with its letter and as few waypoints as choose it."""
    longest = sorted({i for i, _ in walk}, key=lambda i: -graph.edges[i].length)
    stops: list[Stop] = []
    for i in longest:
        index = len(graph.edges[i].points) // 2
        u, v = graph.edges[i].points[index]
        stops.append(Stop(edge=i, index=index, waypoint_px=(float(u), float(v))))
        trail = _shortest_trail(graph, stops, reach_px, source)
        if trail is not None and {edge for edge, _ in trail} == set(longest):
            break
    return Loop(
        letter=chr(ord("A") + k) if k < 26 else str(k + 1),
        points_px=polyline(graph, walk),
        length_px=sum(graph.edges[i].length for i, _ in walk),
        waypoints_px=tuple(stop.waypoint_px for stop in stops),
    )


def _shortest_trail(graph: LaneGraph, stops: Sequence[Stop], reach_px: float, source: str) -> Walk | None:
    """Depth-first search with a bound over closed walks without a repeated edge; the first waypoint's edge leads."""
    required = {stop.edge for stop in stops}
    onward = leaving(graph)
    first = (stops[0].edge, True)
    best: dict[bool, tuple[float, Walk]] = {}
    stack: list[tuple[float, Walk]] = [(graph.edges[first[0]].length, (first,))]
    for _ in range(_SEARCH_LIMIT):
        if not stack:
            chosen = best.get(True, best.get(False))
            return chosen[1] if chosen else None
        cost, walk = stack.pop()
        used = {i for i, _ in walk}
        here = as_travelled(graph, walk[-1]).b
        if here == graph.edges[first[0]].a and used >= required:
            closed = cost + turn_cost_px(graph, walk[-1], first, reach_px)
            in_order, turned = _in_order(graph, walk, stops)
            if in_order not in best or closed < best[in_order][0]:
                best[in_order] = closed, turned
        for half in onward[here]:
            longer = cost + graph.edges[half[0]].length + turn_cost_px(graph, walk[-1], half, reach_px)
            if half[0] not in used and (True not in best or longer < best[True][0]):
                stack.append((longer, (*walk, half)))
    raise InputError(
        f"{source}: the lanes form too many loops to search ({len(graph.edges)} stretches): simplify the twin"
    )


def _in_order(graph: LaneGraph, walk: Walk, stops: Sequence[Stop]) -> tuple[bool, Walk]:
    """Whether the closed walk passes the stops in their order, in either direction, and the walk turned into that one."""
    for turned in (walk, tuple((i, not forward) for i, forward in reversed(walk))):
        places = [place_on(graph, turned, stop) for stop in stops]
        lowest = places.index(min(places))
        from_lowest = places[lowest:] + places[:lowest]
        if from_lowest == sorted(from_lowest):
            return True, turned
    return False, walk


def _has_end(edge: Edge, place: PointPx) -> bool:
    return any(math.dist(place, end) < 1e-9 for end in (edge.points[0], edge.points[-1]))
