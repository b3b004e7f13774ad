"""Who is first under each ranking, how sure that is, and what may never happen to a place."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.race.penalties import with_penalties
from dnb_edge.race.rules import FormatRules, Ranking
from dnb_edge.race.standings import UNITS, CarResult, best_theoretical, classify, standings
from dnb_edge.values import Lap, Penalty, SectorTime, Standing

SIGMA_S = 0.01


def lap(number: int, start_s: float, time_s: float, **fields: Any) -> Lap:
    given: dict[str, Any] = {
        "number": number,
        "start_t_ns": round(start_s * 1e9),
        "end_t_ns": round((start_s + time_s) * 1e9),
        "start_s": start_s,
        "time_s": time_s,
        "sigma_s": SIGMA_S,
        "valid": True,
        "reasons": (),
        "similarity_percent": None,
        "observed_fraction": 1.0,
        "official_time_s": time_s,
    }
    return Lap(**given | fields)


def in_a_row(times_s: Sequence[float], start_s: float = 0.0, **fields: Any) -> tuple[Lap, ...]:
    """Laps that follow one another; a negative time is that of an invalid lap."""
    laps = []
    for number, time_s in enumerate(times_s, start=1):
        laps.append(lap(number, start_s, abs(time_s), valid=time_s > 0, **fields))
        start_s += abs(time_s)
    return tuple(laps)


def car(number: int, times_s: Sequence[float] = (), **fields: Any) -> CarResult:
    laps = fields.pop("laps", None) or in_a_row(times_s)
    given: dict[str, Any] = {"car": number, "name": f"car {number}", "laps": laps, "start_t_ns": 0, "elapsed_s": 60.0}
    return CarResult(**given | fields)


def ranked(rank_by: Ranking, *results: CarResult, laps: int | None = None, **fields: Any) -> list[Standing]:
    return list(classify(results, FormatRules(rank_by=rank_by, **fields), laps))


def order(lines: Sequence[Standing]) -> list[int]:
    return [line.car for line in lines]


# What each ranking makes of one car: its laps' times (negative: invalid), the format, the value and its sigma.
@pytest.mark.parametrize(
    ("rank_by", "times_s", "fields", "value", "sigma"),
    [
        (Ranking.BEST_LAP, [12, 10, 11], {}, 10.0, SIGMA_S),
        (Ranking.BEST_LAP, [12, -10, 11], {}, 11.0, SIGMA_S),
        (Ranking.BEST_LAP, [9, 12, 11], {"warm_up_laps": 1}, 11.0, SIGMA_S),
        (Ranking.BEST_LAP, [-9], {}, None, None),
        (Ranking.BEST_LAP, [], {}, None, None),
        (Ranking.BEST_CONSECUTIVE, [12, 10, 11, 9], {"best_of": 2}, 20.0, SIGMA_S),
        (Ranking.BEST_CONSECUTIVE, [12, 10, -5, 9, 14], {"best_of": 2}, 22.0, SIGMA_S),
        (Ranking.BEST_CONSECUTIVE, [12, -10, 11], {"best_of": 2}, None, None),
        (Ranking.BEST_CONSECUTIVE, [1, 1, 11, 12], {"best_of": 2, "warm_up_laps": 2}, 23.0, SIGMA_S),
        (Ranking.BEST_AVERAGE, [12, 10, 11, 8], {"best_of": 2}, 9.0, SIGMA_S * math.sqrt(2) / 2),
        (Ranking.BEST_AVERAGE, [12, 10, 8, 11], {"best_of": 2}, 9.0, SIGMA_S / 2),
        (Ranking.BEST_AVERAGE, [12, 10], {"best_of": 3}, None, None),
        (Ranking.TOTAL_TIME, [12, -10, 11], {}, 33.0, SIGMA_S),
        (Ranking.TOTAL_TIME, [12, 10, 11], {"warm_up_laps": 1}, 21.0, SIGMA_S),
        (Ranking.MOST_LAPS, [12, -10, 11], {}, 2.0, None),
        (Ranking.MOST_LAPS, [12, 10, 11], {"warm_up_laps": 2}, 1.0, None),
        (Ranking.MOST_LAPS, [], {}, 0.0, None),
    ],
)
def test_what_is_ranked_by(
    rank_by: Ranking, times_s: list[float], fields: dict[str, Any], value: float | None, sigma: float | None
) -> None:
    """Only valid laps where the ranking says so, no warm-up laps, and the shared crossings of laps in a row cancel."""
    (line,) = ranked(rank_by, car(1, times_s), **fields)
    assert line.value == pytest.approx(value)
    assert line.sigma == pytest.approx(sigma)


def test_a_start_that_was_given_begins_the_total_time() -> None:
    """From the grid the way to the start line counts, and only the finish is uncertain; in a rolling start nothing is added."""
    laps = in_a_row([10, 10], start_s=1.5)
    (line,) = ranked(Ranking.TOTAL_TIME, car(1, laps=laps, start_t_ns=0))
    assert line.value == pytest.approx(21.5)
    assert line.sigma == pytest.approx(SIGMA_S / math.sqrt(2))
    (line,) = ranked(Ranking.TOTAL_TIME, car(1, laps=laps, start_t_ns=laps[0].start_t_ns))
    assert (line.value, line.sigma) == (pytest.approx(20.0), pytest.approx(SIGMA_S))


@pytest.mark.parametrize("rank_by", [Ranking.TOTAL_TIME, Ranking.MOST_LAPS])
def test_a_lap_that_was_taken_away_gives_no_time_back(rank_by: Ranking) -> None:
    """Whichever of its laps a judge takes away, the clock ran: the car comes after one that drove as many in less."""
    laps = in_a_row([10, 10, 10, 10])
    without = {k: car(1, laps=tuple(one for one in laps if one.number != k)) for k in (1, 2, 3)}
    values = [ranked(Ranking.TOTAL_TIME, result)[0].value for result in without.values()]
    assert values == [pytest.approx(40.0)] * 3
    for result in without.values():
        assert order(ranked(rank_by, result, car(2, [11, 11, 11]))) == [2, 1]


def test_similarity_is_the_mean_of_the_valid_laps_times_their_factors() -> None:
    """And equal similarities go by time, for two perfect drivers are told apart by speed."""
    scored = [
        lap(1, 0, 10, similarity_percent=90.0),
        lap(2, 10, 10, similarity_percent=80.0, penalty_factor=0.5),
        lap(3, 20, 10, similarity_percent=10.0, valid=False),
        lap(4, 30, 10),
    ]
    (line,) = ranked(Ranking.SIMILARITY, car(1, laps=tuple(scored)))
    assert (line.value, line.sigma) == (65.0, None)
    slow, fast = (car(k, laps=in_a_row([t], similarity_percent=100.0)) for k, t in ((1, 11.0), (2, 10.0)))
    assert order(ranked(Ranking.SIMILARITY, slow, fast)) == [2, 1]


@pytest.mark.parametrize(
    ("fields", "rules", "percent"),
    [
        ({"times_s": [10, 10]}, {}, 50.0),
        ({"times_s": [10, 10, 10, 10]}, {}, 100.0),
        ({"times_s": [10, 10], "running": 0.5}, {}, 62.5),
        ({"times_s": [10, -10], "running": 0.5}, {}, 37.5),
        ({"times_s": [10, 10], "running": 0.5, "dnf": "it stood"}, {}, 62.5),
        ({"times_s": [10, 10], "penalties": (Penalty(offence="off_track", factor=0.5, reason=""),)}, {}, 25.0),
        ({"times_s": [10, 10], "running": 0.5}, {"warm_up_laps": 2}, 25.0),
        ({"times_s": [10], "running": 0.5}, {"warm_up_laps": 2}, 0.0),
        ({"start_t_ns": None}, {}, None),
    ],
)
def test_the_driving_score_is_completion_times_factors(
    fields: dict[str, Any], rules: dict[str, Any], percent: float | None
) -> None:
    """Of four laps: complete valid ones and the share of the running one, of those that are ranked."""
    (line,) = ranked(Ranking.DRIVING_SCORE, car(1, **fields), laps=4, **rules)
    assert line.value == pytest.approx(percent)


def test_the_driving_score_counts_the_laps_factors() -> None:
    """Those of warm-up laps are none, those of invalid laps are."""
    laps = (
        lap(1, 0, 10, penalty_factor=0.1),
        lap(2, 10, 10, penalty_factor=0.8),
        lap(3, 20, 10, penalty_factor=0.5, valid=False),
    )
    (line,) = ranked(Ranking.DRIVING_SCORE, car(1, laps=laps), laps=3, warm_up_laps=1)
    assert line.value == pytest.approx(50.0 * 0.4)
    with pytest.raises(ValueError, match=r"set race\.laps"):
        ranked(Ranking.DRIVING_SCORE, car(1, laps=laps))


def test_survival_goes_by_time_then_by_distance() -> None:
    """Who still drives when the time is up has survived all of it; an early end is what is measured, not the last place."""
    lines = ranked(
        Ranking.SURVIVAL,
        car(1, elapsed_s=61.0, distance_m=20.0),
        car(2, elapsed_s=60.2, distance_m=25.0),
        car(3, elapsed_s=40.0, distance_m=50.0, dnf="it left the track"),
        car(4, elapsed_s=None, start_t_ns=None),
        car(5, elapsed_s=30.0, distance_m=50.0),
        time_limit_s=60.0,
    )
    assert order(lines) == [2, 1, 3, 5, 4]
    assert [line.value for line in lines] == [60.0, 60.0, 40.0, 30.0, None]
    assert [line.gap for line in lines] == [None, 0.0, 20.0, 30.0, None]
    assert [line.dnf for line in lines] == [None, None, "it left the track", None, None]


# Best laps in order, places, ties: a difference of 1.96 * hypot(0.01, 0.01) = 0.0277 s can just not be told.
@pytest.mark.parametrize(
    ("bests_s", "places", "tied"),
    [
        ([10.0, 10.1, 10.2], [1, 2, 3], [False, False, False]),
        ([10.0, 10.0277, 10.2], [1, 1, 3], [True, True, False]),
        ([10.0, 10.0278, 10.2], [1, 2, 3], [False, False, False]),
        ([10.0, 10.02, 10.04, 10.06], [1, 1, 1, 1], [True, True, True, True]),
        ([10.0, 10.1, 10.12, 10.3, 10.31], [1, 2, 2, 4, 4], [False, True, True, True, True]),
    ],
)
def test_ties_are_chains_of_neighbours_that_cannot_be_told_apart(
    bests_s: list[float], places: list[int], tied: list[bool]
) -> None:
    """All of a chain share the better place; the next place after it leaves out as many."""
    lines = ranked(Ranking.BEST_LAP, *(car(k, [best_s]) for k, best_s in enumerate(bests_s, start=1)))
    assert [line.place for line in lines] == places
    assert [line.tied for line in lines] == tied


def test_the_same_laps_are_no_tie_when_they_are_sure() -> None:
    """It is the uncertainty that makes the tie."""
    sure = [car(k, laps=in_a_row([10 + k / 1000], sigma_s=0.0001)) for k in (1, 2)]
    assert [line.place for line in ranked(Ranking.BEST_LAP, *sure)] == [1, 2]


def test_laps_come_before_time() -> None:
    """More laps are ahead of any time, and are no tie; the gap is told in laps, and among equals in seconds."""
    lines = ranked(
        Ranking.TOTAL_TIME, car(1, [10, 10]), car(2, [11, 11, 11]), car(3, [10, 10.5]), car(4, [12, 12, 12]), laps=3
    )
    assert order(lines) == [2, 4, 1, 3]
    assert [line.gap for line in lines] == [None, pytest.approx(3.0), None, None]
    assert [line.gap_laps for line in lines] == [None, 0, 1, 1]
    assert [line.interval for line in lines] == [None, pytest.approx(3.0), None, pytest.approx(0.5)]
    assert [line.interval_laps for line in lines] == [None, 0, 1, 0]
    assert not any(line.tied for line in lines)


@pytest.mark.parametrize("rank_by", [Ranking.TOTAL_TIME, Ranking.MOST_LAPS])
def test_a_lap_more_is_no_tie_whatever_the_times(rank_by: Ranking) -> None:
    """Two laps and one that took as long together: counts are exact."""
    lines = ranked(rank_by, car(1, [10, 10]), car(2, [20]), car(3, [10, 10]), time_limit_s=30.0)
    assert [(line.car, line.place, line.tied) for line in lines] == [(1, 1, True), (3, 1, True), (2, 3, False)]


def test_most_laps_counts_valid_ones_and_an_invalid_one_costs_its_time() -> None:
    """Both have two valid laps; the one that wasted a lap between them got there later."""
    lines = ranked(Ranking.MOST_LAPS, car(1, [10, -5, 10]), car(2, [11, 11]), car(3, [10, 10, 10]), time_limit_s=30.0)
    assert order(lines) == [3, 2, 1]
    assert [line.gap for line in lines] == [None, 1.0, 1.0]
    assert [(line.laps, line.valid_laps) for line in lines] == [(3, 3), (2, 2), (3, 2)]


def test_gaps_are_behind_whichever_way_is_better() -> None:
    """A gap is positive where less is better, and where more is."""
    fast, slow = car(1, [10]), car(2, [12])
    assert [line.gap for line in ranked(Ranking.BEST_LAP, fast, slow)] == [None, 2.0]
    near, far = (car(k, laps=in_a_row([10], similarity_percent=percent)) for k, percent in ((1, 95.0), (2, 90.0)))
    assert [line.gap for line in ranked(Ranking.SIMILARITY, far, near)] == [None, 5.0]


def test_who_did_not_finish_comes_last_with_the_reason() -> None:
    """Whatever the laps before were worth; they are in order among themselves, and no gap is told to those that finished."""
    lines = ranked(
        Ranking.BEST_LAP, car(1, [9], dnf="it stood"), car(2, [11]), car(3), car(4, [8], dnf="it was lifted")
    )
    assert order(lines) == [2, 3, 4, 1]
    assert [line.place for line in lines] == [1, 2, 3, 4]
    assert [line.gap for line in lines] == [None, None, None, None]
    assert [line.interval for line in lines] == [None, None, None, 1.0]


def test_cars_without_a_value_share_a_place() -> None:
    """Before anybody has a lap all are equal."""
    lines = ranked(Ranking.BEST_LAP, car(3), car(1), car(2, [10]))
    assert [(line.car, line.place, line.tied) for line in lines] == [(2, 1, False), (1, 2, True), (3, 2, True)]


def test_official_times_count_and_are_shown() -> None:
    """With penalties; the warm-up's are not added up."""
    judge = Penalty(offence="judge", seconds=5.0, reason="")
    laps = tuple(with_penalties(one, [judge]) for one in in_a_row([20, 10, 11]))
    (line,) = ranked(Ranking.BEST_LAP, car(1, laps=laps), warm_up_laps=1)
    assert (line.value, line.best_lap_s, line.last_lap_s, line.penalty_s, line.laps) == (15.0, 15.0, 16.0, 10.0, 3)


