"""The closed loop's world: a track, things on it and one vehicle that a driver steers by its front camera, on simulated time.

Knows what is really driven, to the instant. Knows no detector and no wall clock: a control made of a picture taken at t takes
hold at t + delay, however long the driver took over it. The same task and the same driver give the same bytes.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dnb_edge.sim.camera import PinholeCamera
from dnb_edge.sim.circuit import Circuit, edge_line
from dnb_edge.sim.control import Briefing, Control, Driver, Sight, VehicleState
from dnb_edge.sim.driver import Pose
from dnb_edge.sim.front_camera import OBSTACLE_BGR, FrontCamera
from dnb_edge.sim.light import light_of
from dnb_edge.sim.places import place
from dnb_edge.sim.renderer import Renderer
from dnb_edge.sim.rig import TrueLap, border_marks
from dnb_edge.sim.solids import cylinder, mesh
from dnb_edge.sim.task import LoopTask
from dnb_edge.sim.vehicle import Arc, VehicleSettings, reach_m, stepped
from dnb_edge.values import BgrImage, Direction, Frame, PointM, Points, StampSource

STEP_NS = 5_000_000
"""The vehicle's step: controls take hold at the first step's beginning that is not before their instant."""
LEFT_M = 0.6
"""Farther from the centreline than this the vehicle has left the track, and the drive ends."""
STUCK_S = 8.0
"""A vehicle that has not come on by `STUCK_M` within this time is stuck, and the drive ends."""
STUCK_M = 0.10
RUN_OUT_S = 0.8
"""Driven on after the last lap, so that the overhead camera sees the crossing well."""
APART_M = 0.03
"""A vehicle must get this far from a thing before it can run into it again."""

SLOWEST_MPS = 0.35
"""Who drives slower than this runs out of time, where the task sets no limit of its own."""

_STEP_S = STEP_NS * 1e-9
_LOOK_STEPS = 4
_ROUTE_STEP_M = 0.005
_HALVINGS = 40


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueCrossing:
    """An instant at which the ground point crossed the start line."""

    t_s: float
    direction: Direction


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueCollision:
    """An instant at which the vehicle ran into an obstacle, and stopped there."""

    t_s: float
    obstacle: int
    """Its index among the task's."""
    track_m: PointM
    """The vehicle's ground point then."""
    speed_mps: float
    """Of the vehicle, before it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopTruth:
    """What has really happened so far. Instants in seconds of the simulated clock, whose 0 is the first frame's stamp."""

    crossings: tuple[TrueCrossing, ...]
    laps: tuple[TrueLap, ...]
    """Complete ones: from one forward crossing to the next, a crossing back and forth again left out."""
    collisions: tuple[TrueCollision, ...]
    distance_m: float
    """Way of the ground point, forwards and back."""
    off_lane_s: float
    """Time in which the ground point was not on the lane."""
    duration_s: float
    completed: bool
    """Whether all laps of the task were driven."""
    ended: str | None
    """Why the drive is over: `laps`, `time`, `left` or `stuck`; None while it goes on."""


