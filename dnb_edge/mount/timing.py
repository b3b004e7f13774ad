"""The timing sigma that a view can be expected to give, from the fit that finds a crossing.

Knows rates, lengths and speeds; nothing of a camera's place. The fit itself is `dnb_edge.race.crossing`'s, and a test
holds the two together.

A crossing's instant is the zero of a parabola fitted by generalised least squares to the n signed distances round the line
(`dnb_edge.race.instant` has the model), with independent noise of sigma_m in each. The sigma here is the root of its mean
variance, with the zero anywhere between the two frames round the line, as likely here as there, and of sigma_stamp^2. A lap has
two crossings: sqrt(2) times as much.
What all crossings of one line share drops out of laps: the detector's constant offset, the exposure's middle, the row's delay.
"""

from __future__ import annotations

import math

import numpy as np

from dnb_edge.race.crossing import CrossingSettings
from dnb_edge.race.instant import expected_sigma_s

FIT_HALF_S = CrossingSettings().fit_half_s
"""Half the time that the fit spans, seconds, where a run's settings do not say otherwise."""

SLOWEST_FPS = 5.0
"""Below this rate the gap between two frames is too long for a crossing to be more than estimated."""

SCATTER_LENGTHS = 0.02
"""Scatter of the detector's ground point from frame to frame, car lengths: the middle of 0.01 to 0.03 (docs/detector.md)."""

SCATTER_LEAST_PX = 0.5
"""The least scatter to count on, camera px, however small the car in the picture."""

_PHASES = 16


def detector_sigma_px(car_length_px: float) -> float:
    """One standard deviation of the ground point from frame to frame, camera px, of a car of that length."""
    return max(SCATTER_LEAST_PX, SCATTER_LENGTHS * car_length_px)


def frames_of_fit(fps: float, *, fit_half_s: float = FIT_HALF_S) -> tuple[int, int]:
    """How many frames take part before and behind the line, the two next to it counted."""
    ahead_s, behind_s = CrossingSettings(fit_half_s=fit_half_s).reach_s(1.0 / fps)
    return 1 + math.floor(ahead_s * fps + 1e-6), 1 + math.floor(behind_s * fps + 1e-6)


def crossing_sigma_s(
    sigma_m: float, *, speed_mps: float, fps: float, fit_half_s: float = FIT_HALF_S, stamp_sigma_s: float = 0.0
) -> float:
    """Expected sigma of one crossing, seconds, of a car whose ground point scatters by `sigma_m` along its way.

    The car is seen in every frame and drives smoothly.
    """
    before, behind = frames_of_fit(fps, fit_half_s=fit_half_s)
    frames = np.arange(-before, behind) + 1.0
    zeros = (np.arange(_PHASES) + 0.5) / _PHASES
    sigmas_s = [expected_sigma_s((frames - zero) / fps, sigma_m=sigma_m, speed_mps=speed_mps) for zero in zeros]
    return math.hypot(float(np.sqrt(np.mean(np.square(sigmas_s)))), stamp_sigma_s)
