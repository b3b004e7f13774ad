"""One car in the field: its race, its running lap, and what it has done so far.

Knows one car's laps, incidents and rules; knows nothing of the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from dnb_edge.race.car import CarRace, Passed
from dnb_edge.race.fix import Fix
from dnb_edge.race.laps import DrivenLap
from dnb_edge.race.penalties import counted, ends_the_race, judged, judged_run, retires
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

    def seen(self, fixes: Sequence[Fix]) -> list[Running]:
        """Takes the fixes of a frame; returns what they tell of the running lap."""
        if self.live is None:
            return []
        return [running for fix in fixes if (running := self.live.fix(fix)) is not None]

    def crossed(self, crossing: Crossing) -> None:
        """Keeps what a crossing means for the car's race and its running lap."""
        begins = crossing.status in (PassStatus.START, PassStatus.LAP)
        if begins and self.start_t_ns is None:
            self.start_t_ns = crossing.t_ns
        if self.live is None:
            return
        running = self.race.laps.running
        if begins and running is not None:
            self.live.started(crossing, lap=running.number)
        elif crossing.status is PassStatus.ARRIVED:
            self.live.stopped()

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

    def over(self, rules: PenaltyRules, t_ns: int) -> list[Passed]:
        """Takes the car out of the race where what goes on at `t_ns` costs that already: who is stuck may be so for ever.
        Returns what ended with it.
        """
        for draft in self.race.laps.going_on(t_ns):
            if ends_the_race(draft.kind, self.incidents, rules):
                return list(self.race.retire(draft.end_t_ns, draft.text))
        return []

    def retired(self, rules: PenaltyRules, t_ns: int) -> list[Passed]:
        """Takes the car out of the race where an incident so far costs that, though it was known only after the last lap;
        returns what ended with it."""
        if self.dnf is not None:
            return []
        penalty = retires(self.incidents, rules)
        if penalty is None:
            return []
        (incident,) = (one for one in self.incidents if one.number == penalty.incident)
        self.dnf = penalty.reason
        self.end_t_ns = min(incident.end_t_ns, t_ns)
        if self.live is not None:
            self.live.stopped()
        return list(self.race.retire(self.end_t_ns, penalty.reason))

    def result(self, t_ns: int, rules: PenaltyRules) -> CarResult:
        """What the car has done until `t_ns`."""
        assert self.number is not None, "a car that has done nothing has no result"
        until_ns = t_ns if self.end_t_ns is None else self.end_t_ns
        driven_m = self.race.laps.driven_m
        return CarResult(
            car=self.number,
            name=self.name if self.name is not None else f"car {self.number}",
            laps=tuple(self.laps),
            start_t_ns=self.start_t_ns,
            elapsed_s=None if self.start_t_ns is None else max(0.0, (until_ns - self.start_t_ns) * 1e-9),
            distance_m=len(self.laps) * self.lap_m + driven_m,
            running=driven_m / self.lap_m,
            penalties=judged_run(self.laps, self.incidents, rules)[1],
            dnf=self.dnf,
        )


def numbered(event: Crossing | Incident | Running, number: int) -> Crossing | Incident | Running:
    """The event as one of car `number`."""
    return event if event.car == number else replace(event, car=number)
