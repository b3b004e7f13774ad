"""The start of a race and its phases, for all cars together: grid, countdown, start; then what the cars' own machines say.

Knows fixes, the route and the cars' states; knows no laps and no clock but the frames' stamps. The same frames give the same
start again, chance included: it comes from the rules' seed. What happens is in `TRANSITIONS`.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Self, TypeAlias

from dnb_edge.race.fix import Fix
from dnb_edge.race.incidents import Draft
from dnb_edge.race.lap_table import LapState
from dnb_edge.race.rules import StartMode, StartRules
from dnb_edge.track.model import Track, crossings_of
from dnb_edge.values import Incident, IncidentKind, RacePhase, RaceState

UNSEEN_S = 1.0
"""A car that was not seen for so long is not on the grid, seconds."""


class Signal(StrEnum):
    """What moves a race from one phase to the next."""

    READY = "ready"
    """All cars stand on the grid."""
    GO = "go"
    """The countdown is over; in a rolling start, the first car has begun its first lap."""
    TIME_UP = "time_up"
    """No car may begin a lap any more, and at least one may finish its own."""
    OVER = "over"
    """The race of every car is over."""


TRANSITIONS: dict[tuple[RacePhase, Signal], RacePhase] = {
    (RacePhase.WAITING, Signal.READY): RacePhase.COUNTDOWN,
    (RacePhase.WAITING, Signal.GO): RacePhase.RACING,
    (RacePhase.WAITING, Signal.OVER): RacePhase.FINISHED,
    (RacePhase.COUNTDOWN, Signal.GO): RacePhase.RACING,
    (RacePhase.COUNTDOWN, Signal.OVER): RacePhase.FINISHED,
    (RacePhase.RACING, Signal.TIME_UP): RacePhase.GRACE,
    (RacePhase.RACING, Signal.OVER): RacePhase.FINISHED,
    (RacePhase.GRACE, Signal.OVER): RacePhase.FINISHED,
}
"""Every legal step; any other raises `KeyError`."""

StartNews: TypeAlias = RaceState | Incident
"""A change of phase or a second of the countdown; or a jump start, number 0 until the car's race has numbered it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """Where on the route the grid is."""

    start_s_m: float
    """s_m of the start line."""
    loop_m: float | None
    """Length of a closed route, metres; None where it is open."""

    @classmethod
    def of(cls, track: Track) -> Self:
        """The grid of a track whose lines are right; see `sectors.check_lines`."""
        route = track.centreline
        return cls(
            start_s_m=crossings_of(route, track.start_line)[0][0], loop_m=route.length_m if route.closed else None
        )

    def before_m(self, s_m: float) -> float:
        """How far before the start line, along the route, `s_m` is, metres; on an open route negative behind it."""
        before_m = self.start_s_m - s_m
        return before_m if self.loop_m is None else before_m % self.loop_m


@dataclass(slots=True)
class _Standing:
    """One car on the grid."""

    rest: Fix
    """Where it came to rest."""
    last: Fix
    jumped: bool = False

    @property
    def away_m(self) -> float:
        return math.dist(self.rest.track_m, self.last.track_m)


