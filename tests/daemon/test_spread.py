"""Percentiles by a histogram against those of the numbers themselves."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.daemon.spread import Spread


@given(st.lists(st.floats(0.02, 1e5), min_size=1, max_size=200), st.sampled_from([50.0, 95.0, 99.0, 100.0]))
def test_a_percentile_is_at_most_two_percent_above_the_true_one(values: list[float], percent: float) -> None:
    """By nearest rank; never below it, never above the greatest."""
    spread = Spread()
    for value in values:
        spread.add(value)
    true = sorted(values)[math.ceil(percent / 100 * len(values)) - 1]
    told = spread.percentile(percent)
    assert told is not None
    assert true * (1 - 1e-6) <= told <= min(true * 1.0201, max(values))


def test_nothing_and_out_of_range() -> None:
    """None before there is any; durations out of range count as its ends."""
    spread = Spread()
    assert spread.percentile(95.0) is None
    spread.add(-1.0)
    spread.add(1e9)
    assert spread.percentile(50.0) == pytest.approx(0.01)
    assert spread.percentile(100.0) == pytest.approx(1e6, rel=0.03)