class World:
    """One task's world. Not safe for use by several threads. Rooms and floors are drawn when a picture is first asked for."""

    def __init__(self, task: LoopTask) -> None:
        self.task = task
        where = place(task.place)
        self.circuit: Circuit = where.circuit
        self.camera: PinholeCamera = where.camera.resized(task.size_px)
        """The overhead camera."""
        self._light = light_of(task.light, task.seed)
        self._vehicle, self._lean = _varied(task.vehicle, task.seed)
        (x, y), (end_x, end_y) = self.circuit.start_line_m
        self._line = _Line(start_m=(x, y), along_m=(end_x - x, end_y - y))
        self._route = _Route(self.circuit)
        self._control = Control(steering=0.0, throttle=0.0)
        self._waiting: deque[tuple[int, Control]] = deque()
        self._step = 0
        """Number of the step that `_arc` is; it begins at `_step` * `STEP_NS`."""
        self._front_index = 0
        self._hit: tuple[int, float] | None = None
        """(obstacle, seconds into the present step) where that step ends against one."""
        self._touching: set[int] = set()
        self._crossings: list[TrueCrossing] = []
        self._laps: list[TrueLap] = []
        self._collisions: list[TrueCollision] = []
        self._debt = 0
        """Crossings backward that none forward has taken back."""
        self._lap_began_s: float | None = None
        self._distance_m = 0.0
        self._off_lane_s = 0.0
        start = _start_state(self.circuit, task)
        self._came_on = (0.0, start.track_m)
        """When and where the vehicle was last seen to have come on."""
        self._ended: str | None = None
        self._ends_s = limit_s(task, self.circuit)
        self._arc = self._begin_step(start)

    @property
    def ended(self) -> str | None:
        """Why the drive is over: `laps`, `time`, `left` or `stuck`; None while it goes on."""
        return self._ended

    def brief(self, driver: Driver) -> Briefing:
        """What that driver is told before it starts."""
        task, settings = self.task, self.task.vehicle
        told = driver.knows_truth
        return Briefing(
            seed=task.seed,
            wheelbase_m=settings.wheelbase_m,
            steering_lock_rad=settings.steering_lock_rad,
            top_speed_mps=settings.top_speed_mps,
            picture_px=task.front_size_px,
            period_s=1.0 / task.front_fps,
            delay_s=task.delay_s,
            circuit=self.circuit if told else None,
            obstacles=task.obstacles if told else (),
        )

    def drive_until(self, t_ns: int, driver: Driver) -> None:
        """Lets `driver`, which was started, drive up to `t_ns`: all front pictures up to then are shown to it.

        Goes on after `ended` as well, as far as it is asked to. Raises `DriverFailed`.
        """
        while (at_ns := self.front_t_ns(self._front_index)) <= t_ns:
            self.advance(at_ns)
            sight = self.sight(truth=driver.knows_truth)
            self._front_index += 1
            self.steer(driver.drive(sight), at_ns)
        self.advance(t_ns)

    def front_t_ns(self, index: int) -> int:
        """When front picture `index` is taken."""
        return round(index * 1_000_000_000 / self.task.front_fps)

    def frame_t_ns(self, index: int) -> int:
        """When overhead frame `index` is taken."""
        return round(index * 1_000_000_000 / self.task.fps)

    def steer(self, control: Control, seen_ns: int) -> None:
        """`control`, made of what was seen at `seen_ns`, takes hold the task's delay later. In order of `seen_ns`."""
        self._waiting.append((seen_ns + round(self.task.delay_s * 1e9), control))

    def advance(self, t_ns: int) -> None:
        """Drives on until the step that holds `t_ns`."""
        while (self._step + 1) * STEP_NS <= t_ns:
            self._finish_step()

    def state(self, t_ns: int) -> VehicleState:
        """The vehicle at `t_ns`, within the step up to which it was driven."""
        elapsed_ns = t_ns - self._step * STEP_NS
        if not 0 <= elapsed_ns <= STEP_NS:
            raise ValueError(f"{t_ns} ns is not within step {self._step}")
        return self._arc.state(elapsed_ns * 1e-9)

    def sight(self, *, truth: bool = False) -> Sight:
        """The front picture that is due next, the vehicle having been driven there."""
        t_ns = self.front_t_ns(self._front_index)
        state = self.state(t_ns)
        return Sight(
            t_ns=t_ns,
            bgr=self._front.picture(self._front_index, state, self._light.gain(t_ns * 1e-9)),
            speed_mps=state.speed_mps,
            state=state if truth else None,
        )

    def frame(self, index: int) -> Frame:
        """Overhead frame `index`, the vehicle having been driven there."""
        t_ns = self.frame_t_ns(index)
        state = self.state(t_ns)
        pose = Pose(track_m=state.track_m, heading_rad=state.heading_rad, speed_mps=state.speed_mps)
        picture = self._renderer.picture(index, pose)
        gain = self._light.gain(t_ns * 1e-9)
        if gain != 1.0:
            picture = np.asarray(np.rint(picture * np.float32(gain)), dtype=np.uint8)
        return Frame(
            sequence=index,
            t_ns=t_ns,
            stamp_source=StampSource.SIMULATED,
            width_px=self.camera.width_px,
            height_px=self.camera.height_px,
            bgr=picture,
        )

    def empty_picture(self) -> BgrImage:
        """What the overhead camera sees without the vehicle."""
        return self._renderer.picture(0, None)

    def keypoint_pairs(self, count: int = 8) -> tuple[Points, Points]:
        """`count` (at least 4) marks on the lane's outer border, as (camera px, twin px), each (count, 2), exact."""
        return border_marks(self.circuit, self.camera, count)

    def truth(self) -> LoopTruth:
        """What has really happened so far."""
        return LoopTruth(
            crossings=tuple(self._crossings),
            laps=tuple(self._laps),
            collisions=tuple(self._collisions),
            distance_m=self._distance_m,
            off_lane_s=self._off_lane_s,
            duration_s=self._step * _STEP_S,
            completed=len(self._laps) >= self.task.laps,
            ended=self._ended,
        )

    @cached_property
    def _renderer(self) -> Renderer:
        renderer = Renderer(self.circuit, self.camera, self.task.seed)
        for number, thing in enumerate(self.task.obstacles):
            x, y = thing.track_m
            colour = OBSTACLE_BGR[number % len(OBSTACLE_BGR)]
            solid = cylinder((x, y, 0.5 * thing.height_m), thing.radius_m, thing.height_m, 2, colour, sides=20)
            renderer.stand(mesh([solid]))
        return renderer

    @cached_property
    def _front(self) -> FrontCamera:
        return FrontCamera(self.circuit, self.task.obstacles, seed=self.task.seed, size_px=self.task.front_size_px)

    def _begin_step(self, state: VehicleState) -> Arc:
        """The step from `state` on, up to where it leads against something."""
        while self._waiting and self._waiting[0][0] <= self._step * STEP_NS:
            self._control = self._waiting.popleft()[1]
        settings = self._vehicle
        arc = stepped(
            settings,
            state,
            steering_rad=self._control.steering * settings.steering_lock_rad + self._lean.at(self._step * _STEP_S),
            speed_mps=self._control.throttle * settings.top_speed_mps,
            step_s=_STEP_S,
        )
        self._hit = None
        for number in range(len(self.task.obstacles)):
            gap_m = self._gap_m(arc.state(_STEP_S), number)
            if number in self._touching:
                # It may leave what it touches, and come no nearer.
                if gap_m < min(APART_M, self._gap_m(state, number)):
                    return replace(arc, stops_s=0.0)
            elif gap_m < 0.0:
                self._hit = (number, self._meeting_s(arc, number))
                return replace(arc, stops_s=self._hit[1])
        return arc

    def _finish_step(self) -> None:
        """Ends the present step, writes down what happened in it, and begins the next."""
        arc, began_s = self._arc, self._step * _STEP_S
        before, after = arc.state(0.0), arc.state(_STEP_S)
        self._distance_m += math.dist(before.track_m, after.track_m)
        self._watch_line(arc, began_s)
        if self._hit is not None:
            number, hit_s = self._hit
            speed = arc.speed_mps + arc.acceleration_mps2 * hit_s
            self._collisions.append(
                TrueCollision(t_s=began_s + hit_s, obstacle=number, track_m=after.track_m, speed_mps=speed)
            )
            self._touching.add(number)
        self._touching = {number for number in self._touching if self._gap_m(after, number) < APART_M}
        self._step += 1
        if self._step % _LOOK_STEPS == 0:
            self._look_round(after)
        self._arc = self._begin_step(after)

    def _gap_m(self, state: VehicleState, number: int) -> float:
        thing = self.task.obstacles[number]
        return reach_m(self._vehicle, state, thing.track_m) - thing.radius_m

    def _meeting_s(self, arc: Arc, number: int) -> float:
        low, high = 0.0, _STEP_S
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            if self._gap_m(arc.state(middle), number) < 0.0:
                high = middle
            else:
                low = middle
        return low

    def _watch_line(self, arc: Arc, began_s: float) -> None:
        before, after = (self._line.left_m(arc.state(t).track_m) for t in (0.0, _STEP_S))
        if (before < 0.0) == (after < 0.0):
            return
        low, high = 0.0, _STEP_S
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            if (self._line.left_m(arc.state(middle).track_m) < 0.0) == (before < 0.0):
                low = middle
            else:
                high = middle
        if self._line.holds(arc.state(high).track_m):
            self._crossed(began_s + high, Direction.FORWARD if before < 0.0 else Direction.REVERSE)

    def _crossed(self, t_s: float, direction: Direction) -> None:
        self._crossings.append(TrueCrossing(t_s=t_s, direction=direction))
        if direction is Direction.REVERSE:
            # Before the first lap nothing is lost by it.
            self._debt += self._lap_began_s is not None
        elif self._debt:
            self._debt -= 1
        else:
            if self._lap_began_s is not None:
                self._laps.append(TrueLap(number=len(self._laps) + 1, start_s=self._lap_began_s, end_s=t_s))
            self._lap_began_s = t_s

    def _look_round(self, state: VehicleState) -> None:
        """Where the vehicle is on the track, and whether the drive is over."""
        now_s, aside_m = self._step * _STEP_S, self._route.aside_m(state.track_m)
        if aside_m > 0.5 * self.circuit.lane_width_m:
            self._off_lane_s += _LOOK_STEPS * _STEP_S
        if math.dist(state.track_m, self._came_on[1]) > STUCK_M:
            self._came_on = (now_s, state.track_m)
        if self._ended is not None:
            return
        if len(self._laps) >= self.task.laps and now_s >= self._laps[self.task.laps - 1].end_s + RUN_OUT_S:
            self._ended = "laps"
        elif now_s >= self._ends_s:
            self._ended = "time"
        elif aside_m > LEFT_M:
            self._ended = "left"
        elif now_s - self._came_on[0] >= STUCK_S:
            self._ended = "stuck"


