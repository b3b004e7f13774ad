"""Where a vehicle will be when a control that is wanted now takes hold.

Knows the kinematic bicycle and the controls that are on their way. Knows no circuit and no picture.
"""

from __future__ import annotations

import math
from collections import deque

from dnb_edge.sim.control import Briefing, Control, VehicleState

_STEERING_LAG_S = 0.05
_MOTOR_LAG_S = 0.20
"""What the vehicle is taken to be like; over the short time that is looked ahead nothing depends on it sharply."""
_STEP_S = 0.01


class Foresight:
    """Remembers what was wanted, and for when."""

    def __init__(self, briefing: Briefing) -> None:
        self._briefing = briefing
        self._wanted: deque[tuple[float, Control]] = deque(maxlen=256)

    def remember(self, now_s: float, wanted: Control) -> None:
        """Takes note of what is wanted, having seen the picture of `now_s`."""
        self._wanted.append((now_s + self._briefing.delay_s, wanted))

    def overrule(self, given: Control) -> None:
        """Takes note that `given` was given in place of what was wanted last."""
        if self._wanted:
            self._wanted[-1] = (self._wanted[-1][0], given)

    def state(self, now_s: float, state: VehicleState) -> VehicleState:
        """`state` of the picture of `now_s` as it will be when a control made of that picture takes hold."""
        left_s, t_s = self._briefing.delay_s, now_s
        while left_s > 1e-9:
            step_s = min(_STEP_S, left_s)
            state = foreseen(state, self._in_force(t_s), self._briefing, step_s)
            t_s, left_s = t_s + step_s, left_s - step_s
        return state

    def _in_force(self, t_s: float) -> Control:
        held = [one for from_s, one in self._wanted if from_s <= t_s]
        return held[-1] if held else Control(steering=0.0, throttle=0.0)


def foreseen(state: VehicleState, control: Control, briefing: Briefing, step_s: float) -> VehicleState:
    """`state` after `step_s` under `control`: the kinematic bicycle about the footprint's centre, with plain lags."""
    steering = state.steering_rad + (control.steering * briefing.steering_lock_rad - state.steering_rad) * min(
        1.0, step_s / _STEERING_LAG_S
    )
    speed = state.speed_mps + (control.throttle * briefing.top_speed_mps - state.speed_mps) * min(
        1.0, step_s / _MOTOR_LAG_S
    )
    slip = math.atan(0.5 * math.tan(steering))
    course = state.heading_rad + slip
    return VehicleState(
        track_m=(
            state.track_m[0] + speed * step_s * math.cos(course),
            state.track_m[1] + speed * step_s * math.sin(course),
        ),
        heading_rad=state.heading_rad + speed * step_s * math.cos(slip) * math.tan(steering) / briefing.wheelbase_m,
        speed_mps=speed,
        steering_rad=steering,
    )
