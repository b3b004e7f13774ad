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
from typing import Annotated, Any, Literal

import yaml
from pydantic import BaseModel, Field, ValidationError

from dnb_edge.config.load import ConfigLoader
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
    file = _checked(path, _parsed(path))
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


def _parsed(path: Path) -> dict[str, Any]:
    try:
        data = yaml.load(path.read_text(encoding="utf-8"), Loader=ConfigLoader)  # noqa: S506 a safe loader
    except OSError as error:
        raise InputError(f"{path}: cannot read the layout ({error.strerror}): check the path") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text: {_FORM}") from error
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark else ""
        raise InputError(f"{path}{where}: not valid YAML: {getattr(error, 'problem', None) or error}") from error
    except (TypeError, RecursionError) as error:
        raise InputError(f"{path}: not plain YAML: {error}; {_FORM}") from error
    if not isinstance(data, dict):
        raise InputError(f"{path}: no layout in it: {_FORM}")
    return data


def _checked(path: Path, data: dict[str, Any]) -> _File:
    try:
        return _File.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        words = {"extra_forbidden": "unknown key", "missing": "is missing"}
        what = words.get(first["type"], str(first["msg"])[:1].lower() + str(first["msg"])[1:])
        raise InputError(f"{path}: {key}: {what}; {_FORM}") from error
