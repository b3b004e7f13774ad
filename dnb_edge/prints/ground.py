"""What lies on the floor when a track is printed: the lane, its borders, the start's marks and floor markers.

Knows a track in metres and what of it is ink. Knows no paper: the drawing's millimetres have their origin in the floor's bottom
left corner, x to the right and y up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.prints.layout import PlacedMarker
from dnb_edge.prints.tiles import Box, Tiling
from dnb_edge.sim.circuit import Circuit
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.layout import laid_out
from dnb_edge.track.line import DirectedLine
from dnb_edge.track.model import START_LINE, Track
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import PointM, Points

BORDER_MM = 12.0
"""Width of the dark line along the lane's edges."""
TWIN_METRES_PER_PX = 0.001
_STEP_M = 0.005
_CLEAR_MM = 6.0
"""Between a floor marker's white border and the lane's dark one, or the drawing's edge."""
_BESIDE_M = 0.06
"""Floor round the lane of a track that comes without a size."""
_GRID_MM = 5.0
"""Floor markers' middles lie at whole multiples of it."""
_WIDE_MM = 60.0
_CELL_MM = 8.0
_ARROW_MM = 60.0
_ARROW = ((0.0, 0.08), (0.55, 0.08), (0.55, 0.25), (1.0, 0.0), (0.55, -0.25), (0.55, -0.08), (0.0, -0.08))
"""In its own length: along the direction of travel, and across."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ground:
    """A track's floor, in millimetres of the drawing."""

    name: str
    size_mm: tuple[float, float]
    """Width and height of the floor that is printed."""
    origin_m: PointM
    """Its bottom left corner, track m."""
    scale: TwinScale
    """Of the track's twin."""
    middle_mm: Points
    """(n, 2) the centreline, in the order of travel."""
    left_mm: Points
    """(n, 2) the lane's left edge, point by point beside it."""
    right_mm: Points
    closed: bool
    length_m: float
    """Of a lap."""
    filled: bool
    """Whether the lane is printed in its colour, or only its dark borders, which saves ink."""
    flags_mm: tuple[Points, ...]
    """Dark squares beside the lane that mark the start line, (4, 2) each."""
    arrow_mm: Points | None
    """The arrow in the direction of travel beside the start; None where the lane leaves no room for it."""
    family: str
    marker_mm: float
    """Side of a floor marker's black square."""
    markers: tuple[PlacedMarker, ...] = ()

    def to_mm(self, at_m: Points) -> Points:
        """(n, 2) track m to the drawing's mm."""
        return np.asarray(1000.0 * (np.asarray(at_m) - np.asarray(self.origin_m)))

    def border_mm(self) -> tuple[Points, Points]:
        """The left and the right outer edge of the dark borders."""
        left, right = self.left_mm - self.middle_mm, self.right_mm - self.middle_mm
        return self.middle_mm + _longer(left, BORDER_MM), self.middle_mm + _longer(right, BORDER_MM)

    def _colour_mm(self) -> tuple[Points, ...]:
        """Lines along the lane, `_WIDE_MM` apart at most: a sheet may lie between its middle and its edge."""
        ways = [edge - self.middle_mm for edge in self.border_mm()]
        count = math.ceil(max(float(np.linalg.norm(way, axis=1).max()) for way in ways) / _WIDE_MM)
        return tuple(self.middle_mm + k / count * way for way in ways for k in range(1, count))

    def needs(self, box: Box) -> bool:
        """Whether anything is to be printed in this part of the floor."""
        outlines = [*self.border_mm(), self.middle_mm, *self.flags_mm, *(self._colour_mm() if self.filled else ())]
        outlines += [_square(1000.0 * (np.asarray(one.at_m) - self.origin_m), self.marker_mm) for one in self.markers]
        if self.arrow_mm is not None:
            outlines.append(self.arrow_mm)
        points = np.vstack(outlines)
        inside = (points > (box.left, box.bottom)) & (points < (box.right, box.top))
        return bool(np.any(np.all(inside, axis=1)))


