"""A detection brought to the track plane, with all that motion wants to know of it.

Knows the map from picture to track and the route; keeps nothing from frame to frame.
"""

from __future__ import annotations

import math

from dnb_edge.motion.appearance import Sighting
from dnb_edge.track.centreline import Centreline
from dnb_edge.values import Detection, Observation
from dnb_edge.view.ground import GroundMap, Slopes


class Sight:
    """Turns detections into sightings."""

    def __init__(self, ground: GroundMap, route: Centreline, *, margin_m: float, camera: int = 0) -> None:
        """`margin_m` is how far beyond the lane's edge an observation still counts as on the lane; `camera` is the number of
        the camera whose map `ground` is."""
        self._ground = ground
        self._camera = camera
        self._route = route
        self._margin_m = margin_m

    def sighting(self, detection: Detection, t_ns: int, t_s: float) -> Sighting | None:
        """The detection on the track plane; None at or beyond the horizon."""
        ground, height_m = self._ground, detection.height_m
        seen = ground.seen(detection.camera_px)
        if seen is None:
            return None
        track_m, (xu, xv, yu, yv) = seen
        below_px = detection.camera_px
        if height_m > 0.0:
            share = ground.share_at(height_m)
            xu, xv, yu, yv = xu * share, xv * share, yu * share, yv * share
            track_m = ground.below_m(track_m, height_m)
            below_px = ground.point_to_camera_px(track_m) or below_px
        variance = detection.sigma_px * detection.sigma_px
        observation = Observation(
            t_ns=t_ns,
            t_s=t_s,
            camera_px=below_px,
            track_m=track_m,
            covariance_m2=(
                (xu * xu + xv * xv) * variance,
                (xu * yu + xv * yv) * variance,
                (yu * yu + yv * yv) * variance,
            ),
            confidence=detection.confidence,
            length_px=detection.length_px,
            camera=self._camera,
        )
        return Sighting(
            observation=observation,
            on_lane=self._route.is_within(track_m, self._margin_m),
            length_m=detection.length_px * math.sqrt(abs(xu * yv - xv * yu)),
            marker_id=detection.marker_id,
            colour_bgr=detection.colour_bgr,
            heading_rad=_heading_on_track(detection.heading_rad, (xu, xv, yu, yv)),
        )


def _heading_on_track(heading_rad: float | None, slopes: Slopes) -> float | None:
    """The direction on the track plane, atan2(dy, dx), of one in the picture, atan2(-v, u)."""
    if heading_rad is None:
        return None
    xu, xv, yu, yv = slopes
    right, down = math.cos(heading_rad), -math.sin(heading_rad)
    return math.atan2(yu * right + yv * down, xu * right + xv * down)
