"""The track file: one YAML document that holds a whole track, so that a twin need be looked at only once.

    format: dnb-edge track
    version: 2
    name: "my track"
    closed: true                  # false: from point to point
    length_m: 10.8                # told, not read
    scale: {metres_per_px: 0.01, height_px: 400.0}
    made_of: {picture: "twin.png", sha256: "...", waypoints_px: [[200.0, 50.0]]}
    lines:
      start: {px: [[320.0, 180.0], [380.0, 180.0]], m: [[3.2, 2.2], [3.8, 2.2]]}
      sectors:
      - {name: "sector 1", px: ..., m: ...}
    points:                       # x_m, y_m, half_left_m, half_right_m
    - [3.5, 2.2, 0.16, 0.16]

Of a line's two forms `m` (track m) is exact and `px` (twin px, rounded) is for people: who moves a line changes `px` and
deletes `m`. Files of version 1 (JSON) are read as ever. Knows the file's form and version. Knows no picture.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
import yaml
from pydantic import BaseModel, ValidationError

from dnb_edge.config.document import first_fault
from dnb_edge.config.sections import STRICT, Number
from dnb_edge.config.text import plain
from dnb_edge.errors import InputError
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.layout import NamedLine, laid_out
from dnb_edge.track.line import DirectedLine
from dnb_edge.track.model import FINISH_LINE, START_LINE, Track
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import PointPx

FILE_FORMAT = "dnb-edge track"
FILE_VERSION = 2
_JSON_VERSION = 1

_SAME_PX = 0.02
"""Further apart than rounding makes them, a line's two forms contradict each other."""

_HEAD = """\
# A track of dnb-edge. Draw it: dnb-edge track show FILE --overlay track.png
# The name and the lines may be changed by hand. To move a line, change its ends `px` (twin pixels: u to the right, v down)
# and delete its `m` (metres); cars drive to the left of the way from its first end to its second.
"""


Pair: TypeAlias = tuple[Number, Number]


class _Part(BaseModel):
    model_config = STRICT


class _Scale(_Part):
    metres_per_px: Number
    height_px: Number


class _MadeOf(_Part):
    picture: str | None = None
    sha256: str | None = None
    waypoints_px: tuple[Pair, ...] = ()


class _Line(_Part):
    name: str | None = None
    px: tuple[Pair, Pair] | None = None
    m: tuple[Pair, Pair] | None = None


class _Lines(_Part):
    start: _Line
    finish: _Line | None = None
    sectors: tuple[_Line, ...] = ()


