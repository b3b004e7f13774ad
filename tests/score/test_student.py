"""Student's t: SciPy as the judge."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from dnb_edge.score.student import two_sided_p, two_sided_quantile

DEGREES = (1.0, 1.5, 2.0, 3.0, 4.0, 9.0, 29.3, 100.0, 1e3, 1e5)


@pytest.mark.parametrize("df", DEGREES)
@pytest.mark.parametrize("t", [0.01, 0.5, 1.0, 2.0, 5.0, 30.0, 1e4])
def test_tails_are_scipys(df: float, t: float) -> None:
    """Both tails together, to nine digits, from the middle to where next to nothing is left; either sign."""
    assert two_sided_p(t, df) == pytest.approx(2 * stats.t.sf(t, df), rel=1e-9, abs=1e-300)
    assert two_sided_p(-t, df) == two_sided_p(t, df)


@pytest.mark.parametrize("df", [*DEGREES, 1e8, math.inf])
@pytest.mark.parametrize("confidence", [0.5, 0.9, 0.95, 0.99, 0.999999])
def test_quantiles_are_scipys(df: float, confidence: float) -> None:
    """The t of an interval, for every number of laps from two on; the normal one for very many."""
    assert two_sided_quantile(confidence, df) == pytest.approx(stats.t.ppf(0.5 + confidence / 2, df), rel=1e-7)


def test_the_tables_of_the_textbooks() -> None:
    """Values that every table of t has, for machines without SciPy."""
    told = {1: 12.706, 2: 4.303, 4: 2.776, 9: 2.262, 29: 2.045, 120: 1.980}
    assert {df: round(two_sided_quantile(0.95, df), 3) for df in told} == told


@given(confidence=st.floats(0.001, 0.9999), df=st.floats(1, 1e6))
def test_the_quantile_undoes_the_tail(confidence: float, df: float) -> None:
    """Tail probability and quantile are each other's inverse."""
    assert two_sided_p(two_sided_quantile(confidence, df), df) == pytest.approx(1 - confidence, rel=1e-6)


@given(df=st.floats(0.5, 1e7))
def test_nothing_and_everything(df: float) -> None:
    """At 0 all lies outside, at infinity nothing."""
    assert two_sided_p(0.0, df) == 1.0
    assert two_sided_p(math.inf, df) == 0.0


@pytest.mark.parametrize(("confidence", "df"), [(0.0, 3), (1.0, 3), (0.95, 0), (0.95, -1)])
def test_what_makes_no_sense_is_an_error(confidence: float, df: float) -> None:
    """A probability outside of 0..1 or no degrees of freedom give no number."""
    with pytest.raises(ValueError, match=r"confidence|degrees"):
        two_sided_quantile(confidence, df)
