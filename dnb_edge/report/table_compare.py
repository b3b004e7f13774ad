"""Rows compared by one figure each: who is alike, the letters, the ranks, and the sentences that say so.

Knows estimates and labels; knows no lap and no column.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from dnb_edge.score.compare import Comparison, Estimate, Sample, compare
from dnb_edge.score.ranking import RESAMPLES, Place, Ranking, joint_units, mean_units, ranking, share_units
from dnb_edge.score.share import Share, Tally, compare_shares

_MOST_NAMED = 8
"""Entries whose order is told in a sentence; with more the sentence says only how sure it is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FigureOrder:
    """All rows by one figure."""

    figure: str
    """Its name in words, such as `completion time`."""
    comparison: Comparison
    ranking: Ranking

    def letters(self, row: int) -> str | None:
        """Of one row; None where there is nothing to compare."""
        return self.comparison.letters[row] if self.comparison.p else None

    @property
    def places(self) -> tuple[Place | None, ...]:
        """Where each row stands."""
        return self.ranking.places


def by_means(
    figure: str, estimates: Sequence[Estimate | None], runs: Sequence[Sequence[Sample]], *, most_is_best: bool
) -> FigureOrder:
    """Rows by a mean: their estimates, and the runs that these were made of."""
    sign = -1.0 if most_is_best else 1.0
    means = [math.inf if one is None else sign * one.mean for one in estimates]
    order = _best_first(means)
    comparison = _in_rows(compare([estimates[i] for i in order], [runs[i] for i in order]), order)
    joint = joint_units(runs)
    units = [mean_units(of_row) for of_row in runs] if joint is None else joint
    places = ranking(units, most_is_best=most_is_best, joint=joint is not None)
    return FigureOrder(figure=figure, comparison=comparison, ranking=places)


def by_shares(figure: str, shares: Sequence[Share | None], runs: Sequence[Sequence[Tally]]) -> FigureOrder:
    """Rows by a share of successes, the greatest first."""
    order = _best_first([math.inf if one is None else -one.share for one in shares])
    comparison = _in_rows(compare_shares([shares[i] for i in order]), order)
    joint = joint_units(runs)
    units = [share_units(of_row) for of_row in runs] if joint is None else joint
    places = ranking(units, most_is_best=True, joint=joint is not None)
    return FigureOrder(figure=figure, comparison=comparison, ranking=places)


def alike_notes(order: FigureOrder, labels: Sequence[str]) -> list[str]:
    """Who cannot be told apart, and who was not compared."""
    comparison, figure = order.comparison, order.figure
    notes = []
    for group in comparison.groups:
        if len(group) > 1:
            *most, last = (labels[i] for i in sorted(group))
            least = comparison.least_p(group)
            p = f"p = {least:.2f}" + (" or more" if len(most) > 1 and least < 0.995 else "")
            notes.append(f"{', '.join(most)} and {last} cannot be told apart by {figure} ({p})")
    compared = sum(letters is not None for letters in comparison.letters)
    if comparison.untested and len(comparison.untested) + compared > 1:
        names = ", ".join(labels[i] for i in sorted(comparison.untested))
        notes.append(f"One valid lap tells no spread, so not compared by {figure}: {names}")
    return notes


def pair_note(runs: Sequence[Sequence[Sample]]) -> list[str]:
    """Says so where rows are compared seed by seed: each row's runs of seeds of their own, the same as another row's."""
    named = [{run.pair for run in of_row if run.pair is not None} for of_row in runs]
    seeds = [frozenset(names) for names, of_row in zip(named, runs, strict=True) if len(names) == len(of_row) > 1]
    return [] if len(set(seeds)) == len(seeds) else ["Runs of one seed are compared with each other"]


def order_note(order: FigureOrder, labels: Sequence[str]) -> list[str]:
    """The order of the rows and how often it holds; nothing where there is none, or all are first."""
    ranked = [(place.rank, i) for i, place in enumerate(order.places) if place is not None]
    share = order.ranking.order_share
    if share is None or {rank for rank, _ in ranked} == {1}:
        return []
    words = ""
    if len(ranked) <= _MOST_NAMED:
        by_rank: dict[int, list[str]] = {}
        for rank, i in sorted(ranked):
            by_rank.setdefault(rank, []).append(labels[i])
        words = ": " + ", then ".join(" = ".join(names) for names in by_rank.values())
    return [f"Order by {order.figure}{words}; holds in {_percent(share)} of {RESAMPLES} resamples"]


def _percent(share: float) -> str:
    """A share that is not all of them never reads as 100 %."""
    return f"{100 * share:.0f} %" if share in {0.0, 1.0} else f"{min(max(100 * share, 0.1), 99.9):.1f} %"


def _best_first(figures: Sequence[float]) -> list[int]:
    return sorted(range(len(figures)), key=lambda i: (figures[i], i))


def _in_rows(ranked: Comparison, order: Sequence[int]) -> Comparison:
    """A comparison of rows that were given in `order`, so that letters begin with the best, by the rows' own numbers."""
    letters = dict(zip(order, ranked.letters, strict=True))
    p = {(min(order[i], order[j]), max(order[i], order[j])): value for (i, j), value in ranked.p.items()}
    return Comparison(
        p=p,
        untested=frozenset(order[i] for i in ranked.untested),
        letters=tuple(letters[i] for i in range(len(order))),
        groups=tuple(frozenset(order[i] for i in group) for group in ranked.groups),
    )
