"""The route: one closed loop of lane, or one way from point to point, as an even, smooth line down the lane's middle.

Knows a lane mask and a graph's loop or path. Knows no colours, no metres and no start line. A skeleton is drawn into the
mouths of junctions; so it is only the first guess, and the lane's own edges, sought across it, place the middle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.track.graph import LaneGraph, build_graph
from dnb_edge.track.loop import loop_through, only_loop
from dnb_edge.track.path import path_through
from dnb_edge.track.skeleton import thin
from dnb_edge.track.twin import Mask
from dnb_edge.values import PointPx, Points

Floats = NDArray[np.float64]

_THIN_SIDE_PX = 900
"""Longest side of the picture that is thinned; the edges are sought at full size all the same."""
_WIDEST = 1.3
"""A half-width beyond this many usual ones belongs to a junction's mouth, not to the lane."""
_WIDER = 1.15
"""Up to this many usual half-widths the middle between both edges is the lane's; narrower places are lane as well."""
_MOST_POINTS = 1500


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Route:
    """A polyline down the middle of the lane. A closed one has one of its two directions, or that of its waypoints."""

    points_px: Points
    """Shape (n, 2), twin px, evenly spaced; where it is closed the last joins the first, which is not repeated."""
    half_left_px: Floats
    """Shape (n,), twin px to the lane's edge on the left of travel as seen on the twin, at most 1.3 usual ones."""
    half_right_px: Floats
    """Shape (n,), the same on the right."""
    closed: bool = True
    """False for a route from its first to its last point."""

    @property
    def length_px(self) -> float:
        """Length of the line, twin px, with the way from the last point to the first where it is closed."""
        return float(_chords(self.points_px, self.closed).sum())


def find_route(mask: Mask, *, waypoints_px: tuple[PointPx, ...] = (), closed: bool = True, source: str) -> Route:
    """The loop of the lane `mask` (height, width), or the loop through `waypoints_px`, smooth and even; where not `closed`,
    the way from the first waypoint through the others to the last.

    `source` names the picture in errors. Raises `InputError` where the lane does not close to a loop, a waypoint is far
    from any lane, or no loop or way passes the waypoints; `SeveralLoops` where there are no waypoints and several loops.
    """
    graph, half_width_px = lane_graph(mask)
    far_px = 2 * half_width_px
    if not closed:
        line = path_through(graph, waypoints_px, reach_px=half_width_px, far_px=far_px, source=source)
    elif waypoints_px:
        line = loop_through(graph, waypoints_px, reach_px=half_width_px, far_px=far_px, source=source)
    else:
        line = only_loop(graph, reach_px=half_width_px, source=source)
    return _centred(mask, line, half_width_px, closed, source)


def lane_graph(mask: Mask) -> tuple[LaneGraph, float]:
    """The graph of the lane in twin px, and the lane's usual half-width, twin px."""
    factor = min(1.0, _THIN_SIDE_PX / max(mask.shape))
    small = np.pad(_reduced(mask, factor), 1)
    radius = np.asarray(cv2.distanceTransform(small.astype(np.uint8), cv2.DIST_L2, 5), dtype=np.float32)
    skeleton = thin(small)
    graph = build_graph(skeleton, radius)
    half_width = (float(np.median(radius[skeleton])) if skeleton.any() else 1.0) / factor
    edges = tuple(replace(edge, points=(edge.points - 0.5) / factor - 0.5) for edge in graph.edges)
    return LaneGraph(edges=edges), half_width


def _reduced(mask: Mask, factor: float) -> Mask:
    if factor == 1.0:
        return mask
    size = (round(mask.shape[1] * factor), round(mask.shape[0] * factor))
    small = cv2.resize(mask.astype(np.uint8) * 255, size, interpolation=cv2.INTER_AREA)
    return np.asarray(small > 127, dtype=bool)


def _centred(mask: Mask, line: Points, half_width_px: float, closed: bool, source: str) -> Route:
    """`line` brought to the lane's middle: edges sought across it, the line smoothed through what they say, thrice."""
    count = int(np.clip(math.ceil(_chords(line, closed).sum() / (0.1 * half_width_px)), 100, _MOST_POINTS))
    even = _even(line, count, closed)
    points = _even(_smoothed(even, np.ones(count), 6 * half_width_px, closed), count, closed)
    usual_px = half_width_px
    for _ in range(3):
        left, right = _edges_across(mask, points, 2.5 * usual_px, closed)
        targets, weights, usual_px = _middles(points, left, right, usual_px, closed)
        points = _even(_smoothed(targets, weights, 4 * usual_px, closed), count, closed)
    left, right = _edges_across(mask, points, 2.5 * usual_px, closed)
    outside = (left <= 0) | (right <= 0)
    if outside.mean() > 0.02:
        u, v = points[int(np.argmax(outside))]
        raise InputError(f"{source}: the route leaves the lane near ({u:.0f}, {v:.0f}) twin px: the lane turns too "
                         "sharply there for its width, or its colour is patchy")  # fmt: skip
    widths = [np.clip(side, 0.5 * usual_px, _WIDEST * usual_px) for side in (left, right)]
    return Route(points_px=points, half_left_px=widths[0], half_right_px=widths[1], closed=closed)


