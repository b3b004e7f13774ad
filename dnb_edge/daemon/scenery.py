"""What stands still in a race, as whoever draws it elsewhere needs it.

Knows the core's setup and the live socket's values; knows no socket.
"""

from __future__ import annotations

import math

import numpy as np

from dnb_edge.core import CoreSetup
from dnb_edge.live.messages import Scenery, SceneryLine
from dnb_edge.view.ground import GroundMap

STEP_M = 0.02
MOST_POINTS = 1000


def make_scenery(setup: CoreSetup) -> Scenery:
    """The track of `setup` and how its camera sees it."""
    track, route = setup.track, setup.track.centreline
    count = max(3, min(MOST_POINTS, math.ceil(route.length_m / STEP_M)))
    at_m = np.linspace(0.0, route.length_m, count, endpoint=not route.closed)
    ground = setup.ground
    return Scenery(
        centreline_m=tuple((x, y) for x, y in route.points_at(at_m).tolist()),
        closed=route.closed,
        lane_width_m=float(np.median(route.half_left_m + route.half_right_m)),
        lines=tuple(SceneryLine(name=line.name, start_m=line.start_m, end_m=line.end_m) for line in track.lines),
        length_m=track.lap_m()[1],
        camera_from_track=_camera_from_track(ground),
        frame_px=(ground.width_px, ground.height_px),
    )


def _camera_from_track(ground: GroundMap) -> tuple[tuple[float, float, float], ...]:
    """Homography, track m -> camera px of an ideal lens, rows first; the third coordinate is positive before the camera."""
    per_px = ground.scale.metres_per_px
    twin_from_track = np.array([[1 / per_px, 0, 0], [0, -1 / per_px, ground.scale.height_px], [0, 0, 1]])
    matrix = np.linalg.inv(np.reshape(ground.camera_to_twin, (3, 3))) @ twin_from_track
    return tuple((a, b, c) for a, b, c in matrix.tolist())
