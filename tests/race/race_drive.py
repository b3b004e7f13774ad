"""One car driven round a track without pictures: where it is at each instant, exactly or with noise, to what its race says."""

from __future__ import annotations

import math
import random
from collections.abc import Callable

import numpy as np

from dnb_edge.race.car import CarRace, Passed
from dnb_edge.race.crossing import CrossingSettings
from dnb_edge.race.laps import DrivenLap
from dnb_edge.race.rules import LapRules
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.line import line_across
from dnb_edge.track.model import Track
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import Crossing, Incident, Observation, PassStatus, PointM

SCALE = TwinScale(metres_per_px=0.01, height_px=400.0)
Where = Callable[[float], PointM | None]


def ring(radius_m: float = 1.0, *, sectors: int = 0, half_m: float = 0.15, points: int = 400) -> Track:
    """A circle about the origin driven anticlockwise, its start line at angle 0, `sectors` equal sectors."""
    angles = np.linspace(0, 2 * np.pi, points, endpoint=False)
    route = Centreline(
        points_m=radius_m * np.column_stack((np.cos(angles), np.sin(angles))),
        half_left_m=np.full(points, half_m),
        half_right_m=np.full(points, half_m),
    )
    lines = [
        line_across(route, k * route.length_m / sectors, name=f"sector {k}", margin_m=0.05) for k in range(1, sectors)
    ]
    start = line_across(route, 0.0, name="start", margin_m=0.05)
    return Track(name="ring", scale=SCALE, centreline=route, start_line=start, sector_lines=tuple(lines))


def at(angle: float, radius_m: float = 1.0) -> PointM:
    """The point of the ring at an angle."""
    return radius_m * math.cos(angle), radius_m * math.sin(angle)


def drive(
    track: Track,
    where: Where,
    *,
    seconds: float,
    fps: float = 30.0,
    noise_m: float = 0.0,
    rules: LapRules | None = None,
    race: CarRace | None = None,
) -> list[Passed]:
    """Everything that is told of a car at `where(t_s)`, None while it is not seen."""
    chance = random.Random(1)
    race = race or CarRace.begin(track, CrossingSettings(), rules or LapRules())
    told: list[Passed] = []
    for k in range(round(seconds * fps)):
        t_ns = round(k * 1e9 / fps)
        point = where(t_ns * 1e-9)
        fixes = []
        if point is not None:
            seen = (point[0] + chance.gauss(0, noise_m), point[1] + chance.gauss(0, noise_m)) if noise_m else point
            variance = max(noise_m, 0.001) ** 2
            observation = Observation(
                t_ns=t_ns, t_s=t_ns * 1e-9, camera_px=(100 * seen[0], 100 * seen[1]), track_m=seen,
                covariance_m2=(variance, 0.0, variance), confidence=1.0, length_px=20.0,
            )  # fmt: skip
            fixes = race.fixes([observation], target_id=1, t_ns=t_ns, track_m=seen)
        told += race.frame(t_ns, fixes, more_may_come=False)
    return told + race.finish()


def statuses(told: list[Passed]) -> list[PassStatus | None]:
    """Of the crossings, in order."""
    return [one.status for one in told if isinstance(one, Crossing)]


def laps_of(told: list[Passed]) -> list[DrivenLap]:
    """The complete laps, in order."""
    return [one for one in told if isinstance(one, DrivenLap)]


def incidents_of(told: list[Passed]) -> list[Incident]:
    """What happened, in order."""
    return [one for one in told if isinstance(one, Incident)]