def test_laps_of_old_recordings_count_as_timed() -> None:
    """They know no official time."""
    (line,) = ranked(Ranking.BEST_LAP, car(1, laps=(lap(1, 0, 10, official_time_s=None),)))
    assert (line.value, line.best_lap_s, line.last_lap_s) == (10.0, 10.0, 10.0)


def test_the_event_says_what_it_ranks_by() -> None:
    """With the unit of its values."""
    event = standings([car(1, [10])], FormatRules(), None, t_ns=5, t_s=1.0, final=True)
    assert (event.rank_by, event.unit, event.final, event.rows[0].value) == ("best_lap", "s", True, 10.0)
    assert set(UNITS) == set(Ranking)


def sectors(*times_s: float | None) -> tuple[SectorTime, ...]:
    return tuple(
        SectorTime(number=k, line=f"sector {k}", time_s=time_s, sigma_s=None if time_s is None else SIGMA_S)
        for k, time_s in enumerate(times_s, start=1)
    )


def test_the_best_theoretical_lap_is_made_of_the_best_sectors() -> None:
    """Of valid laps; where two in a row come from one lap, their shared crossing cancels."""
    laps = [
        lap(1, 0, 9, sectors=sectors(2.0, 3.0, 4.0)),
        lap(2, 9, 9, sectors=sectors(3.0, 4.0, 2.0)),
        lap(3, 18, 3, sectors=sectors(1.0, 1.0, 1.0), valid=False),
        lap(4, 21, 9, sectors=sectors(None, None, 9.0)),
    ]
    best = best_theoretical(laps)
    assert best is not None
    assert (best.time_s, best.laps) == (7.0, (1, 1, 2))
    assert best.sigma_s == pytest.approx(SIGMA_S * math.sqrt(2))
    whole = best_theoretical(laps[:1])
    assert whole is not None
    assert (whole.time_s, whole.sigma_s) == (9.0, pytest.approx(SIGMA_S))
    assert best_theoretical(laps[2:]) is None
    assert best_theoretical([lap(1, 0, 9)]) is None


