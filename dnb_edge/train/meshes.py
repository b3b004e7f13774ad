"""Real meshes as coloured triangle soups: vehicles of length 1 with the nose along +x, clutter in metres.

Knows mesh files (through trimesh, loaded only when files are read) and the catalogue; not how a soup is drawn or scaled.
"""

from __future__ import annotations

import io
import logging
import re
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import radians
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError, WorkError
from dnb_edge.train.mesh_catalogue import CLUTTER, VEHICLES, Axis, Entry, Part

log = logging.getLogger(__name__)

FloatArray = NDArray[np.float64]

TRIANGLES_MAX = 2500
"""A mesh with more is simplified; a textured one with fewer is cut finer, so that its picture shows."""

GREY_BGR = (150.0, 150.0, 150.0)
AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mesh:
    """A solid thing as coloured triangles, standing on z = 0, z up."""

    name: str
    corners_m: FloatArray
    """(n, 3, 3) metres; corners counter-clockwise from outside where the file says so."""
    colours_bgr: FloatArray
    """(n, 3) in 0..255, one a triangle."""
    recolour: bool = False
    """The colours are only plausible: a generator may paint it anew."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Patch:
    """Triangles of one material: corners (n, 3, 3), and either colours (n, 3) or a texture with its (n, 3, 2) places."""

    corners: FloatArray
    colours_bgr: FloatArray
    uv: FloatArray | None = None
    texture_bgr: NDArray[np.uint8] | None = None


def load_vehicle_meshes(assets: Path) -> list[Mesh]:
    """Every vehicle of the catalogue that `assets` holds: nose along +x, length 1, wheel contacts' middle at the origin."""
    return _load_all(VEHICLES, assets, vehicles=True)


def load_clutter_meshes(assets: Path) -> list[Mesh]:
    """Every piece of clutter of the catalogue that `assets` holds: metres, footprint's middle at the origin."""
    return _load_all(CLUTTER, assets, vehicles=False)


def load_entry(entry: Entry, assets: Path, *, vehicle: bool) -> Mesh:
    """One entry of the catalogue; raises `WorkError` with one line where a file is missing or cannot be used."""
    patches = [patch for part in entry.parts for patch in _read_part(part, assets / entry.folder)]
    turn = _axes_matrix(entry.up, entry.nose)
    patches = _cut_finer([replace(patch, corners=patch.corners @ turn.T) for patch in patches])
    simpler = [
        _simplify(patch.corners, _colours(patch), room) for patch, room in zip(patches, _rooms(patches), strict=True)
    ]
    corners, colours = (np.concatenate(each) for each in zip(*simpler, strict=True))
    corners, colours = _without_slivers(corners, colours)
    corners = _as_vehicle(corners) if vehicle else _as_clutter(corners, entry.longest_m)
    return Mesh(name=entry.name, corners_m=corners, colours_bgr=colours, recolour=entry.recolour)


def save_meshes(path: Path, meshes: Sequence[Mesh]) -> Path:
    """Keep meshes in one .npz (corners as float32, colours as bytes), which `read_meshes` loads at once."""
    counts = np.array([len(mesh.corners_m) for mesh in meshes], dtype=np.int64)
    corners = np.concatenate([np.empty((0, 3, 3)), *(mesh.corners_m for mesh in meshes)])
    colours = np.concatenate([np.empty((0, 3)), *(mesh.colours_bgr for mesh in meshes)])
    np.savez_compressed(
        path,
        names=np.array([mesh.name for mesh in meshes], dtype=np.str_),
        recolour=np.array([mesh.recolour for mesh in meshes], dtype=np.bool_),
        counts=counts,
        corners_m=corners.astype(np.float32),
        colours_bgr=np.rint(np.clip(colours, 0.0, 255.0)).astype(np.uint8),
    )
    return path if path.suffix == ".npz" else path.with_name(path.name + ".npz")


