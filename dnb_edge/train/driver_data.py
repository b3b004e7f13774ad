"""What the driving network learns from: pictures of drives in the closed loop's world, with what the expert would have done.

Knows worlds, the expert (pure pursuit, a little slower than by itself), and how a drive is disturbed so that it shows the way
back. Knows no network and no loss. All follows from seeds.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.nut.pursuit import PurePursuit, PursuitStyle
from dnb_edge.sim.circuit import Circuit
from dnb_edge.sim.control import Briefing, Control, Sight, VehicleState
from dnb_edge.sim.light import LightChange
from dnb_edge.sim.places import place
from dnb_edge.sim.task import LoopTask, obstacles_beside
from dnb_edge.sim.world import World
from dnb_edge.train.driver_network import HEIGHT_PX, WIDTH_PX
from dnb_edge.values import BgrImage

EXPERT = PursuitStyle(top_mps=1.15, lateral_mps2=1.5, lookahead_s=0.24, lookahead_m=(0.21, 0.45), clearance_m=0.045)
"""Slower and gentler than by itself: the network sees no obstacle beside it, so it must not hurry back to the middle."""
_PLACES = ("demo", "demo", "demo", "hairpin", "table", "eight")
_OBSTACLE_COUNTS = {"demo": 4, "hairpin": 8, "table": 0, "eight": 4}
LOST_M = 0.30
"""Farther from the centreline than this the expert has nothing to teach."""
LOST_RAD = math.radians(75.0)

Student = Callable[[Sight], Control]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lessons:
    """Pictures with what is right to do on seeing them."""

    pixels: NDArray[np.uint8]
    """(n, 60, 80, 3) red, green, blue."""
    speed: NDArray[np.float32]
    """(n, 1) m/s."""
    wanted: NDArray[np.float32]
    """(n, 2) steering, throttle."""

    def __len__(self) -> int:
        return len(self.pixels)


def joined(parts: list[Lessons]) -> Lessons:
    """All of `parts`, at least one, in their order."""
    return Lessons(
        pixels=np.concatenate([one.pixels for one in parts]),
        speed=np.concatenate([one.speed for one in parts]),
        wanted=np.concatenate([one.wanted for one in parts]),
    )


def to_pixels(bgr: BgrImage) -> NDArray[np.uint8]:
    """(60, 80, 3) red, green, blue of a front picture, made smaller as `dnb_edge.nut.fit` does for any model."""
    small = cv2.resize(bgr, (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_AREA)
    return cv2.cvtColor(small, cv2.COLOR_BGR2RGB).astype(np.uint8, copy=False)


def lesson_task(seed: int) -> LoopTask:
    """The drive that `seed` makes: a place, a delay, in half of them things on the lane, in half light that changes."""
    random = np.random.default_rng([seed, 91])
    where = _PLACES[int(random.integers(len(_PLACES)))]
    count = _OBSTACLE_COUNTS[where] if random.random() < 0.6 else 0
    dim = random.random() < 0.5
    return LoopTask(
        seed=seed,
        laps=50,
        place=where,
        obstacles=obstacles_beside(place(where).circuit, count=count, seed=seed),
        light=LightChange(depth=0.7 * dim, period_s=8.0, step=0.4 * dim, step_period_s=5.0),
        delay_s=float(random.uniform(0.02, 0.18)),
    )


def drive_lessons(task: LoopTask, *, pictures: int, student: Student | None = None, share: float = 0.0) -> Lessons:
    """Lessons of one drive of at most `pictures` pictures, which ends early where the expert has nothing to teach.

    The vehicle is steered by the expert, pushed aside now and then; with a `student`, by it for `share` of the time. What is
    kept is always what the expert wanted.
    """
    world = World(task)
    teacher = _Teacher(world.circuit, np.random.default_rng([task.seed, 92]), student, share)
    teacher.start(world.brief(teacher))
    for index in range(pictures):
        world.drive_until(world.front_t_ns(index), teacher)
        if teacher.lost or world.ended is not None or world.truth().collisions:
            break
    teacher.close()
    return teacher.lessons()


class _Teacher:
    """Drives with one hand, and writes down what the expert would have done."""

    name = "teacher"
    knows_truth = True

    def __init__(self, circuit: Circuit, random: np.random.Generator, student: Student | None, share: float) -> None:
        self.lost = False
        """Whether the vehicle is where the expert has nothing to teach; what is seen there is not kept."""
        self._lane = _Lane(circuit)
        self._expert = PurePursuit(EXPERT)
        self._pushes = _Pushes(random)
        self._turns = _Turns(random, share)
        self._student = student
        self._pixels: list[NDArray[np.uint8]] = []
        self._speed: list[float] = []
        self._wanted: list[tuple[float, float]] = []

    def start(self, briefing: Briefing) -> None:
        self._expert.start(briefing)

    def drive(self, sight: Sight) -> Control:
        right = self._expert.drive(sight)
        self.lost = self.lost or sight.state is None or self._lane.is_left(sight.state)
        if not self.lost:
            self._pixels.append(to_pixels(sight.bgr))
            self._speed.append(sight.speed_mps)
            self._wanted.append((right.steering, right.throttle))
        pushed = self._pushes.pushed(right)
        given = self._student(sight) if self._student is not None and self._turns.student_drives() else pushed
        self._expert.overruled(given)
        return given

    def close(self) -> None:
        self._expert.close()

    def lessons(self) -> Lessons:
        return Lessons(
            pixels=np.array(self._pixels, dtype=np.uint8).reshape(-1, HEIGHT_PX, WIDTH_PX, 3),
            speed=np.array(self._speed, dtype=np.float32).reshape(-1, 1),
            wanted=np.array(self._wanted, dtype=np.float32).reshape(-1, 2),
        )


class _Lane:
    """Whether a vehicle is still on its way along a circuit."""

    def __init__(self, circuit: Circuit) -> None:
        s = np.arange(0.0, circuit.centreline.length_m, 0.02)
        self._points, self._ahead = circuit.centreline.at(s), circuit.centreline.tangent(s)

    def is_left(self, state: VehicleState) -> bool:
        """Where a circuit crosses itself, one of its branches is enough."""
        near = np.linalg.norm(self._points - np.asarray(state.track_m), axis=1) < LOST_M
        along = self._ahead @ np.array([math.cos(state.heading_rad), math.sin(state.heading_rad)])
        return not bool(np.any(near & (along > math.cos(LOST_RAD))))


class _Pushes:
    """Pushes the steering aside for a while, now and then, and lets the throttle vary: the expert then shows the way back."""

    def __init__(self, random: np.random.Generator) -> None:
        self._random = random
        self._left = 0
        self._by = 0.0
        self._pace = 1.0

    def pushed(self, right: Control) -> Control:
        """`right` as the vehicle gets it."""
        if self._left == 0 and self._random.random() < 0.05:
            self._left = int(self._random.integers(3, 15))
            self._by = float(self._random.normal(0.0, 0.45))
            self._pace = float(self._random.uniform(0.6, 1.25))
        elif self._left == 0:
            self._by = 0.0
        self._left = max(0, self._left - 1)
        return Control(steering=_clipped(right.steering + self._by), throttle=_clipped(right.throttle * self._pace))


class _Turns:
    """Who drives, stretch by stretch."""

    def __init__(self, random: np.random.Generator, share: float) -> None:
        self._random = random
        self._share = share
        self._left = 0
        self._student = False

    def student_drives(self) -> bool:
        """Whether the student does, for this picture."""
        if self._left == 0:
            self._left = int(self._random.integers(20, 90))
            self._student = bool(self._random.random() < self._share)
        self._left -= 1
        return self._student


def _clipped(value: float) -> float:
    return min(1.0, max(-1.0, value))
