"""One car in the field: its race, its running lap, and what it has done so far.

Knows one car's laps, incidents and rules; knows nothing of the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from dnb_edge.race.car import CarRace, Passed
from dnb_edge.race.fix import Fix
from dnb_edge.race.laps import DrivenLap
from dnb_edge.race.penalties import counted, judged, judged_run, retires
from dnb_edge.race.rules import PenaltyRules
from dnb_edge.race.standings import CarResult
from dnb_edge.score.live import LiveLap
from dnb_edge.values import Crossing, Incident, Lap, PassStatus, Running


@dataclass(slots=True, kw_only=True)
class Entrant:
    """A car that takes part. Changes as the race goes on."""

    race: CarRace
    live: LiveLap | None
    """Tells the running lap; None where nobody wants it told."""
    lap_m: float
    """A lap's length along the route, metres."""
    name: str | None = None
    """None where only its number names it."""
    number: int | None = None
    """None before the car has done anything."""
    laps: list[Lap] = field(default_factory=list)
    """Complete laps, judged."""
    incidents: list[Incident] = field(default_factory=list)
    dnf: str | None = None
    """Why its race ended early; None where it did not."""
    start_t_ns: int | None = None
    """Where its race began; None before."""
    end_t_ns: int | None = None
    """Where its race ended; None while it goes on."""
    start_progress_m: float = 0.0
    last_fix: Fix | None = None

    def seen(self, fixes: Sequence[Fix]) -> list[Running]:
        """Takes the fixes of a frame; returns what they tell of the running lap."""
        if fixes:
            self.last_fix = fixes[-1]
        if self.live is None:
            return []
        return [running for fix in fixes if (running := self.live.fix(fix)) is not None]

    def crossed(self, crossing: Crossing) -> None:
        """Keeps what a crossing means for the car's race and its running lap."""
        begins = crossing.status in (PassStatus.START, PassStatus.LAP)
        if begins and self.start_t_ns is None:
            self.started(crossing.t_ns)
        if self.live is None:
            return
        running = self.race.laps.running
        if begins and running is not None:
            self.live.started(crossing, lap=running.number)
        elif crossing.status is PassStatus.ARRIVED:
            self.live.stopped()

    def started(self, t_ns: int) -> None:
        """Says that the car's race began at `t_ns`."""
        self.start_t_ns = t_ns
        trace = self.race.laps.trace
        if trace:
            self.start_progress_m = trace[0].progress_m
        elif self.last_fix is not None:
            self.start_progress_m = self.last_fix.progress_m

    def judged(self, driven: DrivenLap, rules: PenaltyRules) -> Lap:
        """The complete lap with what its incidents cost. A lap that was given up before it had the same number, and its own."""
        own = {incident.number for incident in driven.incidents}
        before = [one for one in self.incidents if one.number not in own]
        return judged(driven.lap, driven.incidents, rules, counted(before))

    def done(self, driven: DrivenLap, lap: Lap) -> None:
        """Keeps a complete lap; `lap` is its last word."""
        self.laps.append(lap)
        if self.live is not None:
            self.live.finished(driven, lap)

    def retired(self, rules: PenaltyRules, t_ns: int) -> list[Passed]:
        """Takes the car out of the race where an incident so far costs that; returns what ended with it."""
        if self.dnf is not None or self.race.finished:
            return []
        penalty = retires(self.incidents, rules)
        if penalty is None:
            return []
        self.dnf = penalty.reason
        self.end_t_ns = t_ns
        if self.live is not None:
            self.live.stopped()
        return list(self.race.retire(t_ns, penalty.reason))

    def result(self, t_ns: int, rules: PenaltyRules) -> CarResult:
        """What the car has done until `t_ns`."""
        assert self.number is not None, "a car that has done nothing has no result"
        until_ns = t_ns if self.end_t_ns is None else self.end_t_ns
        trace = self.race.laps.trace
        return CarResult(
            car=self.number,
            name=self.name if self.name is not None else f"car {self.number}",
            laps=tuple(self.laps),
            start_t_ns=self.start_t_ns,
            elapsed_s=None if self.start_t_ns is None else max(0.0, (until_ns - self.start_t_ns) * 1e-9),
            distance_m=0.0 if self.last_fix is None else self.last_fix.progress_m - self.start_progress_m,
            running=min(1.0, max(0.0, (trace[-1].progress_m - trace[0].progress_m) / self.lap_m)) if trace else 0.0,
            penalties=judged_run(self.laps, self.incidents, rules)[1],
            dnf=self.dnf,
        )


def numbered(event: Crossing | Incident | Running, number: int) -> Crossing | Incident | Running:
    """The event as one of car `number`."""
    return event if event.car == number else replace(event, car=number)
