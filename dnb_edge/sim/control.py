"""What passes between a driver and the vehicle that it drives: what it sees, and what it wants.

Knows no model, no process and no physics: the vehicle (`sim`) and all drivers (`nut`) meet here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from dnb_edge.errors import WorkError
from dnb_edge.sim.circuit import Circuit
from dnb_edge.values import BgrImage, PointM


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleState:
    """Where the vehicle really is."""

    track_m: PointM
    """The ground point: centre of the car's footprint."""
    heading_rad: float
    """Direction in which it points on the track plane, atan2(dy, dx)."""
    speed_mps: float
    """Along that direction; negative backwards."""
    steering_rad: float
    """Angle of the front wheels, positive to the left."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sight:
    """What the vehicle's computer gets of one front picture."""

    t_ns: int
    """When the picture was taken, simulated clock."""
    bgr: BgrImage
    """(h, w, 3) uint8, the front camera's picture; read-only to drivers."""
    speed_mps: float
    """Of the wheels, when the picture was taken."""
    state: VehicleState | None = None
    """The truth at that moment; for drivers that `knows_truth` alone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Control:
    """What a driver wants from now on."""

    steering: float
    """Share of the steering lock, -1 fully right to 1 fully left."""
    throttle: float
    """Share of full voltage at the motor: the speed it settles at is that share of the top speed; negative drives backwards."""

    def __post_init__(self) -> None:
        for name, value in (("steering", self.steering), ("throttle", self.throttle)):
            if not (math.isfinite(value) and -1.0 <= value <= 1.0):
                raise ValueError(f"{name} must lie between -1 and 1, not {value!r}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacle:
    """A round thing that stands on the floor."""

    track_m: PointM
    radius_m: float
    height_m: float = 0.10


@dataclass(frozen=True, slots=True, kw_only=True)
class Briefing:
    """What a driver is told before it starts."""

    seed: int
    """All that a driver draws at random follows from it."""
    wheelbase_m: float
    steering_lock_rad: float
    top_speed_mps: float
    picture_px: tuple[int, int]
    """(width, height) of the front pictures."""
    period_s: float
    """Between two front pictures."""
    delay_s: float
    """Between a picture and the moment at which the control that was made of it takes hold."""
    circuit: Circuit | None = None
    """For drivers that `knows_truth` alone."""
    obstacles: tuple[Obstacle, ...] = ()
    """For drivers that `knows_truth` alone."""


class DriverFailed(WorkError):
    """A driver answered what it cannot, answered too late, or is gone: the run ends with this reason."""


class Driver(Protocol):
    """Who drives. `start` once, then `drive` for each picture in order, then `close`, in one thread."""

    @property
    def name(self) -> str:
        """What tables call it."""

    @property
    def knows_truth(self) -> bool:
        """Whether it is told the circuit, the obstacles and the vehicle's true state: a measure for others, no entry."""

    def start(self, briefing: Briefing) -> None:
        """Gets ready. Raises `DriverFailed`."""

    def drive(self, sight: Sight) -> Control:
        """What it wants, having seen that. Raises `DriverFailed`."""

    def close(self) -> None:
        """Ends it; safe to repeat."""
