"""Laps of the demo track as the race hands them over, seen by a camera of any rate, with noise and drops; for the tests."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np

from dnb_edge.race.fix import Fix, Progress
from dnb_edge.race.laps import DrivenLap
from dnb_edge.sim.circuit import TWIN_SCALE, demo_circuit
from dnb_edge.sim.driver import Drive, drive
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.line import DirectedLine
from dnb_edge.track.model import START_LINE, Track
from dnb_edge.values import Crossing, Direction, Lap, Observation, Points


@cache
def demo_track(points: int = 740) -> Track:
    """The demo track by its own geometry, without its picture."""
    circuit = demo_circuit()
    s_m = circuit.start_s_m + np.arange(points, dtype=np.float64) * (circuit.centreline.length_m / points)
    half = np.full(points, circuit.lane_width_m / 2)
    start_m, end_m = circuit.start_line_m
    return Track(
        name="demo",
        scale=TWIN_SCALE,
        centreline=Centreline(points_m=circuit.centreline.at(s_m), half_left_m=half, half_right_m=half),
        start_line=DirectedLine(name=START_LINE, start_m=start_m, end_m=end_m),
    )


@cache
def demo_drive(seed: int, laps: int = 2) -> Drive:
    return drive(demo_circuit(), laps=laps, seed=seed)


@dataclass(frozen=True, slots=True, kw_only=True)
class Camera:
    """How a drive is seen."""

    fps: float = 30.0
    noise_m: float = 0.0
    drops: float = 0.0
    """Share of the frames in which the car is not seen."""
    phase: float = 0.37
    """Share of a frame from the drive's beginning to the first frame."""
    seed: int = 1


def seen(driven: Drive, camera: Camera) -> tuple[np.ndarray, Points]:
    """(t_s (n,), observed points (n, 2)) of the frames in which the car is seen."""
    random = np.random.default_rng(camera.seed)
    t_s = (np.arange(int(driven.duration_s * camera.fps), dtype=np.float64) + camera.phase) / camera.fps
    t_s = t_s[random.random(len(t_s)) >= camera.drops]
    return t_s, driven.points(t_s) + random.normal(0.0, camera.noise_m, (len(t_s), 2))


def fixes_at(t_s: np.ndarray, points: Points, track: Track | None = None) -> list[Fix]:
    """The fixes of a car seen at `points` (n, 2), track m, at `t_s` (n,)."""
    progress = Progress((track or demo_track()).centreline)
    fixes = []
    for t, (x, y) in zip(t_s.tolist(), points.tolist(), strict=True):
        observation = Observation(
            t_ns=round(t * 1e9), t_s=t, camera_px=(0.0, 0.0), track_m=(x, y), covariance_m2=(1e-6, 0.0, 1e-6),
            confidence=1.0, length_px=30.0,
        )  # fmt: skip
        fixes.append(progress.fix(observation, target_id=1, track_m=(x, y)))
    return fixes


def crossing(t_s: float, track_m: tuple[float, float], line: str = START_LINE) -> Crossing:
    return Crossing(
        t_ns=round(t_s * 1e9),
        t_s=t_s,
        line=line,
        direction=Direction.FORWARD,
        sigma_s=0.001,
        track_m=track_m,
        target_id=1,
        estimated=False,
    )


def lap_of(fixes: list[Fix], start: Crossing, end: Crossing, *, number: int = 1, valid: bool = True) -> DrivenLap:
    """The lap between two crossings."""
    inside = tuple(fix for fix in fixes if start.t_ns < fix.t_ns <= end.t_ns)
    lap = Lap(
        number=number, start_t_ns=start.t_ns, end_t_ns=end.t_ns, start_s=start.t_s, time_s=(end.t_ns - start.t_ns) * 1e-9,
        sigma_s=0.001, valid=valid, reasons=(), similarity_percent=None, observed_fraction=1.0,
    )  # fmt: skip
    path_m = (start.track_m, *(fix.observed_m for fix in inside), end.track_m)
    return DrivenLap(lap=lap, path_m=path_m, fixes=inside)


def demo_laps(driven: Drive, camera: Camera) -> Iterator[DrivenLap]:
    """The drive's laps as the camera sees them; crossings are exact."""
    fixes = fixes_at(*seen(driven, camera))
    places = [(float(x), float(y)) for x, y in driven.points(np.array(driven.crossings_s))]
    crossings = [crossing(t_s, at) for t_s, at in zip(driven.crossings_s, places, strict=True)]
    for number, (start, end) in enumerate(pairwise(crossings), start=1):
        yield lap_of(fixes, start, end, number=number)