def _chords(points: Points, closed: bool) -> Floats:
    steps = np.roll(points, -1, axis=0) - points if closed else np.diff(points, axis=0)
    return np.asarray(np.hypot(steps[:, 0], steps[:, 1]), dtype=np.float64)


def _even(points: Points, count: int, closed: bool) -> Points:
    """`count` points at equal arc lengths along the polyline `points`, from its first point; an open one's last is kept."""
    ends = np.vstack((points, points[:1])) if closed else points
    chords = np.hypot(*np.diff(ends, axis=0).T)
    ends = np.vstack((ends[:1], ends[1:][chords > 0]))
    along = np.concatenate(([0.0], np.cumsum(chords[chords > 0])))
    at = np.arange(count) * (along[-1] / (count if closed else count - 1))
    return np.column_stack([np.interp(at, along, ends[:, k]) for k in (0, 1)])


def _lefts(points: Points, closed: bool) -> Points:
    """Unit vectors to the left of travel as seen on the twin, whose v points down."""
    ahead = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0) if closed else np.gradient(points, axis=0)
    ahead /= np.hypot(ahead[:, 0], ahead[:, 1])[:, None]
    return np.column_stack((ahead[:, 1], -ahead[:, 0]))


def _edges_across(mask: Mask, points: Points, reach_px: float, closed: bool) -> tuple[Floats, Floats]:
    """Distance from each point to the lane's edge on its left and right, each (n,), at most `reach_px`; 0 off the lane.

    Half a pixel of the mask is resolved: the edge is where its interpolated value falls through one half.
    """
    normals = _lefts(points, closed)
    step = 0.5
    distances = np.arange(0.0, reach_px + step, step)
    lane = mask.astype(np.float32)
    sides = []
    for sign in (1.0, -1.0):
        at = (points[:, None, :] + sign * distances[None, :, None] * normals[:, None, :]).astype(np.float32)
        value = cv2.remap(lane, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
        below = np.asarray(value) < 0.5
        first = np.where(below.any(axis=1), below.argmax(axis=1), len(distances) - 1)
        sides.append(np.maximum(distances[first] - step / 2, 0.0) * (first > 0))
    return sides[0], sides[1]


def _middles(
    points: Points, left: Floats, right: Floats, usual_px: float, closed: bool
) -> tuple[Points, Floats, float]:
    """Where the lane's middle lies by its edges (n, 2), how far to trust each (n,), and the usual half-width.

    Between two edges no wider apart than usual it lies halfway; where one side opens into a junction the nearer edge guides,
    at the usual half-width; where neither serves the weight is almost nothing and the smoothing carries the line on.
    """
    half = (left + right) / 2
    inside = (left > 0) & (right > 0)
    plain = inside & (half < _WIDEST * usual_px)
    if plain.any():
        usual_px = float(np.median(half[plain]))
    between = inside & (half < _WIDER * usual_px)
    nearer = np.minimum(left, right)
    guided = inside & ~between & (nearer < _WIDEST * usual_px)
    towards_left = np.where(left < right, left - usual_px, usual_px - right)
    shift = np.where(between, (left - right) / 2, np.where(guided, towards_left, 0.0))
    weights = np.where(between, 1.0, np.where(guided, 0.3, 1e-3))
    return points + shift[:, None] * _lefts(points, closed), weights, usual_px


def _smoothed(points: Points, weights: Floats, wavelength_px: float, closed: bool) -> Points:
    """The line that minimises sum(weight * |p - point|^2) + k * sum(|third difference of p|^2).

    Third differences let circles pass undiminished. Waves of `wavelength_px` are halved, shorter ones vanish
    (P. H. C. Eilers, "A perfect smoother", Analytical Chemistry 75, 2003; with periodic ends where it is closed).
    """
    n = len(points)
    spacing = float(_chords(points, closed).mean())
    k = (2 * math.sin(math.pi * min(0.5, spacing / wavelength_px))) ** -6
    one = np.eye(n)
    if closed:
        # The square of the third difference's matrix: the same seven numbers in every row, round the ring.
        penalty = sum(
            share * np.roll(one, shift, axis=1)
            for shift, share in zip(range(-3, 4), (-1.0, 6.0, -15.0, 20.0, -15.0, 6.0, -1.0), strict=True)
        )
    else:
        thirds = np.diff(one, n=3, axis=0)
        penalty = thirds.T @ thirds
    solved = np.linalg.solve(np.diag(weights) + k * penalty, weights[:, None] * points)
    return np.asarray(solved, dtype=np.float64)
