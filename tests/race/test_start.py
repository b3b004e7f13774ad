"""The start: grid, countdown, jump starts, and the phases of a race for all cars together."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import pytest

from dnb_edge.race.fix import Fix
from dnb_edge.race.lap_table import LapState
from dnb_edge.race.rules import StartMode, StartRules
from dnb_edge.race.start import TRANSITIONS, Grid, Signal, StartNews, StartProcedure
from dnb_edge.values import Incident, IncidentKind, RacePhase, RaceState

FPS = 30
GRID = StartRules(mode=StartMode.GRID, grid_m=1.0, still_s=1.0, countdown_s=3.0)
ROUND = Grid(start_s_m=0.0, loop_m=10.0)

Where = Callable[[float], float | None]
"""s_m of a car at t_s; None where it is not seen."""


def fix(t_ns: int, s_m: float) -> Fix:
    return Fix(
        t_ns=t_ns,
        t_s=t_ns * 1e-9,
        target_id=1,
        observed_m=(s_m, 0.0),
        covariance_m2=(1e-6, 0.0, 1e-6),
        track_m=(s_m, 0.0),
        s_m=s_m % 10.0,
        d_m=0.0,
        outside_m=-0.1,
        progress_m=s_m,
    )


def started(
    rules: StartRules, cars: dict[int, Where], *, seconds: float, begin_ns: int = 0
) -> tuple[list[StartNews], StartProcedure]:
    """The news of a start that the cars drive, with all of them as their machines would be."""
    start = StartProcedure(rules, ROUND, cars=cars, time_limit_s=60.0)
    news: list[StartNews] = []
    state = LapState.BEFORE_START
    for k in range(round(seconds * FPS)):
        t_ns = begin_ns + round(k * 1e9 / FPS)
        seen = {n: None if (s_m := at(k / FPS)) is None else fix(t_ns, s_m) for n, at in cars.items()}
        news += start.step(t_ns, k / FPS, seen, dict.fromkeys(cars, state))
        if start.go_t_ns is not None:
            state = LapState.OUT_LAP
    return news, start


def states_of(news: list[StartNews]) -> list[tuple[RacePhase, float | None]]:
    return [(one.phase, one.countdown_s) for one in news if isinstance(one, RaceState)]


def jumps_of(news: list[StartNews]) -> list[Incident]:
    return [one for one in news if isinstance(one, Incident)]


def test_a_race_goes_from_phase_to_phase_by_the_table_only() -> None:
    """No phase is left out, none is come back to, and a finished race stays so."""
    illegal = set(itertools.product(RacePhase, Signal)) - set(TRANSITIONS)
    order = list(RacePhase)
    assert all(order.index(after) > order.index(before) for (before, _), after in TRANSITIONS.items())
    assert {(RacePhase.FINISHED, signal) for signal in Signal} <= illegal
    assert (RacePhase.RACING, Signal.READY) in illegal


def test_standing_cars_are_counted_down_to_an_exact_instant() -> None:
    """A second on the grid, then three, two, one and the start, each at its own instant whatever the frames' are."""
    news, start = started(GRID, {1: lambda t: -0.3, 2: lambda t: -0.6}, seconds=6, begin_ns=7)
    assert states_of(news) == [
        (RacePhase.WAITING, None),
        (RacePhase.COUNTDOWN, 3.0),
        (RacePhase.COUNTDOWN, 2.0),
        (RacePhase.COUNTDOWN, 1.0),
        (RacePhase.RACING, None),
    ]
    changes = [one for one in news if isinstance(one, RaceState)]
    assert [one.t_ns for one in changes[1:]] == [7 + k * 1_000_000_000 for k in (1, 2, 3, 4)]
    assert [one.t_s for one in changes[1:]] == pytest.approx([1.0, 2.0, 3.0, 4.0])
    assert start.go_t_ns == 4_000_000_007
    assert changes[-1].remaining_s == 60.0
    assert changes[0].text == "waiting for cars 1, 2 to stand still"


def test_a_start_by_chance_is_the_same_again_with_the_same_seed() -> None:
    """No countdown is told, the start comes within its limits, and only the seed decides when."""
    instants: dict[int, int] = {}
    for seed in (1, 2, 1):
        rules = StartRules(mode=StartMode.GRID, still_s=1.0, countdown_s=1.0, random_s=3.0, seed=seed)
        news, start = started(rules, {1: lambda t: -0.3}, seconds=6)
        assert states_of(news)[1:] == [(RacePhase.COUNTDOWN, None), (RacePhase.RACING, None)]
        assert start.go_t_ns is not None
        assert 2e9 <= start.go_t_ns <= 5e9
        assert instants.setdefault(seed, start.go_t_ns) == start.go_t_ns
    assert instants[1] != instants[2]


