"""The lap machine's table: what is legal, and what a crossing means."""

from __future__ import annotations

import itertools
import math

import pytest

from dnb_edge.race.fix import Fix
from dnb_edge.race.lap_table import RUNNING, STATUS, TRANSITIONS, LapState, Passing
from dnb_edge.race.laps import Course, DrivenLap, LapMachine, Passed
from dnb_edge.race.rules import FormatRules, LapRules
from dnb_edge.values import Crossing, Direction, Incident, IncidentKind, PassStatus

ROUTE_M = 10.0


JUMP = Incident(
    number=0,
    kind=IncidentKind.JUMP_START,
    car=0,
    target_id=1,
    lap=None,
    start_t_ns=0,
    end_t_ns=0,
    start_s=0.0,
    lasted_s=0.0,
    greatest_m=0.05,
    worst_t_ns=0,
    track_m=(0.0, 0.0),
    camera_px=None,
    s_m=None,
    text="the car moved before the start",
)


def machine_of(rules: LapRules | None = None, *, has_finish_line: bool = False, **how: object) -> LapMachine:
    course = Course(lap_m=ROUTE_M, has_finish_line=has_finish_line)
    return LapMachine(rules or LapRules(), course, **how)  # type: ignore[arg-type]


def lap_of(passed: list[Passed]) -> DrivenLap | None:
    return next((one for one in passed if isinstance(one, DrivenLap)), None)


def told_of(passed: list[Passed]) -> Crossing:
    (crossing,) = [one for one in passed if isinstance(one, Crossing)]
    return crossing


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
        observed_m=(progress_m, 0.0),
        covariance_m2=(1e-6, 0.0, 1e-6),
        track_m=(progress_m, 0.0),
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
    every = set(itertools.product(LapState, Passing))
    before, out, lap, grace, finished, retired = LapState
    assert every - set(TRANSITIONS) == {
        *((before, passing) for passing in Passing if passing not in ("go", "jumped", "not_a_lap", "retired")),
        *((out, p) for p in ("jumped", "lap_done", "arrived", "anew", "too_late", "run_done", "sector")),
        *((lap, passing) for passing in ("jumped", "start", "too_late")),
        *((grace, p) for p in ("go", "jumped", "start", "lap_done", "arrived", "anew", "time_up", "cut_off")),
        *((finished, passing) for passing in Passing if passing not in ("not_a_lap", "retired")),
        *((retired, passing) for passing in Passing if passing not in ("go", "jumped", "not_a_lap", "retired")),
    }
    with pytest.raises(KeyError):
        machine_of().jumped(None)  # type: ignore[arg-type]


def test_what_begins_a_lap_leads_to_one_and_what_ends_the_race_does_not() -> None:
    """The table and the statuses agree: after START and LAP a lap runs, after ARRIVED none does."""
    for (_, passing), state in TRANSITIONS.items():
        if STATUS.get(passing) in (PassStatus.START, PassStatus.LAP):
            assert state in RUNNING
        if STATUS.get(passing) is PassStatus.ARRIVED:
            assert state not in RUNNING


def test_a_full_lap_is_counted_with_its_time_and_sigma() -> None:
    """Ten metres round the route between two crossings make one valid lap."""
    machine = machine_of()
    assert told_of(machine.crossed(crossing(0.0))).status is PassStatus.START
    drive(machine, 0.1, 10.0, 1.0)
    told = machine.crossed(crossing(9.95))
    assert (told_of(told).status, told_of(told).lap, told_of(told).reason) == (PassStatus.LAP, 1, None)
    driven = lap_of(told)
    assert driven is not None
    assert (driven.lap.number, driven.lap.valid, driven.lap.observed_fraction) == (1, True, 1.0)
    assert driven.lap.time_s == pytest.approx(9.95)
    assert driven.lap.sigma_s == pytest.approx(0.003 * 2**0.5)
    assert driven.incidents == ()


