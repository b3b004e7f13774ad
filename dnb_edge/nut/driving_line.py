"""The line that a driver who knows the circuit wants to follow: the centreline, bent round obstacles, with a speed everywhere.

Knows the circuit and what stands on it. Knows no vehicle state, no control and no time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnb_edge.sim.car import LENGTH_M, WIDTH_M
from dnb_edge.sim.circuit import Circuit
from dnb_edge.sim.control import Obstacle
from dnb_edge.values import PointM, Points

Floats = NDArray[np.float64]

STEP_M = 0.02
_PULL = 0.001
"""How strongly the line is drawn back to the centreline each round: with `STEP_M`, bends begin about 0.3 m before."""
_ROUNDS = 3000
_SMOOTHING_M = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Pace:
    """How fast to drive."""

    top_mps: float
    lowest_mps: float
    lateral_mps2: float
    """Acceleration to the side that bends are taken with."""
    change_mps2: float
    """Acceleration and braking that the speed along the line keeps to."""
    least_radius_m: float
    """Of the tightest bend that the vehicle can drive."""
    clearance_m: float
    """Wanted between the car's side and an obstacle."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DrivingLine:
    """A closed polyline with equal steps along the circuit; all arrays have the same length n."""

    points_m: Points
    """(n, 2), track m."""
    heading_rad: Floats
    """Direction of travel at each point, atan2(dy, dx)."""
    speed_mps: Floats
    offset_m: Floats
    """To the left of the circuit's centreline."""

    def nearest(self, point_m: PointM, *, around: int | None = None, reach: int = 25) -> int:
        """Index of the point nearest to `point_m`; with `around`, among those within `reach` steps of that index only."""
        count = len(self.points_m)
        among = np.arange(count) if around is None else np.arange(around - reach, around + reach + 1) % count
        offsets = self.points_m[among] - np.asarray(point_m)
        return int(among[np.argmin(np.einsum("ij,ij->i", offsets, offsets))])

    def ahead(self, index: int, distance_m: float) -> PointM:
        """The point `distance_m` along the line after the one at `index`, track m."""
        x, y = self.points_m[(index + round(distance_m / STEP_M)) % len(self.points_m)]
        return float(x), float(y)

    def slowest_mps(self, index: int, distance_m: float) -> float:
        """The lowest speed of the line from `index` over `distance_m`."""
        steps = np.arange(index, index + max(1, round(distance_m / STEP_M)) + 1) % len(self.speed_mps)
        return float(self.speed_mps[steps].min())


def driving_line(circuit: Circuit, obstacles: Sequence[Obstacle], pace: Pace) -> DrivingLine:
    """The line on `circuit` that passes `obstacles`, each on its better side, driven at `pace`."""
    length = circuit.centreline.length_m
    count = max(8, round(length / STEP_M))
    s = np.arange(count) * length / count
    left = circuit.centreline.normal(s)
    offset = _offsets(circuit, obstacles, s, pace)
    points = circuit.centreline.at(s) + offset[:, None] * left
    chords = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    return DrivingLine(
        points_m=points,
        heading_rad=np.arctan2(chords[:, 1], chords[:, 0]),
        speed_mps=_speeds(points, pace),
        offset_m=offset,
    )


def _offsets(circuit: Circuit, obstacles: Sequence[Obstacle], s: Floats, pace: Pace) -> Floats:
    """(n,) offsets to the left: a rubber band between the limits, drawn gently to the centreline."""
    low, high = np.full(len(s), -np.inf), np.full(len(s), np.inf)
    for one in obstacles:
        _limit(circuit, one, s, (low, high), pace)
    crossed = low > high
    low[crossed] = high[crossed] = 0.5 * (low[crossed] + high[crossed])
    offset = np.zeros(len(s))
    if not np.isfinite(low).any() and not np.isfinite(high).any():
        return offset
    for _ in range(_ROUNDS):
        smooth = 0.5 * offset + 0.25 * (np.roll(offset, 1) + np.roll(offset, -1))
        offset = np.clip(smooth * (1.0 - _PULL), low, high)
    return _smoothed(offset, _SMOOTHING_M / STEP_M)


