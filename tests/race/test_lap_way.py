"""How much of a lap's route counts as driven."""

from __future__ import annotations

import math
import random

import pytest
from race_drive import at, drive, incidents_of, laps_of, ring, statuses

from dnb_edge.race.rules import LapRules
from dnb_edge.values import Crossing, IncidentKind

W = 1.3
ROUND = 2 * math.pi


@pytest.mark.parametrize("radius_m", [0.83, 1.17])
def test_a_car_that_is_beyond_the_edge_all_the_way_has_driven_it(radius_m: float) -> None:
    """Its laps are not valid, if the rules say so, and they are laps."""
    told = drive(ring(), lambda t: at(-0.6 + W * t, radius_m), seconds=11, rules=LapRules(off_lane_margin_m=0.01))
    assert statuses(told) == ["start", "lap", "lap"]
    assert {IncidentKind.OFF_TRACK} <= {one.kind for one in incidents_of(told)}


def test_a_rest_in_the_infield_does_not_hide_a_short_cut() -> None:
    """A minute of 5 mm jitter between the two halves of the way across is no way driven."""
    chance = random.Random(1)
    begin_s = (0.2 * ROUND + 0.6) / W
    a, b = at(0.2 * ROUND), at(0.65 * ROUND)
    half_s = math.dist(a, b) / W / 2

    def where(t_s: float) -> tuple[float, float]:
        if t_s < begin_s:
            return at(-0.6 + W * t_s)
        over_s = t_s - begin_s
        if over_s < half_s:
            share = over_s / half_s / 2
        elif over_s < half_s + 60:
            x, y = (a[0] + b[0]) / 2, (a[1] + b[1]) / 2
            return x + chance.uniform(-0.005, 0.005), y + chance.uniform(-0.005, 0.005)
        elif over_s < 2 * half_s + 60:
            share = (over_s - 60) / half_s / 2
        else:
            return at(0.65 * ROUND + W * (over_s - 60 - 2 * half_s))
        return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])

    told = drive(ring(), where, seconds=begin_s + 60 + 5)
    kinds = {one.kind for one in incidents_of(told)}
    assert kinds == {IncidentKind.SHORT_CUT, IncidentKind.OFF_TRACK, IncidentKind.STALLED}


@pytest.mark.parametrize("times", [1, 3])
def test_what_is_driven_twice_counts_once(times: int) -> None:
    """To and fro between 0.2 and 2.3 rad, then carried to 0.9 rad before the line: a half, however often."""
    swing = 2.1

    def where(t_s: float) -> tuple[float, float]:
        way = -0.6 + W * t_s
        if way < 0.2:
            return at(way)
        if way < 0.2 + (2 * times + 1) * swing:
            turn = (way - 0.2) % (2 * swing)
            return at(0.2 + min(turn, 2 * swing - turn))
        return at(way - 0.2 - (2 * times + 1) * swing - 0.9)

    told = drive(ring(), where, seconds=(0.8 + (2 * times + 1) * swing + 0.9) / W + 1.0)
    assert [str(one) for one in statuses(told)] == ["start", "ignored"]
    assert laps_of(told) == []
    (ignored,) = [one for one in told if isinstance(one, Crossing) and one.reason is not None]
    assert ignored.reason is not None
    assert int(ignored.reason.split()[1]) == pytest.approx(100 * (2.3 + 0.9) / ROUND, abs=2)


def test_a_car_that_is_hidden_and_can_have_driven_the_way_has_driven_it() -> None:
    """Unseen for a third of the lap, and then over the line in another gap: it is a lap in which the car was lost."""
    hidden = lambda t: None if 1.5 < t < 3.1 or 5.0 < t < 5.6 else at(-0.6 + W * t)  # noqa: E731
    told = drive(ring(), hidden, seconds=6.5)
    (driven,) = laps_of(told)
    assert [one.kind for one in driven.incidents] == [IncidentKind.LOST]
    assert driven.lap.estimated
