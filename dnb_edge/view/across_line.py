"""How far the map may have a line out of its place, across it.

Knows the ground map, its covariance and a directed line; knows no car. The error of the map is one for all frames: it moves
every crossing of a line alike, so it belongs to the line, not to the crossing.
"""

from __future__ import annotations

import math

import numpy as np

from dnb_edge.track.line import DirectedLine
from dnb_edge.view.calibration import Covariance9, place_jacobian
from dnb_edge.view.ground import GroundMap

_PLACES = 5


def across_sigma_m(ground: GroundMap, covariance: Covariance9, line: DirectedLine) -> float:
    """One standard deviation, metres, of where the map puts what stands on `line`, at right angles to the line.

    The root of the mean variance over places spread along the line: f J C J^T f^T, with f the unit vector across the line, J
    `place_jacobian` and C the covariance of `ground.camera_to_twin` in its scale (see `Calibration.covariance_m2`). 0 where the
    picture shows nothing of the line: then nobody crosses it either.
    """
    (x0, y0), (x1, y1) = line.start_m, line.end_m
    shares = np.linspace(0.0, 1.0, _PLACES).tolist()
    pixels = [ground.point_to_camera_px((x0 + share * (x1 - x0), y0 + share * (y1 - y0))) for share in shares]
    seen = [
        px
        for px in pixels
        if px is not None and -0.5 <= px[0] <= ground.width_px - 0.5 and -0.5 <= px[1] <= ground.height_px - 0.5
    ]
    if not seen:
        return 0.0
    across = np.array(line.forward) @ place_jacobian(ground, np.array(seen))
    return math.sqrt(max(float(np.einsum("ni,ij,nj->n", across, np.array(covariance), across).mean()), 0.0))
