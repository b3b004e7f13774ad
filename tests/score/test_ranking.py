"""Ranks over resamples: as sure as the runs make them, ties shared, nothing depends on order."""

import random
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnb_edge.score.compare import Sample
from dnb_edge.score.ranking import Ranking, _resampled, joint_units, mean_units, ranking, share_units
from dnb_edge.score.share import Tally


def of_runs(*means: float) -> tuple[tuple[float, float], ...]:
    return mean_units([Sample(values=(mean,)) for mean in means])


def ranks(found: Ranking) -> list[int | None]:
    return [None if place is None else place.rank for place in found.places]


def test_far_apart_is_certain_and_alike_is_not() -> None:
    """Three entries far apart keep their order in every resample; two of one spread change places in about half."""
    rng = np.random.default_rng(1)
    apart = ranking([of_runs(*rng.normal(mean, 0.1, 30)) for mean in (9.0, 10.0, 11.0)], most_is_best=False)
    assert (ranks(apart), apart.order_share) == ([1, 2, 3], 1.0)
    assert [place.shares for place in apart.places if place] == [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
    same = rng.normal(10.0, 0.1, 30)
    alike = ranking([of_runs(*same), of_runs(*(same + 1e-6)), of_runs(*rng.normal(20, 0.1, 30))], most_is_best=True)
    assert alike.order_share is not None
    assert 0.45 < alike.order_share < 0.55
    assert alike.places[2] is not None
    assert (alike.places[2].low, alike.places[2].high, alike.places[2].share) == (1, 1, 1.0)
    assert alike.places[0] is not None
    assert (alike.places[0].low, alike.places[0].high) == (2, 3)


@pytest.mark.parametrize("runs", [3, 10, 30])
def test_an_order_holds_as_often_as_it_is_said_to(runs: int) -> None:
    """Means that differ by one standard error of their difference: resamples keep the order about as often as new runs do."""
    rng = np.random.default_rng(2)
    gap = (2 / runs) ** 0.5
    told, kept = [], []
    for _ in range(300):
        pair = [of_runs(*rng.normal(mean, 1.0, runs)) for mean in (0.0, gap)]
        found = ranking(pair, most_is_best=False, resamples=200)
        again = rng.normal(0.0, 1.0, runs).mean() < rng.normal(gap, 1.0, runs).mean()
        place = found.places[0]
        assert place is not None
        told.append(place.shares[0])
        kept.append(again)
    # A resample varies about a mean that varies itself, so it is somewhat less sure of the order than new runs are.
    assert np.mean(kept) - 0.13 < np.mean(told) < np.mean(kept) + 0.03


@pytest.mark.parametrize("runs", [2, 3, 10])
def test_resampled_means_spread_as_means_do(runs: int) -> None:
    """The variance over resamples is s^2 / n, which drawing as many runs as there are would make n - 1 nths of."""
    values = np.random.default_rng(6).normal(10.0, 1.0, runs)
    means = _resampled(of_runs(*values), 0, 20_000)
    assert means.var() == pytest.approx(values.var(ddof=1) / runs, rel=0.04)


def test_runs_in_pairs_are_drawn_together() -> None:
    """Seeds that make everybody slow or fast cannot change an order that each of them confirms; drawn apart they would."""
    seeds = np.random.default_rng(7).normal(0.0, 1.0, 10)
    runs = [
        [Sample(values=(10.0 + shift + value,), pair=str(k)) for k, value in enumerate(seeds)] for shift in (0.0, 0.1)
    ]
    joint = joint_units([runs[0], runs[1][::-1]])
    assert joint is not None
    assert ranking(joint, most_is_best=False, joint=True).order_share == 1.0
    apart = ranking([mean_units(of_one) for of_one in runs], most_is_best=False).order_share
    assert apart is not None
    assert apart < 0.8


def test_a_run_that_failed_is_drawn_and_comes_to_nothing() -> None:
    """Whoever has no lap in any drawn run is last in that resample; who has none at all, in all of them."""
    whole = [Sample(values=(10.0 + k,), pair=str(k)) for k in range(2)]
    half = [Sample(values=(1.0,), pair="0"), Sample(values=(), pair="1")]
    joint = joint_units([whole, half, [replace(one, values=()) for one in whole]])
    assert joint is not None
    found = ranking(joint, most_is_best=False, joint=True)
    assert ranks(found) == [2, 1, 3]
    assert found.order_share == pytest.approx(0.5, abs=0.05)
    nothing = [joint[2], joint[2]]
    assert ranking(nothing, most_is_best=False, joint=True).order_share is None


def test_what_is_not_drawn_together() -> None:
    """Other seeds, one twice, none, or a single one; tallies as samples."""
    one, two = Tally(successes=1, attempts=2, pair="1"), Tally(successes=2, attempts=2, pair="2")
    assert joint_units([[one, two], [two, one]]) == [((1.0, 2.0), (2.0, 2.0))] * 2
    bare = Tally(successes=1, attempts=2)
    for runs in ([[one, two], [one]], [[one, two], [one, one]], [[bare, two], [one, two]], [[one], [one]], [[], []]):
        assert joint_units(runs) is None


def test_the_best_is_the_first_either_way() -> None:
    """Least or most is best as asked for."""
    units = [of_runs(1.0, 1.1), of_runs(2.0, 2.1)]
    assert ranks(ranking(units, most_is_best=False)) == [1, 2]
    assert ranks(ranking(units, most_is_best=True)) == [2, 1]


def test_who_never_finished_is_last_and_who_shows_no_spread_has_no_place() -> None:
    """No unit: last, in every resample; a single unit: no place. Nobody to compare with: no ranking at all."""
    found = ranking([(), of_runs(5.0, 5.1), of_runs(4.0), ()], most_is_best=False)
    assert (ranks(found), found.order_share) == ([2, 1, None, 2], 1.0)
    for units in ([], [of_runs(1.0, 2.0)], [of_runs(1.0), of_runs(2.0)], [(), ()]):
        assert ranking(units, most_is_best=True).order_share is None


def test_shares_that_are_equal_share_a_rank() -> None:
    """Two entries that never failed are both first in every resample."""
    good, bad = [Tally(successes=3, attempts=3)] * 5, [Tally(successes=1, attempts=3)] * 5
    found = ranking([share_units(runs) for runs in (good, bad, good)], most_is_best=True)
    assert (ranks(found), found.order_share) == ([1, 3, 1], 1.0)


def test_what_is_drawn() -> None:
    """Means of runs, or the laps of the only run; shares by their attempts, or lap by lap."""
    assert mean_units([Sample(values=(1.0, 2.0)), Sample(values=()), Sample(values=(3.0,))]) == ((1.5, 1), (3.0, 1))
    assert mean_units([Sample(values=(1.0, 2.0)), Sample(values=())]) == ((1.0, 1), (2.0, 1))
    assert share_units([Tally(successes=1, attempts=2), Tally(successes=0, attempts=0)]) == ((1, 1), (0, 1))
    assert share_units([Tally(successes=1, attempts=2), Tally(successes=0, attempts=3)]) == ((1, 2), (0, 3))


@settings(max_examples=30)
@given(
    runs=st.lists(st.lists(st.floats(1, 100), max_size=6), min_size=1, max_size=5),
    seed=st.integers(0, 99),
    most=st.booleans(),
)
def test_the_order_of_runs_changes_nothing(runs: list[list[float]], seed: int, most: bool) -> None:
    """The same runs in another order give the same ranks and shares; shares of each place add up to one."""
    shuffled = [random.Random(seed).sample(run, len(run)) for run in runs]
    one, other = (
        ranking([of_runs(*run) for run in order], most_is_best=most, resamples=200) for order in (runs, shuffled)
    )
    assert one == other
    for place in one.places:
        if place is not None:
            assert sum(place.shares) == pytest.approx(1.0)
            assert 1 <= place.low <= place.high <= len(runs)
