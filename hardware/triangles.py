"""Triangles of a solid's faces: the same solid gives the same triangles, whatever was done with it before.

Knows the modeller's meshing (Open CASCADE), which keeps a mesh with its shape and hands it out again when it is fine enough;
so each call here throws the old one away first.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepTools import BRepTools
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopLoc import TopLoc_Location


def of_faces(shape: Any, *, deviation_mm: float, deviation_rad: float) -> list[NDArray[np.float64]]:
    """For each face of a shape an array (N, 3, 3) of corners, counter-clockwise as seen from outside; mm, its own frame."""
    BRepTools.Clean_s(shape.wrapped)
    relative = in_parallel = False
    BRepMesh_IncrementalMesh(shape.wrapped, deviation_mm, relative, deviation_rad, in_parallel)
    return [_of_face(face.wrapped) for face in shape.faces()]


def _of_face(face: Any) -> NDArray[np.float64]:
    place = TopLoc_Location()
    mesh = BRep_Tool.Triangulation_s(face, place)
    if mesh is None:
        return np.empty((0, 3, 3))
    move = place.Transformation()
    nodes = [mesh.Node(i).Transformed(move) for i in range(1, mesh.NbNodes() + 1)]
    points = np.array([(node.X(), node.Y(), node.Z()) for node in nodes])
    corners = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)]) - 1
    if face.Orientation() == TopAbs_REVERSED:
        corners = corners[:, ::-1]
    return np.asarray(points[corners])
