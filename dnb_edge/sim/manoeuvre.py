"""A car that does odd things: stands, shakes, drives back, turns round, is lifted away and put down again.

Knows a circuit and a list of legs; knows no camera and no lap. A continuous function of time, as a `Drive` is, but for the
jumps of a lifted car.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnb_edge.sim.circuit import Circuit
from dnb_edge.values import Points

_STEP_S = 0.002
_SMOOTH_S = 0.08
"""One standard deviation of the smoothing of speed and lateral place: nothing with wheels changes them at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Leg:
    """What the car does for a while."""

    seconds: float
    metres: float = 0.0
    """Way along the centreline in that time; negative backwards."""
    to_d_m: float = 0.0
    """Where across the lane it is at the leg's end, metres to the left."""
    shake_m: float = 0.0
    """Amplitude of a shaking to and fro along the way."""
    shake_hz: float = 1.3
    jump_m: float = 0.0
    """Where it is put down at the leg's beginning: so far along the centreline from where it was."""
    seen: bool = True


def ahead(metres: float, speed_mps: float, *, to_d_m: float = 0.0) -> Leg:
    """Drives so far; backwards where `metres` is negative."""
    return Leg(seconds=abs(metres) / speed_mps, metres=metres, to_d_m=to_d_m)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Manoeuvre:
    """The legs joined, from time 0 to `duration_s`."""

    circuit: Circuit
    duration_s: float
    table_t_s: NDArray[np.float64]
    table_s_m: NDArray[np.float64]
    """Distance along the centreline from the start line, unwrapped."""
    table_d_m: NDArray[np.float64]
    table_seen: NDArray[np.bool_]

    def along_m(self, t_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) distance along the centreline from the start line, unwrapped."""
        return np.interp(t_s, self.table_t_s, self.table_s_m)

    def points(self, t_s: NDArray[np.float64]) -> Points:
        """(n, 2) ground points at (n,) instants, track m."""
        at = self.along_m(t_s) + self.circuit.start_s_m
        d = np.interp(t_s, self.table_t_s, self.table_d_m)
        line = self.circuit.centreline
        return np.asarray(line.at(at) + d[:, None] * line.normal(at))

    def seen(self, t_s: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(n,) whether the car is on the track at all."""
        index = np.clip(np.searchsorted(self.table_t_s, t_s, side="right") - 1, 0, len(self.table_seen) - 1)
        return np.asarray(self.table_seen[index])


def manoeuvre(circuit: Circuit, start_m: float, legs: Sequence[Leg]) -> Manoeuvre:
    """A car that begins `start_m` along the centreline from the start line and does `legs` in turn."""
    if not legs or any(leg.seconds <= 0.0 for leg in legs):
        raise ValueError("a manoeuvre needs legs, each of some seconds")
    counts = [max(1, round(leg.seconds / _STEP_S)) for leg in legs]
    speed = np.repeat([leg.metres / (n * _STEP_S) for leg, n in zip(legs, counts, strict=True)], counts)
    s = start_m + np.concatenate(([0.0], np.cumsum(_smooth(speed)[:-1]) * _STEP_S))
    starts = np.concatenate(([0], np.cumsum(counts)))
    t = np.arange(len(s), dtype=np.float64) * _STEP_S
    ends_d = [0.0, *(leg.to_d_m for leg in legs)]
    d = _smooth(np.interp(np.arange(len(s)), starts, ends_d))
    for leg, first, last in zip(legs, starts[:-1].tolist(), starts[1:].tolist(), strict=True):
        s[first:] += leg.jump_m
        if leg.shake_m:
            rise = np.minimum(1.0, (t[first:last] - t[first]) / 0.5)
            s[first:last] += leg.shake_m * rise * np.sin(2.0 * math.pi * leg.shake_hz * (t[first:last] - t[first]))
    return Manoeuvre(
        circuit=circuit,
        duration_s=float(t[-1]),
        table_t_s=t,
        table_s_m=s,
        table_d_m=d,
        table_seen=np.repeat([leg.seen for leg in legs], counts),
    )


def _smooth(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """`values` under a Gaussian of `_SMOOTH_S`, whose sum, far from the ends, is kept; the ends go on as they are."""
    reach = math.ceil(4.0 * _SMOOTH_S / _STEP_S)
    offsets = np.arange(-reach, reach + 1) * _STEP_S
    weights = np.exp(-0.5 * (offsets / _SMOOTH_S) ** 2)
    return np.convolve(np.pad(values, reach, mode="edge"), weights / weights.sum(), mode="valid")
