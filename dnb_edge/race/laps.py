"""Laps from crossings: one state machine for the car, its rules in a table.

Knows fixes, crossings and a lap's length along the route; knows nothing of pictures or files. The out-lap ends with the first
forward crossing of the start line. A lap ends with a forward crossing of the line where laps end, after the car has really
driven the lap's way; crossings that do not fit (backwards, too early, too short) change nothing and say why. Where that line is
the start line, the next lap begins there; where it is a finish line of its own, the car is on an out-lap again, and a car that
comes back to the start line before it has finished begins anew. A complete lap is never dropped: what happened in it stands in
its incidents.

Crossings are confirmed late and stamped early. So fixes wait here until no crossing can come any more that would be earlier
than they are; then the running lap's watchers look at them.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Self, TypeAlias

from dnb_edge.race.crossing import lap_sigma_s
from dnb_edge.race.fix import Fix
from dnb_edge.race.incidents import Draft, Pace
from dnb_edge.race.lap_table import RUNNING, STATUS, TRANSITIONS, LapState, Passing
from dnb_edge.race.off_track import Lane
from dnb_edge.race.rules import Footprint, FormatRules, LapRules
from dnb_edge.race.sectors import SectorPlan, Sectors
from dnb_edge.race.watch import LapWatch
from dnb_edge.track.model import FINISH_LINE, Track
from dnb_edge.values import Crossing, Direction, Incident, IncidentKind, Lap, PassStatus, PointM

MOST_ROUTES = 1.5
"""A lap that drove the route's length more often than this is more than one."""

MOST_FIXES = 20000
"""Fixes kept of one lap: of one that takes longer, such as that of a car which is parked, every other goes."""

WAIT_S = 30.0
"""So long, at most, fixes wait for a crossing that may be on its way, seconds."""


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


