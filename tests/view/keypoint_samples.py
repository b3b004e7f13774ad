"""Keypoints of a camera whose homography is known exactly."""

from __future__ import annotations

import numpy as np

from dnb_edge.track.scale import TwinScale
from dnb_edge.values import Points
from dnb_edge.view.ground import GroundMap
from dnb_edge.view.homography import fit_ground_map
from dnb_edge.view.keypoints import KeypointPairs

WIDTH, HEIGHT = 1280, 720
SCALE = TwinScale(metres_per_px=0.002, height_px=1000)

# A camera 1,000 twin px up that looks 40 degrees down, turned 15 degrees: twin px -> camera px, f = 900 px.
_DOWN = np.radians(40)
_TURN = np.radians(15)
_TWIN_TO_CAMERA = (
    np.array([[900.0, 0, 639.5], [0, 900, 359.5], [0, 0, 1]])
    @ np.array([[1, 0, 0], [0, np.sin(_DOWN), np.cos(_DOWN)], [0, -np.cos(_DOWN), np.sin(_DOWN)]])
    @ np.array([[np.cos(_TURN), -np.sin(_TURN), 0], [np.sin(_TURN), np.cos(_TURN), 0], [0, 0, 1]])
    @ np.array([[1, 0, -500.0], [0, 1, -1700], [0, 0, 1000]])
)
TWIN = np.array([[0.0, 0], [1000, 0], [1000, 1000], [0, 1000], [500, 500], [200, 700], [850, 300]])


def seen(twin_px: Points) -> Points:
    """Twin px (n, 2) as the camera sees them, camera px (n, 2)."""
    h = np.column_stack((twin_px, np.ones(len(twin_px)))) @ _TWIN_TO_CAMERA.T
    assert (h[:, 2] > 0).all()
    return h[:, :2] / h[:, 2:]


def exact_pairs(count: int = 7) -> KeypointPairs:
    return KeypointPairs.from_arrays(seen(TWIN)[:count], TWIN[:count], source="sample")


def ground() -> GroundMap:
    return fit_ground_map(exact_pairs(), SCALE, width_px=WIDTH, height_px=HEIGHT)
