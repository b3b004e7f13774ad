"""The timing sigma that a view can be expected to give, from the fit that finds a crossing.

Knows rates, lengths and speeds; nothing of a camera's place. The fit itself is `dnb_edge.race.crossing`'s, and a test
holds the two together.

A crossing's instant is the zero of a least-squares polynomial through the n signed distances d_k = v (t_k - t0) + noise that
lie round the line. With independent noise of sigma_m in each, the fitted distance at the zero t has the variance
sigma_m^2 b(t)^T (X^T X)^-1 b(t), X being the fit's design and b(t) its basis at t, and the instant's sigma is

    sigma_t = sqrt(sigma_m^2 / v^2 * mean over t of b(t)^T (X^T X)^-1 b(t)  +  sigma_stamp^2)

with t anywhere between the two frames round the line, as likely here as there. A lap has two crossings: sqrt(2) times as much.
What all crossings of one line share drops out of laps: the detector's constant offset, the exposure's middle, the row's delay.
"""

from __future__ import annotations

import math

import numpy as np

from dnb_edge.race.crossing import CrossingSettings

FIT_HALF_S = CrossingSettings().fit_half_s
"""Half the time that the fit spans, seconds, where a run's settings do not say otherwise."""

SLOWEST_FPS = 5.0
"""Below this rate the gap between two frames is too long for a crossing to be more than estimated."""

SCATTER_LENGTHS = 0.02
"""Scatter of the detector's ground point from frame to frame, car lengths: the middle of 0.01 to 0.03 (docs/detector.md)."""

SCATTER_LEAST_PX = 0.5
"""The least scatter to count on, camera px, however small the car in the picture."""

_PHASES = 64


def detector_sigma_px(car_length_px: float) -> float:
    """One standard deviation of the ground point from frame to frame, camera px, of a car of that length."""
    return max(SCATTER_LEAST_PX, SCATTER_LENGTHS * car_length_px)


def frames_of_fit(fps: float, *, fit_half_s: float = FIT_HALF_S) -> int:
    """How many frames take part: the two round the line and those within the fit's reach before and after them."""
    reach_s = min(max(fit_half_s, 2.5 / fps), 2.0 * fit_half_s)
    return 2 + 2 * math.floor(reach_s * fps + 1e-6)


def crossing_sigma_s(
    sigma_m: float, *, speed_mps: float, fps: float, fit_half_s: float = FIT_HALF_S, stamp_sigma_s: float = 0.0
) -> float:
    """Expected sigma of one crossing, seconds, of a car whose ground point scatters by `sigma_m` along its way.

    The module's docstring has the formula; the car is seen in every frame.
    """
    count = frames_of_fit(fps, fit_half_s=fit_half_s)
    degree = 2 if count >= 5 else 1
    frames = np.arange(count) - 0.5 * (count - 1)
    inverse = np.linalg.inv((design := np.vander(frames, degree + 1, increasing=True)).T @ design)
    zero = np.vander((np.arange(_PHASES) + 0.5) / _PHASES - 0.5, degree + 1, increasing=True)
    variance = float(np.einsum("ki,ij,kj->k", zero, inverse, zero).mean())
    return math.hypot(sigma_m * math.sqrt(variance) / speed_mps, stamp_sigma_s)
