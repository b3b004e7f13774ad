"""Exactly right counts of laps for everything that a car, or a hand, can do at the start line and elsewhere."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import pytest
from race_drive import Where, at, drive, incidents_of, laps_of, ring, statuses

from dnb_edge.race.laps import DrivenLap, Passed
from dnb_edge.race.rules import LapRules
from dnb_edge.track.line import line_across
from dnb_edge.values import Crossing, Direction, IncidentKind, PassStatus

W = 1.3
"""Angular speed of the steady car, radians per second; on a ring of one metre also its speed."""

ROUND = 2 * math.pi
LAP_S = ROUND / W
TRACK = ring()


def steady(t_s: float) -> tuple[float, float]:
    return at(-0.6 + W * t_s)


def kinds_of(driven: DrivenLap) -> list[IncidentKind]:
    return [one.kind for one in driven.incidents]


def times_of(told: list[Passed]) -> list[float]:
    return [one.lap.time_s for one in laps_of(told)]


def test_a_steady_car_has_laps_and_no_incidents() -> None:
    """Each lap ends where the next begins, every crossing says what it was."""
    told = drive(TRACK, steady, seconds=16, noise_m=0.003)
    assert statuses(told) == ["start", "lap", "lap", "lap"]
    assert times_of(told) == pytest.approx([LAP_S] * 3, abs=0.01)
    assert incidents_of(told) == []
    assert [one.lap.observed_fraction for one in laps_of(told)] == [1.0] * 3


@pytest.mark.parametrize("noise_m", [0.0, 0.003])
@pytest.mark.parametrize("away_m", [-0.04, -0.01, 0.0, 0.01, 0.03, 0.06])
def test_parked_at_the_line_for_five_minutes(away_m: float, noise_m: float) -> None:
    """The car halts on it, before it or just behind it, then goes on: one start and the laps that it drove."""

    def where(t_s: float) -> tuple[float, float]:
        return at(min(-0.6 + W * t_s, away_m)) if t_s < 300 else at(away_m + W * (t_s - 300))

    told = drive(TRACK, where, seconds=312, fps=15, noise_m=noise_m)
    assert statuses(told) == ["start", "lap", "lap"]
    first, second = laps_of(told)
    assert second.lap.time_s == pytest.approx(LAP_S, abs=0.02)
    stood = [one for one in first.incidents if one.kind is IncidentKind.STALLED]
    if away_m == 0.0 and noise_m:
        # Which side it stood on nobody can tell: when in that time it crossed is anybody's guess.
        assert first.lap.time_s < 301 + LAP_S
    elif first.lap.time_s > 200:
        # It stood behind the line: that belongs to the lap, though the crossing was told when it had gone on.
        assert [one.lasted_s for one in stood] == pytest.approx([300 - (0.6 + away_m) / W], abs=1.0)
    else:
        assert first.lap.time_s == pytest.approx(LAP_S, abs=0.1)
        assert stood == []
    assert {one.kind for one in first.incidents} <= {IncidentKind.STALLED}
    assert second.incidents == ()


def test_parked_in_a_lap_costs_bounded_memory() -> None:
    """An hour at one frame a tenth of a second in the middle of a lap: the lap is kept with a thinned path, and it stood."""
    halt_s = 3.0

    def where(t_s: float) -> tuple[float, float]:
        return steady(t_s if t_s < halt_s else max(halt_s, t_s - 3600.0))

    told = drive(TRACK, where, seconds=3600 + 8, fps=10)
    (driven,) = laps_of(told)
    assert driven.lap.time_s == pytest.approx(LAP_S + 3600, abs=0.1)
    assert 10000 < len(driven.fixes) <= 20000
    assert driven.lap.observed_fraction == 1.0
    assert kinds_of(driven) == [IncidentKind.STALLED]
    assert incidents_of(told)[0].text == "the car stood for 3600.0 s"


@pytest.mark.parametrize("seed", range(4))
def test_twenty_millimetres_of_jitter_on_the_line(seed: int) -> None:
    """Two minutes of it at the end of the first lap: one crossing, in that time."""
    chance = random.Random(seed)
    round_s = (0.6 + ROUND) / W

    def where(t_s: float) -> tuple[float, float]:
        if t_s < round_s:
            return steady(t_s)
        if t_s < round_s + 120:
            return at(chance.uniform(-0.02, 0.02))
        return at(W * (t_s - round_s - 120))

    told = drive(TRACK, where, seconds=round_s + 120 + 2.5 * LAP_S, noise_m=0.002)
    assert statuses(told) == ["start", "lap", "lap", "lap"]
    # Both ends of the stand belong to one of the two laps.
    first_s, second_s, third_s = times_of(told)
    assert first_s + second_s == pytest.approx(2 * LAP_S + 120, abs=0.1)
    assert third_s == pytest.approx(LAP_S, abs=0.02)


def test_reversing_over_the_line_is_no_lap() -> None:
    """Forward, back and forward: one start; the way back is told as such."""

    def where(t_s: float) -> tuple[float, float]:
        return at(-0.6 + W * t_s if t_s < 1 else 0.7 - W * (t_s - 1) if t_s < 2 else -0.6 + W * (t_s - 2))

    told = drive(TRACK, where, seconds=9, rules=LapRules(min_lap_s=0.5))
    assert statuses(told) == ["start", "ignored", "ignored", "lap"]
    assert [one.reason for one in told if isinstance(one, Crossing)] == [
        None, "backwards", "only 21 % of the route driven since the lap's start", None,
    ]  # fmt: skip
    (driven,) = laps_of(told)
    assert driven.lap.time_s == pytest.approx(2 + LAP_S, abs=0.02)
    (back,) = driven.incidents
    assert (back.kind, back.lap) == (IncidentKind.WRONG_WAY, 1)
    assert back.greatest_m == pytest.approx(1.3, abs=0.03)
    assert [back.start_s, back.lasted_s] == pytest.approx([1.0, 1.0], abs=0.05)


def test_a_u_turn_over_the_line_and_all_the_way_round_is_no_lap() -> None:
    """After its first lap the car turns, drives a whole lap the wrong way, turns again and drives on: that is one lap more."""
    turn_s, back_s = 6.0, 6.0

    def where(t_s: float) -> tuple[float, float]:
        out = min(t_s, turn_s) - min(max(t_s - turn_s, 0.0), back_s) + max(t_s - turn_s - back_s, 0.0)
        return at(-0.6 + W * out)

    told = drive(TRACK, where, seconds=turn_s + back_s + 11)
    crossings = [one for one in told if isinstance(one, Crossing)]
    assert [(str(one.direction), str(one.status)) for one in crossings] == [
        ("forward", "start"), ("forward", "lap"), ("reverse", "ignored"), ("reverse", "ignored"), ("forward", "ignored"),
        ("forward", "lap"), ("forward", "lap"),
    ]  # fmt: skip
    assert [kinds_of(one) for one in laps_of(told)] == [[], [IncidentKind.WRONG_WAY], []]
    assert times_of(told) == pytest.approx([LAP_S, turn_s + back_s, LAP_S], abs=0.02)


def carried(from_share: float, to_share: float, away_s: float) -> Where:
    """A car that is taken away at a share of its lap and put down at another, unseen for so long."""
    until_s = (from_share * ROUND + 0.6) / W

    def where(t_s: float) -> tuple[float, float] | None:
        if t_s < until_s:
            return steady(t_s)
        return None if t_s < until_s + away_s else at(to_share * ROUND + W * (t_s - until_s - away_s))

    return where


@pytest.mark.parametrize("away_s", [0.07, 0.5, 3.0])
@pytest.mark.parametrize(
    ("from_share", "to_share", "expected"),
    [
        (0.5, 0.97, "start ignored lap lap"),
        (0.85, 0.97, "start lap lap lap"),
        (0.95, 1.1, "start lap lap lap"),
        (0.6, 1.1, "start lap lap"),
        (0.2, 0.7, "start ignored lap lap"),
        (0.3, 0.1, "start lap lap lap"),
        (0.8, 0.3, "start lap lap"),
    ],
    ids=[
        "before the line",
        "on to before the line",
        "over the line",
        "behind the line",
        "half ahead",
        "back",
        "far back",
    ],
)
def test_lifted_and_replaced(from_share: float, to_share: float, expected: str, away_s: float) -> None:
    """What was carried is not driven: a lap counts once as much as the rules want of its route was driven."""
    if away_s == 3.0 and from_share in (0.2, 0.5):
        expected = "start lap lap"  # in three seconds it could have driven there
    told = drive(TRACK, carried(from_share, to_share, away_s), seconds=0.46 + 3.9 * LAP_S + away_s)
    assert [str(one) for one in statuses(told)][: len(expected.split())] == expected.split()
    first = laps_of(told)[0]
    hidden = {IncidentKind.LIFTED, IncidentKind.LOST, IncidentKind.MISSED_LINE, IncidentKind.SHORT_CUT}
    assert set(kinds_of(first)) <= hidden
    assert (away_s > 1.0) == (IncidentKind.LOST in kinds_of(first))
    # A lap that began in the hand is one of the two that it touches.
    over_line = from_share < 1.0 < to_share or (from_share == 0.8 and away_s == 3.0)
    touched = hidden if over_line else set()
    assert set(kinds_of(laps_of(told)[1])) <= touched
    assert all(one.incidents == () for one in laps_of(told)[2:])


def test_a_car_that_is_carried_over_the_line_is_lifted_in_both_laps() -> None:
    """Neither was driven whole; each incident lies in its own lap."""
    first, second, *_ = laps_of(drive(TRACK, carried(0.95, 1.1, 0.07), seconds=11))
    assert [kinds_of(first), kinds_of(second)] == [[IncidentKind.LIFTED]] * 2
    assert first.incidents[0].start_t_ns < first.lap.end_t_ns == second.incidents[0].start_t_ns


@pytest.mark.parametrize(
    ("from_share", "to_share", "expected"),
    [
        (0.2, 0.5, "start lap lap"),
        (0.2, 0.65, "start lap lap"),
        (0.2, 0.78, "start ignored lap"),
        (0.2, 0.85, "start ignored lap"),
    ],
)
def test_a_short_cut_across_the_infield(from_share: float, to_share: float, expected: str) -> None:
    """Straight from one place of the lane to another: told, and no lap where too little of the route is left."""
    a, b = at(from_share * ROUND), at(to_share * ROUND)
    begin_s, across_s = (from_share * ROUND + 0.6) / W, math.dist(a, b) / W

    def where(t_s: float) -> tuple[float, float]:
        share = (t_s - begin_s) / across_s
        if share <= 0:
            return steady(t_s)
        if share >= 1:
            return at(to_share * ROUND + W * (t_s - begin_s - across_s))
        return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])

    told = drive(TRACK, where, seconds=13, noise_m=0.002)
    assert [str(one) for one in statuses(told)][:3] == expected.split()
    gain_m = (to_share - from_share) * ROUND - math.dist(a, b)
    cuts = [one for one in incidents_of(told) if one.kind is IncidentKind.SHORT_CUT]
    # Counted from one edge of the lane to the other, where it drives across rather than along.
    assert [one.greatest_m for one in cuts] == ([pytest.approx(gain_m + 0.35, abs=0.4)] if gain_m > 0.5 else [])
    assert IncidentKind.OFF_TRACK in kinds_of(laps_of(told)[0])
    assert IncidentKind.WRONG_WAY not in kinds_of(laps_of(told)[0])


def test_two_laps_with_a_missed_crossing_are_one_that_says_so() -> None:
    """The car goes round the end of the line at the end of its first lap."""
    wide = lambda t: at(-0.6 + W * t, 1.3 if 5.1 < t < 5.5 else 1.0)  # noqa: E731
    told = drive(TRACK, wide, seconds=16)
    assert statuses(told) == ["start", "lap", "lap"]
    first, second = laps_of(told)
    assert first.lap.time_s == pytest.approx(2 * LAP_S, abs=0.01)
    assert IncidentKind.MISSED_LINE in kinds_of(first)
    assert second.incidents == ()
    texts = [one.text for one in first.incidents if one.kind is IncidentKind.MISSED_LINE]
    assert texts == ["the car drove 2.0 times round the route: a crossing of the start line was missed"]


@pytest.mark.parametrize("half_s", [0.05, 0.2, 0.45])
def test_a_gap_at_the_line_loses_no_lap(half_s: float) -> None:
    """The crossing lies in it; only a gap beyond the limit is an incident, and of the whole of it."""
    true_s = (0.6 + ROUND) / W
    for shift_s in (-0.8 * half_s, 0.0, 0.8 * half_s):
        hidden = lambda t: None if abs(t - true_s - shift_s) < half_s else steady(t)  # noqa: B023, E731
        told = drive(TRACK, hidden, seconds=11, noise_m=0.002)
        assert statuses(told) == ["start", "lap", "lap"]
        assert times_of(told) == pytest.approx([LAP_S] * 2, abs=0.1)
        assert incidents_of(told) == []


def test_a_gap_over_the_line_is_judged_whole() -> None:
    """Half of it before the line and half behind it, neither beyond the limit: the car was lost all the same."""
    track = ring(3.0)
    told = drive(track, lambda t: None if abs(t - 20) < 0.8 else at((t - 20) / 3 + ROUND, 3.0), seconds=40)
    assert [kinds_of(one) for one in laps_of(told)] == [[IncidentKind.LOST], []]
    assert incidents_of(told)[0].text == "the car was not seen for 1.6 s (limit 1.0 s)"
    assert [one.lap.estimated for one in laps_of(told)] == [True, True]


def test_a_car_that_is_lost_for_ever_is_told_at_the_end_of_the_run() -> None:
    """Nobody ends the incident; the run does."""
    told = drive(TRACK, lambda t: steady(t) if t < 3 else None, seconds=60)
    (lost,) = incidents_of(told)
    assert (lost.kind, lost.lap) == (IncidentKind.LOST, 1)
    assert lost.lasted_s == pytest.approx(57, abs=0.1)
    assert statuses(told) == [PassStatus.START]


def test_a_lap_that_is_too_slow_is_told_when_it_is_and_counted_when_it_ends() -> None:
    """Once, at the moment when the limit passes."""
    told = drive(TRACK, steady, seconds=6, rules=LapRules(max_lap_s=3.0))
    (slow,) = incidents_of(told)
    assert (slow.kind, slow.text) == (IncidentKind.TOO_SLOW, "the lap took longer than race.max_lap_s, 3 s")
    assert slow.end_t_ns - slow.start_t_ns == 3_000_000_000
    assert told.index(slow) == 1, "before the lap ends"
    assert kinds_of(laps_of(told)[0]) == [IncidentKind.TOO_SLOW]


def test_a_lap_that_ended_in_time_is_not_too_slow_though_its_end_is_told_late() -> None:
    """The car halts 30 mm behind the line for longer than anything waits: nobody says that it was too slow, so nobody takes it
    out of the race."""
    end_s = (0.6 + ROUND + 0.03) / W

    def where(t_s: float) -> tuple[float, float]:
        return steady(t_s if t_s < end_s else max(end_s, t_s - 60.0))

    told = drive(TRACK, where, seconds=end_s + 63, rules=LapRules(max_lap_s=8.0))
    assert [one.lap for one in incidents_of(told) if one.kind is IncidentKind.TOO_SLOW] == [2], "in which it stood"
    (driven,) = laps_of(told)
    assert driven.lap.time_s == pytest.approx(LAP_S, abs=0.02)
    assert driven.incidents == ()
    assert driven.lap.observed_fraction == 1.0


def test_lines_that_lie_close_together_are_told_in_the_order_in_which_they_are_crossed() -> None:
    """A sector line 20 mm before the start line."""
    route = TRACK.centreline
    last = line_across(route, route.length_m - 0.02, name="last", margin_m=0.05)
    told = drive(replace(TRACK, sector_lines=(last,)), steady, seconds=11)
    assert [one.line for one in told if isinstance(one, Crossing)] == ["last", "start"] * 3
    assert statuses(told)[1:] == ["start", "sector", "lap", "sector", "lap"]
    assert [len(one.incidents) for one in laps_of(told)] == [0, 0]


def test_a_car_first_seen_driving_backwards_crosses_and_nothing_more() -> None:
    """Round and round the wrong way: no lap begins."""
    told = drive(TRACK, lambda t: at(0.6 - W * t), seconds=16)
    crossings = [one for one in told if isinstance(one, Crossing)]
    assert {one.direction for one in crossings} == {Direction.REVERSE}
    assert {(one.status, one.reason, one.lap) for one in crossings} == {(PassStatus.IGNORED, "backwards", None)}
    assert laps_of(told) == []
    assert incidents_of(told) == []


@pytest.mark.parametrize(("away_m", "is_slow"), [(-0.1, True), (-0.03, True), (0.2, False)])
def test_a_car_that_halts_at_the_line_is_too_slow_only_before_it(away_m: float, is_slow: bool) -> None:
    """It stands for a minute past the limit, and is told once the limit is over where it has not come to the line."""
    end_s = (0.6 + ROUND + away_m) / W
    where = lambda t: steady(t if t < end_s else max(end_s, t - 60.0))  # noqa: E731
    told = drive(TRACK, where, seconds=end_s + 63, rules=LapRules(max_lap_s=8.0), noise_m=0.002)
    slow = [one for one in incidents_of(told) if one.kind is IncidentKind.TOO_SLOW]
    assert [one.lap for one in slow] == ([1] if is_slow else [2])
    driven = laps_of(told)[0]
    assert (IncidentKind.TOO_SLOW in kinds_of(driven)) == is_slow
