"""How sure a mean is, and which means cannot be told apart.

Knows numbers in groups: laps within runs, any unit. Knows no lap, no entry and no file. All sums are exact (`math.fsum`), so
the order of values, runs and candidates changes nothing.

Laps of one run share its lighting, tyres and battery, so they are no independent trials of a driver. Where there are several
runs, each run counts as one value, its mean; the interval then holds for a driver's further runs. Where there is only one, its
laps are the values, and the interval holds for further laps of that run.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from string import ascii_lowercase, ascii_uppercase
from typing import TypeAlias

from dnb_edge.score.student import two_sided_p, two_sided_quantile

CONFIDENCE = 0.95
"""Of every interval and comparison."""

Pair: TypeAlias = tuple[int, int]
"""Two candidates by their index, the lesser first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """What was measured in one run: one value a lap."""

    values: tuple[float, ...]
    sigmas: tuple[float, ...] = ()
    """One standard deviation of each value's measurement, or none at all where it is not known."""
    pair: str | None = None
    """What it shares with one run of each other candidate, such as a seed from which all conditions follow; None where it
    shares nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A mean with its spread and, where there is more than one value, its interval. Units are the values'."""

    mean: float
    """Of all laps with one run; of the runs' means with several."""
    sd: float | None
    """Standard deviation of all laps about their own mean; None with one lap."""
    runs: int
    """Runs that had a value."""
    error: float | None
    """One standard error of `mean`; None with one lap."""
    df: float | None
    """Degrees of freedom behind `error`."""
    low: float | None
    """Lower end of the 95 % confidence interval of `mean`; None with one lap."""
    high: float | None


def estimate(samples: Iterable[Sample]) -> Estimate | None:
    """The mean over the runs `samples`; None where there is no value at all.

    Interval: mean +- t(0.975, n - 1) s / sqrt(n), over laps with one run, over the runs' means with several. The spread of
    measured values holds their measurement's part already; an interval is never narrower than the sigmas alone make it (1.96 of
    their standard error), as it could be by chance with few values.
    """
    kept = [sample for sample in samples if sample.values]
    values = [value for sample in kept for value in sample.values]
    if not values:
        return None
    units = [_mean(sample.values) for sample in kept] if len(kept) > 1 else values
    mean, sd = _mean(units), _sd(values)
    spread = _sd(units)
    if spread is None:
        return Estimate(mean=mean, sd=sd, runs=len(kept), error=None, df=None, low=None, high=None)
    seen = (spread / math.sqrt(len(units)), len(units) - 1.0)
    measured = (_measured_error(kept), math.inf)
    half, error, df = max((two_sided_quantile(CONFIDENCE, df) * error, error, df) for error, df in (seen, measured))
    return Estimate(mean=mean, sd=sd, runs=len(kept), error=error, df=df, low=mean - half, high=mean + half)


def welch_p(one: Estimate, other: Estimate) -> float | None:
    """Probability of means at least so far apart if the two were alike: Welch's t test, two-sided. None without intervals.

    Welch, Biometrika 34, 28 (1947), with the degrees of freedom of Satterthwaite, Biometrics Bull. 2, 110 (1946).
    """
    if one.error is None or other.error is None or one.df is None or other.df is None:
        return None
    apart = abs(one.mean - other.mean)
    # Shares of the greater error: squares of small errors would vanish.
    scale = max(one.error, other.error)
    if scale == 0.0:
        return 1.0 if apart == 0.0 else 0.0
    first, second = (one.error / scale) ** 2, (other.error / scale) ** 2
    share = first**2 / one.df + second**2 / other.df
    df = (first + second) ** 2 / share if share else math.inf
    return two_sided_p(apart / scale / math.sqrt(first + second), df)


def paired_p(one: Sequence[Sample], other: Sequence[Sample]) -> float | None:
    """As `welch_p`, of two candidates whose runs were driven in pairs under the very same conditions: Student's t test over the
    differences within pairs, which what the pairs differ in cannot blur. None where they do not have the same pairs, or fewer
    than two in which both have a value.

    The spread of few differences may be small by chance: it is never taken for less than the measurement's.
    """
    of_one, of_other = _by_pair(one), _by_pair(other)
    if of_one is None or of_other is None or set(of_one) != set(of_other):
        return None
    both = [pair for pair in sorted(of_one) if of_one[pair].values and of_other[pair].values]
    differences = [_mean(of_one[pair].values) - _mean(of_other[pair].values) for pair in both]
    spread = _sd(differences)
    if spread is None:
        return None
    mean = abs(_mean(differences))
    measured = math.hypot(*(_measured_error([of[pair] for pair in both]) for of in (of_one, of_other)))
    errors = ((spread / math.sqrt(len(both)), len(both) - 1.0), (measured, math.inf))
    return max(two_sided_p(mean / error, df) if error else float(mean == 0.0) for error, df in errors)


def _by_pair(samples: Sequence[Sample]) -> dict[str, Sample] | None:
    """The samples by what pairs them; None where one has none or shares it with another of these."""
    found = {sample.pair: sample for sample in samples if sample.pair is not None}
    return found if len(found) == len(samples) else None


