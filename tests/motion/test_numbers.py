"""Numbers on the roofs: what bears one car's number is never taken for another car."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from traffic import FPS, sighting

from dnb_edge.motion.follow import Follower
from dnb_edge.motion.settings import MotionSettings
from dnb_edge.motion.target import Followed
from dnb_edge.values import PointM, TargetState

SIGMA_M = 0.003
Scene = Callable[[float], dict[int, PointM]]


def follow(scene: Scene, *, seconds: float, cars: int = 2) -> list[tuple[Followed, ...]]:
    """The targets frame by frame, of marked cars that are at `scene(t_s)`, track m by number."""
    follower = Follower(MotionSettings(cars=cars))
    history = []
    for k in range(round(seconds * FPS)):
        found = [sighting(k / FPS, at_m, SIGMA_M, marker_id=number) for number, at_m in scene(k / FPS).items()]
        history.append(follower.step(round(k / FPS * 1e9), found))
    return history


def names(history: list[tuple[Followed, ...]], y_m: float) -> set[int]:
    """Numbers of the confirmed targets that were seen in a frame on the lane at `y_m`."""
    return {
        target.target_id
        for targets in history
        for target in targets
        if target.state is TargetState.CONFIRMED and abs(target.last.track_m[1] - y_m) < 0.1
    }


def test_a_marked_car_never_takes_the_place_of_one_that_is_lost() -> None:
    """Car 1 is lost; car 2 jumps a metre, out of its gate, while a place is free: it is car 2 again, within three frames."""

    def scene(t: float) -> dict[int, PointM]:
        jump = 1.0 if t >= 2.0 else 0.0
        return {2: (t + jump, 1.0)} | ({1: (t, 0.0)} if t < 1.0 else {})

    history = follow(scene, seconds=3.0)
    before, after = names(history[:59], 1.0), names(history[60:], 1.0)
    assert len(before) == 1
    assert after == before
    (found,) = (target for target in history[62] if target.state is TargetState.CONFIRMED)
    assert found.last.track_m == pytest.approx((62 / FPS + 1.0, 1.0))


def test_a_lost_car_is_its_own_number_again_wherever_it_comes_back() -> None:
    """Both cars are lost and come back where the other one was: each has its name by its number."""

    def scene(t: float) -> dict[int, PointM]:
        if 1.0 <= t < 2.5:
            return {}
        return {1: (t, 0.0), 2: (t, 1.0)} if t < 2.0 else {1: (t, 1.0), 2: (t, 0.0)}

    history = follow(scene, seconds=3.5)
    assert names(history[80:], 1.0) == names(history[:30], 0.0)
    assert names(history[80:], 0.0) == names(history[:30], 1.0)


def test_a_strangers_number_is_no_car_of_this_race() -> None:
    """Where both cars' numbers are known and one is lost, what bears a third number is never confirmed."""

    def scene(t: float) -> dict[int, PointM]:
        other = {1: (t, 0.0)} if t < 1.0 else {3: (t, 2.0)}
        return {2: (t, 1.0)} | other

    assert names(follow(scene, seconds=4.0), 2.0) == set()


@pytest.mark.parametrize(("number", "kept"), [(1, True), (None, False)])
def test_an_agreeing_number_widens_the_gate(number: int | None, kept: bool) -> None:
    """A jerk of six standard deviations is believed of what bears the car's own number, and of nothing else."""
    follower = Follower(MotionSettings())
    for k in range(30):
        follower.step(round(k / FPS * 1e9), [sighting(k / FPS, (k / FPS, 0.0), SIGMA_M, marker_id=1)])
    (car,) = follower.followed
    sigma_m = math.hypot(SIGMA_M, 2.0 * SIGMA_M)
    found = sighting(1.0, (1.0, 6.0 * sigma_m), SIGMA_M, marker_id=number)
    after = follower.step(round(1e9), [found])
    assert (after[0].state is TargetState.CONFIRMED and after[0].last.track_m == found.observation.track_m) == kept
    assert after[0].target_id == car.target_id
