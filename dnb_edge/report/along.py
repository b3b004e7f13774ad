"""The laps of a run along the route, ready to be drawn: which of them, their traces, and where the lines lie.

Knows a `RunResult` and `score.profile`. Knows no picture and no page. Places are metres along the route as a lap counts them:
s_m where a closed route's lap begins at s_m = 0, and on beyond the route's length where it does not.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnb_edge.race.standings import official_s
from dnb_edge.report.run import RunResult, Stamps
from dnb_edge.score.profile import LapTrace
from dnb_edge.track.model import Track, crossings_of
from dnb_edge.values import Lap, Points

DRAWN_LAPS = 14
"""More laps than these nobody can tell apart in one picture."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LapAlong:
    """One lap that is drawn."""

    index: int
    """Of the lap in `RunResult.laps`."""
    lap: Lap
    best: bool
    """Whether it is its car's best valid lap."""
    trace: LapTrace | None
    """None where it is not known when the car was where."""


def best_laps(laps: Sequence[Lap]) -> dict[int, int]:
    """By car: the index of its best valid lap, by official time; cars without a valid lap are left out."""
    best: dict[int, int] = {}
    for i, lap in enumerate(laps):
        if lap.valid and (lap.car not in best or official_s(lap) < official_s(laps[best[lap.car]])):
            best[lap.car] = i
    return best


def drawn_laps(laps: Sequence[Lap], most: int = DRAWN_LAPS) -> tuple[int, ...]:
    """Indices of the at most `most` laps that pictures show, in order: the best of each car, and the last ones."""
    best = sorted(best_laps(laps).values(), key=lambda i: official_s(laps[i]))[:most]
    others = [i for i in range(len(laps)) if i not in best]
    return tuple(sorted(best + others[max(0, len(others) - most + len(best)) :]))


def laps_along(result: RunResult) -> tuple[LapAlong, ...]:
    """The laps that pictures show, in order."""
    return laps_at(result, drawn_laps(result.laps))


def laps_at(result: RunResult, indices: Iterable[int]) -> tuple[LapAlong, ...]:
    """The laps at these places of `RunResult.laps`."""
    best = set(best_laps(result.laps).values())
    return tuple(LapAlong(index=i, lap=result.laps[i], best=i in best, trace=_trace(result, i)) for i in indices)


def lap_start_m(track: Track) -> float:
    """Where along the route laps begin, s_m; about 0 on a closed route, whatever side of its seam the line was found on."""
    start_m, _ = track.lap_m()
    return track.centreline.step_m(0.0, start_m)


def sector_ends_m(track: Track) -> tuple[float, ...]:
    """Where along a lap its sectors end, metres since its start, rising; the last is the lap's length."""
    start_m, length_m = track.lap_m()
    ways = []
    for line in track.sector_lines:
        for s_m, _ in crossings_of(track.centreline, line)[:1]:
            way_m = s_m - start_m
            ways.append(way_m % track.centreline.length_m if track.centreline.closed else way_m)
    return (*sorted(way_m for way_m in ways if 0.0 < way_m < length_m), length_m)


def lane_edges_m(track: Track, ways_m: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """d_m of the lane's left and right edge, each (n,), at the ways `ways_m` (n,) since a lap's start."""
    widths = [track.centreline.half_widths_at(lap_start_m(track) + way_m) for way_m in ways_m.tolist()]
    left_m, right_m = np.array(widths, dtype=np.float64).reshape(-1, 2).T
    return left_m, -right_m


def path_trace(path_m: Points, t_ns: Stamps, lap: Lap, track: Track) -> LapTrace | None:
    """The trace of a lap by its observed path (n, 2), track m, and the stamps (n,) of that path's points; None where the path
    does not go from the lap's start to its end (a judge's lap between instants at which nothing was crossed).

    The score's lateral figures are of the same path, so a picture of the trace shows what the table says.
    """
    if len(t_ns) < 2 or (int(t_ns[0]), int(t_ns[-1])) != (lap.start_t_ns, lap.end_t_ns):
        return None
    route = track.centreline
    start_m, length_m = track.lap_m()
    s_m, d_m = route.locate_path(path_m)
    steps_m = np.diff(s_m)
    if route.closed:
        steps_m = (steps_m + route.length_m / 2) % route.length_m - route.length_m / 2
    way_m = route.step_m(start_m, float(s_m[0])) + np.concatenate(([0.0], np.cumsum(steps_m)))
    if route.closed:
        # Over a gap of more than half the route the shorter way round is the wrong one: a lap ends where it should.
        rounds = round(float(length_m - way_m[-1]) / route.length_m)
        way_m[int(np.argmax(np.diff(t_ns))) + 1 :] += rounds * route.length_m
    # A lap is its whole stretch of the route, from line to line, and nothing before its end lies beyond the line.
    way_m[0], way_m[-1] = 0.0, length_m
    way_m[:-1] = np.minimum(way_m[:-1], np.nextafter(length_m, 0.0))
    return LapTrace(length_m=length_m, t_s=(t_ns - t_ns[0]) * 1e-9, way_m=way_m, d_m=d_m, track_m=path_m)


def _trace(result: RunResult, index: int) -> LapTrace | None:
    if not result.stamps_ns:
        return None
    return path_trace(result.paths_m[index], result.stamps_ns[index], result.laps[index], result.track)
