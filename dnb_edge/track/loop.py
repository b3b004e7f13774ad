"""The choice of one closed loop through the lane graph: the outer one, or the one that passes the waypoints.

Knows a graph in twin px. Knows no picture, no lane width beyond the reach it is told, and no metres.
"""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.track.graph import Edge, LaneGraph
from dnb_edge.values import PointPx, Points

_SEARCH_LIMIT = 200_000
"""Steps of the search for a loop through waypoints; the paper's track needs 30."""

HalfEdge = tuple[int, bool]
"""An edge's index and True where it is travelled from `a` to `b`."""


def outer_loop(graph: LaneGraph, *, reach_px: float, source: str) -> Points:
    """The boundary of the graph's outer face as a closed polyline (n, 2), twin px, the first point not repeated.

    `reach_px` is how far from a junction its branches' directions are taken: about one half-width. `source` names the
    picture in errors. Raises `InputError` where the lanes do not close to a loop.
    """
    faces = [_Face.of(graph, walk) for walk in _faces(graph, reach_px)]
    outer = max(faces, key=lambda face: abs(face.area), default=None)
    if outer is None or abs(outer.area) < reach_px**2:
        raise InputError(f"{source}: the lane is not closed{_ends_text(graph.dead_ends())}: {_MEND}")
    seen = [i for i, _ in outer.walk]
    twice = {i for i in seen if seen.count(i) > 1}
    ends = [end for end in graph.dead_ends() if any(_has_end(graph.edges[i], end) for i in twice)]
    if ends:
        raise InputError(f"{source}: the outer lane is not closed{_ends_text(tuple(ends))}: {_MEND}, "
                         "or choose another loop by waypoints")  # fmt: skip
    if twice:
        u, v = _middle(graph.edges[min(twice)])
        raise InputError(f"{source}: the outer lane passes ({u:.0f}, {v:.0f}) twin px both ways, so it is no loop: "
                         "choose a loop by waypoints")  # fmt: skip
    return outer.points


def loop_through(
    graph: LaneGraph, waypoints_px: tuple[PointPx, ...], *, reach_px: float, far_px: float, source: str
) -> Points:
    """The shortest closed loop that passes every waypoint's stretch of lane and no stretch twice, as `outer_loop` does.

    Among loops of like length the one with the gentler turns is taken. Raises `InputError` for a waypoint further than
    `far_px` from every lane's middle, and where no loop passes them all.
    """
    required = [_nearest_edge(graph, waypoint, far_px, source) for waypoint in waypoints_px]
    walk = _shortest_trail(graph, required, reach_px)
    if walk is None:
        where = ", ".join(f"({u:g}, {v:g})" for u, v in waypoints_px)
        raise InputError(f"{source}: no closed loop of lanes passes the waypoints {where} twin px"
                         f"{_ends_text(graph.dead_ends())}: move the waypoints, or {_MEND}")  # fmt: skip
    return _polyline(graph, walk)


_MEND = "draw the lane through, or set the gap that may be closed (close_gap_px) wider than the break"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Face:
    walk: tuple[HalfEdge, ...]
    points: Points
    area: float
    """Signed; the outer face's is the largest in size, the sum of all others'."""

    @classmethod
    def of(cls, graph: LaneGraph, walk: tuple[HalfEdge, ...]) -> _Face:
        points = _polyline(graph, walk)
        x, y = points.T
        area = float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) / 2
        return cls(walk=walk, points=points, area=area)


def _faces(graph: LaneGraph, reach_px: float) -> list[tuple[HalfEdge, ...]]:
    """Every face's boundary: at each node the walk leaves by the branch next in angle to the one it came by."""
    leaving: dict[int, list[tuple[float, HalfEdge]]] = defaultdict(list)
    for i, edge in enumerate(graph.edges):
        for forward in (True, False):
            x, y = _direction(_as_travelled(graph, (i, forward)).points, reach_px)
            leaving[edge.a if forward else edge.b].append((math.atan2(y, x), (i, forward)))
    following: dict[HalfEdge, HalfEdge] = {}
    for branches in leaving.values():
        order = [half for _, half in sorted(branches)]
        for k, (i, forward) in enumerate(order):
            following[i, not forward] = order[(k + 1) % len(order)]
    faces, left = [], set(following)
    while left:
        start = min(left)
        walk = [start]
        while (half := following[walk[-1]]) != start:
            walk.append(half)
        left.difference_update(walk)
        faces.append(tuple(walk))
    return faces


