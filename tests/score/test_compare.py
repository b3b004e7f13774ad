"""Intervals and comparisons: they hold as often as they say, agree with SciPy, and do not depend on order."""

import math
import random
from collections.abc import Callable
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from dnb_edge.score.compare import Estimate, Sample, compare, differs, estimate, holm, letter_groups, paired_p, welch_p

TRIALS = 4000


def one_run(*values: float) -> Estimate | None:
    return estimate([Sample(values=values)])


def covered(draw: Callable[[np.random.Generator], list[Sample]], truth: float) -> float:
    """How often the interval holds `truth`."""
    rng = np.random.default_rng(5)
    hits = 0
    for _ in range(TRIALS):
        found = estimate(draw(rng))
        assert found is not None
        assert found.low is not None
        assert found.high is not None
        hits += found.low <= truth <= found.high
    return hits / TRIALS


@pytest.mark.parametrize("laps", [2, 5, 10, 30])
def test_intervals_over_laps_hold_the_truth_in_95_percent(laps: int) -> None:
    """Normal laps of one run: 93 to 97 of 100 intervals hold the mean that they were drawn from."""
    share = covered(lambda rng: [Sample(values=tuple(rng.normal(12.0, 0.4, laps).tolist()))], 12.0)
    assert 0.93 <= share <= 0.97


@pytest.mark.parametrize("runs", [2, 3, 5, 10])
def test_intervals_over_runs_hold_the_truth_though_laps_of_a_run_hang_together(runs: int) -> None:
    """Runs of 3 to 8 laps with a spread of their own, twice that of laps: still 93 to 97 of 100."""

    def draw(rng: np.random.Generator) -> list[Sample]:
        return [
            Sample(values=tuple(rng.normal(rng.normal(12.0, 0.4), 0.2, rng.integers(3, 9)).tolist()))
            for _ in range(runs)
        ]

    assert 0.93 <= covered(draw, 12.0) <= 0.97


def test_laps_of_several_runs_thrown_together_would_claim_too_much() -> None:
    """Why runs are what counts: the same laps taken as independent hold the truth in far fewer than 95 of 100."""

    def draw(rng: np.random.Generator) -> list[Sample]:
        laps = [rng.normal(rng.normal(12.0, 0.4), 0.2, 8) for _ in range(3)]
        return [Sample(values=tuple(np.concatenate(laps).tolist()))]

    assert covered(draw, 12.0) < 0.75


@pytest.mark.parametrize("sigma_s", [0.002, 0.4])
def test_the_measurement_is_in_the_interval(sigma_s: float) -> None:
    """Laps measured with a sigma as small or as large as their own spread: 93 to 97 of 100."""

    def draw(rng: np.random.Generator) -> list[Sample]:
        measured = rng.normal(12.0, 0.4, 5) + rng.normal(0.0, sigma_s, 5)
        return [Sample(values=tuple(measured.tolist()), sigmas=(sigma_s,) * 5)]

    assert 0.93 <= covered(draw, 12.0) <= 0.97


def test_no_interval_is_narrower_than_the_measurement_makes_it() -> None:
    """Two laps that agree by chance are known no better than they were measured."""
    found = estimate([Sample(values=(10.0, 10.0), sigmas=(0.03, 0.04))])
    assert found is not None
    assert found.high == pytest.approx(10.0 + 1.96 * 0.025, abs=1e-5)
    other = estimate([Sample(values=(10.05, 10.05), sigmas=(0.03, 0.04))])
    assert other is not None
    assert welch_p(found, other) == pytest.approx(2 * stats.norm.sf(0.05 / 0.025 / math.sqrt(2)))


def test_one_lap_has_a_mean_and_no_interval() -> None:
    """Nothing is made up where there is no spread to see; nothing at all where there is no lap."""
    found = one_run(67.5)
    assert found is not None
    assert (found.mean, found.sd, found.low, found.high) == (67.5, None, None, None)
    assert estimate([Sample(values=()), Sample(values=())]) is None


def test_each_run_counts_alike() -> None:
    """The mean of several runs is that of their means; a run without a valid lap is none of them."""
    found = estimate([Sample(values=(10.0, 10.0, 10.0, 10.0)), Sample(values=(20.0,)), Sample(values=())])
    assert found is not None
    assert (found.mean, found.runs, found.df) == (15.0, 2, 1.0)


FIGURES = st.lists(st.floats(1, 100), min_size=2, max_size=8)


