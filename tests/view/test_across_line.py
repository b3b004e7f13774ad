"""The map's sigma across a line: what the scatter of maps drawn from the covariance gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dnb_edge.track.line import DirectedLine
from dnb_edge.track.scale import TwinScale
from dnb_edge.view.across_line import across_sigma_m
from dnb_edge.view.calibration import Covariance9
from dnb_edge.view.ground import GroundMap

GROUND = GroundMap(
    camera_to_twin=(1.1, 0.2, 30.0, -0.05, 1.6, 20.0, 0.00002, 0.0006, 1.0),
    scale=TwinScale(metres_per_px=0.002, height_px=1000.0),
    width_px=1280,
    height_px=720,
)


def covariance() -> np.ndarray:
    """Of the nine numbers, each known to its own degree, with some of them bound to others."""
    sigmas = np.array([0.004, 0.003, 1.0, 0.002, 0.004, 1.5, 3e-6, 4e-6, 0.0])
    bound = np.eye(9)
    bound[0, 2] = bound[2, 0] = -0.6
    bound[4, 5] = bound[5, 4] = -0.5
    return np.asarray(bound * np.outer(sigmas, sigmas))


def rows(matrix: np.ndarray) -> Covariance9:
    return tuple(map(tuple, matrix.tolist()))


@pytest.mark.parametrize("ends_px", [((600.0, 500.0), (700.0, 300.0)), ((200.0, 300.0), (260.0, 650.0))])
def test_it_is_the_scatter_of_what_the_map_may_be(ends_px: tuple[tuple[float, float], ...]) -> None:
    """4,000 maps drawn from the covariance put the line's places off, across the line, by the stated sigma within 5 %."""
    start, end = (GROUND.point_to_track_m(px) for px in ends_px)
    assert start is not None
    assert end is not None
    line = DirectedLine(name="start", start_m=start, end_m=end)
    shares = np.linspace(0.0, 1.0, 5)
    places = [(start[0] + s * (end[0] - start[0]), start[1] + s * (end[1] - start[1])) for s in shares.tolist()]
    pixels = [GROUND.point_to_camera_px(place) for place in places]
    random = np.random.default_rng(3)
    drawn = random.multivariate_normal(np.array(GROUND.camera_to_twin), covariance(), size=4000)
    off_m = []
    for numbers in drawn.tolist():
        ground = replace(GROUND, camera_to_twin=tuple(numbers))
        moved = [ground.point_to_track_m(px) for px in pixels if px is not None]
        off_m.append([line.signed_distance(place) for place in moved if place is not None])
    sigma_m = across_sigma_m(GROUND, rows(covariance()), line)
    assert sigma_m == pytest.approx(float(np.sqrt(np.mean(np.square(off_m)))), rel=0.05)
    assert sigma_m > 0.001


def test_a_line_outside_the_picture_has_none() -> None:
    """Where the picture shows nothing of a line nobody crosses it: no sigma, and no error."""
    line = DirectedLine(name="far", start_m=(5e4, 5e5), end_m=(6e4, 5e5))
    assert across_sigma_m(GROUND, rows(covariance()), line) == 0.0
