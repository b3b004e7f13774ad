"""Races that end early, or go on after they ended, through the whole core: when, why, and what the standings then say."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from circle import RADIUS_M, circle_setup, frames, on_circle

from dnb_edge.core import Core
from dnb_edge.race.rules import Effect, FormatRules, LapRules, PenaltyRules, Ranking
from dnb_edge.values import Event, Incident, IncidentKind, Lap, PointM, RacePhase, RaceState, Standing, Standings

OMEGA = 1.2
ANGLE = -0.4
"""The car crosses the start line after a third of a second, and drives a lap in 5.24 s."""

SURVIVAL = FormatRules(time_limit_s=20.0, grace_lap=False, rank_by=Ranking.SURVIVAL)
DRIVING = FormatRules(rank_by=Ranking.DRIVING_SCORE)


def out(*kinds: IncidentKind, free: int = 0) -> PenaltyRules:
    """`kinds` end the race, nothing else costs anything."""
    effects = {kind.value: Effect(dnf=kind in kinds, free=free if kind in kinds else 0) for kind in IncidentKind}
    return PenaltyRules(**effects)


def wide(t_s: float) -> PointM:
    """Leaves the lane for good: it is beyond the margin 8.4 s after the first frame."""
    return on_circle(ANGLE + OMEGA * t_s, RADIUS_M + min(0.3, 0.5 * max(t_s - 8.0, 0.0)))


def round_and_round(t_s: float) -> PointM:
    return on_circle(ANGLE + OMEGA * t_s)


def stuck(t_s: float) -> PointM:
    return on_circle(ANGLE + OMEGA * min(t_s, 8.0))


def turned_back(t_s: float) -> PointM:
    return on_circle(ANGLE + OMEGA * t_s if t_s < 8.0 else ANGLE + OMEGA * 8.0 - 0.8 * (t_s - 8.0))


def gone(t_s: float) -> PointM | None:
    return None if t_s > 8.0 else on_circle(ANGLE + OMEGA * t_s)


def race(position: Callable[[float], PointM | None], *, seconds: float, **rules: object) -> tuple[list[Event], bool]:
    """(all events, whether the race was over before the frames were)."""
    core = Core(circle_setup(**rules))
    events = [event for found in frames(position, seconds=seconds) for event in core.step(found)]
    finished = core.finished
    return events + core.finish(), finished


def last(events: list[Event]) -> Standing:
    (row,) = [event for event in events if isinstance(event, Standings)][-1].rows
    return row


@pytest.mark.parametrize(
    ("position", "kind", "after_s"),
    [
        (wide, IncidentKind.OFF_TRACK, 8.7),
        (stuck, IncidentKind.STALLED, 12.0),
        (turned_back, IncidentKind.WRONG_WAY, 8.5),
        (gone, IncidentKind.LOST, 9.0),
    ],
)
def test_what_ends_a_race_ends_it_while_it_goes_on(
    position: Callable[[float], PointM | None], kind: IncidentKind, after_s: float
) -> None:
    """Who stands outside for ever never comes back: the race is over as soon as it is an incident, and not survived longer."""
    laps = LapRules(stalled_s=4.0)
    events, finished = race(position, seconds=14, laps=laps, format=SURVIVAL, penalties=out(kind))
    assert finished
    (incident,) = (event for event in events if isinstance(event, Incident) and event.kind is kind)
    row = last(events)
    assert row.dnf == incident.text
    start_s = next(event.start_s for event in events if isinstance(event, Lap))
    assert row.value is not None
    assert start_s + row.value == pytest.approx(after_s, abs=0.25)
    over = [event for event in events if isinstance(event, RaceState) and event.phase is RacePhase.FINISHED]
    assert over[0].t_s < after_s + 1.5


def test_free_incidents_do_not_end_a_race() -> None:
    """Of two stands the first is free: the race ends with the second."""

    def twice(t_s: float) -> PointM:
        driven_s = min(t_s, 7.0) + min(max(t_s - 10.0, 0.0), 2.0)
        return on_circle(ANGLE + OMEGA * driven_s)

    rules = out(IncidentKind.STALLED, free=1)
    events, finished = race(twice, seconds=17, laps=LapRules(stalled_s=2.0), format=SURVIVAL, penalties=rules)
    stands = [event for event in events if isinstance(event, Incident)]
    assert finished
    assert len(stands) == 2
    assert last(events).dnf == stands[1].text


def test_an_incident_that_ends_the_race_does_so_in_the_last_lap_too() -> None:
    """It is known only with the crossing that completes the lap, which is the last one or not."""

    for wanted in (1, 2):
        penalties = out(IncidentKind.TOO_SLOW)
        laps = LapRules(laps=wanted, max_lap_s=5.2)
        events, _ = race(round_and_round, seconds=12, laps=laps, penalties=penalties)
        assert last(events).dnf is not None, wanted


def test_what_was_driven_before_the_end_keeps_its_worth() -> None:
    """A lap and 46 % of the next of three are 49 %: before the car's race ended, after it, and where nobody drives on."""
    laps = LapRules(laps=3, stalled_s=4.0)
    ended, _ = race(stuck, seconds=14, laps=laps, format=DRIVING, penalties=out(IncidentKind.STALLED))
    stopped, _ = race(stuck, seconds=10, laps=laps, format=DRIVING)
    for events in (ended, stopped):
        row = last(events)
        assert row.value == pytest.approx(100 * (1 + (8.0 - 5.57) / 5.236) / 3, abs=0.5)


def test_what_a_car_does_after_its_race_counts_for_nothing() -> None:
    """A car that drives on after the time was up did not get further."""
    results = []
    for seconds in (25, 40):
        core = Core(circle_setup(format=SURVIVAL))
        for found in frames(round_and_round, seconds=seconds):
            core.step(found)
        assert core.finished
        results.append(core.results()[0])
    assert results[0].distance_m == results[1].distance_m == pytest.approx(20.0 * OMEGA, abs=0.1)
