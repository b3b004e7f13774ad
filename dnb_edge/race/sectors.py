"""A lap's sectors: its sector lines in the order of the route, each to be crossed once and in its turn.

Knows lines, where along a lap they lie, and crossings; knows nothing of how a crossing was found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from dnb_edge.errors import InputError
from dnb_edge.race.crossing import lap_sigma_s
from dnb_edge.track.line import DirectedLine
from dnb_edge.track.model import Track, crossings_of
from dnb_edge.values import Crossing, SectorTime


@dataclass(frozen=True, slots=True, kw_only=True)
class SectorPlan:
    """The sector lines of a track, in the order in which a lap crosses them."""

    lines: tuple[str, ...] = ()
    along_m: tuple[float, ...] = ()
    """How far behind the lap's start each lies along the route, metres."""

    @classmethod
    def of(cls, track: Track) -> SectorPlan:
        """The plan of a track whose lines are right; see `check_lines`."""
        start_m, _ = track.lap_m()
        route = track.centreline
        along = []
        for line in track.sector_lines:
            s_m, _ = crossings_of(route, line)[0]
            along.append((s_m - start_m) % route.length_m if route.closed else s_m - start_m)
        return cls(lines=tuple(line.name for line in track.sector_lines), along_m=tuple(along))


def check_lines(track: Track) -> None:
    """Raises `InputError`, one line, where a line of the track does not cross the route exactly once and forward, bears the
    name of another, or where the lines are not in the order of a lap.
    """
    names: set[str] = set()
    for line in track.lines:
        if line.name in names:
            raise InputError(f"{_the_line(track, line.name)} is there twice: give each line a name of its own")
        names.add(line.name)
        _check_line(track, line)
    _, lap_m = track.lap_m()
    if lap_m <= 0:
        raise InputError(f"track {track.name!r}: the finish line lies before the start line: swap the two")
    plan = SectorPlan.of(track)
    for name, along_m in zip(plan.lines, plan.along_m, strict=True):
        if not 0 < along_m < lap_m:
            raise InputError(f"{_the_line(track, name)} lies outside of the lap, which goes from the start to the finish "
                             "line: move it")  # fmt: skip
    for (before, before_m), (after, after_m) in pairwise(zip(plan.lines, plan.along_m, strict=True)):
        if after_m <= before_m:
            raise InputError(f"{_the_line(track, after)} comes before {before!r} along the route: put the sector lines in "
                             "the order in which a lap crosses them")  # fmt: skip


def _check_line(track: Track, line: DirectedLine) -> None:
    found = crossings_of(track.centreline, line)
    where = _the_line(track, line.name)
    if not found:
        raise InputError(f"{where} does not cross the route: draw it across the lane")
    if len(found) > 1:
        raise InputError(f"{where} crosses the route {len(found)} times: draw it across the lane once")
    if not found[0][1]:
        raise InputError(f"{where} is crossed backwards by the route: swap its ends")


def _the_line(track: Track, name: str) -> str:
    return f"track {track.name!r}: the line {name!r}"


class Sectors:
    """The sectors of one lap as they are driven."""

    def __init__(self, plan: SectorPlan, start: Crossing, min_progress: float) -> None:
        """`min_progress`: share of the way to a line that must be driven for it to be crossed while others are missing."""
        self._plan = plan
        self._min_progress = min_progress
        self._ends: list[Crossing | None] = [start]

    def crossed(self, crossing: Crossing, driven_m: float) -> str | None:
        """Takes a forward crossing of a sector line, and how far the car has driven in the lap; returns why it ends no
        sector, a sentence, or None where it does.
        """
        lines = self._plan.lines
        k, due = lines.index(crossing.line), len(self._ends) - 1
        if k < due:
            if self._ends[k + 1] is not None:
                return f"{crossing.line} was crossed in this lap already"
            return f"{crossing.line} after {lines[due - 1]}"
        if k > due and driven_m < self._min_progress * self._plan.along_m[k]:
            return f"{crossing.line} before {lines[due]}"
        self._ends += [None] * (k - due)
        self._ends.append(crossing)
        return None

    @property
    def missed(self) -> list[str]:
        """Names of the lines that were passed over so far."""
        return [name for name, end in zip(self._plan.lines, self._ends[1:], strict=False) if end is None]

    @property
    def due(self) -> Sequence[str]:
        """Names of the lines that are still to come."""
        return self._plan.lines[len(self._ends) - 1 :]

    def times(self, end: Crossing) -> tuple[SectorTime, ...]:
        """The sectors of a lap that ended at `end`; none where the track has no sector lines."""
        if not self._plan.lines:
            return ()
        ends = [*self._ends, *[None] * len(self.due), end]
        return tuple(
            SectorTime(
                number=number,
                line=line,
                time_s=None if a is None or b is None else (b.t_ns - a.t_ns) * 1e-9,
                sigma_s=None if a is None or b is None else lap_sigma_s(a, b),
            )
            for number, (line, a, b) in enumerate(
                zip((*self._plan.lines, end.line), ends, ends[1:], strict=False), start=1
            )
        )
