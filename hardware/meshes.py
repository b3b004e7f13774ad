"""Meshes for printing: the same part gives the same bytes, and what cannot be printed is found.

Knows triangles, binary STL and the printer's bed, in mm. Knows no part.
"""

import struct
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from hardware.triangles import of_faces

BED_MM = (220.0, 220.0, 220.0)
_DEVIATION_MM, _DEVIATION_RAD = 0.03, 0.2
_HEADER = b"dnb-edge kit, millimetres, GPL-3.0-or-later".ljust(80, b"\0")


def triangles(shape: Any) -> NDArray[np.float32]:
    """(N, 3, 3) corners of a shape's surface in mm, put on the bed: least z is 0, x and y are centred.

    Rounded to 0.1 micrometres and sorted, so that the order in which the modeller walked its faces does not show.
    """
    exact = np.concatenate(of_faces(shape, deviation_mm=_DEVIATION_MM, deviation_rad=_DEVIATION_RAD))
    least, most = exact.min(axis=(0, 1)), exact.max(axis=(0, 1))
    middle = (least + most) / 2
    corners = (np.round(exact - (middle[0], middle[1], least[2]), 4) + 0.0).astype(np.float32)
    # A triangle may start at any of its corners: the least one goes first.
    first = np.array([np.lexsort(triangle.T[::-1])[0] for triangle in corners])
    turned = corners[np.arange(len(corners))[:, None], (first[:, None] + np.arange(3)) % 3]
    order = np.lexsort(turned.reshape(len(turned), 9).T[::-1])
    return np.asarray(turned[order], dtype=np.float32)


def stl(corners: NDArray[np.float32]) -> bytes:
    """Binary STL of (N, 3, 3) corners; normals are computed from the corners."""
    edges_a, edges_b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normals = np.cross(edges_a.astype(np.float64), edges_b.astype(np.float64))
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0) + 0.0
    record = np.zeros(len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("nothing", "<u2")])
    record["normal"], record["corners"] = np.round(normals, 5) + 0.0, corners
    return _HEADER + struct.pack("<I", len(corners)) + record.tobytes()


def faults(corners: NDArray[np.float32]) -> list[str]:
    """What is wrong with a mesh for printing, in words; nothing where it is watertight, one body, and fits the bed."""
    mesh = trimesh.Trimesh(**trimesh.triangles.to_kwargs(corners))
    mesh.merge_vertices()
    found = []
    if not mesh.is_watertight:
        found.append("is not watertight")
    if not mesh.is_winding_consistent:
        found.append("has faces turned inside out")
    if not mesh.volume > 0:
        found.append(f"has a volume of {mesh.volume:.1f} mm3")
    if mesh.body_count != 1:
        found.append(f"falls into {mesh.body_count} pieces")
    size = mesh.extents
    if any(have > most for have, most in zip(size, BED_MM, strict=True)):
        found.append(f"is {size[0]:.0f} x {size[1]:.0f} x {size[2]:.0f} mm, larger than the bed")
    return found


def volume_mm3(corners: NDArray[np.float32]) -> float:
    """Volume inside a watertight mesh."""
    a, b, c = (corners[:, i].astype(np.float64) for i in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)