def limit_s(task: LoopTask, circuit: Circuit) -> float:
    """Simulated seconds that a driver has for that task."""
    if task.time_limit_s is not None:
        return task.time_limit_s
    return 15.0 + (task.laps + 1) * circuit.centreline.length_m / SLOWEST_MPS


@dataclass(frozen=True, slots=True, kw_only=True)
class _Line:
    """The start line."""

    start_m: PointM
    along_m: PointM
    """From its start to its end."""

    def left_m(self, point_m: PointM) -> float:
        """Distance to the left of the line, which is beyond it; negative before it."""
        return self._offset(point_m)[1]

    def holds(self, point_m: PointM) -> bool:
        """Whether a point on the line's straight lies between its ends."""
        return 0.0 <= self._offset(point_m)[0] <= math.hypot(*self.along_m)

    def _offset(self, point_m: PointM) -> PointM:
        dx, dy = point_m[0] - self.start_m[0], point_m[1] - self.start_m[1]
        ax, ay = self.along_m
        length = math.hypot(ax, ay)
        return (ax * dx + ay * dy) / length, (ax * dy - ay * dx) / length


class _Route:
    """Distances from the centreline."""

    def __init__(self, circuit: Circuit) -> None:
        self._points = edge_line(circuit, 0.0, _ROUTE_STEP_M)

    def aside_m(self, point_m: PointM) -> float:
        """From a point to the centreline, to within a few hundredths of a millimetre where it lies on the lane."""
        offset = self._points - np.asarray(point_m)
        return float(np.sqrt(np.einsum("ij,ij->i", offset, offset).min()))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Lean:
    """What the steering is off by: a trim, and slow play about it, radians."""

    trim_rad: float
    waves: tuple[tuple[float, float, float], ...]
    """(amplitude rad, angular frequency rad/s, phase rad) each."""

    def at(self, t_s: float) -> float:
        """Radians to the left at `t_s`."""
        return self.trim_rad + sum(a * math.sin(w * t_s + p) for a, w, p in self.waves)


