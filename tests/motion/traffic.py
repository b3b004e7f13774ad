"""Simulated traffic for the follower: cars with looks on a round or straight lane, and what a detector says of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from dnb_edge.motion.appearance import Colour, Sighting
from dnb_edge.motion.follow import Follower
from dnb_edge.values import Observation, PointM, TargetState

FPS = 30.0
LENGTH_M = 0.2
PX_PER_M = 200.0

RED: Colour = (40.0, 40.0, 190.0)
BLUE: Colour = (180.0, 70.0, 40.0)
GREEN: Colour = (60.0, 160.0, 60.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Car:
    """A simulated car: where it is at `t_s`, track m, and how it looks."""

    at: Callable[[float], PointM]
    colour: Colour | None = None
    marker_id: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectorNoise:
    """What is wrong with a simulated detector."""

    sigma_m: float = 0.005
    missed: float = 0.04
    """Share of cars that are not found in a frame."""
    colour_sigma: float = 15.0
    marker_read: float = 0.5
    """Share of sightings in which a marker is read."""
    merge_m: float = 0.1
    """Cars nearer than this are one detection: in the middle of them, or on one of them, either way in half of the passes."""


def sightings(
    cars: Sequence[Car], t_s: float, noise: DetectorNoise, random: np.random.Generator, *, in_the_middle: bool
) -> list[Sighting]:
    """What the detector says of the cars at `t_s`, in random order."""
    found: list[Sighting] = []
    for group in _together([car.at(t_s) for car in cars], noise.merge_m):
        if random.random() < noise.missed:
            continue
        chosen = group if in_the_middle else [group[int(random.integers(len(group)))]]
        places = np.array([cars[i].at(t_s) for i in chosen])
        colours = [cars[i].colour for i in chosen]
        seen_colours = [colour for colour in colours if colour is not None]
        blend = np.mean(seen_colours, axis=0) + random.normal(0, noise.colour_sigma, 3) if seen_colours else None
        marker_id = cars[chosen[0]].marker_id if len(chosen) == 1 and random.random() < noise.marker_read else None
        x, y = places.mean(axis=0) + random.normal(0, noise.sigma_m, 2)
        found.append(sighting(t_s, (float(x), float(y)), noise.sigma_m, colour=blend, marker_id=marker_id))
    order = random.permutation(len(found))
    return [found[int(i)] for i in order]


def sighting(
    t_s: float, at_m: PointM, sigma_m: float, *, colour: np.ndarray | None = None, marker_id: int | None = None
) -> Sighting:
    """One sighting of a car at `at_m`, track m."""
    observation = Observation(
        t_ns=round(t_s * 1e9),
        t_s=t_s,
        camera_px=(at_m[0] * PX_PER_M, at_m[1] * PX_PER_M),
        track_m=at_m,
        covariance_m2=(sigma_m**2, 0.0, sigma_m**2),
        confidence=0.9,
        length_px=LENGTH_M * PX_PER_M,
    )
    bgr = None if colour is None else (float(colour[0]), float(colour[1]), float(colour[2]))
    return Sighting(observation=observation, on_lane=True, length_m=LENGTH_M, colour_bgr=bgr, marker_id=marker_id)


def _together(points: Sequence[PointM], merge_m: float) -> list[list[int]]:
    """Indices of the points, those within `merge_m` of one another in one list."""
    groups: list[list[int]] = []
    for i, point in enumerate(points):
        near = [group for group in groups if any(math.dist(point, points[k]) < merge_m for k in group)]
        groups = [group for group in groups if group not in near] + [[i, *(k for group in near for k in group)]]
    return groups


def drive(
    follower: Follower, cars: Sequence[Car], *, start_s: float, end_s: float, noise: DetectorNoise, seed: int
) -> None:
    """Feeds the follower what the detector says of the cars from `start_s` to `end_s`."""
    random = np.random.default_rng(seed)
    in_the_middle = bool(random.random() < 0.5)
    for k in range(round(start_s * FPS), round(end_s * FPS)):
        t_s = k / FPS
        follower.step(round(t_s * 1e9), sightings(cars, t_s, noise, random, in_the_middle=in_the_middle))


def who_is_where(follower: Follower, cars: Sequence[Car], t_s: float) -> list[int | None]:
    """For each car the number of the confirmed target on it; None where none is within half a car's length."""
    confirmed = [target for target in follower.followed if target.state is TargetState.CONFIRMED]
    numbers: list[int | None] = []
    for car in cars:
        on_it = [t for t in confirmed if math.dist(t.estimate.track_m, car.at(t_s)) < LENGTH_M / 2]
        numbers.append(on_it[0].target_id if len(on_it) == 1 else None)
    return numbers
