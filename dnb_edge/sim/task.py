"""One closed-loop drive as plain values: which track, which conditions, which vehicle. The same task is the same drive.

Knows no driver and draws nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from dnb_edge.sim.circuit import Circuit
from dnb_edge.sim.control import Obstacle
from dnb_edge.sim.light import LightChange
from dnb_edge.sim.places import PLACES
from dnb_edge.sim.vehicle import VehicleSettings

CLEAR_OF_START_M = 0.8
"""Obstacles stand no nearer than this to the start line, along the lane: the car starts there."""


class TaskKind(StrEnum):
    """What is asked of a driver."""

    LANE_FOLLOWING = "lane-following"
    OBSTACLES = "obstacles"
    WRONG_WAY = "wrong-way"
    CHANGING_LIGHT = "changing-light"
    CAMERA_DELAY = "camera-delay"


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopTask:
    """One drive. `kind` is its name in tables; the conditions are what the other fields say."""

    kind: TaskKind = TaskKind.LANE_FOLLOWING
    seed: int = 1
    """Where exactly the car stands at the start, its trim, the room's looks, all noise."""
    laps: int = 3
    place: str = "demo"
    """One of `places.PLACES`."""
    obstacles: tuple[Obstacle, ...] = ()
    light: LightChange = field(default_factory=LightChange)
    delay_s: float = 0.05
    """Between a front picture and the moment at which the control that was made of it takes hold."""
    wrong_way: bool = False
    """Whether the car stands on the lane against the direction of travel at the start."""
    size_px: tuple[int, int] = (640, 360)
    """(width, height) of the overhead pictures."""
    fps: float = 30.0
    """Of the overhead camera."""
    front_size_px: tuple[int, int] = (160, 120)
    front_fps: float = 30.0
    time_limit_s: float | None = None
    """Simulated seconds after which the drive ends; None for `limit_s`' own."""
    vehicle: VehicleSettings = field(default_factory=VehicleSettings)

    def __post_init__(self) -> None:
        if self.seed < 0 or self.laps < 1:
            raise ValueError(
                f"a task's seed must not be negative and its laps at least 1, not {self.seed} and {self.laps}"
            )
        if self.place not in PLACES:
            raise ValueError(f"place {self.place!r} is none of {', '.join(PLACES)}")
        for name, rate in (("fps", self.fps), ("front_fps", self.front_fps)):
            if not (math.isfinite(rate) and 1.0 <= rate <= 200.0):
                raise ValueError(f"{name} must lie between 1 and 200, not {rate!r}")
        if not 0.0 <= self.delay_s <= 2.0:
            raise ValueError(f"delay_s must lie between 0 and 2, not {self.delay_s!r}")
        sizes = (*self.size_px, *self.front_size_px)
        if not all(16 <= size <= 4096 for size in sizes):
            raise ValueError("pictures must be 16 to 4096 px wide and high")
        if self.time_limit_s is not None and not self.time_limit_s > 0.0:
            raise ValueError(f"time_limit_s must be positive, not {self.time_limit_s!r}")


def obstacles_beside(circuit: Circuit, *, count: int, seed: int) -> tuple[Obstacle, ...]:
    """`count` obstacles that `seed` stands on the lane, left and right of its middle, so that a car can pass each within it.

    They stand in stretches of the lap of their own, at least 0.5 m apart along it. Raises `ValueError` where so
    many have no room.
    """
    length = circuit.centreline.length_m - 2.0 * CLEAR_OF_START_M
    if count < 0 or count * 0.8 > length:
        raise ValueError(f"{circuit.name}: there is room for {int(length / 0.8)} obstacles, not {count}")
    random = np.random.default_rng([seed, 82])
    radius = 0.03
    # The gap between an obstacle and the far border is the car's width and what the lane leaves besides.
    aside = 0.5 * circuit.lane_width_m - 0.035
    found = []
    for k in range(count):
        stretch = length / count
        margin = 0.25 / stretch
        s = circuit.start_s_m + CLEAR_OF_START_M + stretch * (k + float(random.uniform(margin, 1.0 - margin)))
        side = float(random.choice([-1.0, 1.0]))
        at = circuit.centreline.at(np.array([s]))[0] + side * aside * circuit.centreline.normal(np.array([s]))[0]
        found.append(Obstacle(track_m=(float(at[0]), float(at[1])), radius_m=radius))
    return tuple(found)
