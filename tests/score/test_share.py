"""Shares of successes: their intervals hold and their comparisons raise no false alarm, however laps of a run hang together."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from dnb_edge.score.compare import differs
from dnb_edge.score.share import Tally, compare_shares, share, share_p

TRIALS = 2000


def runs_of(*counts: tuple[int, int]) -> list[Tally]:
    return [Tally(successes=successes, attempts=attempts) for successes, attempts in counts]


def drawn(rng: np.random.Generator, runs: int, mean: float, together: float) -> list[Tally]:
    """Runs of 3 laps, with a chance of their own; `together` 0: all laps alike by chance, 1: all of a run end alike."""
    found = []
    for _ in range(runs):
        chance = mean
        if together:
            spread = 1 / together - 1
            chance = rng.beta(mean * spread, (1 - mean) * spread)
        found.append(Tally(successes=int(rng.binomial(3, chance)), attempts=3))
    return found


@pytest.mark.parametrize("mean", [0.6, 0.95])
@pytest.mark.parametrize("together", [0.0, 0.5, 0.95])
@pytest.mark.parametrize("runs", [5, 30])
def test_intervals_hold_the_share_however_laps_hang_together(runs: int, together: float, mean: float) -> None:
    """At least 93 of 100 intervals over runs hold the chance that laps succeeded with, near 1 as well."""
    rng = np.random.default_rng(3)
    hits = 0
    for _ in range(TRIALS):
        found = share(drawn(rng, runs, mean, together))
        assert found is not None
        hits += found.low <= mean <= found.high
    assert hits / TRIALS >= 0.93


@pytest.mark.parametrize("together", [0.0, 0.95])
@pytest.mark.parametrize("mean", [0.6, 0.95])
@pytest.mark.parametrize("runs", [(5, 5), (30, 10)])
def test_alike_entries_are_told_apart_in_at_most_5_percent(runs: tuple[int, int], mean: float, together: float) -> None:
    """False alarms between two entries of equal chances: not more than 6 of 100, with few runs and with all laps alike."""
    rng = np.random.default_rng(4)
    alarms = 0
    for _ in range(TRIALS):
        one, other = (share(drawn(rng, count, mean, together)) for count in runs)
        assert one is not None
        assert other is not None
        alarms += differs(share_p(one, other))
    assert alarms / TRIALS <= 0.06


def test_laps_of_one_run_are_its_trials() -> None:
    """With one run the interval counts laps, and is Wilson's as SciPy has it; with several it counts runs."""
    one = share(runs_of((7, 10)))
    assert one is not None
    expected = stats.binomtest(7, 10).proportion_ci(method="wilson")
    assert (one.share, one.trials) == (0.7, 10)
    assert (one.low, one.high) == pytest.approx((expected.low, expected.high))
    several = share(runs_of((3, 3), (0, 0), (2, 3), (3, 3)))
    assert several is not None
    assert (several.share, several.trials) == (8 / 9, 3)
    assert share(runs_of((0, 0))) is None
    assert share([]) is None


@given(st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=1, max_size=40))
def test_an_interval_holds_its_share_and_has_a_width(counts: list[tuple[int, int]]) -> None:
    """Within 0..1, round the share, never empty, whatever was counted."""
    found = share(runs_of(*((min(one, all_), all_) for one, all_ in counts)))
    if found is None:
        return
    assert 0 <= found.low <= found.share <= found.high <= 1
    assert found.high - found.low > 0.01


def test_two_runs_each_prove_nothing() -> None:
    """All against none in two runs each is no proof; in ten it is."""
    few = [share(runs_of(*[(successes, 1)] * 2)) for successes in (1, 0)]
    many = [share(runs_of(*[(successes, 1)] * 10)) for successes in (1, 0)]
    assert compare_shares(few).groups == (frozenset({0, 1}),)
    assert compare_shares(many).groups == (frozenset({0}), frozenset({1}))


def test_alike_and_none() -> None:
    """Equal shares are alike with certainty; a candidate that never tried is compared with nobody."""
    same = share(runs_of((3, 3), (3, 3)))
    found = compare_shares([same, None, same])
    assert found.p == {(0, 2): 1.0}
    assert found.letters == ("a", None, "a")
    assert math.isclose(found.least_p([0, 2]), 1.0)
