"""What gets a car out of trouble that no steering along a lane does: turning round, and backing away from what blocks it.

Knows one car's recent moves; no circuit, no picture and no vehicle's sizes.
"""

from __future__ import annotations

import math

from dnb_edge.sim.control import Control


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
        """What to want while backing away, the way it came; None where nothing is in the way."""
        since = self._standing_since_s
        if since is not None and abs(speed_mps) < self._STANDS_MPS and now_s - since > self._PATIENCE_S:
            self._back_until_s = now_s + self._BACK_S
            self._standing_since_s = None
        if now_s < self._back_until_s:
            return Control(steering=self._steering, throttle=0.3 * self._gear)
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