@pytest.mark.parametrize(
    ("t_s", "speed_mps", "rules", "reason"),
    [
        (0.8, 10.0, LapRules(), "0.8 s after the lap's start, less than race.min_lap_s, 2 s"),
        (9.0, 0.38, LapRules(), "only 33 % of the route driven since the lap's start"),
        (9.0, -1.0, LapRules(), "only 0 % of the route driven since the lap's start"),
    ],
)
def test_a_forward_crossing_is_no_lap(t_s: float, speed_mps: float, rules: LapRules, reason: str) -> None:
    """A forward crossing that comes too early or without a lap driven changes nothing and says why."""
    machine = machine_of(rules)
    machine.crossed(crossing(0.0))
    drive(machine, 0.0, t_s, speed_mps)
    told = machine.crossed(crossing(t_s))
    assert lap_of(told) is None
    assert (told_of(told).status, told_of(told).reason, told_of(told).lap) == (PassStatus.IGNORED, reason, 1)
    assert machine.state is LapState.LAP


def test_a_reverse_crossing_changes_nothing() -> None:
    """Neither the out-lap nor a running lap cares for a crossing backwards."""
    machine = machine_of()
    told = told_of(machine.crossed(crossing(0.0, Direction.REVERSE)))
    assert (told.status, told.reason, told.lap) == (PassStatus.IGNORED, "backwards", None)
    assert machine.state is LapState.OUT_LAP
    machine.crossed(crossing(1.0))
    drive(machine, 1.0, 11.0, 1.0)
    assert told_of(machine.crossed(crossing(10.0, Direction.REVERSE))).lap == 1
    driven = lap_of(machine.crossed(crossing(10.95)))
    assert driven is not None
    assert driven.lap.start_s == 1.0


def test_a_lap_that_went_twice_round_says_that_a_crossing_was_missed() -> None:
    """Where a crossing was missed, two laps do not pass for one without a word."""
    machine = machine_of()
    machine.crossed(crossing(0.0))
    drive(machine, 0.1, 20.0, 1.0)
    driven = lap_of(machine.crossed(crossing(19.95)))
    assert driven is not None
    (incident,) = driven.incidents
    assert incident.kind is IncidentKind.MISSED_LINE
    assert incident.text == "the car drove 2.0 times round the route: a crossing of the start line was missed"


def test_nothing_is_counted_after_the_last_lap() -> None:
    """A finished run stays finished, and says so of every crossing."""
    machine = machine_of(LapRules(laps=1))
    machine.crossed(crossing(0.0))
    drive(machine, 0.0, 10.0, 1.0)
    told = machine.crossed(crossing(9.95))
    assert told_of(told).status is PassStatus.ARRIVED
    assert lap_of(told) is not None
    assert machine.state is LapState.FINISHED
    drive(machine, 10.0, 20.0, 1.0)
    told = machine.crossed(crossing(19.95))
    assert lap_of(told) is None
    assert told_of(told).reason == "the race was over: all 1 laps were driven"


def test_a_finish_line_ends_the_lap_and_begins_none() -> None:
    """Start to finish is a lap; then the car is on an out-lap, and the next start begins the next one."""
    machine = machine_of(has_finish_line=True)
    for k in range(2):
        begin_s = 20.0 * k
        early = told_of(machine.crossed(crossing(begin_s, line="finish")))
        assert early.reason == "no lap ran: the start line was not crossed before"
        assert machine.state is LapState.OUT_LAP
        assert told_of(machine.crossed(crossing(begin_s + 0.05))).lap == k + 1
        drive(machine, begin_s + 0.1, begin_s + 10.0, 1.0)
        told = machine.crossed(crossing(begin_s + 9.95, line="finish"))
        driven = lap_of(told)
        assert told_of(told).status is PassStatus.ARRIVED
        assert driven is not None
        assert (driven.lap.number, driven.lap.start_s) == (k + 1, begin_s + 0.05)
        assert machine.state is LapState.OUT_LAP


