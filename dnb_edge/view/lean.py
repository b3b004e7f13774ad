"""Which way things that stand on the floor lean in the picture, from the floor's homography and the camera's place.

Knows one ground map that knows its camera; nothing of cars or networks. Pure geometry. What the lean is good for, and its
definition, stand in `dnb_edge.detect.lean`, whose network is told it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dnb_edge.values import Points
from dnb_edge.view.ground import GroundMap
from dnb_edge.view.pose import likely_pose

_STEP_M = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class FloorLean:
    """The lean anywhere in the picture of a calibrated camera."""

    ground: GroundMap
    """With its camera's place."""

    def __call__(self, camera_px: Points) -> Points:
        """Lean (n, 2) at camera px (n, 2): px a metre of height over px a metre of floor across the line of sight.

        Zero where the picture shows no floor. A point at height e above floor point p appears where p + (p - c) e / (H - e)
        does, c being the floor point below the camera and H its height.
        """
        camera_m = self.ground.camera_m
        if camera_m is None:
            raise ValueError("a ground map without its camera's place tells no lean")
        out = np.zeros_like(camera_px)
        seen = self.ground.sees_ground(camera_px)
        if not seen.any():
            return out
        floor = self.ground.to_track_m(camera_px[seen])
        away = floor - np.array(camera_m[:2])
        here = self.ground.to_camera_px(floor)
        up = (self.ground.to_camera_px(floor + away * (_STEP_M / (camera_m[2] - _STEP_M))) - here) / _STEP_M
        far = np.linalg.norm(away, axis=1, keepdims=True)
        ahead = np.where(far > 1e-6, away / np.maximum(far, 1e-6), (1.0, 0.0))
        across = np.column_stack([-ahead[:, 1], ahead[:, 0]])
        aside = (
            np.linalg.norm(self.ground.to_camera_px(floor + across * _STEP_M) - here, axis=1, keepdims=True) / _STEP_M
        )
        out[seen] = up / aside
        return out


def floor_lean(ground: GroundMap, *, height_m: float | None = None) -> FloorLean | None:
    """The lean for `ground`, a picture of any camera; None where its keypoints fit no camera at all.

    `height_m` is the camera's height above the floor where that was measured.
    """
    if ground.camera_m is not None and height_m is None:
        return FloorLean(ground=ground)
    pose = likely_pose(ground, height_m=height_m)
    return None if pose is None else FloorLean(ground=replace(ground, camera_m=pose.position_m))
