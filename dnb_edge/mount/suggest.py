"""The height, pitch and distance at which a camera sees a whole track best.

Knows `mount`'s geometry and limits; knows no car. Best is the least millimetres a px at the track's worst point, with the whole
track and a margin round it in the picture. A grid over what is free, refined round its best to steps that a person can measure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dnb_edge.mount.geometry import Optics, Stand, TrackArea

Grid: TypeAlias = NDArray[np.float64]

LOWEST_M = 0.3
"""Nobody mounts a camera lower than this."""
FLATTEST_DEG = 5.0
_ROUNDS = (1.0, 0.4, 0.2)
"""Steps of each round of the search, as a share of the first steps."""
_STEP_HEIGHT_M, _STEP_PITCH_DEG, _STEP_DISTANCE_M = 0.05, 2.5, 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class MountLimits:
    """Where a camera may be put."""

    max_height_m: float = 2.5
    margin_m: float = 0.1
    """Floor round the track that has to be in the picture, too."""
    max_pitch_deg: float = 90.0
    max_distance_m: float = 2.0
    """From the track's near edge."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Free:
    """What is given of a stand; None is searched for."""

    height_m: float | None = None
    pitch_deg: float | None = None
    distance_m: float | None = None
    aside_m: float = 0.0
    turn_deg: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Suggestion:
    """The best stand, or where the track fits from none, the one that cuts off least."""

    stand: Stand
    fits: bool


def suggest(optics: Optics, track: TrackArea, limits: MountLimits, free: Free) -> Suggestion:
    """The best stand for what is free; in steps of 1 cm, half a degree and 2 cm."""
    best: tuple[float, float, float] | None = None
    fits = False
    for share in _ROUNDS:
        heights = _axis(free.height_m, (LOWEST_M, limits.max_height_m), _STEP_HEIGHT_M * share, best and best[0])
        pitches = _axis(free.pitch_deg, (FLATTEST_DEG, limits.max_pitch_deg), _STEP_PITCH_DEG * share, best and best[1])
        reach = (-0.5 * track.depth_m, limits.max_distance_m)
        distances = _axis(free.distance_m, reach, _STEP_DISTANCE_M * share, best and best[2])
        grids = np.meshgrid(heights, pitches, distances, indexing="ij")
        spare, worst = _judged(optics, track, limits, free, [grid.ravel() for grid in grids])
        fits = bool((spare >= 0).any())
        pick = int(np.argmin(np.where(spare >= 0, worst, np.inf)) if fits else np.argmax(spare))
        height, pitch, distance = (float(grid.ravel()[pick]) for grid in grids)
        best = (round(height, 3), round(pitch, 3), round(distance, 3))
    assert best is not None, "there is more than one round"
    stand = Stand(height_m=best[0], pitch_deg=best[1], distance_m=best[2], aside_m=free.aside_m, turn_deg=free.turn_deg)
    return Suggestion(stand=stand, fits=fits)


def ceiling_needed_m(optics: Optics, track: TrackArea, limits: MountLimits, free: Free) -> float | None:
    """The least ceiling, to a decimetre, under which the track fits with everything else that is given; None below 12 m."""
    low, high = limits.max_height_m, 12.0
    if not _fits_below(high, optics, track, limits, free):
        return None
    while high - low > 0.05:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _fits_below(middle, optics, track, limits, free) else (middle, high)
    return math.ceil(high * 10.0 - 0.25) / 10.0


def _fits_below(ceiling_m: float, optics: Optics, track: TrackArea, limits: MountLimits, free: Free) -> bool:
    raised = replace(limits, max_height_m=ceiling_m)
    return suggest(optics, track, raised, replace(free, height_m=None)).fits


def _axis(given: float | None, ends: tuple[float, float], step: float, middle: float | None) -> Grid:
    """The values to try: the given one, a grid over the whole range, or a finer one round the last round's best."""
    if given is not None:
        return np.array([given])
    low, high = ends
    if middle is None:
        return np.append(np.arange(low, high - 1e-9, step), high)
    values = middle + step * np.arange(-6, 7)
    # Both ends stay in the choice: straight above, straight down, and under the ceiling are where the best often is.
    values = np.append(values[(values >= low) & (values <= high)].round(2), (low, high))
    return np.unique(values)


def _judged(optics: Optics, track: TrackArea, limits: MountLimits, free: Free, stands: list[Grid]) -> tuple[Grid, Grid]:
    """(spare, worst) of n stands: px from the outermost corner of track and margin to the picture's edge, and mm a px.

    As `MountedCamera` computes them, for many stands at once. The track's worst point is one of its corners: millimetres a px
    grow with the depth and with the way aside.
    """
    height, pitch_deg, distance = (grid[:, None] for grid in stands)
    pitch, turn = np.radians(pitch_deg), math.radians(free.turn_deg)
    sin, cos = np.sin(pitch), np.cos(pitch)
    focal = optics.focal_px

    def placed(margin_m: float) -> tuple[Grid, Grid, Grid]:
        """Right of and ahead of the foot, and depth, each (n, 4)."""
        corners = track.corners_m(margin_m)
        x, y = corners[:, 0] - free.aside_m, corners[:, 1] + distance
        right, ahead = x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn)
        return right, ahead, ahead * cos + height * sin

    right, ahead, depth = placed(limits.margin_m)
    # A corner behind the camera is worse than any before it, and the worse the further behind.
    safe = np.maximum(depth, 1e-6)
    u, v = focal * np.abs(right) / safe, focal * np.abs(height * cos - ahead * sin) / safe
    spare = np.minimum(0.5 * optics.width_px - u, 0.5 * optics.height_px - v)
    spare = np.where(depth > 1e-6, spare, -1e12 * (1.0 - depth)).min(axis=1)
    right, _, depth = placed(0.0)
    total, product = height**2 + (right * cos) ** 2 + depth**2, height * depth
    largest = np.sqrt(0.5 * (total + np.sqrt(np.maximum(total**2 - 4.0 * product**2, 0.0))))
    worst = (1000.0 * np.abs(depth) / (focal * height) * largest).max(axis=1)
    return spare, worst
