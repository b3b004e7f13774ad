"""The closed loop's world: a track, things on it and one vehicle that a driver steers by its front camera, on simulated time.

Knows what is really driven, to the instant. Knows no detector and no wall clock: a control made of a picture taken at t takes
hold at t + delay, however long the driver took over it. The same task and the same driver give the same bytes.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from functools import cached_property, lru_cache, partial

import cv2
import numpy as np

from dnb_edge.sim.camera import PinholeCamera
from dnb_edge.sim.circuit import Circuit
from dnb_edge.sim.control import Briefing, Control, Driver, Sight, VehicleState
from dnb_edge.sim.driver import Pose
from dnb_edge.sim.front_camera import OBSTACLE_BGR, FrontCamera, FrontFloor, front_floor
from dnb_edge.sim.light import light_of
from dnb_edge.sim.places import place
from dnb_edge.sim.renderer import Renderer
from dnb_edge.sim.seeded import start_state, varied
from dnb_edge.sim.solids import cylinder, mesh
from dnb_edge.sim.task import LoopTask
from dnb_edge.sim.vehicle import Arc, halved, reach_m, stepped
from dnb_edge.sim.witness import LoopTruth, TrueCollision, Witness
from dnb_edge.values import Frame, StampSource

STEP_NS = 5_000_000
"""The vehicle's step: controls take hold at the first step's beginning that is not before their instant."""
APART_M = 0.03
"""A vehicle must get this far from a thing before it can run into it again."""

_STEP_S = STEP_NS * 1e-9


class World:
    """One task's world. Not safe for use by several threads. Rooms and floors are drawn when a picture is first asked for."""

    def __init__(self, task: LoopTask) -> None:
        self.task = task
        where = place(task.place)
        self.circuit: Circuit = where.circuit
        self.camera: PinholeCamera = where.camera.resized(task.size_px)
        """The overhead camera."""
        self._light = light_of(task.light, task.seed)
        self._vehicle, self._lean = varied(task.vehicle, task.seed)
        self._control = Control(steering=0.0, throttle=0.0)
        self._waiting: deque[tuple[int, Control]] = deque()
        self._step = 0
        """Number of the step that `_arc` is; it begins at `_step` * `STEP_NS`."""
        self._front_index = 0
        self._hit: tuple[int, float] | None = None
        """(obstacle, seconds into the present step) where that step ends against one."""
        self._touching: set[int] = set()
        start = start_state(self.circuit, task)
        self._witness = Witness(task, self.circuit, start.track_m)
        self._arc = self._begin_step(start)

    @property
    def ended(self) -> str | None:
        """Why the drive is over: `laps`, `time`, `left` or `stuck`; None while it goes on."""
        return self._witness.ended

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
            picture = cv2.convertScaleAbs(picture, alpha=gain).astype(np.uint8, copy=False)
        return Frame(
            sequence=index,
            t_ns=t_ns,
            stamp_source=StampSource.SIMULATED,
            width_px=self.camera.width_px,
            height_px=self.camera.height_px,
            bgr=picture,
        )

    def truth(self) -> LoopTruth:
        """What has really happened so far."""
        return self._witness.truth

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
        task = self.task
        floor = _floor(task.place, task.seed)
        return FrontCamera(floor, task.obstacles, seed=task.seed, size_px=task.front_size_px)

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
                hit_s = halved(_STEP_S, partial(self._clear, arc, number))
                self._hit = (number, hit_s)
                return replace(arc, stops_s=hit_s)
        return arc

    def _finish_step(self) -> None:
        """Ends the present step, has what happened in it written down, and begins the next."""
        arc, began_s = self._arc, self._step * _STEP_S
        after = arc.state(_STEP_S)
        self._step += 1
        self._witness.drove(arc, began_s, self._step * _STEP_S)
        if self._hit is not None:
            number, hit_s = self._hit
            speed_mps = arc.speed_mps + arc.acceleration_mps2 * hit_s
            self._witness.ran_into(
                TrueCollision(t_s=began_s + hit_s, obstacle=number, track_m=after.track_m, speed_mps=speed_mps)
            )
            self._touching.add(number)
        self._touching = {number for number in self._touching if self._gap_m(after, number) < APART_M}
        self._arc = self._begin_step(after)

    def _gap_m(self, state: VehicleState, number: int) -> float:
        thing = self.task.obstacles[number]
        return reach_m(self._vehicle, state, thing.track_m) - thing.radius_m

    def _clear(self, arc: Arc, number: int, elapsed_s: float) -> bool:
        return self._gap_m(arc.state(elapsed_s), number) >= 0.0


@lru_cache(maxsize=2)
def _floor(place_name: str, seed: int) -> FrontFloor:
    """Kept, since several drivers drive one task one after the other."""
    return front_floor(place(place_name).circuit, seed)
