"""Who is who after two cars have met: no swap that markers or colours can tell, and motion alone where they cannot."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from traffic import BLUE, FPS, GREEN, RED, Car, DetectorNoise, sighting, sightings, who_is_where

from dnb_edge.motion.appearance import UNKNOWN, Colour, evidence
from dnb_edge.motion.follow import Follower
from dnb_edge.motion.settings import MotionSettings
from dnb_edge.values import PointM, TargetState

Way = Callable[[float], PointM]
MEET_S = 3.0
"""The moment, in simulated seconds, about which the cars of every scene meet."""

SEEDS = 5
LOOKS: dict[str, tuple[tuple[Colour | None, int | None], tuple[Colour | None, int | None]]] = {
    "colours": ((RED, None), (BLUE, None)),
    "markers": ((None, 3), (None, 7)),
    "alike": ((GREEN, None), (GREEN, None)),
}


def crossing_paths(random: np.random.Generator) -> tuple[Way, Way]:
    angle = random.uniform(0.4, 1.6)
    return (
        lambda t: (t - MEET_S, 0.0),
        lambda t: ((t - MEET_S) * math.cos(angle), (t - MEET_S) * math.sin(angle)),
    )


def overtaking(random: np.random.Generator) -> tuple[Way, Way]:
    faster, beside = random.uniform(0.3, 0.6), random.uniform(0.06, 0.14)
    return lambda t: (t, 0.0), lambda t: (t + faster * (t - MEET_S), beside)


def merging(random: np.random.Generator) -> tuple[Way, Way]:
    """Together for 0.3 to 0.7 s on one line, then apart, each to a side that says nothing of where it came from."""
    together, side, speed, gap = (
        random.uniform(0.3, 0.7),
        random.choice([-1, 1]),
        random.uniform(0.5, 1.2),
        random.uniform(0.0, 0.03),
    )

    def aside(t: float, before: float, after: float) -> float:
        if t < MEET_S:
            return before * min(0.4, (MEET_S - t) * 0.6)
        return after * min(0.4, max(0.0, t - MEET_S - together) * 0.6)

    return lambda t: (speed * t, aside(t, 1, side)), lambda t: (speed * t + gap, aside(t, -1, -side))


def bumping(random: np.random.Generator) -> tuple[Way, Way]:
    """One runs up to the other, which has almost stopped; both go on in the same order."""
    slow = random.uniform(0.05, 0.15)

    def first(t: float) -> float:
        return 0.5 * min(t, MEET_S) + slow * min(max(t - MEET_S, 0), 0.6) + 0.6 * max(t - MEET_S - 0.6, 0)

    return lambda t: (first(t), 0.0), lambda t: (first(t) - 0.08 - 0.15 * abs(t - MEET_S - 0.3), 0.02)


def outcome(
    scene: Callable[[np.random.Generator], tuple[Way, Way]], looks: str, seed: int, noise: DetectorNoise | None = None
) -> str:
    """`kept`, `swapped` or `lost` after one noisy pass."""
    random = np.random.default_rng(seed)
    ways = scene(random)
    cars = [Car(at=way, colour=c, marker_id=m) for way, (c, m) in zip(ways, LOOKS[looks], strict=True)]
    follower = Follower(MotionSettings(cars=2))
    before: list[int | None] = [None, None]
    after: list[int | None] = [None, None]
    for k in range(round(1.2 * FPS), round(5.4 * FPS)):
        t_s = k / FPS
        follower.step(
            round(t_s * 1e9), sightings(cars, t_s, noise or DetectorNoise(), random, in_the_middle=seed % 2 == 0)
        )
        numbers = who_is_where(follower, cars, t_s)
        if None not in numbers and t_s < MEET_S - 0.6:
            before = numbers
        if None not in numbers and t_s > 5.0:
            after = numbers
    if None in before or None in after or set(before) != set(after):
        return "lost"
    return "kept" if before == after else "swapped"


@pytest.mark.parametrize("looks", ["colours", "markers"])
@pytest.mark.parametrize("scene", [crossing_paths, overtaking, merging, bumping])
def test_cars_that_can_be_told_apart_keep_their_names(
    scene: Callable[[np.random.Generator], tuple[Way, Way]], looks: str
) -> None:
    """With noise, missed frames and one detection for both while they are near, no pass ends with names exchanged."""
    assert Counter(outcome(scene, looks, seed) for seed in range(SEEDS)) == {"kept": SEEDS}


def test_colours_that_are_told_late_correct_what_motion_guessed() -> None:
    """While they part no colour is told, so motion names the cars; once there are colours, these have the last word."""
    results: Counter[str] = Counter()
    for seed in range(2 * SEEDS):
        random = np.random.default_rng(seed)
        cars = [Car(at=way, colour=colour) for way, colour in zip(merging(random), (RED, BLUE), strict=True)]
        follower = Follower(MotionSettings(cars=2))
        before, after = None, None
        for k in range(round(1.2 * FPS), round(5.0 * FPS)):
            t_s = k / FPS
            seen = sightings(cars, t_s, DetectorNoise(), random, in_the_middle=True)
            if MEET_S - 0.2 < t_s < MEET_S + 1.2:
                seen = [replace(one, colour_bgr=None) for one in seen]
            follower.step(round(t_s * 1e9), seen)
            numbers = who_is_where(follower, cars, t_s)
            if None not in numbers:
                before, after = (numbers, after) if t_s < MEET_S - 0.6 else (before, numbers)
        results["kept" if before == after else "exchanged"] += 1
    assert results == {"kept": 2 * SEEDS}


def test_cars_that_share_a_detection_are_both_followed() -> None:
    """For half a second there is one detection for two cars: neither is given up, and what is told says how vague it is."""
    follower = Follower(MotionSettings(cars=2))
    for k in range(45):
        t_s = k / FPS
        beside = 0.3 * max(0.0, 1.0 - t_s)
        places = [(t_s, beside), (t_s, -beside)] if beside > 0.05 else [(t_s, 0.0)]
        colours = [np.array(RED), np.array(BLUE)] if len(places) == 2 else [None]
        follower.step(
            round(t_s * 1e9), [sighting(t_s, at, 0.005, colour=c) for at, c in zip(places, colours, strict=True)]
        )
        if t_s > 0.5:
            assert [target.state for target in follower.followed] == [TargetState.CONFIRMED] * 2
    for target in follower.followed:
        assert target.held
        assert math.sqrt(target.last.covariance_m2[0]) >= 0.5 * 0.2
        assert math.dist(target.estimate.track_m, (44 / FPS, 0.0)) < 0.2


def test_a_marker_that_is_seldom_read_corrects_what_motion_guessed() -> None:
    """Read in one frame of seven, a marker seldom helps in the frame in which the cars part: doubt lasts until it is read."""
    rarely = DetectorNoise(marker_read=0.15)
    results = Counter(outcome(merging, "markers", seed, rarely) for seed in range(SEEDS))
    assert results == {"kept": SEEDS}


@pytest.mark.parametrize("scene", [crossing_paths, overtaking])
def test_cars_that_look_alike_keep_their_names_where_their_motion_tells(
    scene: Callable[[np.random.Generator], tuple[Way, Way]],
) -> None:
    """Without looks to go by, steady motion through the pass decides, and it is mostly right."""
    results = Counter(outcome(scene, "alike", seed) for seed in range(SEEDS))
    assert results["lost"] == 0
    assert results["kept"] >= SEEDS - 1


def test_a_single_car_is_never_judged_by_its_looks() -> None:
    """What could only tell cars apart costs nothing where there is one: its light may change as it likes."""
    car = UNKNOWN
    for k in range(5):
        car = car.after(sighting(k / FPS, (0.0, 0.0), 0.005, colour=np.array(RED)))
    assert evidence([car], [(1.0, 0.0)], sighting(1.0, (0.0, 0.0), 0.005, colour=np.array(BLUE))) == [0.0]


def test_a_number_is_believed_once_it_was_read_twice() -> None:
    """One misreading gives a car no number and takes none from it."""
    car = UNKNOWN.after(sighting(0.0, (0.0, 0.0), 0.005, marker_id=4))
    assert car.marker is None
    for _ in range(4):
        car = car.after(sighting(0.0, (0.0, 0.0), 0.005, marker_id=4))
    assert car.after(sighting(0.0, (0.0, 0.0), 0.005, marker_id=9)).marker == 4
