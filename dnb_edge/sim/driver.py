"""Where the simulated car is at any instant, and exactly when it crosses the start line.

Knows the circuit and seeded ways of driving it: slower in bends, another pace each lap, a little or more wandering across
the lane. Knows no camera and no frame rate: the drive is a continuous function of time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnb_edge.sim.circuit import Circuit
from dnb_edge.values import PointM, Points

RUN_OUT_M = 0.9
_STEP_M = 0.002


@dataclass(frozen=True, slots=True, kw_only=True)
class Style:
    """How somebody drives. The default is the demo's driver."""

    top_mps: float = 1.45
    """Speed on the straights; with `lowest_mps` alike, the speed everywhere."""
    lowest_mps: float = 0.6
    """Speed below which it never falls, however tight the bend."""
    lateral_mps2: float = 2.0
    """Acceleration to the side that the driver dares in bends."""
    braking_m: float = 0.22
    """One standard deviation of the smoothing of the speed along the lap, metres."""
    pace: tuple[float, float] = (0.88, 1.06)
    """Each lap's own factor on the speed, drawn evenly between the two."""
    wander: float = 1.0
    """Factor on the deviation across the lane: 0 on the centreline, 1 tidy, more is looser."""
    run_up_m: float = 1.1
    """Way driven before the first crossing."""

    def __post_init__(self) -> None:
        if not (0.0 < self.lowest_mps <= self.top_mps and 0.0 < self.pace[0] <= self.pace[1]):
            raise ValueError(f"a style's speeds and paces must be positive and in order, not {self}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """The car on the floor at one instant."""

    track_m: PointM
    """The ground point: centre of the car's footprint."""
    heading_rad: float
    """Direction of travel on the track plane, atan2(dy, dx)."""
    speed_mps: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drive:
    """One whole drive: a run-up, the laps, a run-out. Time runs from 0 to `duration_s`."""

    circuit: Circuit
    laps: int
    crossings_s: tuple[float, ...]
    """The instants at which the ground point crosses the start line, seconds; `laps` + 1 of them."""
    duration_s: float
    table_t_s: NDArray[np.float64]
    table_s_m: NDArray[np.float64]
    """Distance along the centreline at `table_t_s`, unwrapped, metres; the start line is at 0, L, 2 L ..."""
    wander: Wander

    def points(self, t_s: NDArray[np.float64]) -> Points:
        """(n, 2) ground points at (n,) instants, track m."""
        s = np.interp(t_s, self.table_t_s, self.table_s_m)
        at = s + self.circuit.start_s_m
        line = self.circuit.centreline
        return np.asarray(line.at(at) + self.wander.offset_m(s)[:, None] * line.normal(at))

    def along_m(self, t_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) distance along the centreline from the start line at (n,) instants, unwrapped, metres."""
        return np.interp(t_s, self.table_t_s, self.table_s_m)

    def path_m(self, lap: int, step_s: float) -> tuple[PointM, ...]:
        """The true way of lap number `lap`, from 0: a point every `step_s`, both crossings included, track m."""
        start_s, end_s = self.crossings_s[lap : lap + 2]
        count = max(2, math.ceil((end_s - start_s) / step_s) + 1)
        return tuple((x, y) for x, y in self.points(np.linspace(start_s, end_s, count)).tolist())

    def pose(self, t_s: float) -> Pose:
        """The pose at `t_s`, clipped to the drive's own time."""
        t = min(max(t_s, 0.0), self.duration_s)
        step = 0.002
        before, at, after = self.points(np.clip(np.array([t - step, t, t + step]), 0.0, self.duration_s))
        moved = after - before
        elapsed = min(t + step, self.duration_s) - max(t - step, 0.0)
        return Pose(
            track_m=(float(at[0]), float(at[1])),
            heading_rad=math.atan2(moved[1], moved[0]),
            speed_mps=float(np.hypot(*moved)) / elapsed,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Wander:
    """A small smooth deviation across the lane: a sum of waves along the unwrapped distance."""

    amplitude_m: tuple[float, ...]
    wavelength_m: tuple[float, ...]
    phase_rad: tuple[float, ...]

    def offset_m(self, s_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) metres to the left of the centreline at unwrapped distances `s_m` (n,)."""
        waves = zip(self.amplitude_m, self.wavelength_m, self.phase_rad, strict=True)
        return np.asarray(sum(a * np.sin(2.0 * np.pi * s_m / w + p) for a, w, p in waves))


def wander_of(style: Style, random: np.random.Generator) -> Wander:
    """A wander that `random` draws, as wide as that style's."""
    return Wander(
        amplitude_m=tuple(
            style.wander * float(a) for a in random.uniform([0.008, 0.006, 0.003], [0.016, 0.012, 0.006])
        ),
        wavelength_m=tuple(float(w) for w in random.uniform([3.5, 1.9, 1.1], [5.5, 2.8, 1.5])),
        phase_rad=tuple(float(p) for p in random.uniform(0.0, 2.0 * math.pi, 3)),
    )


def drive(circuit: Circuit, *, laps: int, seed: int, style: Style | None = None) -> Drive:
    """The drive of `laps` complete laps that `seed` makes in that style, the demo's by default."""
    style = style or Style()
    if laps < 1:
        raise ValueError(f"laps must be at least 1, not {laps}")
    random = np.random.default_rng([seed, 1])
    wander = wander_of(style, random)
    length = circuit.centreline.length_m
    s = np.arange(-style.run_up_m, laps * length + RUN_OUT_M, _STEP_M)
    pace = random.uniform(*style.pace, laps + 2)
    slowness = 1.0 / (speed_mps(circuit, s, style) * pace_at(s / length, pace))
    t = np.concatenate(([0.0], np.cumsum(0.5 * (slowness[1:] + slowness[:-1]) * _STEP_M)))
    unsolved = Drive(
        circuit=circuit, laps=laps, crossings_s=(), duration_s=float(t[-1]), table_t_s=t, table_s_m=s, wander=wander
    )
    crossings = tuple(crossing_s(unsolved, k * length) for k in range(laps + 1))
    return Drive(
        circuit=circuit,
        laps=laps,
        crossings_s=crossings,
        duration_s=unsolved.duration_s,
        table_t_s=t,
        table_s_m=s,
        wander=wander,
    )


def speed_mps(circuit: Circuit, s_m: NDArray[np.float64], style: Style) -> NDArray[np.float64]:
    """(n,) speed at (n,) distances from the start line: by curvature, smoothed as a driver brakes before a bend and
    accelerates after it."""
    length = circuit.centreline.length_m
    count = 2048
    lap_s = np.arange(count) * length / count
    bend = np.maximum(np.abs(circuit.centreline.curvature(lap_s)), 1e-6)
    raw = np.clip(np.sqrt(style.lateral_mps2 / bend), style.lowest_mps, style.top_mps)
    distance = np.minimum(lap_s, length - lap_s)
    weights = np.exp(-0.5 * (distance / style.braking_m) ** 2)
    smooth = np.fft.irfft(np.fft.rfft(raw) * np.fft.rfft(weights / weights.sum()), n=count)
    return np.interp(s_m + circuit.start_s_m, lap_s, smooth, period=length)


def pace_at(lap: NDArray[np.float64], pace: NDArray[np.float64]) -> NDArray[np.float64]:
    """The pace factor at unwrapped lap number `lap`, blended smoothly between one lap's pace and the next's."""
    number = np.floor(lap)
    blend = np.clip((lap - number) / 0.2, 0.0, 1.0)
    blend = blend * blend * (3.0 - 2.0 * blend)
    index = number.astype(np.int64) + 1
    earlier = pace[np.clip(index - 1, 0, len(pace) - 1)]
    later = pace[np.clip(index, 0, len(pace) - 1)]
    return np.asarray(earlier + (later - earlier) * blend)


def crossing_s(drive_: Drive, s_m: float) -> float:
    """The instant near unwrapped distance `s_m` at which the ground point meets the start line: bisection, to the last bit."""
    start, end = np.asarray(drive_.circuit.start_line_m)
    along = end - start

    def left_of_line(t: float) -> float:
        offset = drive_.points(np.array([t]))[0] - start
        return float(along[0] * offset[1] - along[1] * offset[0])

    low, high = (float(np.interp(s_m + margin, drive_.table_s_m, drive_.table_t_s)) for margin in (-0.1, 0.1))
    while True:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            return middle
        if left_of_line(middle) < 0.0:
            low = middle
        else:
            high = middle