class StartProcedure:
    """Feed it each frame before the cars' races get it. `jumped` and `go` of the cars' lap machines want its news."""

    def __init__(
        self, rules: StartRules, grid: Grid, *, cars: Iterable[int] = (1,), time_limit_s: float | None = None
    ) -> None:
        """`cars` are the numbers of those that take part; `time_limit_s` is `format.time_limit_s`, for what is told."""
        self._rules = rules
        self._grid = grid
        self._cars: dict[int, _Standing | None] = dict.fromkeys(cars)
        self._time_limit_s = time_limit_s
        self._phase = RacePhase.WAITING
        self._attempt = 0
        self._go_t_ns: int | None = None
        self._zero_ns = 0
        self._seconds: list[int] = []
        self._text: str | None = None

    @property
    def phase(self) -> RacePhase:
        """The phase now."""
        return self._phase

    @property
    def go_t_ns(self) -> int | None:
        """The instant of the start, as soon as it was given; None before, and in a rolling start."""
        return None if self._phase in (RacePhase.WAITING, RacePhase.COUNTDOWN) else self._go_t_ns

    def step(
        self, t_ns: int, t_s: float, fixes: Mapping[int, Fix | None], states: Mapping[int, LapState]
    ) -> list[StartNews]:
        """Takes one frame: the latest fix of each car seen in it, and where each car is in its race, by the cars' numbers."""
        self._zero_ns = t_ns - round(t_s * 1e9)
        news: list[StartNews] = []
        if self._rules.mode is StartMode.GRID and self._phase in (RacePhase.WAITING, RacePhase.COUNTDOWN):
            news += self._before(t_ns, fixes)
        elif self._phase is RacePhase.WAITING:
            news += self._rolling(t_ns, states)
        return news + self._phases(t_ns, list(states.values()))

    def _before(self, t_ns: int, fixes: Mapping[int, Fix | None]) -> list[StartNews]:
        """Grid and countdown."""
        news: list[StartNews] = []
        for car in self._cars:
            fix = fixes.get(car)
            if fix is not None:
                news += self._seen(car, fix)
        if self._phase is RacePhase.WAITING:
            return news + self._waiting(t_ns)
        return news + self._counting(t_ns)

    def _seen(self, car: int, fix: Fix) -> list[StartNews]:
        """Takes a car's fix; returns its jump start, if that was one."""
        standing = self._cars[car]
        if standing is None:
            self._cars[car] = _Standing(fix, fix)
            return []
        before, standing.last = standing.last, fix
        if standing.away_m <= self._rules.jump_m or standing.jumped:
            return []
        if self._phase is RacePhase.WAITING:
            self._cars[car] = _Standing(fix, fix)
            return []
        near_m, far_m = math.dist(standing.rest.track_m, before.track_m), standing.away_m
        share = (self._rules.jump_m - near_m) / (far_m - near_m) if far_m > near_m else 0.0
        at_ns = before.t_ns + round(min(max(share, 0.0), 1.0) * (fix.t_ns - before.t_ns))
        if self._go_t_ns is not None and at_ns >= self._go_t_ns:
            return []
        standing.jumped = True
        return [self._jump(car, at_ns, fix, far_m)]

    def _jump(self, car: int, at_ns: int, fix: Fix, moved_m: float) -> Incident:
        # Where the start comes by chance, nobody is told when it would have been.
        early_s = None if self._go_t_ns is None or self._rules.random_s else (self._go_t_ns - at_ns) * 1e-9
        when = "before the start" if early_s is None else f"{early_s:.2f} s before the start"
        return Draft(
            kind=IncidentKind.JUMP_START,
            start_t_ns=at_ns,
            start_s=(at_ns - self._zero_ns) * 1e-9,
            end_t_ns=fix.t_ns,
            worst=fix,
            greatest_m=moved_m,
            text=f"the car moved by more than {self._rules.jump_m * 1e3:.0f} mm {when}",
        ).told(number=0, car=car, lap=None)

    def _waiting(self, t_ns: int) -> list[StartNews]:
        awaited = self._awaited(t_ns)
        if awaited:
            if awaited == self._text:
                return []
            self._text = awaited
            return [self._state(t_ns, text=awaited)]
        for standing in self._cars.values():
            if standing is not None:
                # It was rolling out when it last counted as moving.
                standing.rest = standing.last
        self._attempt += 1
        chance = random.Random(self._rules.seed * 1_000_003 + self._attempt)  # noqa: S311 - a race, not a secret
        wait_s = self._rules.countdown_s + chance.random() * self._rules.random_s
        self._go_t_ns = t_ns + round(wait_s * 1e9)
        self._phase = TRANSITIONS[self._phase, Signal.READY]
        self._seconds = [] if self._rules.random_s else list(range(math.ceil(wait_s) - 1, 0, -1))
        countdown_s = None if self._rules.random_s else wait_s
        return [self._state(t_ns, countdown_s=countdown_s, text="all cars stand on the grid"), *self._counting(t_ns)]

    def _counting(self, t_ns: int) -> list[StartNews]:
        go_t_ns = self._go_t_ns
        assert go_t_ns is not None, "a countdown ends some time"
        news: list[StartNews] = []
        while self._seconds and t_ns >= go_t_ns - self._seconds[0] * 1_000_000_000:
            left = self._seconds.pop(0)
            news.append(self._state(go_t_ns - left * 1_000_000_000, countdown_s=float(left)))
        if t_ns >= go_t_ns:
            self._phase = TRANSITIONS[self._phase, Signal.GO]
            news.append(self._state(go_t_ns, remaining_s=self._time_limit_s, text="the start was given"))
        return news

    def _awaited(self, t_ns: int) -> str:
        """What is awaited before the countdown, a sentence; empty where nothing is."""
        unseen, away, moving = [], [], []
        for car, standing in self._cars.items():
            if standing is None or (t_ns - standing.last.t_ns) * 1e-9 > UNSEEN_S:
                unseen.append(car)
            elif standing.last.outside_m > 0 or not 0 < self._grid.before_m(standing.last.s_m) <= self._rules.grid_m:
                away.append(car)
            elif (standing.last.t_ns - standing.rest.t_ns) * 1e-9 < self._rules.still_s:
                moving.append(car)
        for cars, what in ((unseen, "be seen"), (away, "come to the grid"), (moving, "stand still")):
            if cars:
                return f"waiting for {_named(cars)} to {what}"
        return ""

    def _rolling(self, t_ns: int, states: Mapping[int, LapState]) -> list[StartNews]:
        if any(state in (LapState.LAP, LapState.GRACE, LapState.FINISHED) for state in states.values()):
            self._phase = TRANSITIONS[self._phase, Signal.GO]
            return [self._state(t_ns, remaining_s=self._time_limit_s, text="the first car has crossed the start line")]
        if self._text is None:
            self._text = "waiting for the first car to cross the start line"
            return [self._state(t_ns, text=self._text)]
        return []

    def _phases(self, t_ns: int, states: list[LapState]) -> list[StartNews]:
        """What the cars' states make of the phase."""
        if not states or self._phase is RacePhase.FINISHED:
            return []
        if all(state in (LapState.FINISHED, LapState.RETIRED) for state in states):
            self._phase = TRANSITIONS[self._phase, Signal.OVER]
            return [self._state(t_ns, text="the race of every car is over")]
        racing = any(state in (LapState.BEFORE_START, LapState.OUT_LAP, LapState.LAP) for state in states)
        if self._phase is RacePhase.RACING and not racing:
            self._phase = TRANSITIONS[self._phase, Signal.TIME_UP]
            return [self._state(t_ns, remaining_s=0.0, text="the time is up: laps that run may be finished")]
        return []

    def _state(
        self, t_ns: int, *, countdown_s: float | None = None, remaining_s: float | None = None, text: str = ""
    ) -> RaceState:
        return RaceState(
            t_ns=t_ns,
            t_s=(t_ns - self._zero_ns) * 1e-9,
            phase=self._phase,
            countdown_s=countdown_s,
            remaining_s=remaining_s,
            text=text,
        )


def _named(cars: list[int]) -> str:
    return f"car {cars[0]}" if len(cars) == 1 else "cars " + ", ".join(str(car) for car in cars)
