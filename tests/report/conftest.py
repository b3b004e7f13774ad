"""A made-up run on an oval track, for the report's tests."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from dnb_edge.report.run import RunResult
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.line import line_across
from dnb_edge.track.model import START_LINE, Track
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import Crossing, Direction, Event, Lap, Observation, RunSummary, Score

LAP_TIMES_S = (12.4831, 12.1022, 13.0105)
FPS = 30


def oval_track() -> Track:
    """Two straights of 2 m joined by half circles of 0.8 m radius, lane 0.4 m wide, 2.5 mm a pixel."""
    turn = np.linspace(-np.pi / 2, np.pi / 2, 60)
    right = np.column_stack((3.2 + 0.8 * np.cos(turn), 1.2 + 0.8 * np.sin(turn)))
    left = np.column_stack((1.2 - 0.8 * np.cos(turn), 1.2 - 0.8 * np.sin(turn)))
    bottom = np.column_stack((np.linspace(1.3, 3.1, 40), np.full(40, 0.4)))
    top = np.column_stack((np.linspace(3.1, 1.3, 40), np.full(40, 2.0)))
    points = np.concatenate((bottom, right, top, left))
    widths = np.full(len(points), 0.2)
    centreline = Centreline(points_m=points, half_left_m=widths, half_right_m=widths)
    return Track(
        name="oval",
        scale=TwinScale(metres_per_px=0.0025, height_px=960),
        centreline=centreline,
        start_line=line_across(centreline, 0.0, name=START_LINE, margin_m=0.03),
    )


def drive(track: Track, *, lap_times_s: tuple[float, ...] = LAP_TIMES_S, valid: tuple[bool, ...] = ()) -> list[Event]:
    """Everything that a run over `lap_times_s` says; each lap drifts from the centreline in its own way."""
    route = track.centreline
    events: list[Event] = []
    start_ns = 1_000_000_000
    events.append(_crossing(track, start_ns))
    for index, time_s in enumerate(lap_times_s):
        number, end_ns = index + 1, start_ns + round(time_s * 1e9)
        for frame in range(1, int(time_s * FPS)):
            share = frame / (time_s * FPS)
            drift_m = 0.03 * (index + 1) * np.sin(2 * np.pi * (2 + index) * share)
            events.append(
                _observation(start_ns + round(frame / FPS * 1e9), route.point_at(share * route.length_m, drift_m))
            )
        events.append(_crossing(track, end_ns))
        ok = valid[index] if valid else True
        similarity = 97.5 - 2.25 * index
        lap = Lap(
            number=number,
            start_t_ns=start_ns,
            end_t_ns=end_ns,
            start_s=(start_ns - 1_000_000_000) * 1e-9,
            time_s=time_s,
            sigma_s=0.0021 + 0.001 * index,
            valid=ok,
            reasons=() if ok else ("the car left the lane by 0.12 m",),
            similarity_percent=similarity,
            observed_fraction=0.997,
        )
        events += [lap, _score(lap, similarity, route.length_m)]
        start_ns = end_ns
    events.append(RunSummary(frames=1200, detected_frames=1188, laps=len(lap_times_s), recording="oval.mcap"))
    return events


@pytest.fixture
def oval() -> Track:
    """The oval."""
    return oval_track()


@pytest.fixture
def drive_oval(oval: Track) -> Callable[..., list[Event]]:
    """Everything that a run on the oval says; keywords are those of `drive`."""
    return partial(drive, oval)


@pytest.fixture
def result(oval: Track) -> Callable[..., RunResult]:
    """Makes the result of a run on the oval; keywords are fields of `RunResult` or of `drive`."""

    def make(**facts: Any) -> RunResult:
        driven = {name: facts.pop(name) for name in ("lap_times_s", "valid") if name in facts}
        named: dict[str, Any] = {"entry": "Blue car", "source_uri": "sim:", "track": oval} | facts
        return RunResult.from_events(drive(oval, **driven), **named)

    return make


def _crossing(track: Track, t_ns: int) -> Crossing:
    return Crossing(
        t_ns=t_ns,
        t_s=t_ns * 1e-9 - 1,
        line=START_LINE,
        direction=Direction.FORWARD,
        sigma_s=0.0015,
        track_m=track.centreline.point_at(0.0),
        target_id=1,
        estimated=False,
    )


def _observation(t_ns: int, track_m: tuple[float, float], target_id: int | None = 1) -> Observation:
    return Observation(
        t_ns=t_ns,
        t_s=t_ns * 1e-9 - 1,
        camera_px=(0.0, 0.0),
        track_m=track_m,
        covariance_m2=(1e-6, 0.0, 1e-6),
        confidence=0.9,
        length_px=60.0,
        target_id=target_id,
    )


def _score(lap: Lap, similarity_percent: float, length_m: float) -> Score:
    return Score(
        lap=lap.number,
        metric="dtw",
        similarity_percent=similarity_percent,
        dtw_mean_m=0.021,
        frechet_m=0.064,
        clamp_m=None,
        baseline_m=1.0,
        completion_time_s=lap.time_s,
        lateral_mean_m=0.019,
        lateral_max_m=0.058,
        path_length_m=length_m * 1.01,
        route_length_m=length_m,
    )
