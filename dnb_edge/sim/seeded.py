"""What a seed makes of a task: how the vehicle was built, and how it is put down at the start.

Knows the task's plain values. Knows no driver and no picture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from dnb_edge.sim.circuit import Circuit
from dnb_edge.sim.control import VehicleState
from dnb_edge.sim.task import LoopTask
from dnb_edge.sim.vehicle import VehicleSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class Lean:
    """What the steering is off by: a trim, and slow play about it, radians."""

    trim_rad: float
    waves: tuple[tuple[float, float, float], ...]
    """(amplitude rad, angular frequency rad/s, phase rad) each."""

    def at(self, t_s: float) -> float:
        """Radians to the left at `t_s`."""
        return self.trim_rad + sum(a * math.sin(w * t_s + p) for a, w, p in self.waves)


def varied(settings: VehicleSettings, seed: int) -> tuple[VehicleSettings, Lean]:
    """The vehicle as `seed` built it: no two motors and servos are alike."""
    random = np.random.default_rng([seed, 85])
    motor = float(random.uniform(0.97, 1.03))
    trim = float(random.uniform(-0.02, 0.02))
    waves = tuple(
        (
            float(random.uniform(0.003, 0.009)),
            math.tau * float(random.uniform(0.05, 0.5)),
            float(random.uniform(0.0, math.tau)),
        )
        for _ in range(3)
    )
    return replace(settings, top_speed_mps=settings.top_speed_mps * motor), Lean(trim_rad=trim, waves=waves)


def start_state(circuit: Circuit, task: LoopTask) -> VehicleState:
    """The vehicle as it is put down: before the start line, about in the lane's middle, about along it."""
    random = np.random.default_rng([task.seed, 86])
    s = np.array([circuit.start_s_m - float(random.uniform(0.6, 0.9))])
    aside, turn = float(random.uniform(-0.03, 0.03)), float(random.uniform(-0.08, 0.08))
    line = circuit.centreline
    at, ahead = (line.at(s) + aside * line.normal(s))[0], line.tangent(s)[0]
    heading = math.atan2(ahead[1], ahead[0]) + turn + (math.pi if task.wrong_way else 0.0)
    return VehicleState(
        track_m=(float(at[0]), float(at[1])),
        heading_rad=math.remainder(heading, math.tau),
        speed_mps=0.0,
        steering_rad=0.0,
    )
