"""Small non-linear least-squares problems by Levenberg and Marquardt's method (Marquardt, 1963), with a numerical Jacobian.

Knows numbers only: residuals of unit variance and the parameters that may move.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_STEP = 1e-6
_MOST_ROUNDS = 60
_ENOUGH = 1e-8
_GIVE_UP = 1e12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """Where the sum of squares is least."""

    parameters: FloatArray
    residuals: FloatArray
    jacobian: FloatArray
    """(m, n), columns of zeros for parameters that did not move."""
    inverse: FloatArray
    """(n, n) covariance of the parameters where the residuals have unit variance; zeros for those that did not move."""

    @property
    def cost(self) -> float:
        """Sum of the squared residuals."""
        return float(self.residuals @ self.residuals)

    @property
    def freedom(self) -> int:
        """Residuals less parameters that moved; at least 1."""
        return max(1, len(self.residuals) - int(np.count_nonzero(np.diag(self.inverse))))


def minimise(residuals: Callable[[FloatArray], FloatArray], start: FloatArray, free: NDArray[np.bool_]) -> Fit | None:
    """The fit nearest to `start` (n,), moving the parameters in `free` (n,) only; None where it does not converge.

    `residuals` may return numbers that are not finite where the parameters make no sense.
    """
    p = start.astype(np.float64)
    r = residuals(p)
    damping = 1e-3
    for _ in range(_MOST_ROUNDS):
        j = _jacobian(residuals, p, free)
        if not (np.isfinite(r).all() and np.isfinite(j).all()):
            return None
        normal, right = j.T @ j, -j.T @ r
        gain = 0.0
        while damping < _GIVE_UP:
            step = np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), right)
            moved = p.copy()
            moved[free] += step
            after = residuals(moved)
            gain = float(r @ r - after @ after)
            # Not a number where the step led out of what makes sense.
            if gain >= 0.0:
                p, r, damping = moved, after, max(damping / 10.0, 1e-12)
                break
            damping *= 10.0
        if damping >= _GIVE_UP or gain <= _ENOUGH * max(float(r @ r), 1e-12):
            break
    return fit_at(residuals, p, free)


def fit_at(residuals: Callable[[FloatArray], FloatArray], p: FloatArray, free: NDArray[np.bool_]) -> Fit | None:
    """The fit whose minimum is known to lie at `p` (n,); None where the residuals are no numbers there."""
    r = residuals(p)
    j = _jacobian(residuals, p, free)
    if not np.isfinite(j).all():
        return None
    jacobian = np.zeros((len(r), len(p)))
    jacobian[:, free] = j
    inverse = np.zeros((len(p), len(p)))
    inverse[np.ix_(free, free)] = np.linalg.pinv(j.T @ j, hermitian=True)
    return Fit(parameters=p, residuals=r, jacobian=jacobian, inverse=inverse)


def _jacobian(residuals: Callable[[FloatArray], FloatArray], p: FloatArray, free: NDArray[np.bool_]) -> FloatArray:
    columns = []
    for k in np.flatnonzero(free):
        step = np.zeros(len(p))
        step[k] = _STEP
        columns.append((residuals(p + step) - residuals(p - step)) / (2.0 * _STEP))
    return np.column_stack(columns)