def holm(p_values: Mapping[Pair, float]) -> dict[Pair, float]:
    """The p values corrected for their number, so that all comparisons together raise a false alarm in 5 %.

    Holm, Scand. J. Statist. 6, 65 (1979): the k-th smallest of m is multiplied by m - k + 1, none falls below a smaller one's.
    """
    adjusted: dict[Pair, float] = {}
    least = 0.0
    for rank, pair in enumerate(sorted(p_values, key=lambda one: (p_values[one], one))):
        least = max(least, min(1.0, (len(p_values) - rank) * p_values[pair]))
        adjusted[pair] = least
    return adjusted


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Which of several candidates differ in one figure."""

    p: Mapping[Pair, float]
    """Corrected p value of each pair that could be tested."""
    untested: frozenset[int]
    """Candidates with a mean but no interval: nothing can be said of them."""
    letters: tuple[str | None, ...]
    """A candidate's groups: two that share a letter cannot be told apart. None for a candidate that was not tested."""
    groups: tuple[frozenset[int], ...]
    """The groups behind the letters, `a` first."""

    def least_p(self, group: Iterable[int]) -> float:
        """The least corrected p value among the pairs of a group of two or more."""
        return min(self.p[pair] for pair in combinations(sorted(group), 2))

    def alike(self, candidate: int) -> tuple[int, ...]:
        """The candidates that were not shown to differ from `candidate`, in order; none where it has no mean."""
        tested = {i for i, letters in enumerate(self.letters) if letters is not None}
        if candidate in self.untested:
            return tuple(sorted((tested | self.untested) - {candidate}))
        if candidate not in tested:
            return ()
        same = (i for i in tested - {candidate} if not differs(self.p[_pair(i, candidate)]))
        return tuple(sorted((*same, *self.untested)))


def differs(p: float) -> bool:
    """Whether a corrected p value tells two candidates apart at 95 %."""
    return p < 1 - CONFIDENCE


def compare(estimates: Sequence[Estimate | None], runs: Sequence[Sequence[Sample]] | None = None) -> Comparison:
    """Each candidate against each other with Holm's correction: Welch's test, or of the differences within pairs where `runs`,
    what the estimates were made of, come in pairs. None is a candidate without a value.
    """
    tested = [i for i, one in enumerate(estimates) if one is not None and one.error is not None]
    raw = {}
    for i, j in combinations(tested, 2):
        one, other = estimates[i], estimates[j]
        assert one is not None, "only tested ones"
        assert other is not None, "only tested ones"
        p = None if runs is None else paired_p(runs[i], runs[j])
        p = welch_p(one, other) if p is None else p
        assert p is not None, "both have an interval"
        raw[i, j] = p
    return compared(raw, tested, candidates=len(estimates), untested=_without_interval(estimates))


def compared(
    p_values: Mapping[Pair, float], tested: Sequence[int], *, candidates: int, untested: frozenset[int] = frozenset()
) -> Comparison:
    """What the uncorrected p values of all pairs of `tested` come to; of `untested` nothing can be said."""
    adjusted = holm(p_values)
    groups = letter_groups(tested, {pair for pair, p in adjusted.items() if differs(p)})
    return Comparison(
        p=adjusted,
        untested=untested,
        letters=tuple(
            "".join(_letter(k) for k, group in enumerate(groups) if i in group) if i in tested else None
            for i in range(candidates)
        ),
        groups=tuple(groups),
    )


def letter_groups(candidates: Sequence[int], different: Iterable[Pair]) -> list[frozenset[int]]:
    """The largest groups of candidates of which no two are `different`, first those of the first candidates.

    Piepho's insert and absorb, J. Comput. Graph. Statist. 13, 456 (2004). Every pair that is not different shares a group.
    """
    groups = {frozenset(candidates)} if candidates else set()
    for i, j in sorted(different):
        both = {group for group in groups if i in group and j in group}
        groups = (groups - both) | {group - {one} for group in both for one in (i, j)}
        groups = {group for group in groups if not any(group < other for other in groups)}
    return sorted(groups, key=sorted)


def _without_interval(estimates: Sequence[Estimate | None]) -> frozenset[int]:
    return frozenset(i for i, one in enumerate(estimates) if one is not None and one.error is None)


def _letter(number: int) -> str:
    letters = ascii_lowercase + ascii_uppercase
    return letters[number] if number < len(letters) else f"({number + 1})"


def _pair(i: int, j: int) -> Pair:
    return (i, j) if i < j else (j, i)


def _mean(values: Sequence[float]) -> float:
    return math.fsum(values) / len(values)


def _sd(values: Sequence[float]) -> float | None:
    """Sample standard deviation; None with fewer than two values."""
    if len(values) < 2:
        return None
    mean = _mean(values)
    return math.sqrt(math.fsum((value - mean) ** 2 for value in values) / (len(values) - 1))


def _measured_error(samples: Sequence[Sample]) -> float:
    """Standard error that the measurement alone gives the mean of the runs' means; 0 where no sigma is known."""
    per_run = [math.sqrt(math.fsum(sigma**2 for sigma in sample.sigmas)) / len(sample.values) for sample in samples]
    return math.sqrt(math.fsum(error**2 for error in per_run)) / len(samples)
