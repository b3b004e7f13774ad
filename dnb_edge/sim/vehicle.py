"""A small car that is steered: a kinematic bicycle with lag in its steering and its motor, and tyres that hold only so much.

Knows one short step of driving, as an arc that is exact at every instant of it. Knows no track, no driver and no picture.
Formulas: Rajamani, Vehicle Dynamics and Control, section 2.2 (kinematic bicycle), with the rear axle as the point of reference.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from dnb_edge.sim.control import VehicleState
from dnb_edge.values import PointM


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleSettings:
    """What the vehicle is like. The default is the simulated car of `car`, as nimble as small lab cars are."""

    wheelbase_m: float = 0.152
    rear_to_centre_m: float = 0.074
    """From the rear axle ahead to the ground point, the centre of the footprint."""
    length_m: float = 0.235
    width_m: float = 0.165
    steering_lock_rad: float = math.radians(40.0)
    steering_rate_rps: float = 9.0
    """Fastest turn of the front wheels about their kingpins, rad/s."""
    steering_lag_s: float = 0.035
    """Time constant with which the front wheels follow what is wanted."""
    motor_lag_s: float = 0.20
    """Time constant with which the speed follows what is wanted."""
    acceleration_mps2: float = 4.0
    """Most that motor and brake can do, m/s^2."""
    grip_mps2: float = 4.5
    """Acceleration to the side beyond which the tyres slide and the car turns less than its wheels ask for."""
    top_speed_mps: float = 2.0

    def __post_init__(self) -> None:
        positive = (
            self.wheelbase_m, self.length_m, self.width_m, self.steering_lock_rad, self.steering_rate_rps,
            self.steering_lag_s, self.motor_lag_s, self.acceleration_mps2, self.grip_mps2, self.top_speed_mps,
        )  # fmt: skip
        if not all(math.isfinite(value) and value > 0.0 for value in positive):
            raise ValueError(f"a vehicle's sizes, lags and limits must be positive, not {self}")
        if not 0.0 <= self.rear_to_centre_m <= self.wheelbase_m or self.steering_lock_rad >= math.radians(80.0):
            raise ValueError(
                f"a vehicle's ground point lies between its axles, and its lock is below 80 degrees, not {self}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Arc:
    """One step of driving: the rear axle's way of constant curvature at constant acceleration."""

    rear_m: PointM
    """Middle of the rear axle at the step's beginning, track m."""
    heading_rad: float
    speed_mps: float
    acceleration_mps2: float
    curvature: float
    """1/m, positive to the left."""
    steering_rad: float
    rear_to_centre_m: float
    stops_s: float = math.inf
    """When in the step it runs against something and stands from then on."""

    def state(self, elapsed_s: float) -> VehicleState:
        """The vehicle `elapsed_s` after the step's beginning; exact within the step."""
        stands = elapsed_s >= self.stops_s
        elapsed_s = min(elapsed_s, self.stops_s)
        way_m = elapsed_s * (self.speed_mps + 0.5 * self.acceleration_mps2 * elapsed_s)
        half_turn = 0.5 * self.curvature * way_m
        # The chord of an arc; sin(x) / x by its series where x is small.
        chord_m = way_m * (
            math.sin(half_turn) / half_turn if abs(half_turn) > 1e-4 else 1.0 - half_turn * half_turn / 6.0
        )
        along = self.heading_rad + half_turn
        heading = self.heading_rad + 2.0 * half_turn
        x = self.rear_m[0] + chord_m * math.cos(along) + self.rear_to_centre_m * math.cos(heading)
        y = self.rear_m[1] + chord_m * math.sin(along) + self.rear_to_centre_m * math.sin(heading)
        return VehicleState(
            track_m=(x, y),
            heading_rad=math.remainder(heading, math.tau),
            speed_mps=0.0 if stands else self.speed_mps + self.acceleration_mps2 * elapsed_s,
            steering_rad=self.steering_rad,
        )


def stepped(
    settings: VehicleSettings, state: VehicleState, *, steering_rad: float, speed_mps: float, step_s: float
) -> Arc:
    """The next step of `step_s` from `state`, towards the angle of the front wheels and the speed that are wanted."""
    steering = _steered(settings, state.steering_rad, steering_rad, step_s)
    change = (speed_mps - state.speed_mps) * (1.0 - math.exp(-step_s / settings.motor_lag_s)) / step_s
    acceleration = min(max(change, -settings.acceleration_mps2), settings.acceleration_mps2)
    curvature = math.tan(steering) / settings.wheelbase_m
    fastest = max(abs(state.speed_mps), abs(state.speed_mps + acceleration * step_s))
    if fastest * fastest * abs(curvature) > settings.grip_mps2:
        curvature = math.copysign(settings.grip_mps2 / (fastest * fastest), curvature)
    cos, sin = math.cos(state.heading_rad), math.sin(state.heading_rad)
    return Arc(
        rear_m=(state.track_m[0] - settings.rear_to_centre_m * cos, state.track_m[1] - settings.rear_to_centre_m * sin),
        heading_rad=state.heading_rad,
        speed_mps=state.speed_mps,
        acceleration_mps2=acceleration,
        curvature=curvature,
        steering_rad=steering,
        rear_to_centre_m=settings.rear_to_centre_m,
    )


def reach_m(settings: VehicleSettings, state: VehicleState, point_m: PointM) -> float:
    """Distance from the footprint's edge to a point of the floor, metres; negative inside."""
    dx, dy = point_m[0] - state.track_m[0], point_m[1] - state.track_m[1]
    cos, sin = math.cos(state.heading_rad), math.sin(state.heading_rad)
    ahead = abs(dx * cos + dy * sin) - 0.5 * settings.length_m
    aside = abs(dy * cos - dx * sin) - 0.5 * settings.width_m
    if ahead > 0.0 and aside > 0.0:
        return math.hypot(ahead, aside)
    return max(ahead, aside)


def _steered(settings: VehicleSettings, now_rad: float, wanted_rad: float, step_s: float) -> float:
    wanted = min(max(wanted_rad, -settings.steering_lock_rad), settings.steering_lock_rad)
    turn = (wanted - now_rad) * (1.0 - math.exp(-step_s / settings.steering_lag_s))
    most = settings.steering_rate_rps * step_s
    return now_rad + min(max(turn, -most), most)


def halved(step_s: float, holds: Callable[[float], bool]) -> float:
    """The instant of a step up to which `holds` is true, and from which on it is not: halved to the last bits."""
    low, high = 0.0, step_s
    for _ in range(40):
        middle = 0.5 * (low + high)
        if holds(middle):
            low = middle
        else:
            high = middle
    return high
