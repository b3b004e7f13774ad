"""The skeleton as a graph: nodes where lanes meet or end, edges of ordered points between them.

Knows skeleton pixels and the lane's half-width at them. Knows no colours, no metres and no choice of route. Points are
(x, y) = (column, row) of the skeleton's own picture.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import Points

_SPUR_RADII = 1.5
"""A dead end shorter than this many lane half-widths is a ragged edge's; a bump on the edge makes one of about 1."""

_CROSSING_RADII = 1.75
"""Two lanes that cross at an angle w thin to two forks whose bridge is 2 cos(w) times the widest circle at its ends: with
this, lanes that cross at 45 degrees or more are one crossing, where they go straight on."""

_STRAIGHT_COS = -0.64
"""Cosine of the angle (130 degrees) between two branches above which one goes straight on in the other."""

Pixel = tuple[int, int]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Edge:
    """A stretch of lane between two nodes; `a` and `b` are the same node for a loop."""

    a: int
    b: int
    points: Points
    """Shape (n, 2), n >= 2, from the place of `a` to the place of `b`, both included."""

    @property
    def length(self) -> float:
        """Length along the points, pixels."""
        return float(np.hypot(*np.diff(self.points, axis=0).T).sum())

    def flipped(self) -> Edge:
        """The same stretch from `b` to `a`."""
        return Edge(a=self.b, b=self.a, points=self.points[::-1])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LaneGraph:
    """The lanes of a twin. Edges' indices are their names."""

    edges: tuple[Edge, ...]

    def degrees(self) -> dict[int, int]:
        """Number of edge ends at each node; a loop counts twice."""
        counts: dict[int, int] = defaultdict(int)
        for edge in self.edges:
            counts[edge.a] += 1
            counts[edge.b] += 1
        return dict(counts)

    def dead_ends(self) -> tuple[tuple[float, float], ...]:
        """Places where a lane ends without meeting another."""
        degrees = self.degrees()
        ends = [(e.points[0] if node == e.a else e.points[-1]) for e in self.edges for node in {e.a, e.b}
                if degrees[node] == 1]  # fmt: skip
        return tuple((float(x), float(y)) for x, y in ends)


def build_graph(skeleton: NDArray[np.bool_], radius: NDArray[np.float32]) -> LaneGraph:
    """The graph of `skeleton` (height, width), with spurs pruned and nodes that only join two edges dissolved.

    `radius` (height, width) is each pixel's distance to the lane's edge, in the same pixels.
    """
    edges = _trace(skeleton)
    while True:
        shorter = _without_worst_spur(edges, radius)
        if shorter is None:
            break
        edges = _dissolved(shorter)
    return LaneGraph(edges=tuple(_contracted(_dissolved(edges), radius)))


def _trace(skeleton: NDArray[np.bool_]) -> list[Edge]:
    """Chains of pixels between clusters of junction pixels (those with three neighbours or more)."""
    lane = np.pad(skeleton, 1).astype(np.uint8)
    kernel = np.ones((3, 3), dtype=np.float32)
    neighbours = cv2.filter2D(lane, cv2.CV_8U, kernel, borderType=cv2.BORDER_CONSTANT) - lane
    junction = ((lane > 0) & (neighbours >= 3)).astype(np.uint8)
    nodes, clusters, _, centres = cv2.connectedComponentsWithStats(junction, connectivity=8)
    node_of: NDArray[np.int32] = np.asarray(clusters, dtype=np.int32)
    chains, chain_of = cv2.connectedComponents(lane - junction, connectivity=8)
    ys, xs = np.nonzero(chain_of)
    members: dict[int, set[Pixel]] = defaultdict(set)
    for x, y in zip(xs.tolist(), ys.tolist(), strict=True):
        members[int(chain_of[y, x])].add((x, y))
    edges: list[Edge] = []
    free_node = nodes
    for chain in range(1, chains):
        ordered = _ordered(members[chain])
        ends = _nodes_at(ordered, node_of)
        places = [centres[node] if node else np.asarray(pixel, dtype=np.float64)
                  for node, pixel in zip(ends, (ordered[0], ordered[-1]), strict=True)]  # fmt: skip
        ring = ends == (0, 0) and len(ordered) > 2 and _touch(ordered[0], ordered[-1])
        if ring:
            places[1] = places[0]
        names = [node or free_node + i for i, node in enumerate(ends)]
        free_node += 2
        points = np.vstack((places[0], np.asarray(ordered, dtype=np.float64), places[1])) - 1.0
        points = points[np.insert(np.any(np.diff(points, axis=0) != 0, axis=1), 0, values=True)]
        if len(points) >= 2:
            edges.append(Edge(a=names[0], b=names[0] if ring else names[1], points=points))
    return edges


def _touch(p: Pixel, q: Pixel) -> bool:
    return max(abs(p[0] - q[0]), abs(p[1] - q[1])) == 1


def _around(p: Pixel) -> list[Pixel]:
    """The eight neighbours, the four that share a side first."""
    x, y = p
    sides = [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]
    return [*sides, (x + 1, y + 1), (x - 1, y + 1), (x + 1, y - 1), (x - 1, y - 1)]


