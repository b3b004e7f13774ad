"""What incidents cost, and that it can be taken back."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.race.penalties import (
    charged_to,
    counted,
    judged,
    judged_run,
    penalties_of,
    retires,
    unjudged,
    with_penalties,
)
from dnb_edge.race.rules import Effect, PenaltyRules
from dnb_edge.values import Incident, IncidentKind, Lap, Penalty

SECOND_NS = 1_000_000_000


def lap(number: int = 1, time_s: float = 10.0, **fields: Any) -> Lap:
    given: dict[str, Any] = {
        "number": number,
        "start_t_ns": round((number - 1) * time_s * SECOND_NS),
        "end_t_ns": round(number * time_s * SECOND_NS),
        "start_s": (number - 1) * time_s,
        "time_s": time_s,
        "sigma_s": 0.002,
        "valid": True,
        "reasons": (),
        "similarity_percent": 90.0,
        "observed_fraction": 1.0,
    }
    return Lap(**given | fields)


def incident(kind: IncidentKind, number: int = 1, of_lap: int | None = 1, *, start_t_ns: int | None = None) -> Incident:
    began_ns = ((of_lap or 1) - 1) * 10 * SECOND_NS + number if start_t_ns is None else start_t_ns
    return Incident(
        number=number,
        kind=kind,
        car=1,
        target_id=1,
        lap=of_lap,
        start_t_ns=began_ns,
        end_t_ns=began_ns + 1,
        start_s=0.0,
        lasted_s=0.4,
        greatest_m=0.1,
        worst_t_ns=began_ns,
        track_m=(0.0, 0.0),
        camera_px=None,
        s_m=0.0,
        text=f"{kind.value} {number}",
    )


OFF, CUT, STALLED = IncidentKind.OFF_TRACK, IncidentKind.SHORT_CUT, IncidentKind.STALLED


@pytest.mark.parametrize(
    ("effect", "seconds", "factor", "valid", "penalties"),
    [
        (Effect(), 0.0, 1.0, True, 0),
        (Effect(seconds=3.0), 6.0, 1.0, True, 2),
        (Effect(factor=0.8), 0.0, 0.64, True, 2),
        (Effect(factor=0.0), 0.0, 0.0, True, 2),
        (Effect(invalid=True), 0.0, 1.0, False, 2),
        (Effect(dnf=True), 0.0, 1.0, True, 2),
        (Effect(seconds=3.0, free=1), 3.0, 1.0, True, 1),
        (Effect(seconds=3.0, free=2), 0.0, 1.0, True, 0),
    ],
)
def test_each_effect_does_what_it_says(
    effect: Effect, seconds: float, factor: float, valid: bool, penalties: int
) -> None:
    """Twice off the track in one lap: what it adds, multiplies and invalidates; the measured time stays as it was."""
    told = (incident(OFF, 1), incident(OFF, 2))
    result = judged(lap(), told, PenaltyRules(off_track=effect))
    assert (result.penalty_s, result.valid, len(result.penalties)) == (seconds, valid, penalties)
    assert result.penalty_factor == pytest.approx(factor)
    assert (result.time_s, result.sigma_s, result.official_time_s) == (10.0, 0.002, 10.0 + seconds)
    assert result.reasons == (() if valid else ("off_track 1", "off_track 2"))


def test_a_penalty_names_its_incident() -> None:
    """So that the evidence can be found."""
    (penalty,) = penalties_of([incident(CUT, 7)], PenaltyRules(), {})
    assert (penalty.offence, penalty.incident, penalty.reason) == ("short_cut", 7, "short_cut 7")


def test_what_is_free_is_counted_over_the_run_and_by_kind() -> None:
    """Two are free: of the third lap's incident it matters how many went before, and only of its kind."""
    rules = PenaltyRules(off_track=Effect(seconds=1.0, free=2), stalled=Effect(seconds=5.0, free=1))
    for before, costs in ((0, 0.0), (1, 0.0), (2, 1.0), (9, 1.0)):
        assert judged(lap(3), [incident(OFF)], rules, {OFF: before}).penalty_s == costs
    assert judged(lap(3), [incident(OFF)], rules, {STALLED: 9}).penalty_s == 0.0


def test_reasons_of_the_lap_itself_stay() -> None:
    """What the lap machine found wrong is not the penalties' to forgive."""
    wrong = lap(valid=False, reasons=("the car drove 2.0 times round the route",))
    result = judged(wrong, [incident(OFF)], PenaltyRules())
    assert result.reasons == ("the car drove 2.0 times round the route", "off_track 1")
    assert unjudged(result) == wrong


def test_a_judge_adds_to_what_is_there() -> None:
    """A judge's penalty comes after the incidents', with the same sums."""
    judge = Penalty(offence="judge", seconds=2.0, factor=0.5, reason="touched by hand")
    result = with_penalties(judged(lap(), [incident(OFF)], PenaltyRules(off_track=Effect(seconds=1.0))), [judge])
    assert (result.penalty_s, result.official_time_s, result.penalty_factor) == (3.0, 13.0, 0.5)


