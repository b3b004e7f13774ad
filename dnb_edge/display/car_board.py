"""What a board knows of one car, as one value, and how each event changes it. Knows nothing of the other cars."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

from dnb_edge import values

LAPS_KEPT = 50
"""Laps that a board remembers for its table: a day of practice must not grow without end."""


class Phase(StrEnum):
    """Where a car's run stands."""

    WAITING = "waiting"
    """The car has not been confirmed yet."""
    OUT_LAP = "out_lap"
    """The car is on its way to its first crossing of the start line."""
    LAP = "lap"
    FINISHED = "finished"


@dataclass(frozen=True, slots=True, kw_only=True)
class CarBoard:
    """One car's part of the board."""

    car: int = 1
    target_id: int | None = None
    """The target that it was last told as; None before its first crossing."""
    phase: Phase = Phase.WAITING
    lap_number: int | None = None
    """The running lap; None where no lap is running."""
    lap_start_s: float | None = None
    """Start of the running lap; None where no lap is running."""
    laps: tuple[values.Lap, ...] = ()
    """The last `LAPS_KEPT` complete laps, oldest first."""
    best_lap: values.Lap | None = None
    """The fastest valid lap by its official time; the first of equals."""
    crossed_s: float | None = None
    """When the car last crossed the start line forward."""
    seen_s: float | None = None
    """When the car's estimate last came from a detection."""
    running: values.Running | None = None
    """The latest of the running lap; None before one was told of this lap."""

    @property
    def last_lap(self) -> values.Lap | None:
        """The latest complete lap."""
        return self.laps[-1] if self.laps else None

    @property
    def laps_done(self) -> int:
        """Number of complete laps, those no longer in `laps` included."""
        return self.laps[-1].number if self.laps else 0

    def seen(self, t_s: float) -> CarBoard:
        """Confirmed on the track at `t_s`."""
        return replace(self, phase=Phase.OUT_LAP if self.phase is Phase.WAITING else self.phase, seen_s=t_s)

    def crossed(self, crossing: values.Crossing) -> CarBoard:
        """After a forward crossing of the start line."""
        after = replace(self, crossed_s=crossing.t_s, target_id=crossing.target_id)
        begins = crossing.status is values.PassStatus.START
        if crossing.status is None:
            begins = self.phase in {Phase.WAITING, Phase.OUT_LAP}
        if not begins or self.phase is Phase.FINISHED:
            # A running lap is ended by its Lap alone: the rules may have refused this crossing (minimum lap).
            return after
        number = crossing.lap if crossing.lap is not None else self.laps_done + 1
        return replace(after, phase=Phase.LAP, lap_number=number, lap_start_s=crossing.t_s, running=None)

    def lapped(self, lap: values.Lap, laps_wanted: int | None) -> CarBoard:
        """After a complete lap."""
        best = self.best_lap
        faster = lap.valid and (best is None or official_s(lap) < official_s(best))
        lapped = replace(
            self,
            target_id=self.target_id if lap.target_id is None else lap.target_id,
            laps=(*self.laps, lap)[-LAPS_KEPT:],
            best_lap=lap if faster else best,
            running=None,
        )
        if self.phase is Phase.FINISHED or (laps_wanted is not None and lap.number >= laps_wanted):
            return lapped.finished()
        return replace(lapped, phase=Phase.LAP, lap_number=lap.number + 1, lap_start_s=lap.start_s + lap.time_s)

    def finished(self) -> CarBoard:
        """After the run."""
        return replace(self, phase=Phase.FINISHED, lap_number=None, lap_start_s=None, running=None)


def official_s(lap: values.Lap) -> float:
    """The lap's time with its penalties, seconds."""
    return lap.time_s if lap.official_time_s is None else lap.official_time_s
