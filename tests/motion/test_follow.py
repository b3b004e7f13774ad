"""The life of a target: birth on the lane, confirmation by travel, coasting, loss; and the filter beneath."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.motion import kalman
from dnb_edge.motion.appearance import Sighting
from dnb_edge.motion.follow import Follower
from dnb_edge.motion.settings import MotionSettings
from dnb_edge.motion.target import PENDING_KEPT, Followed
from dnb_edge.values import Observation, PointM, TargetState

FRAME_NS = 33_333_333
VARIANCE = (1e-5, 0.0, 1e-5)


def seen(k: int, x_m: float, y_m: float = 0.0, *, on_lane: bool = True) -> Sighting:
    observation = Observation(
        t_ns=k * FRAME_NS,
        t_s=k * FRAME_NS * 1e-9,
        camera_px=(x_m * 200, y_m * 200),
        track_m=(x_m, y_m),
        covariance_m2=VARIANCE,
        confidence=0.9,
        length_px=40.0,
    )
    return Sighting(observation=observation, on_lane=on_lane, length_m=0.2)


def follow(
    frames: dict[int, list[PointM]], last: int, settings: MotionSettings | None = None, *, on_lane: bool = True
) -> tuple[Follower, list[tuple[Followed, ...]]]:
    follower = Follower(settings or MotionSettings())
    history = []
    for k in range(last + 1):
        sightings = [seen(k, *point, on_lane=on_lane) for point in frames.get(k, [])]
        history.append(follower.step(k * FRAME_NS, sightings))
    return follower, history


def moving(first: int, last: int, speed_mps: float = 1.0, y_m: float = 0.0) -> dict[int, list[PointM]]:
    return {k: [(speed_mps * k * FRAME_NS * 1e-9, y_m)] for k in range(first, last + 1)}


def states(history: list[tuple[Followed, ...]]) -> list[str]:
    return ["".join(target.state.value[0] for target in targets) for targets in history]


def test_a_moving_car_is_confirmed_after_four_observations_and_some_travel() -> None:
    """Tentative until it has been seen four times and has moved 80 mm, confirmed then."""
    _, history = follow(moving(0, 5), 5)
    assert states(history) == ["t", "t", "t", "c", "c", "c"]


def test_what_trembles_on_the_spot_is_never_confirmed() -> None:
    """A chair's castor that is detected in every frame with 10 mm of jitter stays tentative."""
    random = np.random.default_rng(0)
    still = {k: [(1 + random.normal(0, 0.01), 1 + random.normal(0, 0.01))] for k in range(300)}
    _, history = follow(still, 299)
    assert {target.state for targets in history for target in targets} <= {TargetState.TENTATIVE, TargetState.LOST}


def test_a_car_that_waits_for_hours_costs_no_more_than_one_that_waits_for_seconds() -> None:
    """What is kept of a parked car is bounded; when it sets off it is confirmed all the same."""
    follower = Follower(MotionSettings())
    for k in range(2000):
        follower.step(k * FRAME_NS, [seen(k, 2.0 * (max(0, k - 1980) * FRAME_NS * 1e-9) ** 2)])
    (target,) = follower.followed
    assert target.state is TargetState.CONFIRMED
    assert target.observations == 2000
    follower = Follower(MotionSettings())
    for k in range(2000):
        follower.step(k * FRAME_NS, [seen(k, 0.0)])
    assert len(follower.followed[0].pending) == PENDING_KEPT


def test_nothing_is_born_beside_the_lane() -> None:
    """Observations off the lane start no target."""
    follower, _ = follow(moving(0, 10), 10, on_lane=False)
    assert follower.followed == ()


def test_an_unseen_car_coasts_and_is_taken_up_again_with_its_identity() -> None:
    """Ten frames of occlusion keep the target; it is confirmed again when seen."""
    frames = moving(0, 10) | moving(21, 25)
    _, history = follow(frames, 25)
    assert [targets[0].state for targets in history[11:21]] == [TargetState.COASTING] * 10
    assert history[25][0].state is TargetState.CONFIRMED
    assert {target.target_id for targets in history for target in targets} == {1}


def test_a_car_unseen_for_too_long_is_lost_once() -> None:
    """After the limit the target is reported lost a single time and then gone."""
    follower, history = follow(moving(0, 10), 60)
    assert sum(target.state is TargetState.LOST for targets in history for target in targets) == 1
    assert follower.followed == ()