def _varied(settings: VehicleSettings, seed: int) -> tuple[VehicleSettings, _Lean]:
    """The vehicle as `seed` built it: no two motors and servos are alike."""
    random = np.random.default_rng([seed, 85])
    motor = float(random.uniform(0.97, 1.03))
    trim = float(random.uniform(-0.02, 0.02))
    waves = tuple(
        (
            float(random.uniform(0.003, 0.009)),
            math.tau * float(random.uniform(0.05, 0.5)),
            float(random.uniform(0.0, math.tau)),
        )
        for _ in range(3)
    )
    return replace(settings, top_speed_mps=settings.top_speed_mps * motor), _Lean(trim_rad=trim, waves=waves)


def _start_state(circuit: Circuit, task: LoopTask) -> VehicleState:
    """The vehicle as it is put down: before the start line, about in the lane's middle, about along it."""
    random = np.random.default_rng([task.seed, 86])
    s = np.array([circuit.start_s_m - float(random.uniform(0.6, 0.9))])
    aside, turn = float(random.uniform(-0.03, 0.03)), float(random.uniform(-0.08, 0.08))
    line = circuit.centreline
    at, ahead = (line.at(s) + aside * line.normal(s))[0], line.tangent(s)[0]
    heading = math.atan2(ahead[1], ahead[0]) + turn + (math.pi if task.wrong_way else 0.0)
    return VehicleState(
        track_m=(float(at[0]), float(at[1])),
        heading_rad=math.remainder(heading, math.tau),
        speed_mps=0.0,
        steering_rad=0.0,
    )
