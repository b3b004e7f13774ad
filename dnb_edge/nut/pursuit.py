"""Pure pursuit: a driver that knows the truth, as a measure for others.

Steers the rear axle on the arc to a point of its line a little ahead (Coulter, "Implementation of the Pure Pursuit Path
Tracking Algorithm", CMU-RI-TR-92-01, 1992), from where the car will be when the control takes hold. Started the wrong way
round, it turns between forward and backward; blocked, it backs away. Knows circuit, obstacles and the vehicle's true
state; looks at no picture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from dnb_edge.nut.driving_line import DrivingLine, Pace, driving_line
from dnb_edge.nut.foresight import Foresight
from dnb_edge.nut.recovery import BackAway, TurnRound
from dnb_edge.sim.control import Briefing, Control, DriverFailed, Sight, VehicleState


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
    clearance_m: float = 0.03
    """Wanted between the car's side and an obstacle."""


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

    def overruled(self, given: Control) -> None:
        """Tells it that the vehicle was given another control than it wanted last: it teaches, or is disturbed."""
        if self._driving is not None:
            self._driving.overruled(given)

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
            clearance_m=style.clearance_m,
        )
        self._line: DrivingLine = driving_line(briefing.circuit, briefing.obstacles, pace)
        self._index: int | None = None
        self._foresight = Foresight(briefing)
        self._turn = TurnRound()
        self._rescue = BackAway()

    def control(self, t_ns: int, state: VehicleState) -> Control:
        """What to want, having seen `state` at `t_ns`."""
        now_s = t_ns * 1e-9
        ahead = self._foresight.state(now_s, state)
        self._index = self._line.nearest(ahead.track_m, around=self._index)
        wanted = self._rescue.control(now_s, state.speed_mps) or self._going(now_s, ahead)
        self._rescue.remember(now_s, wanted, state.speed_mps)
        self._foresight.remember(now_s, wanted)
        return wanted

    def overruled(self, given: Control) -> None:
        """Takes note that `given` was given in place of what was wanted last."""
        self._foresight.overrule(given)

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


def _wrapped(angle_rad: float) -> float:
    """Into -pi to pi."""
    return math.remainder(angle_rad, math.tau)


def _clipped(value: float) -> float:
    return min(1.0, max(-1.0, value))
