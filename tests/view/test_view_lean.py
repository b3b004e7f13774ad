"""The lean from a calibration: what a true camera shows of a rod that stands on the floor."""

import math

import numpy as np
import pytest

from dnb_edge.track.scale import TwinScale
from dnb_edge.train.camera import overhead_view
from dnb_edge.view.ground import GroundMap
from dnb_edge.view.lean import floor_lean

SIZE = (1280, 720)


def _ground(view) -> GroundMap:
    """The exact map of a drawn camera: its floor's x, y are metres on a twin of 1 cm a pixel."""
    points = np.array([[300.0, 300.0], [900.0, 320.0], [1000.0, 650.0], [250.0, 600.0]])
    floor = view.floor_points(points) + 5.0
    twin = np.column_stack([floor[:, 0] / 0.01, 1000.0 - floor[:, 1] / 0.01])
    rows = []
    for (u, v), (x, y) in zip(points, twin, strict=True):
        rows += [[u, v, 1, 0, 0, 0, -x * u, -x * v, -x], [0, 0, 0, u, v, 1, -y * u, -y * v, -y]]
    matrix = np.linalg.svd(np.array(rows))[2][-1]
    matrix /= matrix[8]
    return GroundMap(
        camera_to_twin=tuple(matrix.tolist()),
        scale=TwinScale(metres_per_px=0.01, height_px=1000.0),
        width_px=SIZE[0],
        height_px=SIZE[1],
    )


@pytest.mark.parametrize("pitch_deg", [35.0, 50.0, 70.0])
@pytest.mark.parametrize("roll_rad", [0.0, 0.3])
def test_the_lean_is_what_the_camera_shows(pitch_deg, roll_rad):
    """Told from the homography alone, the lean agrees with the camera that made it, all over the frame."""
    view = overhead_view(
        width_px=SIZE[0],
        height_px=SIZE[1],
        camera_height_m=2.15,
        pitch_rad=math.radians(pitch_deg),
        field_of_view_rad=math.radians(70.0),
        roll_rad=roll_rad,
    )
    lean = floor_lean(_ground(view))
    assert lean is not None
    points = np.array([[200.0, 400.0], [640.0, 360.0], [1100.0, 650.0], [640.0, 700.0]])
    assert lean(points) == pytest.approx(view.lean(points), abs=0.02)


def test_a_camera_that_looks_straight_down_leans_away_from_its_foot():
    """Where the homography tells no height, the lean of a usual lens is told: none below the camera, outward elsewhere."""
    view = overhead_view(
        width_px=SIZE[0],
        height_px=SIZE[1],
        camera_height_m=2.15,
        pitch_rad=math.radians(90.0),
        field_of_view_rad=math.radians(70.0),
    )
    lean = floor_lean(_ground(view))
    assert lean is not None
    told = lean(np.array([[639.5, 359.5], [1200.0, 359.5], [639.5, 40.0]]))
    assert told[0] == pytest.approx((0.0, 0.0), abs=0.02)
    assert told[1][0] > 0.3
    assert told[2][1] < -0.2
    assert told == pytest.approx(view.lean(np.array([[639.5, 359.5], [1200.0, 359.5], [639.5, 40.0]])), abs=0.1)
