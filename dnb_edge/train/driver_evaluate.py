"""How well a driver does in the closed loop's world by the world's own truth, over seeds that teach nobody.

Knows worlds and their truth; nothing of the appliance that times a drive (that is `dnb-edge nut drive`) and of networks.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass

from dnb_edge.sim.control import Briefing, Control, Driver, Sight
from dnb_edge.sim.task import LoopTask
from dnb_edge.sim.world import World


@dataclass(frozen=True, slots=True, kw_only=True)
class Driven:
    """What one drive came to."""

    seed: int
    laps_wanted: int
    lap_times_s: tuple[float, ...]
    collisions: int
    off_lane_s: float
    ended: str
    """As `LoopTruth.ended`."""
    answer_ms: float
    """Mean time on this machine's clock from a picture to its control."""


class _Timed:
    """A driver on a stopwatch."""

    def __init__(self, driver: Driver) -> None:
        self.name = driver.name
        self.knows_truth = driver.knows_truth
        self._driver = driver
        self._spent_s = 0.0
        self._answers = 0

    def start(self, briefing: Briefing) -> None:
        self._driver.start(briefing)

    def drive(self, sight: Sight) -> Control:
        began = time.perf_counter()
        control = self._driver.drive(sight)
        self._spent_s += time.perf_counter() - began
        self._answers += 1
        return control

    def close(self) -> None:
        self._driver.close()

    @property
    def answer_ms(self) -> float:
        return 1e3 * self._spent_s / max(1, self._answers)


def driven(task: LoopTask, driver: Driver) -> Driven:
    """One whole drive of `task`. Raises `DriverFailed`."""
    world, timed = World(task), _Timed(driver)
    timed.start(world.brief(timed))
    index = 0
    while world.ended is None:
        world.drive_until(world.front_t_ns(index), timed)
        index += 1
    timed.close()
    truth = world.truth()
    return Driven(
        seed=task.seed,
        laps_wanted=task.laps,
        lap_times_s=tuple(lap.time_s for lap in truth.laps[: task.laps]),
        collisions=len(truth.collisions),
        off_lane_s=truth.off_lane_s,
        ended=world.ended,
        answer_ms=timed.answer_ms,
    )


def figures(drives: Iterable[Driven]) -> dict[str, float]:
    """What several drives, at least one, came to together."""
    drives = list(drives)
    times = [time_s for one in drives for time_s in one.lap_times_s]
    wanted = sum(one.laps_wanted for one in drives)
    return {
        "drives": len(drives),
        "laps_wanted": wanted,
        "laps_driven": len(times),
        "laps_percent": round(100.0 * len(times) / wanted, 1),
        "drives_completed": sum(len(one.lap_times_s) == one.laps_wanted for one in drives),
        "collisions": sum(one.collisions for one in drives),
        "off_lane_s": round(sum(one.off_lane_s for one in drives), 2),
        "lap_time_mean_s": round(sum(times) / max(1, len(times)), 3),
    }