def test_the_start_line_before_the_finish_line_begins_the_lap_anew() -> None:
    """A run that was given up leaves nothing behind: time and way count from the later start."""
    machine = machine_of(has_finish_line=True)
    machine.crossed(crossing(0.0))
    drive(machine, 0.1, 6.0, 1.0)
    told = machine.crossed(crossing(6.0))
    assert (told_of(told).status, told_of(told).lap, lap_of(told)) == (PassStatus.START, 1, None)
    drive(machine, 6.1, 9.0, 1.0)
    assert lap_of(machine.crossed(crossing(9.0, line="finish"))) is None, "only three metres since"
    drive(machine, 9.0, 16.0, 1.0)
    driven = lap_of(machine.crossed(crossing(15.95, line="finish")))
    assert driven is not None
    assert driven.lap.start_s == 6.0


def test_the_last_run_to_the_finish_line_ends_the_race() -> None:
    """With a finish line of its own, too."""
    machine = machine_of(LapRules(laps=1), has_finish_line=True)
    machine.crossed(crossing(0.0))
    drive(machine, 0.1, 10.0, 1.0)
    assert lap_of(machine.crossed(crossing(9.95, line="finish"))) is not None
    assert machine.state is LapState.FINISHED


def rounds(machine: LapMachine, ends_s: list[float], speed_mps: float = 1.0) -> list[Passed]:
    """Drives with a crossing at each of `ends_s`; everything that is told."""
    told: list[Passed] = []
    since = 0.0
    for end_s in ends_s:
        drive(machine, since, end_s + 0.05, speed_mps)
        told += machine.crossed(crossing(end_s))
        since = math.floor(end_s * 10) / 10 + 0.1
    return told


@pytest.mark.parametrize(
    ("grace", "statuses", "laps", "why"),
    [
        (True, ["start", "lap", "arrived", "ignored"], 2, "the time was up"),
        (False, ["start", "lap", "ignored", "ignored"], 1, "the time was up, and the lap that ran was given up"),
    ],
)
def test_when_the_time_is_up_the_running_lap_may_end_or_not(
    grace: bool, statuses: list[str], laps: int, why: str
) -> None:
    """Fifteen seconds from the first crossing: the second lap runs then, and only a grace lap lets it end."""
    machine = machine_of(format_rules=FormatRules(time_limit_s=15.0, grace_lap=grace))
    told = rounds(machine, [0.05, 10.05, 20.05, 30.05])
    assert [str(one.status) for one in told if isinstance(one, Crossing)] == statuses
    assert sum(isinstance(one, DrivenLap) for one in told) == laps
    assert machine.state is LapState.FINISHED
    assert machine.over == why
    assert told[-1].reason == f"the race was over: {why}"  # type: ignore[union-attr]


def test_the_time_is_up_without_a_crossing_too() -> None:
    """Frames alone end the race; the board can tell that the last lap runs."""
    machine = machine_of(format_rules=FormatRules(time_limit_s=5.0))
    machine.crossed(crossing(0.05))
    drive(machine, 0.1, 5.0, 1.0)
    machine.settle(round(5.0e9))
    before = machine.state
    drive(machine, 5.0, 5.3, 1.0)
    machine.settle(round(5.2e9))
    assert (before, machine.state) == (LapState.LAP, LapState.GRACE)
    assert machine.running is not None
    assert machine.running.number == 1
    assert machine.running.elapsed_s(round(5.2e9)) == pytest.approx(5.15)


def test_from_the_grid_crossings_count_from_the_start_on_and_the_time_from_there() -> None:
    """What is crossed before the start begins no lap; the limit runs from the start, not from the first crossing."""
    machine = machine_of(format_rules=FormatRules(time_limit_s=15.0), grid=True)
    early = told_of(machine.crossed(crossing(0.05)))
    assert (early.status, early.reason) == (PassStatus.IGNORED, "the start was not given yet")
    machine.go(round(1e9))
    assert machine.limit_t_ns == round(16e9)
    assert told_of(machine.crossed(crossing(0.9))).reason == "the start was not given yet"
    assert told_of(machine.crossed(crossing(2.0))).status is PassStatus.START
    assert machine.limit_t_ns == round(16e9)


