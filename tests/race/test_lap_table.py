"""The lap machine's table: what is legal, and what a crossing means."""

from __future__ import annotations

import itertools

import pytest

from dnb_edge.race.fix import Fix
from dnb_edge.race.laps import TRANSITIONS, LapMachine, LapState, Passing, longest_s
from dnb_edge.race.rules import LapRules
from dnb_edge.values import Crossing, Direction

ROUTE_M = 10.0


def crossing(t_s: float, direction: Direction = Direction.FORWARD, line: str = "start") -> Crossing:
    return Crossing(
        t_ns=round(t_s * 1e9),
        t_s=t_s,
        line=line,
        direction=direction,
        sigma_s=0.003,
        track_m=(0.0, 0.0),
        target_id=1,
        estimated=False,
    )


def fix(t_s: float, progress_m: float, outside_m: float = -0.1) -> Fix:
    return Fix(
        t_ns=round(t_s * 1e9),
        t_s=t_s,
        target_id=1,
        observed_m=(0.0, 0.0),
        covariance_m2=(1e-6, 0.0, 1e-6),
        track_m=(0.0, 0.0),
        s_m=progress_m % ROUTE_M,
        d_m=0.0,
        outside_m=outside_m,
        progress_m=progress_m,
    )


def drive(machine: LapMachine, start_s: float, end_s: float, speed_mps: float) -> None:
    """Ten frames a second at constant speed."""
    for k in range(round(start_s * 10), round(end_s * 10)):
        machine.frame(k * 100_000_000)
        machine.fix(fix(k / 10, speed_mps * k / 10))


def test_every_legal_step_stands_in_the_table_and_no_other() -> None:
    """The table is what it is; a step outside it is an error."""
    legal = set(TRANSITIONS)
    every = set(itertools.product(LapState, Passing))
    assert every - legal == {
        (LapState.OUT_LAP, Passing.LAP_DONE),
        (LapState.OUT_LAP, Passing.ARRIVED),
        (LapState.OUT_LAP, Passing.ANEW),
        (LapState.OUT_LAP, Passing.RUN_DONE),
        (LapState.LAP, Passing.START),
        (LapState.FINISHED, Passing.START),
        (LapState.FINISHED, Passing.LAP_DONE),
        (LapState.FINISHED, Passing.ARRIVED),
        (LapState.FINISHED, Passing.ANEW),
        (LapState.FINISHED, Passing.RUN_DONE),
    }


def test_a_full_lap_is_counted_with_its_time_and_sigma() -> None:
    """Ten metres round the route between two crossings make one valid lap."""
    machine = LapMachine(LapRules(), ROUTE_M)
    machine.crossed(crossing(0.0))
    drive(machine, 0.1, 10.0, 1.0)
    driven = machine.crossed(crossing(9.95))
    assert driven is not None
    assert (driven.lap.number, driven.lap.valid, driven.lap.observed_fraction) == (1, True, 1.0)
    assert driven.lap.time_s == pytest.approx(9.95)
    assert driven.lap.sigma_s == pytest.approx(0.003 * 2**0.5)


@pytest.mark.parametrize(
    ("t_s", "speed_mps", "rules", "why"),
    [
        (1.0, 10.0, LapRules(min_lap_s=2.0), "earlier than the minimum lap"),
        (9.0, 0.2, LapRules(), "without having driven round the route"),
        (9.0, -1.0, LapRules(), "having driven round the wrong way"),
    ],
)
def test_a_forward_crossing_is_no_lap(t_s: float, speed_mps: float, rules: LapRules, why: str) -> None:
    """A forward crossing that comes too early or without a lap driven changes nothing."""
    machine = LapMachine(rules, ROUTE_M)
    machine.crossed(crossing(0.0))
    drive(machine, 0.0, t_s, speed_mps)
    assert machine.crossed(crossing(t_s)) is None, why
    assert machine.state is LapState.LAP