Passed: TypeAlias = Crossing | Incident | DrivenLap
"""A crossing with its status, an incident that ended, or the lap that the crossing before it completed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """What the laps know of the track."""

    lap_m: float
    """A lap's length along the route, metres."""
    loop_m: float | None = None
    """Length of a closed route, metres; None where it is open or nobody says."""
    has_finish_line: bool = False
    """Whether laps end at a line of their own."""
    sectors: SectorPlan = field(default_factory=SectorPlan)
    lane: Lane | None = None
    """Needed where the car's footprint counts."""

    @classmethod
    def of(cls, track: Track, rules: LapRules) -> Self:
        """The course of a track whose lines are right; see `sectors.check_lines`."""
        return cls(
            lap_m=track.lap_m()[1],
            loop_m=track.centreline.length_m if track.centreline.closed else None,
            has_finish_line=track.finish_line is not None,
            sectors=SectorPlan.of(track),
            lane=None if rules.off_lane is Footprint.CENTRE else Lane(track.centreline),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class RunningLap:
    """The lap that runs now."""

    number: int
    start: Crossing
    state: LapState

    def elapsed_s(self, t_ns: int) -> float:
        """Seconds since its start."""
        return (t_ns - self.start.t_ns) * 1e-9


class LapMachine:
    """Takes frames, the car's fixes and its crossings, each in order; returns crossings with their status, incidents, laps."""

    def __init__(
        self,
        rules: LapRules,
        course: Course,
        *,
        car: int = 1,
        format_rules: FormatRules | None = None,
        grid: bool = False,
    ) -> None:
        """`grid`: the race begins with `go`, not with the first crossing."""
        self._rules = rules
        self._course = course
        self._car = car
        self._format = format_rules or FormatRules()
        self._grid = grid
        self._state = LapState.BEFORE_START if grid else LapState.OUT_LAP
        self._start: Crossing | None = None
        self._done = 0
        self._go_t_ns: int | None = None
        self._limit_t_ns: int | None = None
        self._over: str | None = None
        self._pace = Pace(rules.lifted_m)
        self._coming: deque[Fix] = deque()
        self._frames: deque[int] = deque()
        self._last_t_ns = 0
        self._told = 0
        self._jump: Incident | None = None
        self._forget()

    def _forget(self) -> None:
        """Leaves the lap that ran."""
        self._watch: LapWatch | None = None
        self._sectors: Sectors | None = None
        self._trace: list[Fix] = []
        self._seen = 0
        self._frame_count = 0
        self._incidents: list[Incident] = []
        self._is_slow = False

    @property
    def state(self) -> LapState:
        """The state now."""
        return self._state

    @property
    def over(self) -> str | None:
        """Why the car's race is over, such as `the time was up`; None while it is not."""
        return self._over

    @property
    def laps_done(self) -> int:
        """Number of complete laps."""
        return self._done

    @property
    def limit_t_ns(self) -> int | None:
        """When the time is up; None where there is no limit, or it does not run yet."""
        return self._limit_t_ns

    @property
    def running(self) -> RunningLap | None:
        """The lap that runs now; None outside laps."""
        if self._start is None or self._state not in RUNNING:
            return None
        return RunningLap(number=self._done + 1, start=self._start, state=self._state)

    @property
    def trace(self) -> Sequence[Fix]:
        """The fixes of the running lap so far; empty outside laps."""
        start = self._start
        if start is None or self._watch is None:
            return ()
        return [fix for fix in (*self._trace, *self._coming) if fix.t_ns > start.t_ns]

    def frame(self, t_ns: int) -> None:
        """Says that a frame was looked at, whether the car was seen in it or not."""
        self._last_t_ns = t_ns
        if self._over is None:
            self._frames.append(t_ns)

    def fix(self, fix: Fix) -> None:
        """Takes the car's next fix, in the order of stamps."""
        if self._over is None:
            self._coming.append(fix)

    def go(self, t_ns: int) -> None:
        """Says that the start was given at `t_ns`."""
        self._state = TRANSITIONS[self._state, Passing.GO]
        self._go_t_ns = t_ns
        if self._format.time_limit_s is not None:
            self._limit_t_ns = t_ns + round(self._format.time_limit_s * 1e9)

    def jumped(self, incident: Incident) -> Incident:
        """Says that the car moved before the start: it races from now on. Returns the incident with its number."""
        self._state = TRANSITIONS[self._state, Passing.JUMPED]
        self._told += 1
        self._jump = replace(incident, number=self._told, car=self._car)
        return self._jump

    def retire(self, t_ns: int, reason: str) -> list[Incident]:
        """Takes the car out of the race for `reason`, a clause such as `a judge took it out`; returns what was going on.

        A race that is over stays over.
        """
        state = TRANSITIONS[self._state, Passing.RETIRED]
        incidents = self._given_up(t_ns) if state is not self._state else []
        if state is not self._state:
            self._end(f"the car has retired: {reason}")
        self._state = state
        return incidents

    def settle(self, t_ns: int) -> list[Incident]:
        """Says that no crossing will come any more with a stamp up to `t_ns`; returns the incidents that ended."""
        limit_ns = self._limit_t_ns
        incidents = []
        if limit_ns is not None and self._over is None and self._is_past(limit_ns, t_ns):
            incidents = self._time_is_up(limit_ns)
        return incidents + self._settle(t_ns)

    def crossed(self, crossing: Crossing) -> list[Passed]:
        """Takes one crossing of any line; returns it with its status, and what ended with it, in the order of stamps."""
        told: list[Passed] = []
        limit_ns = self._limit_t_ns
        if limit_ns is not None and crossing.t_ns > limit_ns:
            told += self._time_is_up(limit_ns)
        told += self._settle(crossing.t_ns)
        self._count(crossing.t_ns)
        missing = [] if self._sectors is None else self._sectors.missed
        passing, reason = self._passing(crossing)
        running = self.running
        begins = passing in (Passing.START, Passing.ANEW)
        told.append(
            replace(
                crossing,
                status=STATUS[passing],
                reason=reason,
                car=self._car,
                lap=self._done + 1 if running is not None or begins else None,
            )
        )
        if passing is Passing.SECTOR and self._sectors is not None:
            missed = [line for line in self._sectors.missed if line not in missing]
            told += [self._tell(self._missed(line, crossing)) for line in missed]
        told += self._moved(passing, crossing)
        return told

    def finish(self) -> list[Incident]:
        """Says that no frame will follow; returns what was going on."""
        limit_ns = self._limit_t_ns
        incidents = []
        if limit_ns is not None and self._last_t_ns > limit_ns:
            incidents = self._time_is_up(limit_ns)
        return incidents + self._given_up(self._last_t_ns)

    def _moved(self, passing: Passing, crossing: Crossing) -> list[Passed]:
        """Takes the step of the table; returns what a lap that ended by it leaves."""
        state = TRANSITIONS[self._state, passing]
        told: list[Passed] = []
        progress_m = self._progress_at(crossing.t_ns)
        if STATUS[passing] in (PassStatus.LAP, PassStatus.ARRIVED):
            told += self._close(crossing, progress_m)
        elif passing in (Passing.ANEW, Passing.TOO_LATE):
            told += self._given_up(crossing.t_ns)
        self._state = state
        if passing in (Passing.START, Passing.LAP_DONE, Passing.ANEW):
            self._begin(crossing, progress_m)
        elif passing in (Passing.ARRIVED, Passing.RUN_DONE, Passing.TOO_LATE):
            self._start = None
            self._forget()
        if state is LapState.FINISHED and self._over is None:
            all_laps = passing is Passing.RUN_DONE and self._done == self._rules.laps
            self._end(f"all {self._done} laps were driven" if all_laps else "the time was up")
        return told

    def _passing(self, crossing: Crossing) -> tuple[Passing, str | None]:
        """What a crossing means, and why it means nothing where it does."""
        reason = self._ignored(crossing)
        if reason is not None:
            return Passing.NOT_A_LAP, reason
        if crossing.line in self._course.sectors.lines:
            assert self._sectors is not None, "outside laps sector lines are ignored"
            reason = self._sectors.crossed(crossing, self._driven_m(crossing.t_ns))
            return (Passing.SECTOR, None) if reason is None else (Passing.NOT_A_LAP, reason)
        if self._start is None:
            return Passing.START, None
        at_finish = crossing.line == FINISH_LINE
        if self._course.has_finish_line and not at_finish:
            if self._state is LapState.GRACE:
                return Passing.TOO_LATE, "the time was up: no new lap begins"
            return Passing.ANEW, None
        reason = self._too_short(crossing, self._start)
        if reason is not None:
            return Passing.NOT_A_LAP, reason
        if self._done + 1 == self._rules.laps or self._state is LapState.GRACE:
            return Passing.RUN_DONE, None
        return (Passing.ARRIVED if at_finish else Passing.LAP_DONE), None

    def _ignored(self, crossing: Crossing) -> str | None:
        """Why a crossing means nothing whatever the car has driven; None where it may mean something."""
        start = self._start
        early = self._go_t_ns is not None and crossing.t_ns < self._go_t_ns and self._jump is None
        if self._over is not None:
            return f"the race was over: {self._over}"
        if self._state is LapState.BEFORE_START or early:
            return "the start was not given yet"
        if crossing.direction is Direction.REVERSE:
            return "backwards"
        if start is None and crossing.line == FINISH_LINE:
            return "no lap ran: the start line was not crossed before"
        if start is None and crossing.line in self._course.sectors.lines:
            return "no lap ran"
        if start is not None and crossing.t_ns <= start.t_ns:
            return "earlier than the lap's start"
        return None

    def _too_short(self, crossing: Crossing, start: Crossing) -> str | None:
        elapsed_s = (crossing.t_ns - start.t_ns) * 1e-9
        if elapsed_s < self._rules.min_lap_s:
            return f"{elapsed_s:.1f} s after the lap's start, less than race.min_lap_s, {self._rules.min_lap_s:g} s"
        share = self._driven_m(crossing.t_ns) / self._course.lap_m
        if share < self._rules.min_progress:
            return f"only {math.floor(100 * max(share, 0.0))} % of the route driven since the lap's start"
        return None

    def _begin(self, crossing: Crossing, progress_m: float) -> None:
        """Begins a lap at `crossing`, where the car's progress was `progress_m`."""
        # What was looked at although the crossing is earlier is looked at again: it belongs to this lap.
        late = [fix for fix in self._trace if fix.t_ns > crossing.t_ns]
        early = [fix for fix in self._trace if fix.t_ns <= crossing.t_ns]
        self._coming.extendleft(reversed(late))
        if late:
            self._pace.back_to(early[-1] if early else None)
        last = self._pace.last
        self._forget()
        self._start = crossing
        self._sectors = Sectors(self._course.sectors, crossing, self._rules.min_progress)
        self._watch = LapWatch(
            self._rules,
            crossing,
            seen_t_ns=crossing.t_ns if last is None else max(crossing.t_ns, last.t_ns),
            progress_m=progress_m,
            loop_m=self._course.loop_m,
            lane=self._course.lane,
        )
        if not self._grid and self._limit_t_ns is None and self._format.time_limit_s is not None:
            self._limit_t_ns = crossing.t_ns + round(self._format.time_limit_s * 1e9)

    def _close(self, end: Crossing, progress_m: float) -> list[Passed]:
        """The complete lap, after what went on when it ended."""
        start, watch, sectors = self._start, self._watch, self._sectors
        assert start is not None, "the table lets a lap end only after its start"
        assert watch is not None, "every lap is watched"
        assert sectors is not None, "every lap has its sectors"
        drafts = watch.close(end.t_ns)
        drafts += [self._missed(line, end) for line in sectors.due]
        routes = watch.way.driven_to_m(progress_m) / self._course.lap_m
        if routes > MOST_ROUTES:
            text = f"the car drove {routes:.1f} times round the route: a crossing of the start line was missed"
            drafts.append(_of_lap(IncidentKind.MISSED_LINE, start, end.t_ns, end, text))
        told: list[Passed] = [self._tell(draft) for draft in drafts]
        told += self._slow(end.t_ns)
        fixes = tuple(fix for fix in self._trace if fix.t_ns <= end.t_ns)
        seen = self._seen - (len(self._trace) - len(fixes))
        self._done += 1
        lap = Lap(
            number=self._done,
            start_t_ns=start.t_ns,
            end_t_ns=end.t_ns,
            start_s=start.t_s,
            time_s=(end.t_ns - start.t_ns) * 1e-9,
            sigma_s=lap_sigma_s(start, end),
            valid=True,
            reasons=(),
            similarity_percent=None,
            observed_fraction=min(seen / self._frame_count, 1.0) if self._frame_count else 0.0,
            target_id=end.target_id,
            car=self._car,
            sectors=sectors.times(end),
            estimated=start.estimated or end.estimated,
        )
        path = (start.track_m, *(fix.observed_m for fix in fixes), end.track_m)
        jump = () if self._jump is None or self._done > 1 else (self._jump,)
        told.append(DrivenLap(lap=lap, path_m=path, fixes=fixes, incidents=(*jump, *self._incidents)))
        return told

    def _given_up(self, t_ns: int) -> list[Incident]:
        """What went on when the running lap, if any, was given up at `t_ns`."""
        incidents = self._settle(t_ns)
        watch, self._watch = self._watch, None
        return incidents if watch is None else incidents + [self._tell(draft) for draft in watch.close(t_ns)]

    def _time_is_up(self, limit_ns: int) -> list[Incident]:
        """The race's time is over: the running lap may be finished, or not."""
        if self._over is not None or self._state is LapState.GRACE:
            return []
        incidents = self._settle(limit_ns)
        self._state = TRANSITIONS[self._state, Passing.TIME_UP if self._format.grace_lap else Passing.CUT_OFF]
        if self._state is LapState.FINISHED:
            cut = ", and the lap that ran was given up" if self._watch is not None else ""
            incidents += self._given_up(limit_ns)
            self._end(f"the time was up{cut}")
        return incidents

    def _end(self, reason: str) -> None:
        self._over = reason
        self._start = None
        self._coming.clear()
        self._frames.clear()
        self._forget()

    def _settle(self, t_ns: int) -> list[Incident]:
        incidents: list[Incident] = []
        while self._coming and self._coming[0].t_ns <= t_ns:
            fix = self._coming.popleft()
            step = self._pace.step(fix)
            if self._watch is None:
                # One is kept: the crossing may turn out to lie just before it.
                self._trace = [fix]
                continue
            self._trace.append(fix)
            self._seen += 1
            if len(self._trace) > MOST_FIXES:
                self._trace = self._trace[::2]
            incidents += [self._tell(draft) for draft in self._watch.feed(step)]
        last_t_ns = t_ns if self._pace.last is None else self._pace.last.t_ns
        # A crossing in a gap is known only after it: until then its frames belong to no lap.
        self._count(max(min(last_t_ns, t_ns), t_ns - round(WAIT_S * 1e9)))
        start, max_lap_s = self._start, self._rules.max_lap_s
        if start is not None and max_lap_s is not None and self._is_past(start.t_ns + round(max_lap_s * 1e9), t_ns):
            incidents += self._slow(t_ns)
        return incidents

    def _slow(self, t_ns: int) -> list[Incident]:
        """Tells once that the running lap is too slow, if it is at `t_ns`."""
        start, max_lap_s = self._start, self._rules.max_lap_s
        if start is None or self._watch is None or max_lap_s is None or self._is_slow:
            return []
        end_t_ns = start.t_ns + round(max_lap_s * 1e9)
        if t_ns <= end_t_ns:
            return []
        self._is_slow = True
        text = f"the lap took longer than race.max_lap_s, {max_lap_s:g} s"
        return [self._tell(_of_lap(IncidentKind.TOO_SLOW, start, end_t_ns, self._pace.last or start, text))]

    def _count(self, t_ns: int) -> None:
        """Counts the running lap's frames up to `t_ns`."""
        while self._frames and self._frames[0] <= t_ns:
            self._frames.popleft()
            self._frame_count += 1

    def _is_past(self, moment_ns: int, t_ns: int) -> bool:
        """Whether `moment_ns` is over at `t_ns`, and no crossing before it can turn up after a short gap."""
        last = self._pace.last if not self._coming else self._coming[-1]
        seen = last is not None and last.t_ns > moment_ns
        return t_ns > moment_ns + (0 if seen else self._rules.max_gap_s * 1e9)

    def _progress_at(self, t_ns: int) -> float:
        """The car's progress at a crossing at `t_ns`, between the fixes on either side of it."""
        last, coming = self._pace.last, self._coming[0] if self._coming else None
        for fix in reversed(self._trace):
            if fix.t_ns <= t_ns:
                last = fix
                break
            coming = fix
        if last is None or coming is None or not last.t_ns <= t_ns < coming.t_ns:
            known = last or coming
            return 0.0 if known is None else known.progress_m
        step_m = coming.progress_m - last.progress_m
        if abs(step_m) > 2 * math.dist(last.track_m, coming.track_m) + self._rules.short_cut_m:
            return last.progress_m
        return last.progress_m + step_m * (t_ns - last.t_ns) / (coming.t_ns - last.t_ns)

    def _driven_m(self, t_ns: int) -> float:
        return 0.0 if self._watch is None else self._watch.way.driven_to_m(self._progress_at(t_ns))

    def _missed(self, line: str, at: Crossing) -> Draft:
        assert self._start is not None, "lines are missed in laps"
        text = f"the line {line!r} was not crossed in its turn"
        return _of_lap(IncidentKind.MISSED_LINE, self._start, at.t_ns, at, text)

    def _tell(self, draft: Draft) -> Incident:
        self._told += 1
        incident = draft.told(number=self._told, car=self._car, lap=self._done + 1)
        self._incidents.append(incident)
        return incident


def _of_lap(kind: IncidentKind, start: Crossing, end_t_ns: int, worst: Fix | Crossing, text: str) -> Draft:
    """An incident of the whole lap up to `end_t_ns`."""
    return Draft(
        kind=kind, start_t_ns=start.t_ns, start_s=start.t_s, end_t_ns=end_t_ns, worst=worst, text=text
    )  # fmt: skip
