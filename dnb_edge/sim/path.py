"""A smooth closed path on the track plane: a periodic cubic spline, parameterised by arc length.

Knows the plane geometry of one closed curve, twice continuously differentiable, so that a car driven along it turns its
wheels smoothly. Knows no picture, no time and no car.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import PointM, Points

_SAMPLES_PER_SEGMENT = 512


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ClosedPath:
    """A closed curve through given knots, run through in their order.

    Every method takes `s_m` of any shape (n,), metres of arc length from the first knot, taken modulo `length_m`.
    """

    knots_m: Points
    """(n, 2) knots, track m."""
    second: Points
    """(n, 2) second derivatives at the knots with respect to the spline's own parameter."""
    parameter: NDArray[np.float64]
    """(n + 1,) parameter at each knot (accumulated chord length), the first again at the end."""
    table_parameter: NDArray[np.float64]
    table_s_m: NDArray[np.float64]
    length_m: float

    def at(self, s_m: NDArray[np.float64]) -> Points:
        """(n, 2) points, track m."""
        return self._evaluate(self._parameter_at(s_m), 0)

    def tangent(self, s_m: NDArray[np.float64]) -> Points:
        """(n, 2) unit vectors in the direction of travel."""
        first = self._evaluate(self._parameter_at(s_m), 1)
        return np.asarray(first / np.linalg.norm(first, axis=1, keepdims=True))

    def normal(self, s_m: NDArray[np.float64]) -> Points:
        """(n, 2) unit vectors to the left of the direction of travel."""
        tangent = self.tangent(s_m)
        return np.column_stack((-tangent[:, 1], tangent[:, 0]))

    def curvature(self, s_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) signed curvature in 1/m, positive in a left bend."""
        parameter = self._parameter_at(s_m)
        first, second = self._evaluate(parameter, 1), self._evaluate(parameter, 2)
        cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        return np.asarray(cross / np.linalg.norm(first, axis=1) ** 3)

    def _parameter_at(self, s_m: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.interp(np.mod(s_m, self.length_m), self.table_s_m, self.table_parameter)

    def _evaluate(self, parameter: NDArray[np.float64], derivative: int) -> Points:
        return _spline(self.knots_m, self.second, self.parameter, parameter, derivative)


def closed_path(knots_m: list[PointM]) -> ClosedPath:
    """The path through `knots_m` (at least three distinct points, track m) and back to the first."""
    knots = np.asarray(knots_m, dtype=np.float64)
    chords = np.linalg.norm(np.roll(knots, -1, axis=0) - knots, axis=1)
    if len(knots) < 3 or not np.all(chords > 0.0):
        raise ValueError("a closed path needs at least three knots, no two neighbours alike")
    parameter = np.concatenate(([0.0], np.cumsum(chords)))
    second = _periodic_second_derivatives(knots, chords)
    table = np.concatenate(
        [np.linspace(a, b, _SAMPLES_PER_SEGMENT, endpoint=False) for a, b in itertools.pairwise(parameter)]
        + [parameter[-1:]]
    )
    # Simpson's rule on the speed between neighbouring samples: exact far below a micrometre at this density.
    middle = 0.5 * (table[:-1] + table[1:])
    speed = np.linalg.norm(_spline(knots, second, parameter, table, 1), axis=1)
    speed_middle = np.linalg.norm(_spline(knots, second, parameter, middle, 1), axis=1)
    steps = np.diff(table) * (speed[:-1] + 4.0 * speed_middle + speed[1:]) / 6.0
    table_s = np.concatenate(([0.0], np.cumsum(steps)))
    return ClosedPath(
        knots_m=knots,
        second=second,
        parameter=parameter,
        table_parameter=table,
        table_s_m=table_s,
        length_m=float(table_s[-1]),
    )


def _periodic_second_derivatives(knots: Points, chords: NDArray[np.float64]) -> Points:
    """Second derivatives of the interpolating periodic cubic spline: the usual cyclic tridiagonal system, solved densely."""
    count = len(knots)
    matrix = np.zeros((count, count))
    right = np.zeros((count, 2))
    for i in range(count):
        before, after = i - 1, (i + 1) % count
        h_before, h_after = chords[before], chords[i]
        matrix[i, before] += h_before
        matrix[i, i] += 2.0 * (h_before + h_after)
        matrix[i, after] += h_after
        right[i] = 6.0 * ((knots[after] - knots[i]) / h_after - (knots[i] - knots[before]) / h_before)
    return np.asarray(np.linalg.solve(matrix, right))


def _spline(
    knots: Points, second: Points, breaks: NDArray[np.float64], parameter: NDArray[np.float64], derivative: int
) -> Points:
    """The spline or its first or second derivative at `parameter` (n,), by the second-derivative form of each piece."""
    i = np.clip(np.searchsorted(breaks, parameter, side="right") - 1, 0, len(knots) - 1)
    j = (i + 1) % len(knots)
    h = (breaks[i + 1] - breaks[i])[:, None]
    b = (parameter - breaks[i])[:, None] / h
    a = 1.0 - b
    if derivative == 0:
        curve = a * knots[i] + b * knots[j] + ((a**3 - a) * second[i] + (b**3 - b) * second[j]) * h**2 / 6.0
    elif derivative == 1:
        curve = (knots[j] - knots[i]) / h + ((3 * b**2 - 1) * second[j] - (3 * a**2 - 1) * second[i]) * h / 6.0
    else:
        curve = a * second[i] + b * second[j]
    return np.asarray(curve)
