"""What a board shows, as one value, and how each event changes it: a pure reducer.

Knows events and their order in time. Knows no display, no clock and no file: `t_s` comes with the events, in seconds
from the first frame of the run on the source's clock.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

from dnb_edge import values
from dnb_edge.track.model import START_LINE

LAPS_KEPT = 50
"""Laps that a board remembers for its table: a day of practice must not grow without end."""

FLASH_S = 1.0
"""For how long a board flashes after a crossing, seconds."""

UNSEEN_S = 2.0
"""After how long without an estimate of the car a board says that it is not seen, seconds."""


class Phase(StrEnum):
    """Where the run stands."""

    WAITING = "waiting"
    """No car has been confirmed yet."""
    OUT_LAP = "out_lap"
    """The car is on its way to its first crossing of the start line."""
    LAP = "lap"
    FINISHED = "finished"


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardState:
    """What any display shows; cumulative, so that a display which missed states has missed nothing."""

    start_line: str = START_LINE
    """Name of the line whose forward crossings begin and end laps."""
    laps_wanted: int | None = None
    """Laps after which the run ends; None where it has no end."""
    phase: Phase = Phase.WAITING
    t_s: float = 0.0
    """The latest moment heard of."""
    lap_number: int | None = None
    """The running lap; None where no lap is running."""
    lap_start_s: float | None = None
    """Start of the running lap; None where no lap is running."""
    laps: tuple[values.Lap, ...] = ()
    """The last `LAPS_KEPT` laps, oldest first."""
    best_lap: values.Lap | None = None
    """The fastest valid lap of the whole run, of equals the earliest."""
    crossed_s: float | None = None
    """The latest forward crossing of the start line."""
    seen_s: float | None = None
    """When the car was last estimated from a detection."""
    health: values.Health | None = None

    @property
    def last_lap(self) -> values.Lap | None:
        """The latest complete lap."""
        return self.laps[-1] if self.laps else None

    @property
    def laps_done(self) -> int:
        """Number of complete laps, those no longer in `laps` included."""
        return self.laps[-1].number if self.laps else 0

    @property
    def running_s(self) -> float | None:
        """Time of the running lap so far; None where no lap is running."""
        return None if self.lap_start_s is None else max(0.0, self.t_s - self.lap_start_s)

    @property
    def flashing(self) -> bool:
        """True for `FLASH_S` after a crossing."""
        return self.crossed_s is not None and self.t_s - self.crossed_s < FLASH_S

    @property
    def unseen(self) -> bool:
        """True where a run is on and the car has not been seen for `UNSEEN_S`."""
        on_track = self.phase in {Phase.OUT_LAP, Phase.LAP}
        return on_track and self.seen_s is not None and self.t_s - self.seen_s > UNSEEN_S

    @property
    def state_line(self) -> str:
        """The run in a few words, such as `lap 2 of 3`."""
        match self.phase:
            case Phase.WAITING:
                return "waiting for the car"
            case Phase.OUT_LAP:
                return "out lap"
            case Phase.LAP:
                wanted = "" if self.laps_wanted is None else f" of {self.laps_wanted}"
                return f"lap {self.lap_number}{wanted}"
            case Phase.FINISHED:
                return "finished"

    def at(self, t_s: float) -> BoardState:
        """The same board at `t_s`; time never runs backwards."""
        return replace(self, t_s=max(self.t_s, t_s))

    def after(self, event: values.Event) -> BoardState:
        """The board once `event` has happened. A lap and the crossing that ends it may come in either order."""
        match event:
            case values.Target(state=values.TargetState.CONFIRMED):
                changed = self._seen(event.t_s)
            case values.Crossing(direction=values.Direction.FORWARD) if event.line == self.start_line:
                changed = self._crossed(event.t_s)
            case values.Lap():
                changed = self._lapped(event)
            case values.Health():
                changed = replace(self.at(event.t_s), health=event)
            case values.RunSummary():
                changed = _finished(self)
            case values.Observation() | values.Target() | values.Crossing():
                changed = self.at(event.t_s)
            case values.Score() | values.Incident() | values.Running() | values.RaceState() | values.Standings():
                changed = self
        return changed

    def _seen(self, t_s: float) -> BoardState:
        phase = Phase.OUT_LAP if self.phase is Phase.WAITING else self.phase
        return replace(self.at(t_s), phase=phase, seen_s=t_s)

    def _crossed(self, t_s: float) -> BoardState:
        crossed = replace(self.at(t_s), crossed_s=t_s)
        if self.phase in {Phase.WAITING, Phase.OUT_LAP}:
            return replace(crossed, phase=Phase.LAP, lap_number=1, lap_start_s=t_s)
        # A running lap is ended by its Lap alone: the rules may have refused this crossing (minimum lap).
        return crossed

    def _lapped(self, lap: values.Lap) -> BoardState:
        end_s = lap.start_s + lap.time_s
        faster = lap.valid and (self.best_lap is None or lap.time_s < self.best_lap.time_s)
        lapped = replace(self.at(end_s), laps=(*self.laps, lap)[-LAPS_KEPT:], best_lap=lap if faster else self.best_lap)
        if self.phase is Phase.FINISHED or (self.laps_wanted is not None and lap.number >= self.laps_wanted):
            return _finished(lapped)
        return replace(lapped, phase=Phase.LAP, lap_number=lap.number + 1, lap_start_s=end_s)


def _finished(state: BoardState) -> BoardState:
    return replace(state, phase=Phase.FINISHED, lap_number=None, lap_start_s=None)


def laps_since(earlier: BoardState | None, later: BoardState) -> tuple[values.Lap, ...]:
    """The laps that `later` knows and `earlier` does not, oldest first; all of them where there is no `earlier`."""
    done = 0 if earlier is None else earlier.laps_done
    return tuple(lap for lap in later.laps if lap.number > done)