def _ordered(pixels: set[Pixel]) -> list[Pixel]:
    """The pixels of one chain (each with at most two neighbours in it) from one end to the other, or round a ring."""
    ends = sorted(p for p in pixels if sum(q in pixels for q in _around(p)) <= 1)
    here = ends[0] if ends else min(pixels)
    left, path = set(pixels), []
    while True:
        path.append(here)
        left.discard(here)
        following = next((q for q in _around(here) if q in left), None)
        if following is None:
            return path
        here = following


def _nodes_at(path: list[Pixel], node_of: NDArray[np.int32]) -> tuple[int, int]:
    """The junction clusters that the chain's first and last pixel touch; 0 for none."""
    first = [int(node_of[y, x]) for x, y in _around(path[0]) if node_of[y, x]]
    last = [int(node_of[y, x]) for x, y in _around(path[-1]) if node_of[y, x]]
    if len(path) == 1 and first:
        # A single pixel between two clusters touches both; one that touches a single cluster once is a dead end.
        return first[0], (first[1] if len(first) > 1 else 0)
    return (first[0] if first else 0), (last[0] if last else 0)


def _without_worst_spur(edges: list[Edge], radius: NDArray[np.float32]) -> list[Edge] | None:
    """`edges` less the shortest dead end among those that only a ragged edge makes; None where there is none."""
    degrees = LaneGraph(edges=tuple(edges)).degrees()
    spurs: list[tuple[float, int]] = []
    for i, edge in enumerate(edges):
        loose = [degrees[node] == 1 for node in (edge.a, edge.b)]
        if edge.a == edge.b or loose[0] == loose[1]:
            continue
        root = edge.points[-1] if loose[0] else edge.points[0]
        if edge.length < _SPUR_RADII * _radius_at(root, radius):
            spurs.append((edge.length, i))
    if not spurs:
        return None
    worst = min(spurs)[1]
    return edges[:worst] + edges[worst + 1 :]


def _radius_at(point: NDArray[np.float64], radius: NDArray[np.float32]) -> float:
    return float(radius[round(float(point[1])), round(float(point[0]))])


def _dissolved(edges: list[Edge]) -> list[Edge]:
    """`edges` with each pair that meets alone at a node joined into one."""
    edges = list(edges)
    while True:
        at: dict[int, list[int]] = defaultdict(list)
        for i, edge in enumerate(edges):
            at[edge.a].append(i)
            at[edge.b].append(i)
        pair = next(((node, ends) for node, ends in at.items() if len(ends) == 2 and ends[0] != ends[1]), None)
        if pair is None:
            return edges
        node, (i, j) = pair
        first = edges[i] if edges[i].b == node else edges[i].flipped()
        second = edges[j] if edges[j].a == node else edges[j].flipped()
        joined = Edge(a=first.a, b=second.b, points=np.vstack((first.points, second.points[1:])))
        edges = [edge for k, edge in enumerate(edges) if k not in (i, j)] + [joined]


def _contracted(edges: list[Edge], radius: NDArray[np.float32]) -> list[Edge]:
    """`edges` with junctions that lie within one half-width of each other made one, and two forks that are one crossing, too:
    a crossing thins to two forks.
    """
    edges = list(edges)
    while True:
        degrees = LaneGraph(edges=tuple(edges)).degrees()
        bridges = [
            (edge.length, i)
            for i, edge in enumerate(edges)
            if edge.a != edge.b
            and min(degrees[edge.a], degrees[edge.b]) >= 3
            and _is_one_junction(edges, edge, max(degrees[edge.a], degrees[edge.b]), radius)
        ]
        if not bridges:
            return edges
        bridge = edges.pop(min(bridges)[1])
        middle = (bridge.points[0] + bridge.points[-1]) / 2
        edges = [_moved(edge, (bridge.a, bridge.b), middle) for edge in edges]


def _is_one_junction(edges: list[Edge], bridge: Edge, degree: int, radius: NDArray[np.float32]) -> bool:
    widest = max(_radius_at(bridge.points[0], radius), _radius_at(bridge.points[-1], radius))
    if bridge.length < widest or degree > 3 or bridge.length > _CROSSING_RADII * widest:
        return bridge.length < widest
    before, after = (
        [_outward(edge.points[:: 1 if forward else -1], 2 * widest) for edge in edges if edge is not bridge
         for forward in (True, False) if (edge.a if forward else edge.b) == node]
        for node in (bridge.a, bridge.b)
    )  # fmt: skip
    turns = np.array(before) @ np.array(after).T
    either_pairing = (max(turns[0, 0], turns[1, 1]), max(turns[0, 1], turns[1, 0]))
    return bool(min(either_pairing) < _STRAIGHT_COS)


def _outward(points: Points, reach: float) -> NDArray[np.float64]:
    """Unit vector from a branch's first point to the one `reach` along it, or its middle one where it is shorter."""
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    k = max(1, int(np.searchsorted(along, min(reach, along[-1] / 2))))
    way = points[k] - points[0]
    return np.asarray(way / max(float(np.hypot(*way)), 1e-9), dtype=np.float64)


def _moved(edge: Edge, nodes: tuple[int, int], place: NDArray[np.float64]) -> Edge:
    """`edge` with its ends at either of `nodes` led to `place`, under the first one's name."""
    if edge.a in nodes:
        edge = replace(edge, a=nodes[0], points=np.vstack((place, edge.points)))
    if edge.b in nodes:
        edge = replace(edge, b=nodes[0], points=np.vstack((edge.points, place)))
    return edge