def test_a_car_that_jumped_the_start_races_and_carries_the_incident_into_its_first_lap() -> None:
    """Its crossing before the start counts; the incident is numbered, and is the first lap's alone."""
    machine = machine_of(grid=True)
    jump = machine.jumped(JUMP)
    assert (jump.number, jump.car) == (1, 1)
    assert machine.state is LapState.OUT_LAP
    machine.crossed(crossing(0.05))
    machine.go(round(0.5e9))
    told = rounds(machine, [10.05, 20.05])
    assert [one.incidents for one in told if isinstance(one, DrivenLap)] == [(jump,), ()]


def test_a_car_that_retires_is_out_and_says_why() -> None:
    """Its running lap is given up; what it crosses later changes nothing."""
    machine = machine_of()
    rounds(machine, [0.05])
    drive(machine, 0.1, 5.0, 1.0)
    assert machine.retire(round(5e9), "a judge took it out") == []
    assert (machine.state, machine.running) == (LapState.RETIRED, None)
    assert told_of(machine.crossed(crossing(9.0))).reason == (
        "the race was over: the car has retired: a judge took it out"
    )
    assert machine.retire(round(6e9), "again") == []
    assert machine.over == "the car has retired: a judge took it out"


def test_fixes_that_were_looked_at_too_early_belong_to_the_lap_in_which_they_lie() -> None:
    """A crossing that is told after a long wait divides the fixes where it was, not where it was told."""
    machine = machine_of()
    machine.crossed(crossing(0.05))
    drive(machine, 0.1, 14.0, 1.0)
    machine.settle(round(14e9))
    first = lap_of(machine.crossed(crossing(10.05)))
    drive(machine, 14.0, 20.1, 1.0)
    second = lap_of(machine.crossed(crossing(20.05)))
    assert first is not None
    assert second is not None
    assert [first.fixes[-1].t_s, second.fixes[0].t_s, second.fixes[-1].t_s] == [10.0, 10.1, 20.0]
    assert (first.lap.observed_fraction, second.lap.observed_fraction) == (1.0, 1.0)
    assert second.incidents == ()


def test_what_began_after_a_crossing_that_was_told_late_belongs_to_the_next_lap() -> None:
    """The car leaves the lane at 11 s; that the lap had ended at 10.05 s is told at 14 s."""
    machine = machine_of()
    machine.crossed(crossing(0.05))
    for k in range(1, 201):
        machine.frame(k * 100_000_000)
        machine.fix(fix(k / 10, k / 10, 0.3 if 110 <= k <= 150 else -0.1))
        if k == 140:
            machine.settle(round(14e9))
            first = lap_of(machine.crossed(crossing(10.05)))
    second = lap_of(machine.crossed(crossing(20.0)))
    assert first is not None
    assert second is not None
    assert first.incidents == ()
    (incident,) = second.incidents
    assert (incident.kind, incident.start_s) == (IncidentKind.OFF_TRACK, 11.0)
    assert incident.lasted_s == pytest.approx(4.0)


def test_the_latest_fix_waits_for_the_next_one() -> None:
    """A crossing may come to lie just before the fix that was not through the line yet: every frame is in its own lap."""
    machine = machine_of()
    laps = []
    due_s = [0.05, 9.98, 19.98]
    for k in range(203):
        machine.frame(k * 100_000_000)
        machine.fix(fix(k / 10, k / 10))
        if due_s and k / 10 >= due_s[0] + 0.05:
            laps += [one for one in machine.crossed(crossing(due_s.pop(0))) if isinstance(one, DrivenLap)]
        machine.settle(k * 100_000_000)
    assert [one.lap.observed_fraction for one in laps] == [1.0, 1.0]
    assert [(one.fixes[0].t_s, one.fixes[-1].t_s) for one in laps] == [(0.1, 9.9), (10.0, 19.9)]


@pytest.mark.parametrize("bad", [{"laps": 0}, {"min_progress": 1.5}, {"max_gap_s": 0.0}, {"min_lap_s": -1.0}])
def test_rules_that_make_no_sense_are_refused(bad: dict[str, float]) -> None:
    """Each impossible rule is an error at once."""
    with pytest.raises(ValueError, match="race"):
        LapRules(**bad)  # type: ignore[arg-type]
