"""Lines and tracks for a recording that is raced again: `--line` and `--track`.

Knows the forms in which lines are given, and what makes a track fit a recording; knows no rules.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from dnb_edge.archive.coordinates import numbers, point
from dnb_edge.config.text import parse_lines
from dnb_edge.errors import InputError
from dnb_edge.race.sectors import check_lines
from dnb_edge.track.build import LinePx
from dnb_edge.track.layout import NamedLine, foot_m, laid_out
from dnb_edge.track.line import DirectedLine, line_across
from dnb_edge.track.model import FINISH_LINE, START_LINE, Track
from dnb_edge.values import PointPx

Place: TypeAlias = LinePx | PointPx | None
"""Where a line is to be, twin px: its two ends, a place on the route, or nowhere."""

AT = "AT:"
NONE = "none"

_SAME_ROUTE = 0.1
"""A route of which less than this share lies on the recorded one is another track's."""


def parse_line_options(texts: Sequence[str]) -> dict[str, Place]:
    """Each line's place by its name, from `NAME=u,v:u,v`, `NAME=AT:u,v`, `NAME=none`, or a file of such.

    Raises `InputError` naming the option or the file where it has another form.
    """
    places: dict[str, Place] = {}
    for text in texts:
        name, equals, place = text.partition("=")
        if equals and name.strip() and "/" not in name:
            places[name.strip()] = _place(text, place.strip())
        else:
            places |= _from_file(Path(text).expanduser())
    return places


def _place(text: str, place: str) -> Place:
    option = f"--line {text}:"
    if place == NONE:
        return None
    if place.startswith(AT):
        return point(option, place.removeprefix(AT))
    ends = place.split(":")
    if len(ends) != 2:
        raise InputError(
            f"{option} must be NAME=u,v:u,v (its ends, twin px), NAME=AT:u,v (a place on the route) or NAME=none"
        )
    return point(option, ends[0]), point(option, ends[1])


def _from_file(path: Path) -> dict[str, Place]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise InputError(
            f"--line {path}: neither NAME=u,v:u,v nor a file of lines that can be read: {reason}"
        ) from error
    data, lines = parse_lines(path, text, what="a file of lines")
    return {str(name): _written(path, lines[name,], name, value) for name, value in data.items()}


def _written(path: Path, line: int, name: str, value: Any) -> Place:
    """The place of one line in a file: [[u, v], [u, v]], {at: [u, v]} or null."""
    where = f"{path}, line {line}: {name}"
    if value is None:
        return None
    if isinstance(value, Mapping) and set(value) == {"at"}:
        return _pair(where, value["at"])
    if isinstance(value, Sequence) and not isinstance(value, str) and len(value) == 2:
        return _pair(where, value[0]), _pair(where, value[1])
    raise InputError(f"{where}: must be [[u, v], [u, v]] (its ends, twin px), {{at: [u, v]}} or null")


def _pair(where: str, value: Any) -> PointPx:
    if not isinstance(value, list) or len(value) != 2 or not all(type(one) in (int, float) for one in value):
        raise InputError(f"{where}: {value!r} is no point [u, v], twin px")
    u, v = numbers(where, ",".join(map(repr, value)), 2)
    return u, v


def with_lines(track: Track, places: Mapping[str, Place]) -> Track:
    """`track` with these lines instead of its own of the same names, or besides them; other names are sector lines.

    The route begins at the start line and is driven to the left of it, as ever. Raises `InputError`, one line, where a line
    does not cross the route exactly once or lies outside of the lap.
    """
    drawn = {name: _drawn(track, name, place) for name, place in places.items()}
    start = drawn.get(START_LINE, track.start_line)
    if start is None:
        raise InputError(f"--line {START_LINE}=none: a race needs a start line")
    finish = drawn.get(FINISH_LINE, track.finish_line)
    sectors = {line.name: line for line in track.sector_lines}
    for name, line in drawn.items():
        if name in (START_LINE, FINISH_LINE):
            continue
        if line is None and name not in sectors:
            there = ", ".join(sectors) or "none"
            raise InputError(f"--line {name}=none: the track has no line of that name; its sector lines: {there}")
        if line is None:
            del sectors[name]
        else:
            sectors[name] = line
    changed = laid_out(
        track.centreline,
        name=track.name,
        scale=track.scale,
        start=start,
        finish=finish,
        sectors=[NamedLine(line=line, name=name) for name, line in sectors.items()],
        source="--line",
    )
    if START_LINE not in places:
        # The route stays as it was recorded, bit for bit: laying it out anew resamples it.
        changed = replace(track, finish_line=changed.finish_line, sector_lines=changed.sector_lines)
    check_lines(changed)
    return changed


def _drawn(track: Track, name: str, place: Place) -> DirectedLine | None:
    if place is None:
        return None
    if isinstance(place[0], tuple):
        (x0, y0), (x1, y1) = track.scale.to_track_m(np.array(place, dtype=np.float64)).tolist()
        return DirectedLine(name=name, start_m=(x0, y0), end_m=(x1, y1))
    u, v = place
    assert isinstance(u, float | int), "a place is a point"
    assert isinstance(v, float | int), "a place is a point"
    route = track.centreline
    s_m = foot_m(route, (u, v), name, track.scale, "--line")
    return line_across(route, s_m, name=name, margin_m=sum(route.half_widths_at(s_m)) / 4)


def other_track(recorded: Track, path: Path, track: Track, recording: Path) -> Track:
    """`track`, which is from the file `path`. Raises `InputError` where the recording is of another one."""
    scale, was = track.scale, recorded.scale
    if scale.height_px != was.height_px or not math.isclose(scale.metres_per_px, was.metres_per_px, rel_tol=1e-6):
        raise InputError(
            f"{recording}: recorded on another track than {path}: its twin is {was.height_px:g} px high at "
            f"{was.metres_per_px * 1000:g} mm a px, the file's {scale.height_px:g} px at {scale.metres_per_px * 1000:g} mm"
        )
    if _share_on(recorded, track) < _SAME_ROUTE:
        raise InputError(f"{recording}: recorded on another track than {path}: their routes lie in different places")
    check_lines(track)
    return track


def _share_on(recorded: Track, track: Track) -> float:
    """Share of the route of `track` that lies on the lane of `recorded`."""
    route = recorded.centreline
    s_m, d_m = route.locate(track.centreline.points_m)
    on = [route.outside_by_m(s, d) <= 0 for s, d in zip(s_m.tolist(), d_m.tolist(), strict=True)]
    return float(np.mean(on))


def lines_px(track: Track) -> dict[str, list[list[float]]]:
    """The ends of each line by its name, twin px, to a hundredth; for people."""
    named = {}
    for line in track.lines:
        ends = track.scale.to_twin_px(np.array([line.start_m, line.end_m]))
        named[line.name] = [[round(u, 2), round(v, 2)] for u, v in ends.tolist()]
    return named
