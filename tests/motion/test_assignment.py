"""The exact assignment, against the textbook's own solver."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from dnb_edge.motion.assignment import assign

MISS = 40.0


def total(costs: list[list[float]], chosen: dict[int, int]) -> float:
    return sum(costs[row][chosen[row]] if row in chosen else MISS for row in range(len(costs)))


@settings(max_examples=300, deadline=None)
@given(rows=st.integers(1, 8), columns=st.integers(1, 12), seed=st.integers(0, 2**32 - 1), forbidden=st.floats(0, 0.9))
def test_no_assignment_is_cheaper(rows: int, columns: int, seed: int, forbidden: float) -> None:
    """For up to 8 targets and 12 observations, with gates, the cost is scipy's, and no observation is given twice."""
    random = np.random.default_rng(seed)
    costs = random.uniform(0, 50, (rows, columns)).round(random.integers(0, 6))
    costs[random.random((rows, columns)) < forbidden] = math.inf
    chosen = assign(costs.tolist(), MISS)
    padded = np.hstack([np.where(np.isinf(costs), 1e6, costs), np.full((rows, rows), MISS)])
    best = padded[linear_sum_assignment(padded)].sum()
    assert total(costs.tolist(), chosen) == pytest.approx(best)
    assert len(set(chosen.values())) == len(chosen)


@given(costs=st.lists(st.floats(0, 39), min_size=1, max_size=12))
def test_one_target_takes_the_first_of_the_nearest(costs: list[float]) -> None:
    """With one car the assignment is the plain minimum, ties to the first: what recordings of one car were made with."""
    assert assign([costs], MISS) == {0: costs.index(min(costs))}


@pytest.mark.parametrize(
    ("costs", "chosen"),
    [
        ([], {}),
        ([[]], {}),
        ([[], []], {}),
        ([[math.inf]], {}),
        ([[MISS + 1]], {}),
        ([[1.0], [0.0]], {1: 0}),
        ([[1.0, 2.0], [1.5, 9.0]], {0: 1, 1: 0}),
        ([[1.0, math.inf], [0.0, math.inf]], {1: 0}),
    ],
)
def test_small_cases(costs: list[list[float]], chosen: dict[int, int]) -> None:
    """Nothing to give, nothing allowed, dearer than a miss, and a greedy choice that would be wrong."""
    assert assign(costs, MISS) == chosen