effects = st.builds(
    Effect,
    seconds=st.floats(0, 100),
    factor=st.floats(0, 1),
    invalid=st.booleans(),
    dnf=st.booleans(),
    free=st.integers(0, 3),
)
rule_sets = st.builds(PenaltyRules, **{kind.value: effects for kind in IncidentKind})
runs = st.lists(st.tuples(st.sampled_from(list(IncidentKind)), st.sampled_from([None, 1, 2, 3, 4])), max_size=12).map(
    lambda told: [incident(kind, number, of_lap) for number, (kind, of_lap) in enumerate(told, start=1)]
)


@given(told=runs, first=rule_sets, second=rule_sets)
def test_judging_again_starts_from_the_raw_lap(told: list[Incident], first: PenaltyRules, second: PenaltyRules) -> None:
    """Under other rules a judged lap is what it would have been without the first judgement, and it can be undone."""
    raw = lap()
    once = judged(raw, told, first)
    assert unjudged(once) == raw
    assert judged(once, told, second) == judged(raw, told, second)


@given(told=runs, rules=rule_sets)
def test_a_penalty_never_helps(told: list[Incident], rules: PenaltyRules) -> None:
    """No time gets shorter, no score greater, no invalid lap valid."""
    result = judged(lap(), told, rules)
    assert result.official_time_s is not None
    assert result.official_time_s >= result.time_s
    assert 0 <= result.penalty_factor <= 1
    assert result.valid or result.reasons


@given(told=runs, rules=rule_sets)
def test_a_run_is_judged_at_its_end_as_lap_by_lap(told: list[Incident], rules: PenaltyRules) -> None:
    """Where incidents are told in the order of laps, re-scoring gives the live race's laps, and the unfinished lap's rest."""
    told = sorted(told, key=lambda one: charged_to(one) or 0)
    told = [incident(one.kind, number, one.lap) for number, one in enumerate(told, start=1)]
    laps = [lap(1), lap(2), lap(3)]
    before: list[Incident] = []
    live = []
    for each in laps:
        mine = [one for one in told if charged_to(one) == each.number]
        live.append(judged(each, mine, rules, counted(before)))
        before += mine
    rest = penalties_of([one for one in told if charged_to(one) == 4], rules, counted(before))
    assert judged_run(laps, told, rules) == (tuple(live), rest)


@pytest.mark.parametrize(
    ("kind", "of_lap", "charged"),
    [
        (IncidentKind.JUMP_START, None, 1),
        (IncidentKind.JUMP_START, 1, 1),
        (OFF, None, None),
        (OFF, 2, 2),
    ],
)
def test_a_jump_start_belongs_to_the_first_lap(kind: IncidentKind, of_lap: int | None, charged: int | None) -> None:
    """It happens before any lap; other things outside laps belong to none."""
    assert charged_to(incident(kind, of_lap=of_lap)) == charged


def test_a_jump_start_spoils_the_first_lap_and_no_other() -> None:
    """And an off-track on the out-lap costs nothing."""
    told = [incident(OFF, 1, None), incident(IncidentKind.JUMP_START, 2, None)]
    laps, left = judged_run([lap(1), lap(2)], told, PenaltyRules())
    assert [one.valid for one in laps] == [False, True]
    assert left == ()


@pytest.mark.parametrize(
    ("told", "by"),
    [
        ([], None),
        ([(STALLED, 1)], None),
        ([(OFF, None), (OFF, None)], None),
        ([(OFF, 1)], None),
        ([(OFF, 1), (STALLED, 1), (OFF, 3), (OFF, 4)], 3),
        ([(IncidentKind.JUMP_START, None)], 1),
    ],
)
def test_the_first_that_ends_the_race_ends_it(told: list[tuple[IncidentKind, int | None]], by: int | None) -> None:
    """Off the track once is free, twice ends it; outside laps nothing does but a jump start."""
    rules = PenaltyRules(off_track=Effect(dnf=True, free=1), jump_start=Effect(dnf=True))
    found = retires([incident(kind, k, of_lap) for k, (kind, of_lap) in enumerate(told, start=1)], rules)
    assert (found.incident if found else None) == by


def test_what_happened_in_a_lap_that_was_given_up_is_not_charged_to_the_one_that_was_driven_instead() -> None:
    """Both are lap 2: of the first, given up before the other began, the free one is used up, and its penalty stays."""
    rules = PenaltyRules(off_track=Effect(seconds=1.0, free=1))
    given_up = [incident(OFF, 1, 2, start_t_ns=6 * SECOND_NS), incident(OFF, 2, 2, start_t_ns=7 * SECOND_NS)]
    laps = [lap(1, 5.0), lap(2)]
    judged_laps, rest = judged_run(laps, [*given_up, incident(OFF, 3, 2)], rules)
    assert [[one.incident for one in each.penalties] for each in judged_laps] == [[], [3]]
    assert [one.incident for one in rest] == [2]
    first = incident(IncidentKind.JUMP_START, 1, 1, start_t_ns=-5)
    assert [len(one.penalties) for one in judged_run(laps, [first], PenaltyRules())[0]] == [1, 0]
