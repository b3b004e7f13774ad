"""A classical lane follower: finds the dark lane in its front picture, seen from above, and steers along its middle.

Knows its own camera's place on the vehicle and the lane's width, as anybody who calibrated a real car would; not the circuit,
the obstacles or where it is. It does not see things on the lane for what they are: when it stands before one it backs away and
comes again, on one side of the lane or on the other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnb_edge.nut.birds_eye import BirdsEye, LaneSight
from dnb_edge.nut.foresight import Foresight
from dnb_edge.nut.recovery import BackAway
from dnb_edge.sim.circuit import LANE_WIDTH_M
from dnb_edge.sim.control import Briefing, Control, DriverFailed, Sight, VehicleState
from dnb_edge.sim.front_camera import FrontMount
from dnb_edge.values import PointM

_MOUNT = FrontMount()


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneStyle:
    """How the lane follower sees and drives."""

    mount: FrontMount = _MOUNT
    lane_width_m: float = LANE_WIDTH_M
    near_m: float = 0.30
    """Distance from the rear axle at which the lane's middle is steered at."""
    far_m: float = 0.52
    """Distance at which the bend ahead is judged."""
    top_mps: float = 0.85
    lowest_mps: float = 0.35
    lateral_mps2: float = 1.0
    """Acceleration to the side that bends are taken with."""
    lost_mps: float = 0.25
    """While no lane is seen, on the steering of the last picture with one."""


_STYLE = LaneStyle()


class LaneFollower:
    """The driver. `start` before `drive`; one thread."""

    def __init__(self, style: LaneStyle = _STYLE) -> None:
        self._style = style
        self._following: _Following | None = None

    @property
    def name(self) -> str:
        """What tables call it."""
        return "lane-follower"

    @property
    def knows_truth(self) -> bool:
        """False: it has its camera and its wheels' speed."""
        return False

    def start(self, briefing: Briefing) -> None:
        """Prepares the view from above for the pictures' size."""
        self._following = _Following(briefing, self._style)

    def drive(self, sight: Sight) -> Control:
        """What it wants. Raises `DriverFailed` where it was not started, or gets pictures of another size than it was told."""
        if self._following is None:
            raise DriverFailed("lane-follower: was not started")
        return self._following.control(sight)

    def close(self) -> None:
        """Forgets its drive; safe to repeat."""
        self._following = None


class _Following:
    """One drive: the view from above, and what was seen and wanted lately."""

    def __init__(self, briefing: Briefing, style: LaneStyle) -> None:
        self._briefing = briefing
        self._style = style
        self._eye = BirdsEye(briefing.picture_px, style.mount)
        self._foresight = Foresight(briefing)
        self._rescue = BackAway()
        self._aside = KeepAside()
        self._backing = False
        self._steering_rad = 0.0
        self._towards_rad = 0.0

    def control(self, sight: Sight) -> Control:
        """What to want, having seen that."""
        width, height = self._briefing.picture_px
        if sight.bgr.shape != (height, width, 3):
            raise DriverFailed(
                f"lane-follower: was told of pictures {width}x{height}, got one of shape {sight.bgr.shape}"
            )
        now_s = sight.t_ns * 1e-9
        rescue = self._rescue.control(now_s, sight.speed_mps)
        if rescue is not None and not self._backing:
            self._aside.blocked()
        self._backing = rescue is not None
        self._aside.moved(max(sight.speed_mps, 0.0) * self._briefing.period_s)
        wanted = rescue or self._along(sight, now_s)
        self._rescue.remember(now_s, wanted, sight.speed_mps)
        self._foresight.remember(now_s, wanted)
        self._steering_rad = wanted.steering * self._briefing.steering_lock_rad
        return wanted

    def _along(self, sight: Sight, now_s: float) -> Control:
        ahead = self._foresight.state(
            now_s,
            VehicleState(
                track_m=(0.0, 0.0), heading_rad=0.0, speed_mps=sight.speed_mps, steering_rad=self._steering_rad
            ),
        )
        half = 0.5 * self._briefing.wheelbase_m
        rear = (
            ahead.track_m[0] - half * math.cos(ahead.heading_rad),
            ahead.track_m[1] - half * math.sin(ahead.heading_rad),
        )
        lane = self._eye.lane(sight.bgr)
        near = self._middle(lane, rear, self._style.near_m, self._towards_rad)
        if near is None:
            self._towards_rad *= 0.9
            return self._control(self._steering_rad, self._style.lost_mps, sight.speed_mps)
        self._towards_rad = math.atan2(near.at_m[1] - rear[1], near.at_m[0] - rear[0])
        far = self._middle(lane, rear, self._style.far_m, self._towards_rad)
        x, y = near.at_m
        beside = (
            x - self._aside.left_m * math.sin(self._towards_rad),
            y + self._aside.left_m * math.cos(self._towards_rad),
        )
        bend = _bend_to(beside, rear, ahead.heading_rad)
        sharpest = abs(bend) if far is None else max(abs(bend), abs(_bend_to(far.at_m, rear, ahead.heading_rad)))
        speed = math.sqrt(self._style.lateral_mps2 / max(sharpest, 1e-6))
        top = self._style.top_mps if far is not None else 0.6 * self._style.top_mps
        return self._control(
            math.atan(self._briefing.wheelbase_m * bend),
            min(top, max(self._style.lowest_mps, speed)),
            ahead.speed_mps,
        )

    def _middle(self, lane: NDArray[np.bool_], rear: PointM, distance_m: float, towards_rad: float) -> LaneSight | None:
        return self._eye.middle(
            lane,
            centre_m=rear,
            distance_m=distance_m,
            towards_rad=towards_rad,
            half_width_m=0.5 * self._style.lane_width_m,
        )

    def _control(self, steering_rad: float, wanted_mps: float, speed_mps: float) -> Control:
        top = self._briefing.top_speed_mps
        return Control(
            steering=_clipped(steering_rad / self._briefing.steering_lock_rad),
            throttle=_clipped((wanted_mps + 0.8 * (wanted_mps - speed_mps)) / top),
        )


class KeepAside:
    """Which side of the lane's middle to keep to: after being blocked one side for a while; blocked there too, the other."""

    BY_M = 0.06
    FOR_M = 1.0

    def __init__(self) -> None:
        self._side = 1.0
        self._still_m = 0.0

    def blocked(self) -> None:
        """Something is in the way."""
        if self._still_m > 0.0:
            self._side = -self._side
        self._still_m = self.FOR_M

    def moved(self, way_m: float) -> None:
        """The vehicle has come that far."""
        self._still_m = max(0.0, self._still_m - way_m)

    @property
    def left_m(self) -> float:
        """How far to the left of the lane's middle to keep."""
        return self._side * self.BY_M if self._still_m > 0.0 else 0.0


def _bend_to(point_m: PointM, rear_m: PointM, heading_rad: float) -> float:
    """Curvature, 1/m and positive to the left, of the arc that leaves `rear_m` along the heading and meets `point_m`."""
    x, y = point_m[0] - rear_m[0], point_m[1] - rear_m[1]
    leftward = -math.sin(heading_rad) * x + math.cos(heading_rad) * y
    return 2.0 * leftward / (x * x + y * y)


def _clipped(value: float) -> float:
    return min(1.0, max(-1.0, value))