def read_meshes(path: Path) -> list[Mesh]:
    """The meshes that `save_meshes` kept; needs no mesh library. Raises `InputError` for a file that is none of its own."""
    try:
        with np.load(path, allow_pickle=False) as kept:
            ends = np.cumsum(kept["counts"])[:-1]
            corners = np.split(kept["corners_m"].astype(np.float64), ends)
            colours = np.split(kept["colours_bgr"].astype(np.float64), ends)
            names, recolour = kept["names"].tolist(), kept["recolour"].tolist()
    except (OSError, ValueError, KeyError, EOFError, AttributeError, TypeError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: not a file of meshes ({error}); make it anew with save_meshes") from error
    return [
        Mesh(name=name, corners_m=corner, colours_bgr=colour, recolour=paint)
        for name, corner, colour, paint in zip(names, corners, colours, recolour, strict=False)
    ]


def attributions(assets: Path) -> list[dict[str, str]]:
    """Folder, repository and licence of each folder of the catalogue that `assets` holds, from its NOTES.md tables."""
    used = {
        entry.folder
        for entry in (*VEHICLES, *CLUTTER)
        if all((assets / entry.folder / part.file).is_file() for part in entry.parts)
    }
    found: list[dict[str, str]] = []
    for kind in ("vehicles", "clutter"):
        notes = assets / kind / "NOTES.md"
        if not notes.is_file():
            continue
        for line in notes.read_text(encoding="utf-8", errors="replace").splitlines():
            cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
            if line.startswith("|") and len(cells) >= 6 and f"{kind}/{cells[0]}" in used:
                found.append({"folder": f"{kind}/{cells[0]}", "repo": cells[2], "licence": cells[5]})
    return found


def _load_all(entries: Sequence[Entry], assets: Path, *, vehicles: bool) -> list[Mesh]:
    meshes = []
    for entry in entries:
        try:
            meshes.append(load_entry(entry, assets, vehicle=vehicles))
        except WorkError as error:
            log.warning("left out mesh %s: %s", entry.name, error)
    return meshes


class _Beside:
    """Finds what a mesh file names (textures, material files) by bare name, near the file: paths in them rarely hold."""

    def __init__(self, file: Path) -> None:
        self._folders = (file.parent, file.parent.parent)

    def get(self, name: str) -> bytes:
        """The bytes of the nearest file of that name, whatever its folder and case."""
        bare = re.split(r"[/\\]", name.strip())[-1].casefold()
        for folder in self._folders:
            for path in sorted(folder.rglob("*")):
                if path.name.casefold() == bare and path.is_file():
                    return path.read_bytes()
        raise FileNotFoundError(name)

    def __getitem__(self, name: str) -> bytes:
        return self.get(name)

    def keys(self) -> list[str]:
        """Names that can be asked for, as the mesh library wants to know."""
        return [path.name for path in self._folders[0].iterdir() if path.is_file()]

    def namespaced(self, namespace: str) -> _Beside:  # noqa: ARG002 - the mesh library's interface
        """The same place: names are looked up bare."""
        return self


def _read_part(part: Part, folder: Path) -> Iterator[_Patch]:
    import trimesh  # noqa: PLC0415 - workers that read the kept .npz need no mesh library

    file = folder / part.file
    if not file.is_file():
        raise WorkError(f"no {file}")
    turn = trimesh.transformations.euler_matrix(*(radians(angle) for angle in part.turn_deg), "sxyz")[:3, :3]
    try:
        scene = trimesh.load_scene(
            io.BytesIO(file.read_bytes()), file_type=file.suffix[1:].lower(), resolver=_Beside(file), process=False
        )
        patches = []
        for node in scene.graph.nodes_geometry:
            place, name = scene.graph[node]
            geometry = scene.geometry[name]
            if isinstance(geometry, trimesh.Trimesh) and re.fullmatch(part.geometry, name) and len(geometry.faces):
                patches.append(
                    _patch(geometry.copy().apply_transform(place), part, linear=file.suffix in {".glb", ".gltf"})
                )
    except Exception as error:  # a parser of foreign files may raise anything
        raise WorkError(f"cannot read {file}: {type(error).__name__}: {error}".splitlines()[0]) from error
    if not patches:
        raise WorkError(f"{file} holds no triangles that match {part.geometry!r}")
    for patch in patches:
        if not np.isfinite(patch.corners).all():
            raise WorkError(f"{file} holds corners that are no numbers")
        yield replace(patch, corners=patch.corners @ turn.T * part.scale + np.asarray(part.shift))


def _patch(geometry: Any, part: Part, *, linear: bool) -> _Patch:
    """One geometry of a file; `linear`: its plain colours are linear light (glTF), not display values."""
    corners = np.asarray(geometry.triangles, dtype=np.float64)
    visual = geometry.visual
    if part.colour_bgr is not None:
        return _Patch(corners=corners, colours_bgr=np.tile(part.colour_bgr, (len(corners), 1)))
    material = getattr(visual, "material", None)
    if material is None:
        coloured = getattr(visual, "kind", None) in {"face", "vertex"}
        rgb = np.asarray(visual.face_colors)[:, :3] if coloured else np.tile(GREY_BGR, (len(corners), 1))
        return _Patch(corners=corners, colours_bgr=rgb[:, ::-1].astype(np.float64))
    rgba = getattr(material, "baseColorFactor", None)
    rgba = getattr(material, "diffuse", None) if rgba is None else rgba
    flat = np.asarray(GREY_BGR if rgba is None else np.asarray(rgba, dtype=np.float64)[2::-1])
    flat = 255.0 * (flat / 255.0) ** (1.0 / 2.2) if linear else flat
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    uv = getattr(visual, "uv", None)
    colours = np.tile(flat, (len(corners), 1))
    if image is None or uv is None:
        return _Patch(corners=corners, colours_bgr=colours)
    texture = cv2.cvtColor(np.asarray(image.convert("RGB")), cv2.COLOR_RGB2BGR).astype(np.uint8)
    places = np.nan_to_num(np.asarray(uv, dtype=np.float64)[geometry.faces])
    return _Patch(corners=corners, colours_bgr=colours, uv=places, texture_bgr=texture)


def _colours(patch: _Patch) -> FloatArray:
    """(n, 3): the texture at each triangle's centre (v counts upward and repeats), or the flat colours."""
    if patch.uv is None or patch.texture_bgr is None:
        return patch.colours_bgr
    height, width = patch.texture_bgr.shape[:2]
    u, v = (patch.uv.mean(axis=1) % 1.0).T
    columns = np.minimum((u * width).astype(np.int64), width - 1)
    rows = np.minimum(((1.0 - v) * height).astype(np.int64), height - 1)
    colours: FloatArray = patch.texture_bgr[rows, columns].astype(np.float64)
    return colours


def _cut_finer(patches: list[_Patch]) -> list[_Patch]:
    """Bisect long edges of textured triangles, longest first, while the whole stays within `TRIANGLES_MAX`."""
    everything = np.concatenate([patch.corners.reshape(-1, 3) for patch in patches])
    size = float(np.ptp(everything, axis=0).max())
    room = TRIANGLES_MAX - sum(len(patch.corners) for patch in patches)
    patches = list(patches)
    for longest in size * np.array([0.5, 0.35, 0.25, 0.18, 0.13, 0.09, 0.06, 0.045, 0.03]):
        for index, patch in enumerate(patches):
            if patch.uv is not None and room > 0:
                patches[index] = _bisect(patch, longest, room)
                room -= len(patches[index].corners) - len(patch.corners)
    return patches


def _bisect(patch: _Patch, longest: float, room: int) -> _Patch:
    """Cut at the middle of their longest edge up to `room` triangles that have one over `longest`."""
    corners, uv = patch.corners, patch.uv
    if uv is None:
        return patch
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    chosen = np.argsort(-edges.max(axis=1))[:room]
    chosen = chosen[edges[chosen].max(axis=1) > longest]
    if not len(chosen):
        return patch
    order = (edges[chosen].argmax(axis=1)[:, None] + np.arange(3)) % 3
    both = np.concatenate([corners, uv], axis=2)
    first, second, third = np.moveaxis(np.take_along_axis(both[chosen], order[:, :, None], axis=1), 1, 0)
    middle = (first + second) / 2.0
    halves = (np.stack([first, middle, third], axis=1), np.stack([middle, second, third], axis=1))
    cut = np.concatenate([np.delete(both, chosen, axis=0), *halves])
    flat = np.concatenate([np.delete(patch.colours_bgr, chosen, axis=0), *(patch.colours_bgr[chosen],) * 2])
    return replace(patch, corners=cut[:, :, :3], uv=cut[:, :, 3:], colours_bgr=flat)


def _rooms(patches: list[_Patch]) -> list[int]:
    """Triangles that each patch may keep, by its area and its detail alike: fine wheels must not eat up a plain body."""
    counts = np.array([len(patch.corners) for patch in patches], dtype=np.float64)
    areas = np.array([_doubled_areas(patch.corners).sum() for patch in patches])
    weights = counts / counts.sum() + areas / max(areas.sum(), 1e-30) + 0.5 / len(patches)
    rooms, left, weight_left = counts.astype(np.int64), TRIANGLES_MAX, float(weights.sum())
    for index in np.argsort(counts / weights):  # those that need less than their share leave the rest to the others
        rooms[index] = min(int(counts[index]), int(left * weights[index] / weight_left + 1e-9))
        left, weight_left = left - int(rooms[index]), max(weight_left - float(weights[index]), 1e-30)
    return [int(room) for room in rooms]


def _simplify(corners: FloatArray, colours: FloatArray, room: int) -> tuple[FloatArray, FloatArray]:
    """At most `room` triangles of much the same shape, each with the colour of the nearest one before."""
    if len(corners) <= room:
        return corners, colours
    size = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    points, faces = _merged(corners, size * 1e-5)
    try:
        import fast_simplification  # noqa: PLC0415 - only where meshes are made

        points, faces = fast_simplification.simplify(points, faces, target_count=room, agg=5.0)
    except ImportError:
        log.info("fast_simplification is not installed: vertices are clustered instead")
    simpler = np.asarray(points, dtype=np.float64)[faces]
    cell = size / 100.0
    while len(simpler) > room:
        points, faces = _merged(simpler, cell)
        simpler, cell = points[faces], cell * 1.2
    return simpler, colours[_nearest(simpler.mean(axis=1), corners.mean(axis=1))]


def _merged(corners: FloatArray, cell: float) -> tuple[FloatArray, NDArray[np.int64]]:
    """Points (m, 3) and faces (k, 3) of a soup whose corners within one grid cell become one; flat faces go."""
    keys = np.rint(corners.reshape(-1, 3) / cell).astype(np.int64)
    _, first, which = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    faces = which.reshape(-1, 3)
    distinct = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return corners.reshape(-1, 3)[first], faces[distinct].astype(np.int64)


def _nearest(wanted: FloatArray, among: FloatArray) -> NDArray[np.int64]:
    """(m,): for each of `wanted` (m, 3) the index of the nearest of `among` (n, 3)."""
    squares = (among**2).sum(axis=1)
    chunks = [
        np.argmin(squares - 2.0 * piece @ among.T, axis=1) for piece in np.array_split(wanted, len(wanted) // 64 + 1)
    ]
    return np.concatenate(chunks).astype(np.int64)


def _doubled_areas(corners: FloatArray) -> FloatArray:
    """(n,): twice the area of each triangle."""
    doubled: FloatArray = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return doubled


def _without_slivers(corners: FloatArray, colours: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Only triangles that have an area."""
    kept = _doubled_areas(corners) > 1e-12 * float(np.ptp(corners.reshape(-1, 3), axis=0).max()) ** 2
    if not kept.any():
        raise WorkError("all triangles are flat")
    return corners[kept], colours[kept]


def _axes_matrix(up: Axis, nose: Axis) -> FloatArray:
    """The rotation that takes the file's nose to +x and its up to +z."""
    above, ahead = (np.array(AXES[axis[1]]) * (1.0 if axis[0] == "+" else -1.0) for axis in (up, nose))
    return np.stack([ahead, np.cross(above, ahead), above])


def _as_vehicle(corners: FloatArray) -> FloatArray:
    """Length 1 along x; the lowest tenth (the wheels' feet) has its middle at the origin."""
    points = corners.reshape(-1, 3)
    low, high = points.min(axis=0), points.max(axis=0)
    feet = points[points[:, 2] <= low[2] + 0.1 * (high[2] - low[2])]
    length = high[0] - low[0]
    if not length > 0.0:
        raise WorkError("the vehicle has no length")
    middle = (feet.min(axis=0) + feet.max(axis=0)) / 2.0
    if abs(middle[0] - (low[0] + high[0]) / 2.0) > 0.15 * length:
        middle = (low + high) / 2.0  # one axle only: castors are often not drawn
    placed: FloatArray = (corners - np.array([middle[0], middle[1], low[2]])) / length
    return placed


def _as_clutter(corners: FloatArray, longest_m: float) -> FloatArray:
    """The longest side `longest_m`; the footprint's middle at the origin."""
    points = corners.reshape(-1, 3)
    low, high = points.min(axis=0), points.max(axis=0)
    foot = np.array([(low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0, low[2]])
    placed: FloatArray = (corners - foot) * (longest_m / float((high - low).max()))
    return placed
