"""Laps from crossings of the start and the finish line: one state machine for the car, its rules in a table.

Knows fixes, crossings and a lap's length along the route; knows nothing of pictures or files. The out-lap ends with the first
forward crossing of the start line. A lap ends with a forward crossing of the line where laps end, after the car has really
driven the lap's way; crossings that do not fit (backwards, too early, too short) change nothing. Where that line is the start
line, the next lap begins there; where it is a finish line of its own, the car is on an out-lap again, and a car that comes
back to the start line before it has finished begins anew. A complete lap is never dropped: what is wrong with it stands in
its reasons.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

from dnb_edge.race.fix import Fix
from dnb_edge.race.rules import LapRules
from dnb_edge.track.model import FINISH_LINE
from dnb_edge.values import Crossing, Direction, Incident, Lap, PointM


class LapState(StrEnum):
    """Where the car is in its run."""

    OUT_LAP = "out_lap"
    LAP = "lap"
    FINISHED = "finished"


class Passing(StrEnum):
    """What a crossing of the start or the finish line means."""

    START = "start"
    LAP_DONE = "lap_done"
    """The line where laps begin and end: the next lap has begun."""
    ARRIVED = "arrived"
    """A finish line of its own: the lap is done, and no other has begun."""
    ANEW = "anew"
    """The start line before the finish line: the lap that was begun is given up for a new one."""
    RUN_DONE = "run_done"
    NOT_A_LAP = "not_a_lap"


TRANSITIONS: dict[tuple[LapState, Passing], LapState] = {
    (LapState.OUT_LAP, Passing.START): LapState.LAP,
    (LapState.OUT_LAP, Passing.NOT_A_LAP): LapState.OUT_LAP,
    (LapState.LAP, Passing.LAP_DONE): LapState.LAP,
    (LapState.LAP, Passing.ARRIVED): LapState.OUT_LAP,
    (LapState.LAP, Passing.ANEW): LapState.LAP,
    (LapState.LAP, Passing.RUN_DONE): LapState.FINISHED,
    (LapState.LAP, Passing.NOT_A_LAP): LapState.LAP,
    (LapState.FINISHED, Passing.NOT_A_LAP): LapState.FINISHED,
}
"""Every legal step; any other raises `KeyError`."""


MOST_ROUTES = 1.5
"""A lap that drove the route's length more often than this is more than one."""

