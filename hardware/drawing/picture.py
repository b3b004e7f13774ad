"""Shaded pictures of solid bodies as SVG: what is in front hides what is behind, all of it in lines and flat areas.

Knows triangles of a mesh, a direction of view and shapely. Knows no part. Every face of a body becomes a few areas of one
shade; an area loses what lies behind others, decided by the depth at a point of each overlap. The same bodies give the same
bytes: numbers are rounded to 0.01 mm and nothing depends on an order that may vary.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hardware import triangles

Floats = NDArray[np.float64]

SHADES = 7
_MESH_MM, _MESH_RAD = 0.15, 0.35
_SLIVER_MM2 = 0.01
_SAME_MM = 0.02
_HAIR_MM = 0.02
_GRID_MM = 0.001


@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """A solid to draw, moved by `offset_mm` from where it is, in a colour (red, green, blue; 0 to 255)."""

    shape: Any
    colour: tuple[int, int, int]
    offset_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """Where one looks from: a direction to the eye and what is up, in the bodies' frame; parallel projection."""

    towards_eye: tuple[float, float, float]
    up: tuple[float, float, float]

    def axes(self) -> Floats:
        """Rows: right, up, towards the eye; unit vectors."""
        eye = np.array(self.towards_eye) / math.hypot(*self.towards_eye)
        right = np.cross(np.array(self.up), eye)
        right /= np.linalg.norm(right)
        return np.array([right, np.cross(eye, right), eye])

    def project(self, point: tuple[float, float, float]) -> tuple[float, float]:
        """A point of the bodies' frame on the picture: mm to the right and up."""
        right, up, _ = self.axes() @ np.array(point)
        return float(right), float(up)


@dataclass(slots=True, kw_only=True)
class _Patch:
    """A part of one face that has one shade."""

    body: int
    face: int
    shade: int
    triangles: Floats
    """(N, 3, 3): right, up, towards the eye; mm."""
    area: BaseGeometry
    seen: BaseGeometry

    def depth_at(self, x: float, y: float) -> float:
        """The nearest of this patch to the eye above a point of its area."""
        a, b, c = (self.triangles[:, i] for i in range(3))
        det = (b[:, 1] - c[:, 1]) * (a[:, 0] - c[:, 0]) + (c[:, 0] - b[:, 0]) * (a[:, 1] - c[:, 1])
        u = ((b[:, 1] - c[:, 1]) * (x - c[:, 0]) + (c[:, 0] - b[:, 0]) * (y - c[:, 1])) / det
        v = ((c[:, 1] - a[:, 1]) * (x - c[:, 0]) + (a[:, 0] - c[:, 0]) * (y - c[:, 1])) / det
        worst = np.minimum(np.minimum(u, v), 1 - u - v)
        inside = worst >= min(-1e-9, float(worst.max()))
        z = u * a[:, 2] + v * b[:, 2] + (1 - u - v) * c[:, 2]
        return float(z[inside].max())


@dataclass(frozen=True, slots=True, kw_only=True)
class Shaded:
    """Bodies as SVG elements in mm (x right, y down)."""

    svg: str
    bounds: tuple[float, float, float, float]
    """Least x and y, greatest x and y."""
    spots: tuple[tuple[float, float, float] | None, ...]
    """For each body x and y inside the largest part of it that is seen, and that part's area; none where nothing is."""


def shaded(bodies: Sequence[Body], view: View, *, line_mm: float = 0.25) -> Shaded:
    """The bodies as they are seen."""
    axes = view.axes()
    patches = [patch for index, body in enumerate(bodies) for patch in _patches(index, body, axes)]
    _hide(patches)
    drawn: list[str] = []
    for index, body in enumerate(bodies):
        drawn.append(f'<g id="body{index}" stroke-linejoin="round">')
        mine = [patch for patch in patches if patch.body == index and not patch.seen.is_empty]
        by_shade: dict[int, list[BaseGeometry]] = {}
        for patch in mine:
            by_shade.setdefault(patch.shade, []).append(patch.seen)
        for shade in sorted(by_shade):
            colour = _colour(body.colour, shade)
            path = _path(_closed(shapely.union_all(by_shade[shade], grid_size=_GRID_MM)))
            drawn.append(
                f'<path fill="{colour}" stroke="{colour}" stroke-width="0.12" fill-rule="evenodd" d="{path}"/>'
            )
        drawn.append(f'<path fill="none" stroke="#22303a" stroke-width="{line_mm}" d="{_outlines(mine)}"/>')
        drawn.append("</g>")
    bounds = shapely.total_bounds(np.array([patch.area for patch in patches]))
    least_x, least_y, most_x, most_y = (float(value) for value in bounds)
    spots = tuple(_spot([patch.seen for patch in patches if patch.body == index]) for index in range(len(bodies)))
    return Shaded(svg="\n".join(drawn), bounds=(least_x, -most_y, most_x, -least_y), spots=spots)