def test_only_one_car_is_confirmed() -> None:
    """While a car is followed, the second thing that moves stays tentative."""
    both = {k: moving(k, k)[k] + moving(k, k, 0.9, 1.0)[k] for k in range(20)}
    _, history = follow(both, 19)
    assert sorted(target.state for target in history[-1]) == [TargetState.CONFIRMED, TargetState.TENTATIVE]


def test_two_detections_of_the_same_car_are_one_target() -> None:
    """A second detection within a car's length of the followed car starts no target."""
    frames = moving(0, 9) | {k: [moving(k, k)[k][0], (moving(k, k)[k][0][0] + 0.1, 0.0)] for k in range(10, 20)}
    _, history = follow(frames, 19)
    assert [len(targets) for targets in history] == [1] * 20


def test_a_target_that_strays_from_the_lane_is_given_up() -> None:
    """Somebody who walks away over the lane is not followed through the room."""
    follower = Follower(MotionSettings())
    for k in range(120):
        follower.step(k * FRAME_NS, [seen(k, k / 30, on_lane=k < 20)])
    assert follower.followed == ()


@pytest.mark.parametrize(
    ("lengths_m", "cars", "followed"),
    [
        ((0.2, 0.2), 2, 2),
        ((0.2, 0.09), 2, 2),
        ((0.2, 0.07), 2, 1),
        ((0.2, 0.45), 2, 2),
        ((0.2, 0.55), 2, 1),
        ((0.08, 0.035), 2, 1),
        ((0.6, 1.1), 2, 1),
        ((0.01,), 2, 1),
        ((3.0,), 1, 1),
    ],
)
def test_the_cars_of_a_race_are_of_like_size(lengths_m: tuple[float, ...], cars: int, followed: int) -> None:
    """What moves beside a followed car is a second one only where it is about as long; a first one may have any length."""
    follower = Follower(MotionSettings(cars=cars))
    for k in range(40):
        sightings = [
            replace(seen(k, (1.0 - 0.1 * i) * k / 30, float(i)), length_m=length_m)
            for i, length_m in enumerate(lengths_m)
        ]
        follower.step(k * FRAME_NS, sightings)
    assert sum(target.state is TargetState.CONFIRMED for target in follower.followed) == followed


def test_a_box_round_more_than_it_does_not_confirm_what_stands_still() -> None:
    """Beside a followed car, one box four times as long and a hand's breadth off makes no second car of a chair."""
    follower = Follower(MotionSettings(cars=2))
    for k in range(60):
        chair = seen(k, 1.0, 1.0)
        if k == 30:
            wide = replace(chair.observation, length_px=160.0, track_m=(1.1, 1.0), covariance_m2=(1e-3, 0.0, 1e-3))
            chair = replace(chair, observation=wide, length_m=0.8)
        follower.step(k * FRAME_NS, [seen(k, k / 30), chair])
        states = [target.state for target in follower.followed]
        assert states.count(TargetState.CONFIRMED) == (k >= 3)


@given(speed=st.floats(-3, 3), heading=st.floats(0, 6.28), step_ms=st.integers(5, 100))
def test_the_filter_converges_on_constant_velocity_at_any_frame_rate(
    speed: float, heading: float, step_ms: int
) -> None:
    """Noiseless uniform motion is learnt: position and velocity become exact, whatever the time step."""
    vx, vy = speed * math.cos(heading), speed * math.sin(heading)
    estimate = kalman.begin(0, (0.0, 0.0), VARIANCE, 2.0)
    for k in range(1, 40):
        t_s = k * step_ms * 1e-3
        estimate = kalman.predict(estimate, k * step_ms * 1_000_000, 0.5)
        estimate = kalman.update(estimate, (vx * t_s, vy * t_s), VARIANCE)
    assert estimate.velocity_mps == pytest.approx((vx, vy), abs=0.02)
    xx, xy, yy = estimate.velocity_covariance_m2ps2
    assert xy**2 < xx * yy


def test_time_does_not_run_backwards() -> None:
    """A prediction into the past is refused."""
    with pytest.raises(ValueError, match="back"):
        kalman.predict(kalman.begin(10, (0.0, 0.0), VARIANCE, 1.0), 5, 1.0)