def circuit_track(circuit: Circuit) -> Track:
    """A built-in circuit as a track, exactly as it is drawn, with a twin of 1 mm a px."""
    count = math.ceil(circuit.centreline.length_m / _STEP_M)
    s_m = np.arange(count) * circuit.centreline.length_m / count
    half = np.full(count, 0.5 * circuit.lane_width_m)
    centreline = Centreline(points_m=circuit.centreline.at(s_m), half_left_m=half, half_right_m=half)
    start, end = circuit.start_line_m
    _, height_m = circuit_size_m(circuit)
    return laid_out(
        centreline,
        name=circuit.name,
        scale=TwinScale(metres_per_px=TWIN_METRES_PER_PX, height_px=height_m / TWIN_METRES_PER_PX),
        start=DirectedLine(name=START_LINE, start_m=start, end_m=end),
        source=circuit.name,
    )


def circuit_size_m(circuit: Circuit) -> tuple[float, float]:
    """Width and height of a built-in circuit's floor."""
    width_px, height_px = circuit.twin_size_px
    metres_per_px = circuit.scale.metres_per_px
    return width_px * metres_per_px, height_px * metres_per_px


def ground_of(
    track: Track, *, size_m: tuple[float, float] | None, family: str, marker_mm: float, filled: bool = True
) -> Ground:
    """The floor of `track`, without markers: from track m (0, 0) on where its size is given, else all that its lane needs."""
    line = track.centreline
    closed = line.closed
    points, normals = line.points_m, _normals(line.points_m, closed=closed)
    left_m = points + normals * line.half_left_m[:, None]
    right_m = points - normals * line.half_right_m[:, None]
    origin = np.zeros(2)
    if size_m is None:
        edges = np.vstack((left_m, right_m))
        origin, far = edges.min(axis=0) - _BESIDE_M, edges.max(axis=0) + _BESIDE_M
        size_m = (float(far[0] - origin[0]), float(far[1] - origin[1]))

    def mm(at_m: Points) -> Points:
        return np.asarray(1000.0 * (at_m - origin))

    bare = Ground(
        name=track.name,
        size_mm=(1000.0 * size_m[0], 1000.0 * size_m[1]),
        origin_m=(float(origin[0]), float(origin[1])),
        scale=track.scale,
        middle_mm=mm(points),
        left_mm=mm(left_m),
        right_mm=mm(right_m),
        closed=closed,
        length_m=line.length_m,
        filled=filled,
        flags_mm=(),
        arrow_mm=None,
        family=family,
        marker_mm=marker_mm,
    )
    return _with_start(bare, mm(np.asarray((track.start_line.start_m, track.start_line.end_m))).mean(axis=0))


def _with_start(ground: Ground, start_mm: NDArray[np.float64]) -> Ground:
    """The floor with a chequered flag on either side of the start line, about `start_mm`, and an arrow beside it.

    Nothing crosses the lane, so that its colour stays one unbroken band.
    """
    k = int(np.argmin(np.linalg.norm(ground.middle_mm - start_mm, axis=1)))
    middle, sides = ground.middle_mm[k], (ground.left_mm[k], ground.right_mm[k])
    flags: list[Points] = []
    arrow = None
    for side, edge in enumerate(sides):
        out = (edge - middle) / np.linalg.norm(edge - middle)
        ahead = np.array((out[1], -out[0])) if side == 0 else np.array((-out[1], out[0]))
        foot = edge + (BORDER_MM + 1.0) * out
        for row, column in ((0, 0), (1, -1)):
            corner = foot + _CELL_MM * (row * out + column * ahead)
            flags.append(corner + _CELL_MM * np.array((0.0 * out, ahead, ahead + out, out)))
        tail = foot + 40.0 * out - 0.5 * _ARROW_MM * ahead
        drawn = np.array([tail + _ARROW_MM * (a * ahead + b * out) for a, b in _ARROW])
        arrow = drawn if arrow is None and _clear(ground, drawn) else arrow
    return replace(ground, flags_mm=tuple(flags), arrow_mm=arrow)


def _clear(ground: Ground, points: Points) -> bool:
    """Whether all these points are on the floor and off the lane."""
    if not np.all((points > 0.0) & (points < ground.size_mm)):
        return False
    half = np.linalg.norm(ground.left_mm - ground.middle_mm, axis=1)
    apart = np.linalg.norm(points[:, None] - ground.middle_mm[None], axis=2)
    return bool(np.all(apart > half + BORDER_MM + _CLEAR_MM))


