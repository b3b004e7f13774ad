"""A race from the grid through the whole core: standing cars, countdown, start, and who moved too early."""

from __future__ import annotations

import math

import pytest
from circle import circle_setup, frames, on_circle
from test_core_cars import BLUE, RED, TWO
from test_core_cars import race as race_of

from dnb_edge.core import Core
from dnb_edge.race.rules import CarSetup, FormatRules, LapRules, StartMode, StartRules
from dnb_edge.values import Crossing, Event, Incident, IncidentKind, Lap, RacePhase, RaceState, Standings

GRID = StartRules(mode=StartMode.GRID, grid_m=1.0, still_s=1.0, countdown_s=2.0)
OMEGA = 1.2
RAMP_S = 0.5
"""Time from standing to full speed."""


def standing_start(t_s: float, *, moves_at_s: float, angle_rad: float = -0.3) -> tuple[float, float]:
    """Stands before the line, then gathers speed and drives."""
    gone_s = max(0.0, t_s - moves_at_s)
    driven_s = gone_s**2 / (2 * RAMP_S) if gone_s < RAMP_S else gone_s - RAMP_S / 2
    return on_circle(angle_rad + OMEGA * driven_s)


def race(moves_at_s: float, *, seconds: float = 24, **rules: object) -> list[Event]:
    core = Core(circle_setup(start=GRID, laps=LapRules(laps=2), **rules))
    position = lambda t: standing_start(t, moves_at_s=moves_at_s)  # noqa: E731
    events = [event for found in frames(position, seconds=seconds, noise_px=0.3) for event in core.step(found)]
    return events + core.finish()


def test_standing_cars_start_the_countdown_and_race_from_the_signal() -> None:
    """A car that was put on the grid and never moved is a car; after the countdown its laps count from its crossings."""
    events = race(moves_at_s=12.0)
    phases = [event.phase for event in events if isinstance(event, RaceState)]
    assert list(dict.fromkeys(phases)) == [
        RacePhase.WAITING,
        RacePhase.COUNTDOWN,
        RacePhase.RACING,
        RacePhase.FINISHED,
    ]
    counted = [event.countdown_s for event in events if isinstance(event, RaceState) and event.countdown_s is not None]
    assert counted == [2.0, 1.0]
    (go,) = (event for event in events if isinstance(event, RaceState) and event.phase is RacePhase.RACING)
    assert go.t_s < 12.0
    laps = [event for event in events if isinstance(event, Lap)]
    assert [lap.time_s for lap in laps] == pytest.approx([2 * math.pi / OMEGA] * 2, abs=0.01)
    assert all(lap.valid for lap in laps), [lap.reasons for lap in laps]
    assert laps[0].start_s == pytest.approx(12.0 + 0.3 / OMEGA + RAMP_S / 2, abs=0.01)
    assert not [event for event in events if isinstance(event, Incident) and event.kind is IncidentKind.JUMP_START]


def test_who_moves_before_the_signal_has_jumped_the_start() -> None:
    """The jump is told with its instant, and costs the first lap, no other."""
    standing = race(moves_at_s=100.0, seconds=12)
    (counting, *_) = (e for e in standing if isinstance(e, RaceState) and e.phase is RacePhase.COUNTDOWN)
    moves_at_s = counting.t_s + 1.0
    events = race(moves_at_s=moves_at_s)
    (jump,) = (event for event in events if isinstance(event, Incident) and event.kind is IncidentKind.JUMP_START)
    assert jump.start_s == pytest.approx(moves_at_s + math.sqrt(2 * RAMP_S * 0.03 / OMEGA), abs=0.05)
    laps = [event for event in events if isinstance(event, Lap)]
    assert [lap.valid for lap in laps] == [False, True]
    assert laps[0].reasons == (jump.text,)


def test_the_time_limit_ends_the_race_with_a_grace_lap() -> None:
    """When the time is up the running lap is finished and counts, and no other begins."""
    core = Core(circle_setup(start=GRID, format=FormatRules(time_limit_s=8.0)))
    position = lambda t: standing_start(t, moves_at_s=12.0)  # noqa: E731
    events = [event for found in frames(position, seconds=40) for event in core.step(found)]
    assert core.finished
    (go,) = (event for event in events if isinstance(event, RaceState) and event.phase is RacePhase.RACING)
    laps = [event for event in events if isinstance(event, Lap)]
    assert laps[-1].start_s < go.t_s + 8.0 < laps[-1].start_s + laps[-1].time_s
    assert RacePhase.GRACE in [event.phase for event in events if isinstance(event, RaceState)]


def test_two_cars_are_numbered_by_colour_and_ranked() -> None:
    """The blue car crosses first and is still car 2 of the list; the standings name both and put the faster one first."""
    setup = circle_setup(
        motion=TWO, cars=(CarSetup(name="Red", colour_bgr=RED), CarSetup(name="Blue", colour_bgr=BLUE))
    )
    slow = lambda t: on_circle(-0.9 + 0.9 * t, 1.08)  # noqa: E731
    fast = lambda t: on_circle(-0.4 + 1.5 * t, 0.92)  # noqa: E731
    events = race_of(setup, [(slow, RED), (fast, BLUE)], seconds=20)
    crossings = [event for event in events if isinstance(event, Crossing)]
    assert crossings[0].car == 2
    final = [event for event in events if isinstance(event, Standings)][-1]
    assert final.final
    assert [(row.place, row.name, row.tied) for row in final.rows] == [(1, "Blue", False), (2, "Red", False)]
    assert final.rows[1].gap == pytest.approx(2 * math.pi / 0.9 - 2 * math.pi / 1.5, abs=0.02)


def test_cars_without_description_are_numbered_in_the_order_of_their_first_crossing() -> None:
    """Whoever crosses first is car 1, though the other one was seen before it."""
    late = lambda t: on_circle(-2.5 + 0.9 * t, 1.08)  # noqa: E731
    early = lambda t: on_circle(-0.9 + 0.9 * t, 0.92) if t > 0.5 else None  # noqa: E731
    events = race_of(circle_setup(motion=TWO), [(late, RED), (early, BLUE)], seconds=10)
    crossings = [event for event in events if isinstance(event, Crossing)]
    assert [crossing.car for crossing in crossings][:2] == [1, 2]