@pytest.mark.parametrize(
    ("at", "text"),
    [
        (lambda t: None, "waiting for car 2 to be seen"),
        (lambda t: -0.3 if t < 0.5 else None, "waiting for car 2 to be seen"),
        (lambda t: -1.2, "waiting for car 2 to come to the grid"),
        (lambda t: 0.1, "waiting for car 2 to come to the grid"),
        (lambda t: -1.0 + 0.1 * t, "waiting for car 2 to stand still"),
    ],
    ids=["nowhere", "gone", "before the grid", "behind the line", "moving"],
)
def test_the_race_waits_until_every_car_stands_on_the_grid(at: Where, text: str) -> None:
    """One that is not seen, not there or not still keeps all the others waiting, and is named."""
    news, start = started(GRID, {1: lambda t: -0.3, 2: at}, seconds=6)
    assert start.phase is RacePhase.WAITING
    assert [one.text for one in news if isinstance(one, RaceState)][-1] == text


def test_a_car_that_leaves_the_grid_before_the_countdown_is_waited_for_again() -> None:
    """It goes a round and comes back; its second stand of one second is what counts."""
    news, start = started(GRID, {1: lambda t: -0.3 if t < 0.8 else min(-0.3 + 5 * (t - 0.8), 9.7)}, seconds=8)
    assert jumps_of(news) == []
    # Two seconds to come round, one to stand, three to count.
    assert start.go_t_ns == pytest.approx(6.8e9, abs=0.1e9)


@pytest.mark.parametrize("noise_m", [0.0, 0.004])
def test_a_car_that_moves_before_the_start_has_jumped_it(noise_m: float) -> None:
    """At 1 m/s from 3.5 s on, it was 30 mm away at 3.53 s: told once, with the instant; the other car has done nothing."""

    def shake(t: float) -> float:
        return noise_m * (1 if round(t * FPS) % 2 else -1)

    cars: dict[int, Where] = {1: lambda t: -0.5 + max(0.0, t - 3.5) + shake(t), 2: lambda t: -0.7 + shake(t)}
    news, _ = started(GRID, cars, seconds=5)
    (jump,) = jumps_of(news)
    assert (jump.kind, jump.car, jump.lap, jump.number) == (IncidentKind.JUMP_START, 1, None, 0)
    assert jump.start_s == pytest.approx(3.53, abs=0.001 + 3 * noise_m)
    assert jump.greatest_m is not None
    assert jump.greatest_m > 0.03
    assert jump.text == f"the car moved by more than 30 mm {4.0 - jump.start_s:.2f} s before the start"
    assert states_of(news)[-1] == (RacePhase.RACING, None)


@pytest.mark.parametrize("creep_m", [0.005, 0.01, 0.015, 0.02, 0.025, 0.03])
def test_a_car_that_rolled_out_slowly_has_not_jumped(creep_m: float) -> None:
    """Its rest is where it stood when the countdown began, not where it last counted as moving."""

    def at(t_s: float) -> float:
        shake_m = 0.006 if round(t_s * FPS) % 2 and t_s > 4 else 0.0
        return -0.5 + 0.2 * min(t_s, 1.0) + creep_m * min(max(t_s - 1.0, 0.0) / 0.5, 1.0) + shake_m

    news, _ = started(GRID, {1: at}, seconds=7)
    assert jumps_of(news) == []
    assert states_of(news)[-1] == (RacePhase.RACING, None)


@pytest.mark.parametrize(("away_s", "jumps"), [(3.99, 1), (4.01, 0)])
def test_the_instant_decides_between_two_frames(away_s: float, jumps: int) -> None:
    """The start, at 4.02 s, lies between two frames; at 1.7 m/s the car is off by 30 mm 18 ms after it went."""
    rules = StartRules(mode=StartMode.GRID, still_s=1.0, countdown_s=3.02)
    news, start = started(rules, {1: lambda t: -0.5 + 1.7 * max(0.0, t - away_s)}, seconds=5)
    assert start.go_t_ns == 4_020_000_000
    assert len(jumps_of(news)) == jumps


def test_a_rolling_race_begins_with_the_first_car_and_ends_with_the_last() -> None:
    """The phases follow from the cars' own states."""
    start = StartProcedure(StartRules(), ROUND, cars=(1, 2))
    out, lap, grace, finished, retired = (
        LapState.OUT_LAP, LapState.LAP, LapState.GRACE, LapState.FINISHED, LapState.RETIRED,
    )  # fmt: skip
    steps = [(out, out), (out, out), (lap, out), (lap, lap), (grace, lap), (grace, finished), (retired, finished)]
    phases = []
    for k, (one, two) in enumerate(steps):
        phases.append([news.phase for news in start.step(k, k * 1e-9, {}, {1: one, 2: two})])  # type: ignore[union-attr]
    assert phases == [
        [RacePhase.WAITING], [], [RacePhase.RACING], [], [], [RacePhase.GRACE], [RacePhase.FINISHED],
    ]  # fmt: skip
    assert start.go_t_ns is None