def _limit(circuit: Circuit, obstacle: Obstacle, s: Floats, limits: tuple[Floats, Floats], pace: Pace) -> None:
    """Raise the lower or lower the upper of `limits`, both (n,) and changed in place, where the car would touch `obstacle`.

    Each branch of the lane that passes the obstacle (two where a circuit crosses itself) chooses its own side.
    """
    away = np.asarray(obstacle.track_m) - circuit.centreline.at(s)
    along = np.einsum("ij,ij->i", away, circuit.centreline.tangent(s))
    aside = np.einsum("ij,ij->i", away, circuit.centreline.normal(s))
    keep = obstacle.radius_m + 0.5 * WIDTH_M + pace.clearance_m
    reach = obstacle.radius_m + 0.5 * LENGTH_M + pace.clearance_m + _SMOOTHING_M
    beside = (np.abs(along) < reach) & (np.abs(aside) < keep + 0.5 * circuit.lane_width_m)
    for branch in _runs(beside):
        abreast = branch[np.argmin(np.abs(along[branch]))]
        bends = circuit.centreline.curvature(s[branch])
        tightest = float(bends[np.argmax(np.abs(bends))])
        left, right = (
            _awkwardness(float(aside[abreast]) + side * keep, tightest, pace.least_radius_m) for side in (1.0, -1.0)
        )
        if right <= left:
            limits[1][branch] = np.minimum(limits[1][branch], aside[branch] - keep)
        else:
            limits[0][branch] = np.maximum(limits[0][branch], aside[branch] + keep)


def _awkwardness(offset_m: float, bend: float, least_radius_m: float) -> float:
    """How bad it is to pass at `offset_m` to the left in a bend of curvature `bend`, metres: the way to the side, and by how
    much the bend would then be too tight for the vehicle."""
    radius_m = 1.0 / max(abs(bend), 1e-6) - math.copysign(offset_m, offset_m * bend)
    return abs(offset_m) + max(0.0, least_radius_m - radius_m)


def _runs(chosen: NDArray[np.bool_]) -> list[NDArray[np.intp]]:
    """The stretches of a ring on which `chosen` (n,) holds, each as its indices in order."""
    if chosen.all():
        return [np.arange(len(chosen))]
    shift = int(np.argmin(chosen))
    at = (np.flatnonzero(np.roll(chosen, -shift)) + shift) % len(chosen)
    if not len(at):
        return []
    steps = np.diff((at - shift) % len(chosen))
    return list(np.split(at, np.flatnonzero(steps > 1) + 1))


def _smoothed(values: Floats, sigma_steps: float) -> Floats:
    """`values` (n,) on a ring after a Gaussian of `sigma_steps`."""
    at = np.arange(len(values))
    weights = np.exp(-0.5 * (np.minimum(at, len(values) - at) / sigma_steps) ** 2)
    return np.asarray(np.fft.irfft(np.fft.rfft(values) * np.fft.rfft(weights / weights.sum()), n=len(values)))


def _speeds(points: Points, pace: Pace) -> Floats:
    """(n,) speeds: as the bends allow, lowered before them as braking needs and after them as accelerating does."""
    before, after = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
    turned = np.arctan2(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0], np.einsum("ij,ij->i", before, after))
    steps = np.linalg.norm(after, axis=1)
    bend = _smoothed(np.abs(turned) / steps, 2.0)
    speed = np.clip(np.sqrt(pace.lateral_mps2 / np.maximum(bend, 1e-6)), pace.lowest_mps, pace.top_mps)
    count = len(speed)
    # Twice round: a limit may reach back across the ring's seam.
    for i in [*range(count - 1, -1, -1)] * 2:
        speed[i] = min(speed[i], math.sqrt(speed[(i + 1) % count] ** 2 + 2.0 * pace.change_mps2 * steps[i]))
    for i in [*range(count)] * 2:
        speed[i] = min(speed[i], math.sqrt(speed[i - 1] ** 2 + 2.0 * pace.change_mps2 * steps[i - 1]))
    return np.asarray(speed)