# Properties -----------------------------------------------------------------------------------------------------------

times = st.lists(st.floats(1, 100).map(lambda t: round(t, 3)), max_size=6)
any_lap = st.tuples(st.floats(1, 100).map(lambda t: round(t, 3)), st.booleans(), st.floats(0, 100), st.floats(0, 1))


@st.composite
def cars(draw: st.DrawFn, *, clean: bool = False, equally_sure: bool = True) -> list[CarResult]:
    """A field of cars; `clean` ones have no penalties."""
    field = []
    for number in range(1, draw(st.integers(1, 5)) + 1):
        laps, start_s = [], draw(st.sampled_from([0.0, 0.5]))
        for k, (time_s, valid, percent, factor) in enumerate(draw(st.lists(any_lap, max_size=6)), start=1):
            sigma_s = SIGMA_S if equally_sure else draw(st.sampled_from([0.0, 0.01, 1.0]))
            driven = lap(k, start_s, time_s, valid=valid, similarity_percent=percent, sigma_s=sigma_s)
            costs = () if clean else (Penalty(offence="off_track", factor=factor, reason="off"),)
            laps.append(with_penalties(driven, costs))
            start_s += time_s
        field.append(
            CarResult(
                car=number,
                name=str(number),
                laps=tuple(laps),
                start_t_ns=0,
                elapsed_s=draw(st.floats(0, 100)),
                distance_m=draw(st.floats(0, 100)),
                running=draw(st.floats(0, 1)),
                dnf=draw(st.sampled_from([None, None, "it stood"])),
            )
        )
    return field