def _shortest_trail(graph: LaneGraph, required: list[int], reach_px: float) -> tuple[HalfEdge, ...] | None:
    """Depth-first search with a bound over closed walks without a repeated edge; the first waypoint's edge leads."""
    lengths = [edge.length for edge in graph.edges]
    leaving: dict[int, list[HalfEdge]] = defaultdict(list)
    for i, edge in enumerate(graph.edges):
        leaving[edge.a].append((i, True))
        leaving[edge.b].append((i, False))
    first = (required[0], True)
    best: tuple[float, tuple[HalfEdge, ...]] | None = None
    stack: list[tuple[float, tuple[HalfEdge, ...]]] = [(lengths[required[0]], (first,))]
    for _ in range(_SEARCH_LIMIT):
        if not stack:
            return best[1] if best else None
        cost, walk = stack.pop()
        used = {i for i, _ in walk}
        here = _as_travelled(graph, walk[-1]).b
        if here == graph.edges[required[0]].a and used.issuperset(required):
            closed = cost + _turn_cost(graph, walk[-1], first, reach_px)
            if best is None or closed < best[0]:
                best = closed, walk
        for half in leaving[here]:
            longer = cost + lengths[half[0]] + _turn_cost(graph, walk[-1], half, reach_px)
            if half[0] not in used and (best is None or longer < best[0]):
                stack.append((longer, (*walk, half)))
    raise InputError(f"the lanes form too many loops to search ({len(graph.edges)} stretches): simplify the twin")


def _turn_cost(graph: LaneGraph, arriving: HalfEdge, leaving: HalfEdge, reach_px: float) -> float:
    """Twin px that a turn at a junction counts for: one reach per radian, squared."""
    x0, y0 = _direction(_as_travelled(graph, (arriving[0], not arriving[1])).points, reach_px)
    x1, y1 = _direction(_as_travelled(graph, leaving).points, reach_px)
    return reach_px * math.acos(max(-1.0, min(1.0, -(x0 * x1 + y0 * y1)))) ** 2


def _as_travelled(graph: LaneGraph, half: HalfEdge) -> Edge:
    return graph.edges[half[0]] if half[1] else graph.edges[half[0]].flipped()


def _direction(points: Points, reach_px: float) -> tuple[float, float]:
    """Unit vector from the first point to the one `reach_px` along, or a third of the way on a shorter edge."""
    steps = np.hypot(*np.diff(points, axis=0).T)
    along = np.concatenate(([0.0], np.cumsum(steps)))
    k = max(1, int(np.searchsorted(along, min(reach_px, along[-1] / 3))))
    x, y = points[k] - points[0]
    size = math.hypot(x, y) or 1.0
    return float(x) / size, float(y) / size


def _polyline(graph: LaneGraph, walk: tuple[HalfEdge, ...]) -> Points:
    return np.vstack([_as_travelled(graph, half).points[:-1] for half in walk])


def _nearest_edge(graph: LaneGraph, waypoint: PointPx, far_px: float, source: str) -> int:
    nearest = [_distance(edge.points, waypoint) for edge in graph.edges]
    best = int(np.argmin(nearest)) if nearest else -1
    if best < 0 or nearest[best] > far_px:
        away = f"{nearest[best]:.0f} px from" if nearest else "not on"
        raise InputError(f"{source}: waypoint ({waypoint[0]:g}, {waypoint[1]:g}) twin px is {away} the middle of the "
                         "nearest lane: put it on the lane that the route shall take")  # fmt: skip
    return best


def _distance(points: NDArray[np.float64], to: PointPx) -> float:
    return float(np.hypot(points[:, 0] - to[0], points[:, 1] - to[1]).min())


def _has_end(edge: Edge, place: PointPx) -> bool:
    return any(math.dist(place, end) < 1e-9 for end in (edge.points[0], edge.points[-1]))


def _middle(edge: Edge) -> PointPx:
    u, v = edge.points[len(edge.points) // 2]
    return float(u), float(v)


def _ends_text(ends: tuple[PointPx, ...]) -> str:
    """': it ends at (u, v) and (u, v) twin px', at most four of them."""
    if not ends:
        return ""
    return ": it ends at " + " and ".join(f"({u:.0f}, {v:.0f})" for u, v in ends[:4]) + " twin px"