class _File(_Part):
    format: Literal["dnb-edge track"]
    version: Literal[2]
    name: str
    closed: bool
    length_m: Number | None = None
    scale: _Scale
    made_of: _MadeOf = _MadeOf()
    lines: _Lines
    points: tuple[tuple[Number, Number, Number, Number], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class MadeOf:
    """What a track was made of."""

    picture: str | None = None
    """Name of the twin's picture; None where the track came from something else."""
    sha256: str | None = None
    """SHA-256 of the picture's file, hexadecimal."""
    waypoints_px: tuple[PointPx, ...] = ()
    """The waypoints that chose the route, twin px."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackFile:
    """All that a track file holds."""

    track: Track
    made_of: MadeOf = MadeOf()


def track_file(track: Track, made_of: MadeOf | None = None) -> bytes:
    """The track file's bytes; `load_track` gives back an equal track, bit for bit."""
    route, scale, made_of = track.centreline, track.scale, made_of or MadeOf()
    lines = [
        f"{_HEAD}format: {FILE_FORMAT}",
        f"version: {FILE_VERSION}",
        f"name: {_text(track.name)}",
        f"closed: {'true' if route.closed else 'false'}",
        f"length_m: {_number(round(route.length_m, 6))}  # told, not read",
        f"scale: {{metres_per_px: {_number(scale.metres_per_px)}, height_px: {_number(scale.height_px)}}}",
    ]
    if made_of != MadeOf():
        picture = "" if made_of.picture is None else f"picture: {_text(made_of.picture)}, "
        sha256 = "" if made_of.sha256 is None else f"sha256: {_text(made_of.sha256)}, "
        lines.append(f"made_of: {{{picture}{sha256}waypoints_px: {_pairs(made_of.waypoints_px)}}}")
    lines += ["lines:", f"  start: {{{_ends(track.start_line, scale)}}}"]
    if track.finish_line is not None:
        lines.append(f"  finish: {{{_ends(track.finish_line, scale)}}}")
    if track.sector_lines:
        lines.append("  sectors:")
    lines += [f"  - {{name: {_text(line.name)}, {_ends(line, scale)}}}" for line in track.sector_lines]
    lines.append(
        "points:  # along the route: x_m, y_m, half_left_m, half_right_m (lane's edges to the left and the right)"
    )
    rows = np.column_stack((route.points_m, route.half_left_m, route.half_right_m))
    lines += [f"- [{', '.join(map(_number, row))}]" for row in rows.tolist()]
    return ("\n".join(lines) + "\n").encode()


def load_track(path: Path) -> Track:
    """The track in the file `path`. Raises `InputError` where it is missing, damaged or no track file."""
    return load_track_file(path).track


def load_track_file(path: Path) -> TrackFile:
    """The track in the file `path`, and what it was made of. Errors as for `load_track`."""
    document = _document(path)
    if document.get("version") == _JSON_VERSION and isinstance(document.get("track"), dict):
        try:
            return TrackFile(track=Track.from_dict(document["track"]))
        except InputError as error:
            raise InputError(f"{path}: {error}") from error
    if document.get("version") != FILE_VERSION:
        raise InputError(f"{path}: a track file of version {document.get('version')!r}, known are {_JSON_VERSION} and "
                         f"{FILE_VERSION}: build it anew with `dnb-edge track build`")  # fmt: skip
    try:
        file = _File.model_validate(document)
    except ValidationError as error:
        raise InputError(f"{path}: {first_fault(error)}: mend it, or build the track file anew") from error
    return TrackFile(track=_track(file, path), made_of=MadeOf(**file.made_of.model_dump()))


def _document(path: Path) -> dict[str, Any]:
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot read the track file ({error.strerror}): check the path") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a track file: make one with `dnb-edge track build --out`") from error
    document: Any = None
    try:
        # JSON's 1e-05 is text to YAML 1.1; files of version 1 are JSON.
        document = json.loads(text) if text.startswith("{") else plain(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark else ""
        raise InputError(f"{path}{where}: not a track file: {getattr(error, 'problem', None) or 'no YAML'}: make one with "
                         "`dnb-edge track build --out`") from error  # fmt: skip
    except (ValueError, TypeError, RecursionError) as error:
        raise InputError(f"{path}: not a track file: make one with `dnb-edge track build --out`") from error
    if not isinstance(document, dict) or document.get("format") != FILE_FORMAT:
        raise InputError(f"{path}: not a track file: make one with `dnb-edge track build --out`")
    return document


def _track(file: _File, path: Path) -> Track:
    try:
        scale = TwinScale(metres_per_px=file.scale.metres_per_px, height_px=file.scale.height_px)
        points = np.array(file.points, dtype=np.float64).reshape(-1, 4)
        centreline = Centreline(
            points_m=points[:, :2], half_left_m=points[:, 2], half_right_m=points[:, 3], closed=file.closed
        )
        finish = file.lines.finish
        sectors = [
            NamedLine(line=_line(line.name or f"sector {k}", line, scale), name=line.name)
            for k, line in enumerate(file.lines.sectors, start=1)
        ]
        start = _line(START_LINE, file.lines.start, scale)
        finish_line = None if finish is None else _line(FINISH_LINE, finish, scale)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    return laid_out(
        centreline, name=file.name, scale=scale, start=start, finish=finish_line, sectors=sectors, source=str(path)
    )


def _line(name: str, line: _Line, scale: TwinScale) -> DirectedLine:
    """The line from its exact ends in metres, or where those were deleted from its ends in twin px."""
    if line.m is None and line.px is None:
        raise InputError(f"lines: {name!r} has no ends: give px, two points (u, v) on the twin")
    from_px = None if line.px is None else scale.to_track_m(np.array(line.px, dtype=np.float64))
    if line.m is not None:
        if from_px is not None and np.abs(from_px - np.array(line.m)).max() > _SAME_PX * scale.metres_per_px:
            raise InputError(f"lines: {name!r} has other ends in px than in m: delete m to take px, or px to take m")
        return DirectedLine(name=name, start_m=line.m[0], end_m=line.m[1])
    assert from_px is not None, "one of the two is there"
    (x0, y0), (x1, y1) = from_px.tolist()
    return DirectedLine(name=name, start_m=(x0, y0), end_m=(x1, y1))


def _ends(line: DirectedLine, scale: TwinScale) -> str:
    ends_px = scale.to_twin_px(np.array([line.start_m, line.end_m])).tolist()
    rounded = [(round(u, 2), round(v, 2)) for u, v in ends_px]
    return f"px: {_pairs(rounded)}, m: {_pairs((line.start_m, line.end_m))}"


def _pairs(pairs: Any) -> str:
    return "[" + ", ".join(f"[{_number(a)}, {_number(b)}]" for a, b in pairs) + "]"


def _number(value: float) -> str:
    """The shortest text that is read as the same number; YAML 1.1 wants a point before an exponent."""
    text = repr(float(value))
    return text if "." in text or "e" not in text else text.replace("e", ".0e")


def _text(text: str) -> str:
    quoted: str = yaml.safe_dump(text, default_style='"', allow_unicode=True, width=10**6)
    return quoted.strip()