formats = st.builds(
    FormatRules,
    rank_by=st.sampled_from(list(Ranking)),
    best_of=st.integers(1, 3),
    warm_up_laps=st.integers(0, 2),
    time_limit_s=st.none() | st.floats(1, 100),
)
WANTED = 4


@given(field=cars(equally_sure=False), rules=formats, data=st.data())
def test_the_order_is_total_and_does_not_depend_on_the_order_of_the_cars(
    field: list[CarResult], rules: FormatRules, data: st.DataObject
) -> None:
    """Every car once, places that never fall, and the same lines however the cars are given."""
    lines = classify(field, rules, WANTED)
    assert classify(data.draw(st.permutations(field)), rules, WANTED) == lines
    assert sorted(order(lines)) == [one.car for one in field]
    places = [line.place for line in lines]
    assert places[0] == 1
    assert all(after in (before, k) for k, (before, after) in enumerate(pairwise(places), start=2))
    for line in lines:
        assert line.tied == (places.count(line.place) > 1)
        assert line.gap is None or line.gap >= 0
        assert line.interval is None or line.interval >= 0


def at(lines: Sequence[Standing], number: int) -> tuple[int, int]:
    """Where the car stands in the list, and its place."""
    return next((k, line.place) for k, line in enumerate(lines) if line.car == number)


