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
from dataclasses import replace
from typing import TypeAlias

from dnb_edge.race.fix import Fix
from dnb_edge.race.incidents import Draft, Pace
from dnb_edge.race.lap_table import RUNNING, STATUS, TRANSITIONS, LapState, Passing
from dnb_edge.race.open_lap import Course, DrivenLap, OpenLap, RunningLap
from dnb_edge.race.rules import FormatRules, LapRules
from dnb_edge.track.model import FINISH_LINE
from dnb_edge.values import Crossing, Direction, Incident, PassStatus

__all__ = ["LAG_S", "WAIT_S", "Course", "DrivenLap", "LapMachine", "LapState", "Passed", "RunningLap"]

WAIT_S = 30.0
"""So long, at most, fixes wait for a crossing that may be on its way, seconds."""

LAG_S = 0.5
"""The latest fix waits for the next one, at most so long, seconds."""

FOUND_S = 1.0
"""So long, at most, after a car is seen again that is not yet known, seconds."""

Passed: TypeAlias = Crossing | Incident | DrivenLap
"""A crossing with its status, an incident that ended, or the lap that the crossing before it completed."""


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
        self._lap: OpenLap | None = None
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
        self._left_m = 0.0

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
        lap = self._lap
        if lap is None or self._state not in RUNNING:
            return None
        return RunningLap(number=lap.number, start=lap.start, state=self._state, driven_m=lap.driven_m)

    @property
    def trace(self) -> Sequence[Fix]:
        """The fixes of the running lap so far; empty outside laps."""
        lap = self._lap
        return () if lap is None else [fix for fix in (*lap.trace, *self._coming) if fix.t_ns > lap.start.t_ns]

    @property
    def driven_m(self) -> float:
        """Metres of its route that the car has driven in the lap that runs, or in the one in which its race ended; else 0."""
        return self._left_m if self._lap is None else self._lap.driven_m

    def going_on(self, t_ns: int) -> list[Draft]:
        """What goes on at `t_ns`, a frame's stamp, and is an incident already, in the order in which it became known."""
        unseen_until_ns = 0 if self._coming else t_ns - round(FOUND_S * 1e9)
        drafts = [] if self._lap is None else self._lap.so_far(unseen_until_ns)
        return sorted(drafts, key=lambda draft: draft.end_t_ns)

    def frame(self, t_ns: int, *, shows: bool = True) -> None:
        """Says that a frame was looked at, whether the car was seen in it or not. One that does not show where the car is
        (`shows`), of another camera than the one it drives under, is none in which it was missed."""
        self._last_t_ns = t_ns
        if self._over is None and shows:
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
        if state is self._state:
            return []
        incidents = self._given_up(t_ns)
        self._state = state
        self._end(f"the car has retired: {reason}")
        return incidents

    def settle(self, t_ns: int, *, sure_t_ns: int | None = None) -> list[Incident]:
        """Says that no crossing will come any more with a stamp up to `t_ns`; returns the incidents that ended.

        `sure_t_ns` is earlier than that where one that is on its way may come all the same: nobody waits for it any longer, but
        until it is known no lap was too slow that it may have ended in time.
        """
        if self._coming and t_ns - self._coming[-1].t_ns < LAG_S * 1e9:
            # The instant of a crossing may come to lie a little before the latest fix that was not through the line yet.
            t_ns = min(t_ns, self._coming[-1].t_ns - 1)
        limit_ns = self._limit_t_ns
        incidents = []
        if limit_ns is not None and self._is_past(limit_ns, t_ns):
            incidents = self._time_is_up(limit_ns)
        return incidents + self._settle(t_ns, t_ns if sure_t_ns is None else min(t_ns, sure_t_ns))

    def crossed(self, crossing: Crossing) -> list[Passed]:
        """Takes one crossing of any line; returns it with its status, and what ended with it, in the order of stamps."""
        told: list[Passed] = []
        if self._limit_t_ns is not None and crossing.t_ns > self._limit_t_ns:
            told += self._time_is_up(self._limit_t_ns)
        told += self._settle(crossing.t_ns)
        self._count(crossing.t_ns)
        passing, reason, missed = self._passing(crossing)
        begins = passing in (Passing.START, Passing.ANEW)
        told.append(
            replace(
                crossing,
                status=STATUS[passing],
                reason=reason,
                car=self._car,
                lap=self._done + 1 if self._lap is not None or begins else None,
            )
        )
        told += self._tell(missed)
        return told + self._moved(passing, crossing)

    def finish(self) -> list[Incident]:
        """Says that no frame will follow; returns what was going on."""
        incidents = []
        if self._limit_t_ns is not None and self._last_t_ns > self._limit_t_ns:
            incidents = self._time_is_up(self._limit_t_ns)
        return incidents + self._given_up(self._last_t_ns)

    def _moved(self, passing: Passing, crossing: Crossing) -> list[Passed]:
        """Takes the step of the table; returns what a lap that ended by it leaves."""
        state = TRANSITIONS[self._state, passing]
        ended, told = self._lap, list[Passed]()
        progress_m = self._progress_at(crossing.t_ns)
        if STATUS[passing] in (PassStatus.LAP, PassStatus.ARRIVED):
            assert ended is not None, "the table lets a lap end only after its start"
            told += self._tell(ended.ended(crossing, self._pace.peek(self._coming[0]) if self._coming else None))
            self._done += 1
            jump = () if self._jump is None or self._done > 1 else (self._jump,)
            told.append(ended.driven(crossing, car=self._car, before=jump))
            self._lap = None
            self._left_m = 0.0
        elif passing in (Passing.ANEW, Passing.TOO_LATE):
            told += self._given_up(crossing.t_ns)
        self._state = state
        if passing in (Passing.START, Passing.LAP_DONE, Passing.ANEW):
            self._begin(crossing, progress_m, ended)
        if state is LapState.FINISHED and self._over is None:
            all_laps = passing is Passing.RUN_DONE and self._done == self._rules.laps
            self._end(f"all {self._done} laps were driven" if all_laps else "the time was up")
        return told

    def _passing(self, crossing: Crossing) -> tuple[Passing, str | None, list[Draft]]:
        """(what a crossing means, why it means nothing where it does, sector lines that were missed before it)."""
        reason = self._ignored(crossing)
        if reason is not None:
            return Passing.NOT_A_LAP, reason, []
        lap = self._lap
        if lap is None:
            return Passing.START, None, []
        if crossing.line in self._course.sectors.lines:
            reason, missed = lap.sector(crossing, self._driven_m(crossing.t_ns))
            return Passing.SECTOR if reason is None else Passing.NOT_A_LAP, reason, missed
        at_finish = crossing.line == FINISH_LINE
        if self._course.has_finish_line and not at_finish:
            if self._state is LapState.GRACE:
                return Passing.TOO_LATE, "the time was up: no new lap begins", []
            return Passing.ANEW, None, []
        reason = self._too_short(crossing, lap.start)
        if reason is not None:
            return Passing.NOT_A_LAP, reason, []
        if self._done + 1 == self._rules.laps or self._state is LapState.GRACE:
            return Passing.RUN_DONE, None, []
        return (Passing.ARRIVED if at_finish else Passing.LAP_DONE), None, []

    def _ignored(self, crossing: Crossing) -> str | None:
        """Why a crossing means nothing whatever the car has driven; None where it may mean something."""
        lap = self._lap
        early = self._go_t_ns is not None and crossing.t_ns < self._go_t_ns and self._jump is None
        if self._over is not None:
            return f"the race was over: {self._over}"
        if self._state is LapState.BEFORE_START or early:
            return "the start was not given yet"
        if crossing.direction is Direction.REVERSE:
            return "backwards"
        if lap is None and crossing.line == FINISH_LINE:
            return "no lap ran: the start line was not crossed before"
        if lap is None and crossing.line in self._course.sectors.lines:
            return "no lap ran"
        if lap is not None and crossing.t_ns <= lap.start.t_ns:
            return "earlier than the lap's start"
        return None

    def _too_short(self, crossing: Crossing, start: Crossing) -> str | None:
        elapsed_s = (crossing.t_ns - start.t_ns) * 1e-9
        if elapsed_s < self._rules.min_lap_s:
            return f"{elapsed_s:.1f} s after the lap's start, less than race.min_lap_s, {self._rules.min_lap_s:g} s"
        share = self._driven_m(crossing.t_ns) / self._course.lap_m
        if share < self._rules.min_progress:
            return f"only {math.floor(100 * share)} % of the route driven since the lap's start"
        return None

    def _begin(self, crossing: Crossing, progress_m: float, ended: OpenLap | None) -> None:
        """Begins a lap at `crossing`, where the car's progress was `progress_m`, after the lap `ended`, if any."""
        last = self._pace.last
        seen_t_ns = crossing.t_ns if last is None or ended is not None else max(crossing.t_ns, last.t_ns)
        # What was looked at although the crossing is earlier is looked at again: it belongs to this lap.
        late: list[Fix] = []
        if ended is not None:
            late = ended.later_than(crossing.t_ns)
        elif last is not None and last.t_ns > crossing.t_ns:
            late = [last]
        if late:
            self._coming.extendleft(reversed(late))
            before = [] if ended is None else ended.trace[: len(ended.trace) - len(late)]
            self._pace.back_to(before[-1] if before else None)
        self._lap = OpenLap(
            self._rules,
            self._course,
            crossing,
            number=self._done + 1,
            progress_m=progress_m,
            seen_t_ns=seen_t_ns,
            frames=0 if ended is None else ended.frames_later_than(crossing.t_ns),
        )
        if not self._grid and self._limit_t_ns is None and self._format.time_limit_s is not None:
            self._limit_t_ns = crossing.t_ns + round(self._format.time_limit_s * 1e9)

    def _given_up(self, t_ns: int) -> list[Incident]:
        """What went on when the running lap, if any, was given up at `t_ns`."""
        incidents = self._settle(t_ns)
        lap = self._lap
        if lap is not None:
            incidents += self._tell(lap.given_up(t_ns))
            self._left_m = lap.driven_m
        self._lap = None
        return incidents

    def _time_is_up(self, limit_ns: int) -> list[Incident]:
        """The race's time is over: the running lap may be finished, or not."""
        if self._over is not None or self._state is LapState.GRACE:
            return []
        incidents = self._settle(limit_ns)
        self._state = TRANSITIONS[self._state, Passing.TIME_UP if self._format.grace_lap else Passing.CUT_OFF]
        if self._state is LapState.FINISHED:
            cut = "" if self._lap is None else ", and the lap that ran was given up"
            incidents += self._given_up(limit_ns)
            self._end(f"the time was up{cut}")
        return incidents

    def _end(self, reason: str) -> None:
        self._over = reason
        self._lap = None
        self._coming.clear()
        self._frames.clear()

    def _settle(self, t_ns: int, sure_t_ns: int | None = None) -> list[Incident]:
        incidents: list[Incident] = []
        lap = self._lap
        while self._coming and self._coming[0].t_ns <= t_ns:
            step = self._pace.step(self._coming.popleft())
            if lap is not None:
                self._count(step.fix.t_ns)
                incidents += self._tell(lap.feed(step))
        last = self._pace.last
        # A crossing in a gap is known only after it: until then its frames belong to no lap.
        self._count(max(min(t_ns if last is None else last.t_ns, t_ns), t_ns - round(WAIT_S * 1e9)))
        limit_s = self._rules.max_lap_s
        sure_ns = t_ns if sure_t_ns is None else sure_t_ns
        if lap is not None and limit_s is not None and self._is_past(lap.start.t_ns + round(limit_s * 1e9), sure_ns):
            incidents += self._tell(lap.slow(t_ns, last))
        return incidents

    def _count(self, t_ns: int) -> None:
        """Counts the running lap's frames up to `t_ns`."""
        count = 0
        while self._frames and self._frames[0] <= t_ns:
            self._frames.popleft()
            count += 1
        if self._lap is not None:
            self._lap.frames += count

    def _is_past(self, moment_ns: int, t_ns: int) -> bool:
        """Whether `moment_ns` is over at `t_ns`, and no crossing before it can turn up after a short gap."""
        last = self._pace.last if not self._coming else self._coming[-1]
        seen = last is not None and last.t_ns > moment_ns
        return t_ns > moment_ns + (0 if seen else self._rules.max_gap_s * 1e9)

    def _progress_at(self, t_ns: int) -> float:
        """The car's progress at a crossing at `t_ns`, between the fixes on either side of it."""
        last, coming = self._pace.last, self._coming[0] if self._coming else None
        for fix in reversed(() if self._lap is None else self._lap.trace):
            if fix.t_ns <= t_ns:
                last = fix
                break
            coming = fix
        if last is None or coming is None or not last.t_ns <= t_ns < coming.t_ns:
            known = last or coming
            return 0.0 if known is None else known.progress_m
        step_m = coming.progress_m - last.progress_m
        can_m = max(2 * math.dist(last.track_m, coming.track_m), self._pace.can_m(last, coming))
        if abs(step_m) > can_m + self._rules.short_cut_m:
            return last.progress_m
        return last.progress_m + step_m * (t_ns - last.t_ns) / (coming.t_ns - last.t_ns)

    def _driven_m(self, t_ns: int) -> float:
        """Metres of the lap's route that were driven at a crossing at `t_ns`, which may lie in a gap."""
        last = self._pace.last
        if self._lap is None or last is None:
            return 0.0
        return self._lap.driven_m + max(self._progress_at(t_ns) - last.progress_m, 0.0)

    def _tell(self, drafts: Sequence[Draft]) -> list[Incident]:
        """Numbers what happened in the running lap."""
        told = []
        for draft in drafts:
            self._told += 1
            told.append(draft.told(number=self._told, car=self._car, lap=self._done + 1))
        if self._lap is not None:
            self._lap.incidents += told
        return told