@given(one=FIGURES, other=FIGURES)
def test_welch_is_scipys(one: list[float], other: list[float]) -> None:
    """Two samples of one run each: the p value of `scipy.stats.ttest_ind(equal_var=False)`."""
    if np.std(one) < 1e-3 or np.std(other) < 1e-3:
        return
    first, second = one_run(*one), one_run(*other)
    assert first is not None
    assert second is not None
    expected = stats.ttest_ind(one, other, equal_var=False).pvalue
    assert welch_p(first, second) == pytest.approx(expected, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize(("laps", "spreads"), [((5, 5), (1.0, 1.0)), ((10, 6), (1.0, 0.3)), ((30, 8), (1.0, 2.0))])
def test_alike_entries_are_told_apart_in_5_percent(laps: tuple[int, int], spreads: tuple[float, float]) -> None:
    """Welch's false alarms, with equal and with very different spreads and numbers of laps: 3.5 to 6.5 of 100."""
    rng = np.random.default_rng(7)
    alarms = 0
    for _ in range(TRIALS):
        found = [one_run(*rng.normal(50.0, spread, n).tolist()) for n, spread in zip(laps, spreads, strict=True)]
        assert found[0] is not None
        assert found[1] is not None
        p = welch_p(found[0], found[1])
        alarms += p is not None and p < 0.05
    assert 0.035 <= alarms / TRIALS <= 0.065


def test_many_alike_entries_raise_a_false_alarm_in_at_most_5_percent() -> None:
    """Holm's correction: of tables of five alike entries, ten pairs each, not more than 6 in 100 tell any pair apart."""
    rng = np.random.default_rng(11)
    alarms = 0
    for _ in range(1000):
        found = compare([one_run(*rng.normal(50.0, 1.0, 8).tolist()) for _ in range(5)])
        alarms += any(differs(p) for p in found.p.values())
    assert alarms / 1000 <= 0.06


def test_holm_as_in_the_textbook() -> None:
    """The least of m times m, the next m - 1, and none below a smaller one's; never above 1."""
    assert holm({(0, 1): 0.01, (0, 2): 0.04, (1, 2): 0.03}) == pytest.approx({(0, 1): 0.03, (1, 2): 0.06, (0, 2): 0.06})
    assert holm({(0, 1): 0.9, (0, 2): 0.8}) == {(0, 1): 1.0, (0, 2): 1.0}
    assert holm({}) == {}


def test_no_spread_at_all() -> None:
    """Figures that are exactly alike and exactly different, without any spread: told for what they are."""
    same, again, other = one_run(100.0, 100.0), one_run(100.0, 100.0), one_run(90.0, 90.0)
    assert same is not None
    assert again is not None
    assert other is not None
    assert welch_p(same, again) == 1.0
    assert welch_p(same, other) == 0.0


@pytest.mark.parametrize(
    ("n", "different", "expected"),
    [
        (0, [], []),
        (1, [], [{0}]),
        (3, [], [{0, 1, 2}]),
        (3, [(0, 1), (0, 2), (1, 2)], [{0}, {1}, {2}]),
        (3, [(0, 2)], [{0, 1}, {1, 2}]),
        (4, [(0, 3)], [{0, 1, 2}, {1, 2, 3}]),
        (4, [(0, 2), (0, 3), (1, 3)], [{0, 1}, {1, 2}, {2, 3}]),
    ],
)
def test_letters(n: int, different: list[tuple[int, int]], expected: list[set[int]]) -> None:
    """The groups behind a, ab, b."""
    assert letter_groups(range(n), different) == expected


@given(n=st.integers(1, 7), data=st.data())
def test_two_share_a_letter_where_they_are_not_different_and_only_there(n: int, data: st.DataObject) -> None:
    """Whatever differs from what, letters say exactly that, and no group lies within another."""
    pairs = list(combinations(range(n), 2))
    different = data.draw(st.sets(st.sampled_from(pairs))) if pairs else set()
    groups = letter_groups(range(n), different)
    assert set().union(*groups) == set(range(n))
    for i, j in pairs:
        assert any({i, j} <= group for group in groups) == ((i, j) not in different)
    assert not any(one < other for one in groups for other in groups)


def test_who_is_alike() -> None:
    """Far apart is different, close is alike, one lap tells nothing, no lap is not compared."""
    found = compare([one_run(10, 10.1, 9.9), one_run(10.02, 9.96, 10.1), one_run(50, 50.1, 49.9), one_run(10), None])
    assert found.letters == ("a", "a", "b", None, None)
    assert [found.alike(i) for i in range(5)] == [(1, 3), (0, 3), (3,), (0, 1, 2), ()]


@given(
    runs=st.lists(st.lists(st.floats(1, 1e6), max_size=5), min_size=1, max_size=5),
    seed=st.integers(0, 99),
)
def test_the_order_of_runs_and_laps_changes_not_a_bit(runs: list[list[float]], seed: int) -> None:
    """Sums are exact: shuffled runs of shuffled laps give the very same figures."""
    shuffled = [random.Random(seed).sample(run, len(run)) for run in runs]
    random.Random(seed).shuffle(shuffled)
    one, other = (estimate([Sample(values=tuple(run)) for run in order]) for order in (runs, shuffled))
    assert one == other
    assert one is None or math.isfinite(one.mean)


def in_pairs(values: list[float], *, sigma: float | None = None, names: str = "abcdefgh") -> list[Sample]:
    sigmas = () if sigma is None else (sigma,)
    return [Sample(values=(value,), sigmas=sigmas, pair=name) for value, name in zip(values, names, strict=False)]


@given(one=FIGURES, other=FIGURES)
def test_pairs_are_compared_as_scipy_does(one: list[float], other: list[float]) -> None:
    """Runs in pairs: the p value of `scipy.stats.ttest_rel`, in whatever order they come."""
    count = min(len(one), len(other))
    if np.std(np.subtract(one[:count], other[:count])) < 1e-3:
        return
    first, second = in_pairs(one[:count]), in_pairs(other[:count])
    expected = stats.ttest_rel(one[:count], other[:count]).pvalue
    assert paired_p(first, second) == pytest.approx(expected, rel=1e-6, abs=1e-12)
    assert paired_p(first[::-1], second) == paired_p(first, second) == paired_p(second, first)


def test_what_pairs_differ_in_does_not_blur_them() -> None:
    """Seeds that make everybody slow or fast: two that Welch cannot part are told apart pair by pair, with a candidate that has
    no pairs as before; and alike ones are not."""
    rng = np.random.default_rng(9)
    seeds = rng.normal(0.0, 1.0, 8)
    runs = [in_pairs((10.0 + shift + seeds + rng.normal(0, 0.05, 8)).tolist()) for shift in (0.0, 0.3, 0.0)]
    runs.append([Sample(values=(10.0 + value,)) for value in seeds])
    estimates = [estimate(of_one) for of_one in runs]
    assert len(compare(estimates).groups) == 1
    found = compare(estimates, runs)
    assert {pair for pair, p in found.p.items() if differs(p)} == {(0, 1), (1, 2)}


def test_alike_pairs_raise_a_false_alarm_in_5_percent() -> None:
    """Seeds with ten times the spread of drivers: 3.5 to 6.5 of 100 alike pairs of entries are told apart."""
    rng = np.random.default_rng(10)
    alarms = 0
    for _ in range(TRIALS):
        seeds = rng.normal(50.0, 1.0, 6)
        p = paired_p(*(in_pairs((seeds + rng.normal(0.0, 0.1, 6)).tolist()) for _ in range(2)))
        alarms += p is not None and p < 0.05
    assert 0.035 <= alarms / TRIALS <= 0.065


def test_what_is_no_pair() -> None:
    """Other seeds, one seed twice, none, or fewer than two with a value: no pairs. A failed run leaves its pair out."""
    pairs = in_pairs([1.0, 2.0, 3.5])
    assert paired_p(pairs, in_pairs([1.0, 2.0, 3.0], names="abx")) is None
    twice = in_pairs([1.0, 2.0, 3.0], names="aab")
    assert paired_p(twice, twice) is None
    assert paired_p(pairs, [Sample(values=(1.0,))] * 3) is None
    assert paired_p(pairs[:1], pairs[:1]) is None
    failed = [*in_pairs([1.1, 2.3]), Sample(values=(), pair="c")]
    assert paired_p(pairs, failed) == paired_p(pairs[:2], failed[:2])


def test_pairs_are_known_no_better_than_they_were_measured() -> None:
    """Differences that agree by chance have the measurement's error: 0.05 s of two sigmas of 0.03 s, three times over."""
    p = paired_p(in_pairs([10.0, 11.0, 12.0], sigma=0.03), in_pairs([10.05, 11.05, 12.05], sigma=0.03))
    assert p == pytest.approx(2 * stats.norm.sf(0.05 / math.hypot(0.03, 0.03) * math.sqrt(3)), rel=1e-6)
    assert paired_p(in_pairs([10.0, 11.0]), in_pairs([10.0, 11.0])) == 1.0
