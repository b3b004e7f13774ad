"""Where floor markers lie on the track, from a YAML file, the form that a person with a tape measure writes.

    twin: {metres_per_px: 0.002, height_px: 1500}     # may be left out where all places are in metres
    sigma_mm: 5                                       # how well they were measured
    markers:
      - {number: 0, track_m: [0.50, 0.40]}            # the square's middle
      - {number: 3, track_m: [2.50, 0.40], point: top left}    # or a corner of it, as printed
      - {number: 4, twin_px: [812, 200]}

Knows YAML and the file's form; what the places mean is `view.marker_floor`'s knowledge.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, Field

from dnb_edge.config.document import read_mapping, validated
from dnb_edge.config.sections import STRICT, Number, Whole
from dnb_edge.errors import InputError
from dnb_edge.track.scale import TwinScale
from dnb_edge.view.marker_floor import MarkerLayout
from dnb_edge.view.marker_solution import MeasuredPoint

_FORM = "it must hold markers, a list of {number: ..., track_m: [x, y]} or {number: ..., twin_px: [u, v]}"
_LOCAL = {
    "middle": (0.0, 0.0),
    "top left": (-0.5, 0.5),
    "top right": (0.5, 0.5),
    "bottom right": (0.5, -0.5),
    "bottom left": (-0.5, -0.5),
}

_Positive = Annotated[Number, Field(gt=0)]


class _Twin(BaseModel):
    model_config = STRICT

    metres_per_px: _Positive
    height_px: _Positive


class _Marker(BaseModel):
    model_config = STRICT

    number: Annotated[Whole, Field(ge=0)]
    track_m: tuple[Number, Number] | None = None
    twin_px: tuple[Number, Number] | None = None
    point: Literal["middle", "top left", "top right", "bottom right", "bottom left"] = "middle"


class _File(BaseModel):
    model_config = STRICT

    twin: _Twin | None = None
    sigma_mm: _Positive = 5.0
    markers: tuple[_Marker, ...]


def load_marker_layout(path: Path) -> MarkerLayout:
    """The layout in the YAML file `path`. Raises `InputError` naming the file, and the line or key at fault."""
    data = read_mapping(path, what="marker layout", remedy=_FORM)
    file = validated(_File, data, path, remedy=_FORM)
    scale = None if file.twin is None else TwinScale(**file.twin.model_dump())
    points = []
    for marker in file.markers:
        if (marker.track_m is None) == (marker.twin_px is None):
            raise InputError(f"{path}: marker {marker.number} needs one of track_m and twin_px")
        points.append(
            MeasuredPoint(
                number=marker.number,
                local=_LOCAL[marker.point],
                at_m=_at_m(path, marker, scale),
                sigma_m=file.sigma_mm / 1000.0,
            )
        )
    if len({point.number for point in points}) < 2:
        raise InputError(f"{path}: two markers must be measured at least: {_FORM}")
    if len({(point.number, point.local) for point in points}) < len(points):
        raise InputError(f"{path}: the same point of a marker is given twice")
    return MarkerLayout(points=tuple(points), scale=scale, source=str(path))


def _at_m(path: Path, marker: _Marker, scale: TwinScale | None) -> tuple[float, float]:
    if marker.track_m is not None:
        return marker.track_m
    assert marker.twin_px is not None
    if scale is None:
        raise InputError(
            f"{path}: marker {marker.number} is in twin_px: add twin: {{metres_per_px: ..., height_px: ...}}"
        )
    u, v = marker.twin_px
    return u * scale.metres_per_px, (scale.height_px - v) * scale.metres_per_px