def with_markers(ground: Ground, tiling: Tiling, *, cells: int, numbers: tuple[int, ...]) -> Ground:
    """The floor with a marker for each of `numbers`, or fewer where the lane leaves no room for more.

    Each lies whole on one sheet, where no other covers it: in corners first, then ever where the others are farthest.
    Raises `InputError` where fewer than four fit: one more than calibrating needs.
    """
    half = ground.marker_mm * (0.5 + 1.0 / cells)
    room = _room(ground, tiling, half)
    width, height = ground.size_mm
    taken: list[int] = []
    for corner in ((0.0, height), (width, height), (width, 0.0), (0.0, 0.0)):
        away = np.linalg.norm(room - corner, axis=1)
        near = int(np.argmin(away)) if len(room) else None
        if near is not None and near not in taken and float(away[near]) < 0.35 * min(width, height):
            taken.append(near)
    while len(room) and len(taken) < len(numbers):
        apart = np.linalg.norm(room[:, None] - room[taken][None], axis=2).min(axis=1, initial=np.inf)
        best = int(np.argmax(np.round(apart, 6)))
        if float(apart[best]) < 2.0 * half + 20.0:
            break
        taken.append(best)
    if len(taken) < min(4, len(numbers)):
        raise InputError(
            f"--marker-mm {ground.marker_mm:g}: only {len(taken)} floor markers of this size fit beside the lane, and four are "
            "needed: make them smaller, or print none (--markers 0)"
        )
    markers = tuple(
        PlacedMarker(number=number, at_m=(ground.origin_m[0] + x / 1000.0, ground.origin_m[1] + y / 1000.0))
        for number, (x, y) in zip(numbers, room[taken].tolist(), strict=False)
    )
    return replace(ground, markers=markers)


def _room(ground: Ground, tiling: Tiling, half: float) -> Points:
    """(n, 2) middles, mm, at which a marker with its white border (twice `half` wide) is clear of lane and sheets' edges."""
    edges = np.vstack((*ground.border_mm(), ground.middle_mm, *ground.flags_mm))
    lane, reach = tiling.only(ground.needs), half + _CLEAR_MM
    found = [np.empty((0, 2))]
    for tile in tiling.tiles:
        # A sheet that hangs together with no other would lie anywhere.
        places = ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))
        if not any(lane.used(tile.column + across, tile.row + down) for across, down in places):
            continue
        box = tile.in_sight
        low, high = np.array((box.left, box.bottom)), np.array((box.right, box.top))
        first = np.ceil((low + reach) / _GRID_MM).astype(int)
        counts = np.floor((high - reach) / _GRID_MM + 1e-6).astype(int) - first + 1
        if np.any(counts < 1):
            continue
        free = np.ones(counts, dtype=bool)
        near = edges[np.all((edges > low) & (edges < high), axis=1)]
        starts = np.maximum(np.ceil((near - reach) / _GRID_MM).astype(int) - first, 0)
        ends = np.maximum(np.floor((near + reach) / _GRID_MM).astype(int) - first + 1, 0)
        for (left, bottom), (right, top) in zip(starts.tolist(), ends.tolist(), strict=True):
            free[left:right, bottom:top] = False
        # Row by row from below, each from the left: of places that are as good the first is taken.
        rows, columns = np.nonzero(free.T)
        found.append(_GRID_MM * (first + np.column_stack((columns, rows))))
    return np.vstack(found)


def _longer(ways: Points, by: float) -> Points:
    """(n, 2) the same ways, each longer by so much."""
    return np.asarray(ways * (1.0 + by / np.linalg.norm(ways, axis=1, keepdims=True)))


def _square(middle: NDArray[np.float64], side: float) -> Points:
    """Corners and middle."""
    half = 0.5 * side
    return np.asarray(middle + np.array([(-half, -half), (half, -half), (half, half), (-half, half), (0.0, 0.0)]))


def _normals(points: Points, *, closed: bool) -> Points:
    """(n, 2) unit vectors to the left of the way through the points."""
    ahead, behind = np.roll(points, -1, axis=0), np.roll(points, 1, axis=0)
    along = ahead - behind if closed else np.gradient(points, axis=0)
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    return np.column_stack((-along[:, 1], along[:, 0]))
