"""How targets are followed, as a user can set it. Knows numbers and their limits, nothing else."""

from __future__ import annotations

from dataclasses import dataclass

MOST_CARS = 8
"""Greatest number of cars that can be followed at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionSettings:
    """How targets are followed."""

    acceleration_sigma_mps2: float = 4.0
    """Spread of the car's acceleration, metres per second squared."""
    start_speed_sigma_mps: float = 2.0
    """Spread of a new target's unknown speed, metres per second."""
    gate: float = 16.0
    """Greatest squared Mahalanobis distance at which an observation belongs to a target (16: 3.4 in 10,000 missed)."""
    confirm_observations: int = 4
    """Observations that a target needs before it can be confirmed."""
    confirm_travel_m: float = 0.08
    """Distance from its first to its latest observation that a target must have moved before it is confirmed."""
    tentative_lost_after_s: float = 0.2
    """Time unseen after which a target that was never confirmed is forgotten."""
    coasting_lost_after_s: float = 0.7
    """Time unseen after which a confirmed target is lost."""
    strayed_lost_after_s: float = 2.0
    """Time beside the lane after which a target is no longer taken for a car."""
    cars: int = 1
    """Greatest number of cars that are followed at once."""
    regain_s: float = 3.0
    """Time unseen for which a lost car is awaited further along the lane, to be the same target again; 0 for never."""

    def __post_init__(self) -> None:
        for name in ("acceleration_sigma_mps2", "start_speed_sigma_mps", "gate"):
            if not getattr(self, name) > 0:
                raise ValueError(f"motion.{name}: {getattr(self, name)} must be positive")
        if self.confirm_observations < 2:
            raise ValueError(
                f"motion.confirm_observations: {self.confirm_observations} is too few, at least 2 are needed"
            )
        if not 1 <= self.cars <= MOST_CARS:
            raise ValueError(f"motion.cars: {self.cars} must lie between 1 and {MOST_CARS}")
        if self.regain_s < 0:
            raise ValueError(f"motion.regain_s: {self.regain_s} must not be negative")