def test_a_reverse_crossing_changes_nothing() -> None:
    """Neither the out-lap nor a running lap cares for a crossing backwards."""
    machine = LapMachine(LapRules(), ROUTE_M)
    assert machine.crossed(crossing(0.0, Direction.REVERSE)) is None
    assert machine.state is LapState.OUT_LAP
    machine.crossed(crossing(1.0))
    drive(machine, 1.0, 11.0, 1.0)
    assert machine.crossed(crossing(10.0, Direction.REVERSE)) is None
    driven = machine.crossed(crossing(10.95))
    assert driven is not None
    assert driven.lap.start_s == 1.0


def test_a_lap_that_went_twice_round_is_not_valid_and_says_so() -> None:
    """Where a crossing was missed, two laps do not pass for one."""
    machine = LapMachine(LapRules(), ROUTE_M)
    machine.crossed(crossing(0.0))
    drive(machine, 0.1, 20.0, 1.0)
    driven = machine.crossed(crossing(19.95))
    assert driven is not None
    assert not driven.lap.valid
    assert "a crossing of the start line was missed" in driven.lap.reasons[0]


def test_nothing_is_counted_after_the_last_lap() -> None:
    """A finished run stays finished."""
    machine = LapMachine(LapRules(laps=1), ROUTE_M)
    machine.crossed(crossing(0.0))
    drive(machine, 0.0, 10.0, 1.0)
    assert machine.crossed(crossing(9.95)) is not None
    assert machine.state is LapState.FINISHED
    drive(machine, 10.0, 20.0, 1.0)
    assert machine.crossed(crossing(19.95)) is None


def test_a_finish_line_ends_the_lap_and_begins_none() -> None:
    """Start to finish is a lap; then the car is on an out-lap, and the next start begins the next one."""
    machine = LapMachine(LapRules(), ROUTE_M, has_finish_line=True)
    for k in range(2):
        begin_s = 20.0 * k
        assert machine.crossed(crossing(begin_s, line="finish")) is None
        assert machine.state is LapState.OUT_LAP
        assert machine.crossed(crossing(begin_s + 0.05)) is None
        drive(machine, begin_s + 0.1, begin_s + 10.0, 1.0)
        driven = machine.crossed(crossing(begin_s + 9.95, line="finish"))
        assert driven is not None
        assert (driven.lap.number, driven.lap.start_s) == (k + 1, begin_s + 0.05)
        assert machine.state is LapState.OUT_LAP


def test_the_start_line_before_the_finish_line_begins_the_lap_anew() -> None:
    """A run that was given up leaves nothing behind: time and way count from the later start."""
    machine = LapMachine(LapRules(), ROUTE_M, has_finish_line=True)
    machine.crossed(crossing(0.0))
    drive(machine, 0.1, 6.0, 1.0)
    assert machine.crossed(crossing(6.0)) is None
    assert machine.state is LapState.LAP
    drive(machine, 6.1, 9.0, 1.0)
    assert machine.crossed(crossing(9.0, line="finish")) is None, "only three metres since"
    drive(machine, 9.0, 16.0, 1.0)
    driven = machine.crossed(crossing(15.95, line="finish"))
    assert driven is not None
    assert driven.lap.start_s == 6.0


def test_the_last_run_to_the_finish_line_ends_the_race() -> None:
    """With a finish line of its own, too."""
    machine = LapMachine(LapRules(laps=1), ROUTE_M, has_finish_line=True)
    machine.crossed(crossing(0.0))
    drive(machine, 0.1, 10.0, 1.0)
    assert machine.crossed(crossing(9.95, line="finish")) is not None
    assert machine.state is LapState.FINISHED


def test_longest_time_off_the_lane_is_that_of_one_stretch() -> None:
    """Several short excursions are not added up."""
    fixes = [fix(k / 10, k / 10, 0.1 if k in (1, 2, 3, 7, 8) else -0.1) for k in range(10)]
    assert longest_s(fixes, lambda one: one.outside_m > 0) == pytest.approx(0.2)


@pytest.mark.parametrize("bad", [{"laps": 0}, {"min_progress": 1.5}, {"max_gap_s": 0.0}, {"min_lap_s": -1.0}])
def test_rules_that_make_no_sense_are_refused(bad: dict[str, float]) -> None:
    """Each impossible rule is an error at once."""
    with pytest.raises(ValueError, match="race"):
        LapRules(**bad)  # type: ignore[arg-type]
