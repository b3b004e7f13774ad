"""What a board shows, as one value, and how each event changes it: a pure reducer.

Knows events and their order in time. Knows no display, no clock and no file: `t_s` comes with the events, in seconds
from the first frame of the run on the source's clock. With several cars the large figures are those of one of them, the
*shown* car: the one that leads.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from dnb_edge import values
from dnb_edge.display.car_board import LAPS_KEPT, CarBoard, Phase
from dnb_edge.track.model import START_LINE

FLASH_S = 1.0
"""For how long a board flashes after a crossing, seconds."""

UNSEEN_S = 2.0
"""After how long without an estimate of the car a board says that it is not seen, seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardState:
    """What any display shows; cumulative, so that a display which missed states has missed nothing."""

    start_line: str = START_LINE
    """Name of the line whose forward crossings begin laps."""
    laps_wanted: int | None = None
    """Laps after which the run ends; None where it has no end."""
    t_s: float = 0.0
    """The latest moment heard of."""
    cars: tuple[CarBoard, ...] = (CarBoard(),)
    """In the order of their numbers; never empty."""
    shown_car: int = 1
    """Number of the car whose figures stand in front."""
    race: values.RaceState | None = None
    standings: values.Standings | None = None
    told: tuple[values.Lap | values.Incident, ...] = ()
    """The latest laps and incidents of all cars, oldest first."""
    told_count: int = 0
    """How many there were in all."""
    health: values.Health | None = None
    notice: str | None = None
    """A line for people at the box that is no part of the race, such as the set-up code; None where there is none."""

    @property
    def shown(self) -> CarBoard:
        """The car in front."""
        return next((car for car in self.cars if car.car == self.shown_car), self.cars[0])

    @property
    def phase(self) -> Phase:
        """Where the shown car's run stands."""
        return self.shown.phase

    @property
    def lap_number(self) -> int | None:
        """The shown car's running lap; None where none is running."""
        return self.shown.lap_number

    @property
    def lap_start_s(self) -> float | None:
        """Start of the shown car's running lap; None where none is running."""
        return self.shown.lap_start_s

    @property
    def laps(self) -> tuple[values.Lap, ...]:
        """The shown car's latest laps, oldest first."""
        return self.shown.laps

    @property
    def best_lap(self) -> values.Lap | None:
        """The shown car's fastest valid lap."""
        return self.shown.best_lap

    @property
    def last_lap(self) -> values.Lap | None:
        """The shown car's latest complete lap."""
        return self.shown.last_lap

    @property
    def laps_done(self) -> int:
        """Number of the shown car's complete laps."""
        return self.shown.laps_done

    @property
    def crossed_s(self) -> float | None:
        """When the shown car last crossed the start line forward."""
        return self.shown.crossed_s

    @property
    def running_s(self) -> float | None:
        """Time of the shown car's running lap so far; None where no lap is running."""
        return None if self.lap_start_s is None else max(0.0, self.t_s - self.lap_start_s)

    @property
    def flashing(self) -> bool:
        """True for `FLASH_S` after a crossing of the shown car."""
        return self.crossed_s is not None and self.t_s - self.crossed_s < FLASH_S

    @property
    def unseen(self) -> bool:
        """True where a run is on and the shown car has not been seen for `UNSEEN_S`."""
        on_track, seen_s = self.phase in {Phase.OUT_LAP, Phase.LAP}, self.shown.seen_s
        return on_track and seen_s is not None and self.t_s - seen_s > UNSEEN_S

    @property
    def counting_down(self) -> bool:
        """True while a countdown runs."""
        return self.race is not None and self.race.phase is values.RacePhase.COUNTDOWN

    @property
    def state_line(self) -> str:
        """The run in a few words, such as `lap 2 of 3`."""
        race = self.race
        if race is not None and race.phase in {values.RacePhase.WAITING, values.RacePhase.COUNTDOWN}:
            if self.counting_down:
                return "countdown" if race.countdown_s is None else f"countdown, {race.countdown_s:.0f} s"
            if race.text:
                return race.text
        match self.phase:
            case Phase.WAITING:
                return "waiting for the car"
            case Phase.OUT_LAP:
                return "out lap"
            case Phase.LAP:
                wanted = "" if self.laps_wanted is None else f" of {self.laps_wanted}"
                late = ", the time is up" if race is not None and race.phase is values.RacePhase.GRACE else ""
                return f"lap {self.lap_number}{wanted}{late}"
            case Phase.FINISHED:
                return "finished"

    def at(self, t_s: float) -> BoardState:
        """The same board at `t_s`; time never runs backwards."""
        return replace(self, t_s=max(self.t_s, t_s))

    def noting(self, notice: str | None) -> BoardState:
        """The same board with this notice, or without any."""
        return self if notice == self.notice else replace(self, notice=notice)

    def after(self, event: values.Event) -> BoardState:
        """The board once `event` has happened. A lap and the crossing that ends it may come in either order."""
        match event:
            case values.Lap() | values.Incident():
                changed = self._happened(event)
            case values.RaceState() | values.Standings() | values.Health():
                changed = self._stands(event)
            case values.RunSummary():
                changed = replace(self, cars=tuple(car.finished() for car in self.cars))
            case values.Score() | values.VehicleReport():
                changed = self
            case _:
                changed = self.at(event.t_s)._moved(event)  # noqa: SLF001 its own kind
        return changed

    def _moved(self, event: values.Observation | values.Target | values.Crossing | values.Running) -> BoardState:
        match event:
            case values.Target(state=values.TargetState.CONFIRMED):
                return self._seen(event)
            case values.Crossing(direction=values.Direction.FORWARD) if event.line == self.start_line:
                return self._with(event.car, lambda car: car.crossed(event))
            case values.Running():
                return self._with(event.car, lambda car: replace(car, running=event))
            case _:
                return self

    def _happened(self, event: values.Lap | values.Incident) -> BoardState:
        lasted_s = event.time_s if isinstance(event, values.Lap) else event.lasted_s
        told = replace(
            self.at(event.start_s + lasted_s), told=(*self.told, event)[-LAPS_KEPT:], told_count=self.told_count + 1
        )
        if isinstance(event, values.Incident):
            return told
        return told._with(event.car, lambda car: car.lapped(event, self.laps_wanted))  # noqa: SLF001 its own kind

    def _stands(self, event: values.RaceState | values.Standings | values.Health) -> BoardState:
        later = self.at(event.t_s)
        match event:
            case values.RaceState():
                return replace(later, race=event)
            case values.Health():
                return replace(later, health=event)
            case values.Standings():
                leader = event.rows[0].car if event.rows else self.shown_car
                return replace(later, standings=event, shown_car=leader)

    def _seen(self, target: values.Target) -> BoardState:
        """A target belongs to the car that was last told under its number; before any crossing, to the shown one."""
        known = [car.car for car in self.cars if car.target_id == target.target_id]
        if known:
            return self._with(known[0], lambda car: car.seen(target.t_s))
        if self.shown.target_id is None or len(self.cars) == 1:
            return self._with(self.shown.car, lambda car: car.seen(target.t_s))
        return self

    def _with(self, number: int, change: Callable[[CarBoard], CarBoard]) -> BoardState:
        """With one car changed; a car that was not known before joins the others."""
        if any(car.car == number for car in self.cars):
            return replace(self, cars=tuple(change(car) if car.car == number else car for car in self.cars))
        cars = sorted([*self.cars, change(CarBoard(car=number))], key=lambda car: car.car)
        return replace(self, cars=tuple(cars))


def news_since(earlier: BoardState | None, later: BoardState) -> tuple[values.Lap | values.Incident, ...]:
    """The laps and incidents of all cars that `later` knows and `earlier` does not, oldest first, as far as they are kept."""
    missed = later.told_count if earlier is None else max(0, later.told_count - earlier.told_count)
    return later.told[len(later.told) - min(missed, len(later.told)) :]


def laps_since(earlier: BoardState | None, later: BoardState) -> tuple[values.Lap, ...]:
    """The laps among `news_since`."""
    return tuple(one for one in news_since(earlier, later) if isinstance(one, values.Lap))