def _patches(index: int, body: Body, axes: Floats) -> list[_Patch]:
    light = np.array([-0.35, 0.55, 0.76])
    found = []
    faces = triangles.of_faces(body.shape, deviation_mm=_MESH_MM, deviation_rad=_MESH_RAD)
    for number, face in enumerate(faces):
        corners = (face + np.array(body.offset_mm)) @ axes.T
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(normals, axis=1)
        facing = (normals[:, 2] > 1e-3 * lengths) & (lengths > 1e-9)
        if not facing.any():
            continue
        brightness = np.clip(normals[facing] / lengths[facing, None] @ light, 0, 1)
        shades = np.round(brightness * (SHADES - 1)).astype(int)
        for shade in sorted(set(shades.tolist())):
            mine = corners[facing][shades == shade]
            area = _closed(shapely.union_all(shapely.polygons(mine[:, :, :2]), grid_size=_GRID_MM))
            if area.area > _SLIVER_MM2:
                found.append(_Patch(body=index, face=number, shade=shade, triangles=mine, area=area, seen=area))
    return found


def _hide(patches: list[_Patch]) -> None:
    """Take from each patch what others cover."""
    areas = np.array([patch.area for patch in patches])
    tree = shapely.STRtree(areas)
    first, second = tree.query(areas, predicate="intersects")
    covers: list[list[BaseGeometry]] = [[] for _ in patches]
    for i, j in sorted(zip(first.tolist(), second.tolist(), strict=True)):
        if i >= j:
            continue
        for piece in shapely.get_parts(patches[i].area.intersection(patches[j].area, grid_size=_GRID_MM)):
            if piece.area < _SLIVER_MM2:
                continue
            spot = piece.representative_point()
            ahead = patches[i].depth_at(spot.x, spot.y) - patches[j].depth_at(spot.x, spot.y)
            if abs(ahead) > _SAME_MM:
                covers[j if ahead > 0 else i].append(piece)
    for patch, covered in zip(patches, covers, strict=True):
        if covered:
            patch.seen = _opened(
                patch.area.difference(_closed(shapely.union_all(covered, grid_size=_GRID_MM)), grid_size=_GRID_MM)
            )


def _spot(seen: Sequence[BaseGeometry]) -> tuple[float, float, float] | None:
    parts = [part for part in shapely.get_parts(shapely.union_all(list(seen), grid_size=_GRID_MM)) if part.area > 0]
    if not parts:
        return None
    largest = max(parts, key=lambda part: part.area)
    point = largest.representative_point()
    return float(point.x), -float(point.y), float(largest.area)


def _closed(area: BaseGeometry) -> BaseGeometry:
    """Without the hairline gaps that rounding leaves between triangles."""
    return _grown(_grown(area, _HAIR_MM), -_HAIR_MM)


def _opened(area: BaseGeometry) -> BaseGeometry:
    """Without slivers."""
    return _grown(_grown(area, -_HAIR_MM), _HAIR_MM)


def _grown(area: BaseGeometry, by_mm: float) -> BaseGeometry:
    """Grown or shrunk, and made of sound polygons alone: others stop shapely's set operations."""
    # An area that carries a grid is buffered on that grid, wrongly at times: take it off first.
    grown = shapely.set_precision(area, 0).buffer(by_mm, join_style="mitre")
    rounded = shapely.set_precision(shapely.make_valid(grown), _GRID_MM)
    parts = shapely.get_parts(shapely.get_parts(shapely.make_valid(rounded)))
    polygons = [part for part in parts if part.geom_type == "Polygon"]
    return shapely.union_all(polygons, grid_size=_GRID_MM) if polygons else shapely.Polygon()


def _outlines(patches: Sequence[_Patch]) -> str:
    """The borders of all faces that are seen, each once; borders between shades of one face are none."""
    by_face: dict[int, list[BaseGeometry]] = {}
    for patch in patches:
        by_face.setdefault(patch.face, []).append(patch.seen)
    borders = [_closed(shapely.union_all(parts, grid_size=_GRID_MM)).boundary for parts in by_face.values()]
    if not borders:
        return ""
    lines = shapely.line_merge(shapely.union_all(borders, grid_size=0.01))
    return _path(lines)


def _path(shape: BaseGeometry) -> str:
    """SVG path data of areas or lines, y turned down; sorted, so that the same shape gives the same text."""
    pieces = []
    for part in shapely.get_parts(shape):
        rings = (
            [part]
            if part.geom_type in {"LineString", "LinearRing"}
            else [part.exterior, *part.interiors]
            if part.geom_type == "Polygon"
            else []
        )
        for ring in rings:
            points = [(round(x, 2) + 0.0, round(-y, 2) + 0.0) for x, y in shapely.simplify(ring, 0.02).coords]
            if len(points) > 1:
                closed = points[0] == points[-1]
                text = "L".join(f"{x:g} {y:g}" for x, y in (points[:-1] if closed else points))
                pieces.append(f"M{text}{'Z' if closed else ''}")
    return "".join(sorted(pieces))


def _colour(base: tuple[int, int, int], shade: int) -> str:
    """Darker on the side away from the light, a little towards white in it."""
    share = 0.55 + 0.45 * shade / (SHADES - 1)
    red, green, blue = (round(channel * share + 28 * max(0.0, share - 0.85)) for channel in base)
    return f"#{min(red, 255):02x}{min(green, 255):02x}{min(blue, 255):02x}"
