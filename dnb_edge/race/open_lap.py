"""One lap from its start on: what is kept of it while it runs, and what it is when it ends.

Knows the lap's start, its fixes, sectors and watchers; knows nothing of states nor of what a crossing means.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

from dnb_edge.race.crossing import lap_sigma_s
from dnb_edge.race.fix import Fix
from dnb_edge.race.incidents import Draft, Step
from dnb_edge.race.lap_table import LapState
from dnb_edge.race.off_track import Lane
from dnb_edge.race.rules import Footprint, LapRules
from dnb_edge.race.sectors import SectorPlan, Sectors
from dnb_edge.race.watch import LapWatch
from dnb_edge.race.way import Way
from dnb_edge.track.model import Track
from dnb_edge.values import Crossing, Incident, IncidentKind, Lap, PointM

MOST_ROUTES = 1.5
"""A lap that drove the route's length more often than this is more than one."""

MOST_FIXES = 20000
"""Fixes kept of one lap: of one that takes longer, such as that of a car which is parked, every other goes."""


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """What the laps know of the track."""

    lap_m: float
    """A lap's length along the route, metres."""
    start_s_m: float = 0.0
    """s_m of a lap's start."""
    loop_m: float | None = None
    """Length of a closed route, metres; None where it is open or nobody says."""
    has_finish_line: bool = False
    """Whether laps end at a line of their own."""
    sectors: SectorPlan = field(default_factory=SectorPlan)
    lane: Lane | None = None
    """Needed where the car's footprint counts, or what it may hit."""

    @classmethod
    def of(cls, track: Track, rules: LapRules) -> Self:
        """The course of a track whose lines are right; see `sectors.check_lines`."""
        start_s_m, lap_m = track.lap_m()
        return cls(
            lap_m=lap_m,
            start_s_m=start_s_m,
            loop_m=track.centreline.length_m if track.centreline.closed else None,
            has_finish_line=track.finish_line is not None,
            sectors=SectorPlan.of(track),
            lane=Lane(track.centreline) if rules.obstacles or rules.off_lane is not Footprint.CENTRE else None,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class RunningLap:
    """The lap that runs now."""

    number: int
    start: Crossing
    state: LapState
    driven_m: float
    """Metres of its route that the car has driven along; what it drove twice counts once."""

    def elapsed_s(self, t_ns: int) -> float:
        """Seconds since its start."""
        return (t_ns - self.start.t_ns) * 1e-9


class OpenLap:
    """A lap that runs."""

    def __init__(
        self,
        rules: LapRules,
        course: Course,
        start: Crossing,
        *,
        number: int,
        progress_m: float,
        seen_t_ns: int,
        frames: int = 0,
    ) -> None:
        """`progress_m` is the car's at `start`; `seen_t_ns` the stamp up to which nothing is to be said of its being lost;
        `frames` the number of its frames that were looked at already.
        """
        self._rules = rules
        self._lap_m = course.lap_m
        way = Way(rules, progress_m=progress_m, lap_m=course.lap_m, start_s_m=course.start_s_m, loop_m=course.loop_m)
        self._watch = LapWatch(rules, start, way, seen_t_ns=seen_t_ns, lane=course.lane)
        self._sectors = Sectors(course.sectors, start, rules.min_progress)
        self._seen = 0
        self._frames_at: list[int] = []
        self._is_slow = False
        self.start = start
        """Where it began."""
        self.number = number
        """From 1, for each car."""
        self.frames = frames
        """Number of frames looked at since."""
        self.trace: list[Fix] = []
        """Its fixes so far."""
        self.incidents: list[Incident] = []
        """What happened so far."""

    @property
    def driven_m(self) -> float:
        """Metres of the lap's route that the car has driven along."""
        return self._watch.way.driven_m

    def feed(self, step: Step) -> list[Draft]:
        """Takes the car's next step; returns the incidents that ended with it."""
        self.trace.append(step.fix)
        self._frames_at.append(self.frames)
        self._seen += 1
        if len(self.trace) > MOST_FIXES:
            self.trace, self._frames_at = self.trace[::2], self._frames_at[::2]
        return self._watch.feed(step)

    def later_than(self, t_ns: int) -> list[Fix]:
        """The fixes after `t_ns`, oldest first."""
        later = []
        for fix in reversed(self.trace):
            if fix.t_ns <= t_ns:
                break
            later.append(fix)
        return later[::-1]

    def frames_later_than(self, t_ns: int) -> int:
        """How many of its frames were counted after the last fix up to `t_ns`; none where no fix is later."""
        late = len(self.later_than(t_ns))
        if not late:
            return 0
        kept = self._frames_at[: len(self._frames_at) - late]
        return self.frames - (kept[-1] if kept else 0)

    def sector(self, crossing: Crossing, driven_m: float) -> tuple[str | None, list[Draft]]:
        """Takes a forward crossing of a sector line; (why it ends no sector, None where it does; lines missed before it)."""
        before = len(self._sectors.missed)
        reason = self._sectors.crossed(crossing, driven_m)
        return reason, [self._missed(line, crossing) for line in self._sectors.missed[before:]]

    def slow(self, t_ns: int, last: Fix | None) -> list[Draft]:
        """That the lap is too slow, once, if it is at `t_ns`; `last` is where the car was seen last."""
        max_lap_s = self._rules.max_lap_s
        if max_lap_s is None or self._is_slow or t_ns <= self.start.t_ns + max_lap_s * 1e9:
            return []
        self._is_slow = True
        end_t_ns = self.start.t_ns + round(max_lap_s * 1e9)
        text = f"the lap took longer than race.max_lap_s, {max_lap_s:g} s"
        return [self._of_lap(IncidentKind.TOO_SLOW, end_t_ns, last or self.start, text)]

    def so_far(self, t_ns: int) -> list[Draft]:
        """What goes on and is an incident already; see `LapWatch.so_far`."""
        return self._watch.so_far(t_ns)

    def given_up(self, t_ns: int) -> list[Draft]:
        """What was going on when the lap was given up."""
        return self._watch.close(t_ns)

    def ended(self, end: Crossing, over: Step | None) -> list[Draft]:
        """What was going on when the lap ended at `end`, and what is wrong with the lap as a whole; `over` is the step over
        its end, where it is known.
        """
        drafts = self._watch.close(end.t_ns, over)
        drafts += [self._missed(line, end) for line in self._sectors.due]
        routes = self._watch.way.net_m / self._lap_m
        if routes > MOST_ROUTES:
            text = f"the car drove {routes:.1f} times round the route: a crossing of the start line was missed"
            drafts.append(self._of_lap(IncidentKind.MISSED_LINE, end.t_ns, end, text))
        return drafts + self.slow(end.t_ns, self.trace[-1] if self.trace else None)

    def driven(self, end: Crossing, *, car: int, before: Sequence[Incident] = ()) -> DrivenLap:
        """The complete lap; `before` are incidents from before it that belong to it."""
        start = self.start
        late = len(self.later_than(end.t_ns))
        fixes = tuple(self.trace[: len(self.trace) - late])
        frames = self.frames - self.frames_later_than(end.t_ns)
        lap = Lap(
            number=self.number,
            start_t_ns=start.t_ns,
            end_t_ns=end.t_ns,
            start_s=start.t_s,
            time_s=(end.t_ns - start.t_ns) * 1e-9,
            sigma_s=lap_sigma_s(start, end),
            valid=True,
            reasons=(),
            similarity_percent=None,
            observed_fraction=min((self._seen - late) / frames, 1.0) if frames > 0 else 0.0,
            target_id=end.target_id,
            car=car,
            sectors=self._sectors.times(end),
            estimated=start.estimated or end.estimated,
        )
        path = (start.track_m, *(fix.observed_m for fix in fixes), end.track_m)
        # Its end may be told so late that it seemed too slow meanwhile.
        is_slow = self._rules.max_lap_s is not None and lap.time_s > self._rules.max_lap_s
        own = (one for one in self.incidents if is_slow or one.kind is not IncidentKind.TOO_SLOW)
        return DrivenLap(lap=lap, path_m=path, fixes=fixes, incidents=(*before, *own))

    def _missed(self, line: str, at: Crossing) -> Draft:
        text = f"the line {line!r} was not crossed in its turn"
        return self._of_lap(IncidentKind.MISSED_LINE, at.t_ns, at, text)

    def _of_lap(self, kind: IncidentKind, end_t_ns: int, worst: Fix | Crossing, text: str) -> Draft:
        start = self.start
        return Draft(
            kind=kind, start_t_ns=start.t_ns, start_s=start.t_s, end_t_ns=end_t_ns, worst=worst, text=text
        )  # fmt: skip
