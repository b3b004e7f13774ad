"""How sure a share of successes is, and whether two differ: of laps that succeeded, in runs or in one.

Knows counts only. Laps of one run succeed or fail for the same reasons, so where there are several runs each counts as one
trial, however many laps it had. A run's share lies within 0..1 and so never varies more than one trial that succeeds or fails:
what is said here holds even where all laps of a run always end alike, and is on the safe side where they do not.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from dnb_edge.score.compare import CONFIDENCE, Comparison, Pair, compared
from dnb_edge.score.student import two_sided_p, two_sided_quantile


@dataclass(frozen=True, slots=True, kw_only=True)
class Tally:
    """What one run came to."""

    successes: int
    attempts: int
    pair: str | None = None
    """As in `compare.Sample`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Share:
    """Successes for each attempt, 0..1, with its interval."""

    share: float
    """Of all attempts of all runs."""
    trials: int
    """What the interval counts: runs where there are several, else attempts."""
    low: float
    """Lower end of the 95 % confidence interval."""
    high: float


def share(runs: Iterable[Tally]) -> Share | None:
    """The share over `runs`; None where nothing was attempted.

    Interval: Wilson's score interval, J. Am. Stat. Assoc. 22, 209 (1927), which keeps within 0..1 and has a width at its ends.
    """
    kept = [run for run in runs if run.attempts]
    attempts = sum(run.attempts for run in kept)
    if not attempts:
        return None
    part = sum(run.successes for run in kept) / attempts
    trials = len(kept) if len(kept) > 1 else attempts
    z = two_sided_quantile(CONFIDENCE, math.inf)
    slack = z**2 / trials
    middle = (part + slack / 2) / (1 + slack)
    half = z / (1 + slack) * math.sqrt(part * (1 - part) / trials + slack / (4 * trials))
    # At 0 and at 1 the end is that very number, but for rounding.
    low, high = min(max(middle - half, 0.0), part), max(min(middle + half, 1.0), part)
    return Share(share=part, trials=trials, low=low, high=high)


def share_p(one: Share, other: Share) -> float:
    """Probability of shares at least so far apart if the two were alike, two-sided.

    Agresti and Caffo, The American Statistician 54, 280 (2000): one success and one failure are added to each, which keeps the
    test honest with few trials and with shares of 0 and 1.
    """
    parts = [((each.share * each.trials + 1) / (each.trials + 2), each.trials + 2) for each in (one, other)]
    error = math.sqrt(math.fsum(part * (1 - part) / trials for part, trials in parts))
    if one.share == other.share:
        return 1.0
    return two_sided_p((parts[0][0] - parts[1][0]) / error, math.inf)


def compare_shares(shares: Iterable[Share | None]) -> Comparison:
    """Each candidate against each other, with Holm's correction. None is a candidate without an attempt."""
    candidates = list(shares)
    tested = [(i, one) for i, one in enumerate(candidates) if one is not None]
    raw: dict[Pair, float] = {(i, j): share_p(one, other) for i, one in tested for j, other in tested if i < j}
    return compared(raw, [i for i, _ in tested], candidates=len(candidates))
