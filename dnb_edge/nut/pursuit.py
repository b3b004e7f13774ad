"""Pure pursuit: a driver that knows the truth, as a measure for others.

Steers the rear axle on the arc to a point of its line a little ahead (Coulter, "Implementation of the Pure Pursuit Path
Tracking Algorithm", CMU-RI-TR-92-01, 1992), from where the car will be when the control takes hold. Started the wrong way
round, it turns between forward and backward; blocked, it backs away. Knows circuit, obstacles and the vehicle's true
state; looks at no picture.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from dnb_edge.nut.driving_line import DrivingLine, Pace, driving_line
from dnb_edge.sim.control import Briefing, Control, DriverFailed, Sight, VehicleState

_STEERING_LAG_S = 0.06
_MOTOR_LAG_S = 0.20
"""What it takes the vehicle to be like while it looks ahead over the delay; nothing depends on it sharply."""
_STEP_S = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class PursuitStyle:
    """How pure pursuit drives."""

    top_share: float = 0.85
    """Greatest share of the vehicle's top speed."""
    top_mps: float = 1.3
    lowest_mps: float = 0.45
    lateral_mps2: float = 1.8
    change_mps2: float = 1.4
    lookahead_s: float = 0.16
    """The point steered at lies this long ahead, at the present speed..."""
    lookahead_m: tuple[float, float] = (0.16, 0.40)
    """... but within these distances."""


_STYLE = PursuitStyle()


class PurePursuit:
    """The driver. `start` before `drive`; one thread."""

    def __init__(self, style: PursuitStyle = _STYLE) -> None:
        self._style = style
        self._driving: _Driving | None = None

    @property
    def name(self) -> str:
        """What tables call it."""
        return "pure-pursuit"

    @property
    def knows_truth(self) -> bool:
        """True: it is a measure for others."""
        return True

    def start(self, briefing: Briefing) -> None:
        """Plans its line. Raises `DriverFailed` where it is not told the circuit."""
        if briefing.circuit is None:
            raise DriverFailed("pure-pursuit: was not told the circuit")
        self._driving = _Driving(briefing, self._style)

    def drive(self, sight: Sight) -> Control:
        """What it wants. Raises `DriverFailed` where it is not told the vehicle's state."""
        if self._driving is None:
            raise DriverFailed("pure-pursuit: was not started")
        if sight.state is None:
            raise DriverFailed("pure-pursuit: was not told the vehicle's state")
        return self._driving.control(sight.t_ns, sight.state)

    def close(self) -> None:
        """Forgets its drive; safe to repeat."""
        self._driving = None


class _Driving:
    """One drive: its line, where on it the car is, and what was wanted lately."""

    def __init__(self, briefing: Briefing, style: PursuitStyle) -> None:
        if briefing.circuit is None:
            raise DriverFailed("pure-pursuit: was not told the circuit")
        self._style = style
        self._briefing = briefing
        pace = Pace(
            top_mps=min(style.top_mps, style.top_share * briefing.top_speed_mps),
            lowest_mps=min(style.lowest_mps, style.top_share * briefing.top_speed_mps),
            lateral_mps2=style.lateral_mps2,
            change_mps2=style.change_mps2,
            least_radius_m=briefing.wheelbase_m / math.tan(briefing.steering_lock_rad),
        )
        self._line: DrivingLine = driving_line(briefing.circuit, briefing.obstacles, pace)
        self._index: int | None = None
        self._wanted: deque[tuple[float, Control]] = deque(maxlen=64)
        self._turn = TurnRound()
        self._rescue = BackAway()

    def control(self, t_ns: int, state: VehicleState) -> Control:
        """What to want, having seen `state` at `t_ns`."""
        now_s = t_ns * 1e-9
        ahead = self._foreseen(now_s, state)
        self._index = self._line.nearest(ahead.track_m, around=self._index)
        wanted = self._rescue.control(now_s, state.speed_mps) or self._going(now_s, ahead)
        self._rescue.remember(now_s, wanted, state.speed_mps)
        self._wanted.append((now_s + self._briefing.delay_s, wanted))
        return wanted

    def _going(self, now_s: float, ahead: VehicleState) -> Control:
        """Round where the car points the wrong way, else along the line."""
        index = self._index or 0
        error = _wrapped(float(self._line.heading_rad[index]) - ahead.heading_rad)
        offset = self._offset_m(index, ahead)
        return self._turn.control(now_s, error, offset) or self._pursuit(index, ahead)

    def _offset_m(self, index: int, state: VehicleState) -> float:
        """Of the car to the left of its line."""
        x, y = self._line.points_m[index]
        heading = float(self._line.heading_rad[index])
        return math.cos(heading) * (state.track_m[1] - float(y)) - math.sin(heading) * (state.track_m[0] - float(x))

    def _pursuit(self, index: int, state: VehicleState) -> Control:
        style, briefing = self._style, self._briefing
        nearest, farthest = style.lookahead_m
        distance = min(max(style.lookahead_s * abs(state.speed_mps), nearest), farthest)
        half = 0.5 * briefing.wheelbase_m
        cos, sin = math.cos(state.heading_rad), math.sin(state.heading_rad)
        rear = (state.track_m[0] - half * cos, state.track_m[1] - half * sin)
        x, y = self._line.ahead(index, distance)
        away = (x - rear[0], y - rear[1])
        leftward = -sin * away[0] + cos * away[1]
        angle = math.atan2(2.0 * briefing.wheelbase_m * leftward, away[0] ** 2 + away[1] ** 2)
        speed = self._line.slowest_mps(index, 0.12 * max(state.speed_mps, 0.0))
        return Control(
            steering=_clipped(angle / briefing.steering_lock_rad),
            throttle=_clipped((speed + 1.0 * (speed - state.speed_mps)) / briefing.top_speed_mps),
        )

    def _foreseen(self, now_s: float, state: VehicleState) -> VehicleState:
        """The state at which a control wanted now takes hold: a bicycle under the controls that are on their way."""
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


