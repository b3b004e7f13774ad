"""Where lines lie on a route, and the track that a route and its lines make.

Knows the route in metres and the twin's scale, by which its errors name places. Knows no picture. `source` names in errors
the picture or the file that the lines come from.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dnb_edge.errors import InputError
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.line import DirectedLine, line_across
from dnb_edge.track.model import Track, crossings_of
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import PointPx

_AT_START_M = 1e-6
"""A start line so near to s_m = 0 is on it: a stored route is not resampled for the last bit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedLine:
    """A sector line and what it is to be called; None for `sector 1`, `sector 2` ... in the order of a lap."""

    line: DirectedLine
    name: str | None


def laid_out(
    centreline: Centreline,
    *,
    name: str,
    scale: TwinScale,
    start: DirectedLine,
    finish: DirectedLine | None = None,
    sectors: Sequence[NamedLine] = (),
    source: str,
) -> Track:
    """The track along `centreline`. A closed route is turned so that it crosses `start` forward, and begins there; an open
    one keeps its direction. The finish and the sector lines are turned to be crossed forward, the sector lines sorted.

    Raises `InputError` where a line does not cross the route exactly once or lies in the wrong order.
    """
    s_m, forward = _only_crossing(centreline, start, scale, source)
    if centreline.closed:
        if not forward:
            centreline = centreline.reversed()
            s_m, _ = _only_crossing(centreline, start, scale, source)
        if abs(centreline.step_m(0.0, s_m)) > _AT_START_M:
            centreline = started_at(centreline, s_m)
            s_m = 0.0
    elif finish is None:
        raise InputError(f"{source}: an open route needs a finish line: add one")
    elif not forward:
        raise InputError(f"{source}: the route from its first to its last waypoint crosses the start line backwards: "
                         "swap the ends of the line, or turn the order of the waypoints round")  # fmt: skip
    lap_m = centreline.length_m
    if finish is not None:
        finish, lap_m = _placed(centreline, finish, s_m, scale, source)
        if lap_m <= _AT_START_M or (centreline.closed and centreline.length_m - lap_m <= _AT_START_M):
            fault = (
                "is the start line: leave it out" if centreline.closed else "lies before the start line: swap the two"
            )
            raise InputError(f"{source}: the finish line {fault}")
    placed = sorted(
        ((*_placed(centreline, sector.line, s_m, scale, source)[::-1], sector.name) for sector in sectors),
        key=lambda one: one[0],
    )
    for along_m, line, _ in placed:
        if not 0 <= along_m <= lap_m:
            raise InputError(f"{source}: the line {line.name!r} lies outside of the lap, which goes from the start to "
                             "the finish line: move it")  # fmt: skip
    return Track(
        name=name,
        scale=scale,
        centreline=centreline,
        start_line=start,
        finish_line=finish,
        sector_lines=tuple(
            replace(line, name=f"sector {k}" if known is None else known)
            for k, (_, line, known) in enumerate(placed, start=1)
        ),
    )


def _placed(
    centreline: Centreline, line: DirectedLine, start_s_m: float, scale: TwinScale, source: str
) -> tuple[DirectedLine, float]:
    """`line` turned to be crossed forward, and how far behind the start line it lies along the route, metres."""
    s_m, forward = _only_crossing(centreline, line, scale, source)
    along_m = (s_m - start_s_m) % centreline.length_m if centreline.closed else s_m - start_s_m
    return line if forward else replace(line, start_m=line.end_m, end_m=line.start_m), along_m


def _only_crossing(centreline: Centreline, line: DirectedLine, scale: TwinScale, source: str) -> tuple[float, bool]:
    crossings = crossings_of(centreline, line)
    if len(crossings) == 1:
        return crossings[0]
    ends = scale.to_twin_px(np.array([line.start_m, line.end_m]))
    line_text = " to ".join(f"({u:.0f}, {v:.0f})" for u, v in ends)
    places = scale.to_twin_px(centreline.points_at(np.array([s for s, _ in crossings])))
    where = ", at " + " and ".join(f"({u:.0f}, {v:.0f})" for u, v in places) if len(places) else ""
    raise InputError(
        f"{source}: the line {line.name!r} from {line_text} twin px crosses the route {len(crossings)} times{where}: "
        "draw it across the route's lane once"
    )


def foot_m(centreline: Centreline, at_px: PointPx, name: str, scale: TwinScale, source: str) -> float:
    """s_m of the route's place nearest to `at_px`, twin px, where the line `name` is to be.

    Raises `InputError` where that is further away than the lane's width.
    """
    at_m = scale.to_track_m(np.asarray([at_px], dtype=np.float64))
    (s_m,), (d_m,) = (values.tolist() for values in centreline.locate(at_m))
    if abs(d_m) > sum(centreline.half_widths_at(s_m)):
        raise InputError(f"{source}: the place ({at_px[0]:g}, {at_px[1]:g}) twin px of the line {name!r} is "
                         f"{abs(d_m) / scale.metres_per_px:.0f} px from the route: put it on the route's lane")  # fmt: skip
    return float(s_m)


def straightest_m(centreline: Centreline) -> float:
    """The s_m about which a closed route turns least, over about four lane widths, of the places where a line across the lane
    crosses the route once: where it crosses itself it is straight, too.
    """
    n = len(centreline.points_m)
    steps = np.roll(centreline.points_m, -1, axis=0) - centreline.points_m
    heading = np.arctan2(steps[:, 1], steps[:, 0])
    turn = abs((np.diff(heading, append=heading[:1]) + np.pi) % (2 * np.pi) - np.pi)
    width = 2 * float(np.median(centreline.half_left_m))
    reach = int(np.clip(2 * width / centreline.length_m * n, 1, n // 8))
    turned = sum(np.roll(turn, k) for k in range(-reach, reach + 1))
    straightest = centreline.s_m[np.argsort(turned, kind="stable")].tolist()
    # A lane's width of room on all sides, if there is, keeps the line clear of other branches.
    for room_m in (width, 0.0):
        for s_m in straightest:
            if all(_crosses_once(centreline, s_m + k * room_m, room_m) for k in (0, -1, 1)):
                return float(s_m)
    return float(straightest[0])


def _crosses_once(centreline: Centreline, s_m: float, margin_m: float) -> bool:
    return len(crossings_of(centreline, line_across(centreline, s_m, name="across", margin_m=margin_m))) == 1


def started_at(centreline: Centreline, s_m: float) -> Centreline:
    """The same closed route, evenly resampled from `s_m` on, with the half-widths that hold there."""
    n = len(centreline.points_m)
    at = s_m + np.arange(n, dtype=np.float64) * (centreline.length_m / n)
    widths = np.array([centreline.half_widths_at(s) for s in at.tolist()])
    return Centreline(
        points_m=centreline.points_at(np.asarray(at, dtype=np.float64)),
        half_left_m=widths[:, 0],
        half_right_m=widths[:, 1],
    )