penalties = st.builds(
    Penalty,
    offence=st.just("judge"),
    seconds=st.floats(0, 100).map(lambda t: round(t, 3)),
    factor=st.floats(0, 1),
    invalid=st.booleans(),
    reason=st.just("a judge's"),
)
CONSTANT_SIGMA = (Ranking.BEST_LAP, Ranking.TOTAL_TIME, Ranking.SURVIVAL)
"""Where all laps are equally sure, so are all values under these; total times only if they begin at a crossing."""


@given(field=cars(), rules=formats, penalty=penalties, data=st.data())
def test_a_penalty_never_improves_a_place(
    field: list[CarResult], rules: FormatRules, penalty: Penalty, data: st.DataObject
) -> None:
    """Whatever it costs, nobody comes to stand further up; nor, where all are equally sure, to share a better place."""
    if rules.rank_by is Ranking.SIMILARITY:
        penalty = replace(penalty, invalid=False)  # without its worst lap a mean gets better
    chosen = data.draw(st.sampled_from(field))
    if not chosen.laps:
        return
    k = data.draw(st.integers(0, len(chosen.laps) - 1))
    laps = (*chosen.laps[:k], with_penalties(chosen.laps[k], [penalty]), *chosen.laps[k + 1 :])
    worse = [replace(one, laps=laps) if one is chosen else one for one in field]
    before = at(classify(field, rules, WANTED), chosen.car)
    after = at(classify(worse, rules, WANTED), chosen.car)
    assert after[0] >= before[0]
    if rules.rank_by in CONSTANT_SIGMA and (rules.rank_by is not Ranking.TOTAL_TIME or rules.warm_up_laps > 0):
        assert after[1] >= before[1]


@given(field=cars(clean=True), rules=formats, data=st.data())
def test_without_one_of_its_valid_laps_nobody_stands_better(
    field: list[CarResult], rules: FormatRules, data: st.DataObject
) -> None:
    """A mean of similarities is the exception, as its worst lap is worth less than none."""
    if rules.rank_by is Ranking.SIMILARITY:
        return
    chosen = data.draw(st.sampled_from(field))
    valid = [one for one in chosen.laps if one.valid]
    if not valid:
        return
    taken = data.draw(st.sampled_from(valid))
    fewer = replace(chosen, laps=tuple(one for one in chosen.laps if one is not taken))
    before = at(classify(field, rules, WANTED), chosen.car)
    after = at(classify([fewer if one is chosen else one for one in field], rules, WANTED), chosen.car)
    assert after[0] >= before[0]