class TurnRound:
    """Turns a car that points the wrong way, forward and backward in turn so that it stays near its lane."""

    _BEGIN_RAD = math.radians(100.0)
    _END_RAD = math.radians(40.0)
    _ROOM_M = 0.10
    _LEAST_S = 0.35
    """A move lasts at least this long: the motor must first come round."""
    _LONGEST_S = 2.5
    _THROTTLE = 0.25

    def __init__(self) -> None:
        self._side = 0.0
        self._gear = 1.0
        self._since_s = 0.0

    def control(self, now_s: float, error_rad: float, offset_m: float) -> Control | None:
        """What to want where the car must turn by `error_rad` (positive: to the left) to point along its line, `offset_m` to
        the left of it; None where it points that way well enough."""
        if not self._side:
            if abs(error_rad) < self._BEGIN_RAD:
                return None
            self._side, self._gear, self._since_s = math.copysign(1.0, error_rad), 1.0, now_s
        elif abs(error_rad) < self._END_RAD:
            self._side = 0.0
            return None
        outward = -self._gear * math.sin(error_rad) * offset_m > 0.0
        moved_s = now_s - self._since_s
        if (outward and abs(offset_m) > self._ROOM_M and moved_s > self._LEAST_S) or moved_s > self._LONGEST_S:
            self._gear, self._since_s = -self._gear, now_s
        return Control(steering=self._side * self._gear, throttle=self._gear * self._THROTTLE)


class BackAway:
    """Backs away where the car was told to move and stands: something is in its way. Needs the wheels' speed only."""

    _STANDS_MPS = 0.02
    _PATIENCE_S = 0.8
    _BACK_S = 0.7
    _PAUSE_S = 1.0
    """After backing away, before it may think itself blocked again."""

    def __init__(self) -> None:
        self._standing_since_s: float | None = None
        self._back_until_s = -math.inf
        self._gear = -1.0
        self._steering = 0.0

    def control(self, now_s: float, speed_mps: float) -> Control | None:
        """What to want while backing away; None where nothing is in the way."""
        since = self._standing_since_s
        if since is not None and abs(speed_mps) < self._STANDS_MPS and now_s - since > self._PATIENCE_S:
            self._back_until_s = now_s + self._BACK_S
            self._standing_since_s = None
        if now_s < self._back_until_s:
            return Control(steering=-self._steering, throttle=0.3 * self._gear)
        return None

    def remember(self, now_s: float, wanted: Control, speed_mps: float) -> None:
        """Takes note of what was wanted, and whether the car stood."""
        backing = now_s < self._back_until_s
        pushing = abs(wanted.throttle) > 0.05 and abs(speed_mps) < self._STANDS_MPS
        if backing or now_s < self._back_until_s + self._PAUSE_S or not pushing:
            self._standing_since_s = None
        elif self._standing_since_s is None:
            self._standing_since_s = now_s
        if not backing:
            self._gear, self._steering = -math.copysign(1.0, wanted.throttle), wanted.steering


def _wrapped(angle_rad: float) -> float:
    """Into -pi to pi."""
    return math.remainder(angle_rad, math.tau)


def _clipped(value: float) -> float:
    return min(1.0, max(-1.0, value))
