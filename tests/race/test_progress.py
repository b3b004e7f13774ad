"""From a position on the route to distance driven along it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dnb_edge.race.fix import Progress
from dnb_edge.track.centreline import Centreline
from dnb_edge.values import Observation

ANGLES = np.linspace(0, 2 * np.pi, 360, endpoint=False)
RING = Centreline(
    points_m=np.column_stack([np.cos(ANGLES), np.sin(ANGLES)]),
    half_left_m=np.full(360, 0.15),
    half_right_m=np.full(360, 0.15),
)


def driven_m(angles_rad: list[float], radius_m: float = 1.0) -> list[float]:
    progress = Progress(RING)
    driven = []
    for k, angle in enumerate(angles_rad):
        point = (radius_m * math.cos(angle), radius_m * math.sin(angle))
        seen = Observation(
            t_ns=k, t_s=k * 1e-9, camera_px=(0, 0), track_m=point, covariance_m2=(1, 0, 1), confidence=1, length_px=9
        )
        driven.append(progress.fix(seen, target_id=1, track_m=point).progress_m)
    return driven


@pytest.mark.parametrize(
    ("angles", "radians"),
    [
        (np.arange(0, 4 * math.pi, 0.1), 12.5),
        (-np.arange(0, 4 * math.pi, 0.1), -12.5),
        ([0.1, -0.1, 0.1, -0.1], -0.2),
        (np.concatenate([np.arange(0, 7, 0.1), np.arange(7, 6, -0.1)]), 6.1),
    ],
    ids=["twice round", "twice round backwards", "to and fro over the start", "round and a little back"],
)
def test_progress_goes_on_over_the_start_and_falls_when_backing(angles: list[float], radians: float) -> None:
    """Arc length wraps at the start line; the distance driven does not."""
    assert driven_m(list(angles))[-1] == pytest.approx(radians, abs=0.01)


def test_progress_does_not_care_how_far_to_the_side_the_car_is() -> None:
    """Only the way along the route counts."""
    angles = list(np.arange(0, 5, 0.2))
    assert driven_m(angles, 1.1) == pytest.approx(driven_m(angles), abs=0.01)