OUT_LAP_FRAMES = 5000
"""Frames kept before the first crossing, which may be confirmed long after its instant."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DrivenLap:
    """A complete lap with the path driven in it, before it is scored."""

    lap: Lap
    path_m: tuple[PointM, ...]
    """Observed ground points from crossing to crossing, track m, both crossings included. Not the filtered ones: those
    lag behind in bends, by more than the observations scatter."""
    fixes: tuple[Fix, ...] = ()
    """The fixes between the two crossings."""
    incidents: tuple[Incident, ...] = ()
    """What happened in the lap; what it costs is not yet known."""


class LapMachine:
    """Takes the car's fixes and the start and finish lines' crossings, in order, and returns laps."""

    def __init__(self, rules: LapRules, lap_length_m: float, *, has_finish_line: bool = False) -> None:
        """`lap_length_m` is a lap's length along the route; `has_finish_line` where laps end at a line of their own."""
        self._rules = rules
        self._lap_length_m = lap_length_m
        self._has_finish_line = has_finish_line
        self._state = LapState.OUT_LAP
        self._trace: list[Fix] = []
        self._frames: list[int] = []
        self._start: Crossing | None = None
        self._done = 0

    @property
    def state(self) -> LapState:
        """The state now."""
        return self._state

    def frame(self, t_ns: int) -> None:
        """Says that a frame was looked at, whether the car was seen in it or not."""
        if self._state is LapState.FINISHED:
            return
        self._frames.append(t_ns)
        if self._state is LapState.OUT_LAP and len(self._frames) > 2 * OUT_LAP_FRAMES:
            self._keep_from(self._frames[-OUT_LAP_FRAMES])

    def fix(self, fix: Fix) -> None:
        """Takes the car's next fix, in the order of stamps."""
        if self._state is not LapState.FINISHED:
            self._trace.append(fix)

    def crossed(self, crossing: Crossing) -> DrivenLap | None:
        """Takes one crossing of the start or the finish line; returns the lap that it completed, if any."""
        passing = self._passing(crossing)
        state = TRANSITIONS[self._state, passing]
        lap = None
        if passing in (Passing.LAP_DONE, Passing.ARRIVED, Passing.RUN_DONE):
            lap = self._close(crossing)
        self._state = state
        if passing is not Passing.NOT_A_LAP:
            self._start = None if passing is Passing.ARRIVED else crossing
            self._keep_from(crossing.t_ns)
        return lap

    def _passing(self, crossing: Crossing) -> Passing:
        if crossing.direction is Direction.REVERSE or self._state is LapState.FINISHED:
            return Passing.NOT_A_LAP
        at_finish = crossing.line == FINISH_LINE
        if self._start is None:
            return Passing.NOT_A_LAP if at_finish else Passing.START
        if self._has_finish_line and not at_finish:
            return Passing.ANEW
        if (crossing.t_ns - self._start.t_ns) * 1e-9 < self._rules.min_lap_s or not self._driven_round(crossing):
            return Passing.NOT_A_LAP
        if self._done + 1 == self._rules.laps:
            return Passing.RUN_DONE
        return Passing.ARRIVED if at_finish else Passing.LAP_DONE

    def _driven_round(self, crossing: Crossing) -> bool:
        lap = self._until(crossing)
        driven_m = lap[-1].progress_m - lap[0].progress_m if lap else 0.0
        return driven_m >= self._rules.min_progress * self._lap_length_m

    def _until(self, crossing: Crossing) -> list[Fix]:
        return [fix for fix in self._trace if fix.t_ns <= crossing.t_ns]

    def _close(self, end: Crossing) -> DrivenLap:
        start = self._start
        assert start is not None, "the table lets a lap end only after its start"
        fixes = self._until(end)
        frames = sum(start.t_ns < t_ns <= end.t_ns for t_ns in self._frames)
        reasons = self._reasons(start, end, fixes)
        self._done += 1
        lap = Lap(
            number=self._done,
            start_t_ns=start.t_ns,
            end_t_ns=end.t_ns,
            start_s=start.t_s,
            time_s=(end.t_ns - start.t_ns) * 1e-9,
            sigma_s=math.hypot(start.sigma_s, end.sigma_s),
            valid=not reasons,
            reasons=reasons,
            similarity_percent=None,
            observed_fraction=len(fixes) / frames if frames else 0.0,
            target_id=end.target_id,
        )
        path = (start.track_m, *(fix.observed_m for fix in fixes), end.track_m)
        return DrivenLap(lap=lap, path_m=path, fixes=tuple(fixes))

    def _reasons(self, start: Crossing, end: Crossing, fixes: Sequence[Fix]) -> tuple[str, ...]:
        stamps = [start.t_ns, *(fix.t_ns for fix in fixes), end.t_ns]
        gap_s = max((after - before) * 1e-9 for before, after in pairwise(stamps))
        reasons = []
        if gap_s > self._rules.max_gap_s:
            reasons.append(f"the car was not seen for {gap_s:.1f} s (limit {self._rules.max_gap_s:.1f} s)")
        driven = (fixes[-1].progress_m - fixes[0].progress_m) / self._lap_length_m if fixes else 0.0
        if driven > MOST_ROUTES:
            reasons.append(f"the car drove {driven:.1f} times round the route: a crossing of the start line was missed")
        off_lane_s = longest_s(fixes, lambda fix: fix.outside_m > self._rules.off_lane_margin_m)
        if off_lane_s > self._rules.off_lane_s:
            furthest_m = max(fix.outside_m for fix in fixes)
            reasons.append(f"the car left the lane for {off_lane_s:.1f} s, by up to {furthest_m * 1e3:.0f} mm")
        return tuple(reasons)

    def _keep_from(self, t_ns: int) -> None:
        self._trace = [fix for fix in self._trace if fix.t_ns > t_ns]
        self._frames = [frame_t_ns for frame_t_ns in self._frames if frame_t_ns > t_ns]


def longest_s(fixes: Sequence[Fix], holds: Callable[[Fix], bool]) -> float:
    """Longest time, in seconds, over which `holds` is true of every fix in a row."""
    longest_ns, since_ns = 0, None
    for fix in fixes:
        if not holds(fix):
            since_ns = None
        elif since_ns is None:
            since_ns = fix.t_ns
        if since_ns is not None:
            longest_ns = max(longest_ns, fix.t_ns - since_ns)
    return longest_ns * 1e-9
