"""Student's t distribution: tail probabilities and quantiles, for small samples, without SciPy.

Knows numbers only. The distribution function is a regularised incomplete beta function, which is computed by its continued
fraction (DLMF 8.17.22, https://dlmf.nist.gov/8.17.E22) with Lentz's method as Thompson and Barnett modified it
(J. Comput. Phys. 64, 490, 1986); quantiles are found on it by bisection.
"""

from __future__ import annotations

import math
from functools import lru_cache
from statistics import NormalDist

_NORMAL_FROM_DF = 1e7
"""From so many degrees of freedom on the normal distribution is the same to seven digits."""

_TINY = 1e-300
_EPSILON = 1e-15
_TERMS = 20_000
"""More than the continued fraction needs for any number of degrees of freedom below `_NORMAL_FROM_DF`."""


def two_sided_p(t: float, df: float) -> float:
    """Probability of a value at least as far from 0 as `t`, with `df` degrees of freedom (positive, may be infinite).

    P = I_x(df/2, 1/2) with x = df / (df + t^2), Abramowitz and Stegun 26.7.1 and 26.5.27. Raises `ValueError` for other `df`.
    """
    if not df > 0:
        raise ValueError(f"{df} degrees of freedom: must be positive")
    if math.isinf(t):
        return 0.0
    if df >= _NORMAL_FROM_DF:
        return math.erfc(abs(t) / math.sqrt(2))
    # Both shares by themselves: near 0 the one, near infinity the other loses its digits.
    square = t * t
    return _incomplete_beta(df / 2, 0.5, df / (df + square), square / (df + square))


@lru_cache(maxsize=256)
def two_sided_quantile(confidence: float, df: float) -> float:
    """The t within which, to both sides of 0, lies the share `confidence` (0..1, exclusive): 1.96 for 0.95 and many `df`.

    Raises `ValueError` where `confidence` or `df` is out of range.
    """
    if not 0 < confidence < 1:
        raise ValueError(f"confidence {confidence}: must lie between 0 and 1")
    outside = 1 - confidence
    if df >= _NORMAL_FROM_DF:
        return NormalDist().inv_cdf(1 - outside / 2)
    high = 1.0
    while two_sided_p(high, df) > outside:
        high *= 2
    low = 0.0 if high == 1.0 else high / 2
    while (middle := (low + high) / 2) not in {low, high}:
        if two_sided_p(middle, df) > outside:
            low = middle
        else:
            high = middle
    return high


def _incomplete_beta(a: float, b: float, x: float, y: float) -> float:
    """The regularised incomplete beta function I_x(a, b), with y = 1 - x given for its digits."""
    if x <= 0 or y <= 0:
        return 0.0 if x <= 0 else 1.0
    front = math.exp(math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b) + a * math.log(x) + b * math.log(y))
    # The fraction converges fast on this side; on the other, I_x(a, b) = 1 - I_y(b, a).
    if x < (a + 1) / (a + b + 2):
        return front * _fraction(a, b, x) / a
    return 1.0 - front * _fraction(b, a, y) / b


def _fraction(a: float, b: float, x: float) -> float:
    """The continued fraction 1/(1 + d1/(1 + d2/(1 + ...))) of I_x(a, b), by the modified Lentz method."""
    c, d = 1.0, _inverse(1 - (a + b) * x / (a + 1))
    value = d
    for m in range(1, _TERMS):
        even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))
        change = 1.0
        for term in (even, odd):
            d = _inverse(1 + term * d)
            c = 1 + term / c
            c = c if abs(c) > _TINY else _TINY
            change = d * c
            value *= change
        if abs(change - 1) < _EPSILON:
            break
    return value


def _inverse(value: float) -> float:
    return 1 / (value if abs(value) > _TINY else _TINY)
