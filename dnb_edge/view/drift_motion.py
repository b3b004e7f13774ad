"""How a whole picture has moved, from where single patches of it were found: what most of them agree on.

Knows points in camera px and the shifts between two pictures; knows no picture, no track and no time. The motion of a camera
that turns, rolls, tips or shifts a little moves the picture by a field that eight numbers describe (the generators of the
homographies); what moves otherwise, hides or is mistaken is outvoted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import Points

_MOST_PAIRS = 400
_NEAR = 0.35
"""Two points nearer than this, in half widths of the picture, say too little of turn and scale."""

_ROUNDS = 4
_FLOOR_PX = 0.08
_STRETCH = (0.2, 0.6)
"""How much of stretch and perspective is expected: px, and a share of the motion itself."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motion:
    """A field of shifts over a picture of one size."""

    numbers: NDArray[np.float64]
    """(8,) in px: shift along u and v, growth, turn, two stretches, two perspectives; at the picture's half width."""
    covariance: NDArray[np.float64]
    """(8, 8) of them, px^2."""
    agreeing: NDArray[np.bool_]
    """(n,) which of the points follow it."""
    size_px: tuple[int, int]

    def shift_px(self, camera_px: Points) -> Points:
        """(n, 2) by how much the picture has moved at camera px (n, 2) of the picture before."""
        return np.asarray((_design(camera_px, self.size_px) @ self.numbers).reshape(-1, 2))

    def covariance_px2(self, camera_px: Points) -> NDArray[np.float64]:
        """(n, 2, 2) covariance of `shift_px`."""
        rows = _design(camera_px, self.size_px).reshape(-1, 2, 8)
        return np.asarray(rows @ self.covariance @ rows.transpose(0, 2, 1))


def common_motion(
    before_px: Points, shift_px: Points, size_px: tuple[int, int], *, tolerance_px: float
) -> Motion | None:
    """The motion that most of the points (n, 2), shifted by (n, 2), agree on within `tolerance_px`; None without two points
    that are far enough from one another, or where three would not agree."""
    agreeing = _similar(before_px, shift_px, size_px, tolerance_px)
    if agreeing is None or agreeing.sum() < 3:
        return None
    design = _design(before_px, size_px).reshape(-1, 2, 8)
    motion = None
    for _ in range(_ROUNDS):
        rows, wanted = design[agreeing].reshape(-1, 8), shift_px[agreeing].ravel()
        numbers, covariance = _fit(rows, wanted)
        off_px = np.linalg.norm((design @ numbers) - shift_px, axis=1)
        follows = off_px <= tolerance_px
        motion = Motion(numbers=numbers, covariance=covariance, agreeing=follows, size_px=size_px)
        if follows.sum() < 3 or np.array_equal(follows, agreeing):
            break
        agreeing = follows
    return motion


def _fit(rows: NDArray[np.float64], wanted: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least squares in which stretch and perspective must be worth their while: they are small in small motions, and without
    points all over the picture nothing else would hold them."""
    plain, *_ = np.linalg.lstsq(rows[:, :4], wanted, rcond=None)
    floor_px, share = _STRETCH
    expected_px = floor_px + share * float(np.sqrt(np.mean(wanted**2)))
    sigma_px = max(_FLOOR_PX, min(0.5, float(np.sqrt(np.mean((rows[:, :4] @ plain - wanted) ** 2)))))
    for _ in range(2):
        hold = np.diag([0.0] * 4 + [(sigma_px / expected_px) ** 2] * 4)
        inverse = np.linalg.inv(rows.T @ rows + hold + 1e-9 * np.eye(8))
        numbers = inverse @ rows.T @ wanted
        spare = max(1, len(wanted) - 8)
        sigma_px = max(_FLOOR_PX, float(np.sqrt(((rows @ numbers - wanted) ** 2).sum() / spare)))
    return numbers, np.asarray(inverse * sigma_px**2)


def _similar(
    before_px: Points, shift_px: Points, size_px: tuple[int, int], tolerance_px: float
) -> NDArray[np.bool_] | None:
    """Which points follow that shift, turn and growth, of all that two of them fix, which most follow.

    In complex numbers: z' = z + a z + b. The farther the motion goes, the more of perspective is let pass here.
    """
    half = size_px[0] / 2.0
    z = ((before_px - np.array(size_px) / 2.0) / half) @ np.array([1.0, 1.0j])
    shift = shift_px @ np.array([1.0, 1.0j])
    first, second = np.triu_indices(len(z), 1)
    far = np.abs(z[second] - z[first]) > _NEAR
    first, second = first[far], second[far]
    if len(first) == 0:
        return None
    step = -(-len(first) // _MOST_PAIRS)
    first, second = first[::step], second[::step]
    turn = (shift[second] - shift[first]) / (z[second] - z[first])
    offset = shift[first] - turn * z[first]
    off_px = np.abs(turn[:, None] * z + offset[:, None] - shift)
    allowed = tolerance_px + 0.2 * np.abs(offset)[:, None]
    follows = off_px <= allowed
    # Of two that as many follow, the one which they follow more closely.
    merit = (follows * (1.0 - 0.5 * off_px / allowed)).sum(axis=1)
    return np.asarray(follows[int(np.argmax(merit))])


def _design(camera_px: Points, size_px: tuple[int, int]) -> NDArray[np.float64]:
    """(2 n, 8): what each number adds to u and v of the shift at each point."""
    half = size_px[0] / 2.0
    x, y = ((np.asarray(camera_px, dtype=np.float64) - np.array(size_px) / 2.0) / half).T
    zero, one = np.zeros_like(x), np.ones_like(x)
    along_u = np.stack((one, zero, x, -y, x, y, x * x, x * y), axis=1)
    along_v = np.stack((zero, one, y, x, -y, x, x * y, y * y), axis=1)
    return np.stack((along_u, along_v), axis=1).reshape(-1, 8)
