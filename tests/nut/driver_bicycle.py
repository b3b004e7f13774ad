"""A plain vehicle for tests of drivers: the kinematic bicycle with first-order lags, and controls that arrive late."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from dnb_edge.sim.circuit import Circuit
from dnb_edge.sim.control import Briefing, Control, Driver, Obstacle, Sight, VehicleState

STEP_S = 0.005
PERIOD_S = 1.0 / 30.0
NOTHING = np.zeros((1, 1, 3), dtype=np.uint8)


@dataclass(slots=True)
class Ride:
    """What a ride was like, a value a picture."""

    states: list[VehicleState] = field(default_factory=list)
    controls: list[Control] = field(default_factory=list)
    offsets_m: list[float] = field(default_factory=list)
    travelled_m: float = 0.0
    """Along the centreline, signed."""

    @property
    def worst_m(self) -> float:
        return max(map(abs, self.offsets_m))


def briefing(circuit: Circuit | None, *, delay_s: float = 0.05, obstacles: Sequence[Obstacle] = ()) -> Briefing:
    return Briefing(
        seed=1, wheelbase_m=0.152, steering_lock_rad=math.radians(40.0), top_speed_mps=2.0, picture_px=(1, 1),
        period_s=PERIOD_S, delay_s=delay_s, circuit=circuit, obstacles=tuple(obstacles),
    )  # fmt: skip


def at(circuit: Circuit, s_m: float, *, offset_m: float = 0.0, turned_rad: float = 0.0) -> VehicleState:
    """A car that stands `s_m` along the circuit, turned away from it by `turned_rad`."""
    s = np.array([s_m])
    point = (circuit.centreline.at(s) + offset_m * circuit.centreline.normal(s))[0]
    ahead = circuit.centreline.tangent(s)[0]
    return VehicleState(
        track_m=(float(point[0]), float(point[1])), heading_rad=math.atan2(ahead[1], ahead[0]) + turned_rad,
        speed_mps=0.0, steering_rad=0.0,
    )  # fmt: skip


def ride(
    driver: Driver,
    circuit: Circuit,
    brief: Briefing,
    start: VehicleState,
    duration_s: float,
    *,
    wall: Callable[[VehicleState], bool] = lambda _: False,
    bgr: Callable[[VehicleState], np.ndarray] = lambda _: NOTHING,
) -> Ride:
    """Drive for `duration_s`; a step into `wall` is not taken and stops the car."""
    state, ridden, coming = start, Ride(), []
    in_force = Control(steering=0.0, throttle=0.0)
    driver.start(brief)
    steps = round(duration_s / STEP_S)
    stride = round(PERIOD_S / STEP_S)
    for step in range(steps):
        t_s = step * STEP_S
        if step % stride == 0:
            sight = Sight(t_ns=round(t_s * 1e9), bgr=bgr(state), speed_mps=state.speed_mps, state=state)
            wanted = driver.drive(sight)
            coming.append((t_s + brief.delay_s, wanted))
            ridden.states.append(state)
            ridden.controls.append(wanted)
        while coming and coming[0][0] <= t_s + 1e-9:
            in_force = coming.pop(0)[1]
        moved = stepped(state, in_force, brief)
        if wall(moved):
            moved = VehicleState(
                track_m=state.track_m, heading_rad=state.heading_rad, speed_mps=0.0, steering_rad=moved.steering_rad
            )
        state = moved
    driver.close()
    _measure(ridden, circuit)
    return ridden


def stepped(state: VehicleState, control: Control, brief: Briefing) -> VehicleState:
    steering = state.steering_rad + (control.steering * brief.steering_lock_rad - state.steering_rad) * STEP_S / 0.08
    speed = state.speed_mps + (control.throttle * brief.top_speed_mps - state.speed_mps) * STEP_S / 0.25
    slip = math.atan(0.5 * math.tan(steering))
    course = state.heading_rad + slip
    x, y = state.track_m
    return VehicleState(
        track_m=(x + speed * STEP_S * math.cos(course), y + speed * STEP_S * math.sin(course)),
        heading_rad=state.heading_rad + speed * STEP_S * math.cos(slip) * math.tan(steering) / brief.wheelbase_m,
        speed_mps=speed,
        steering_rad=steering,
    )


def _measure(ridden: Ride, circuit: Circuit) -> None:
    """Offsets and the way along the centreline, from the states; neighbours are near each other."""
    s = np.arange(0.0, circuit.centreline.length_m, 0.005)
    points, normals = circuit.centreline.at(s), circuit.centreline.normal(s)
    places = []
    for state in ridden.states:
        away = np.asarray(state.track_m) - points
        nearest = int(np.argmin(np.einsum("ij,ij->i", away, away)))
        ridden.offsets_m.append(float(away[nearest] @ normals[nearest]))
        places.append(s[nearest])
    length = circuit.centreline.length_m
    ridden.travelled_m = float(sum(math.remainder(b - a, length) for a, b in itertools.pairwise(places)))
