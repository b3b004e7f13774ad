"""A round track seen by a camera straight above, and cars that drive on it: exact inputs for the core's tests."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from dnb_edge.core import CoreSetup
from dnb_edge.motion.settings import MotionSettings
from dnb_edge.race.crossing import CrossingSettings
from dnb_edge.race.rules import LapRules
from dnb_edge.score.similarity import ScoreSettings
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.line import line_across
from dnb_edge.track.model import Track
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import Detection, FrameDetections, PointM
from dnb_edge.view.ground import GroundMap

RADIUS_M = 1.0
CENTRE_M = (2.0, 2.0)
HALF_LANE_M = 0.15
SCALE = TwinScale(metres_per_px=0.01, height_px=400.0)
GROUND = GroundMap(camera_to_twin=(0.4, 0, 0, 0, 0.4, 0, 0, 0, 1.0), scale=SCALE, width_px=1000, height_px=1000)


def on_circle(angle_rad: float, radius_m: float = RADIUS_M) -> PointM:
    return CENTRE_M[0] + radius_m * math.cos(angle_rad), CENTRE_M[1] + radius_m * math.sin(angle_rad)


def circle_track(points: int = 400) -> Track:
    """A circle of one metre radius driven anticlockwise; the start line lies at angle 0."""
    angles = np.linspace(0, 2 * np.pi, points, endpoint=False)
    half = np.full(points, HALF_LANE_M)
    centreline = Centreline(
        points_m=np.array([on_circle(angle) for angle in angles]), half_left_m=half, half_right_m=half
    )
    start = line_across(centreline, 0.0, name="start", margin_m=0.05)
    return Track(name="circle", scale=SCALE, centreline=centreline, start_line=start)


def circle_setup(**changes: object) -> CoreSetup:
    parts: dict[str, object] = {
        "track": circle_track(),
        "ground": GROUND,
        "motion": MotionSettings(),
        "crossing": CrossingSettings(),
        "laps": LapRules(),
        "score": ScoreSettings(),
    }
    return CoreSetup(**(parts | changes))  # type: ignore[arg-type]


def detection(point_m: PointM, *, sigma_px: float = 1.0) -> Detection:
    camera_px = GROUND.point_to_camera_px(point_m)
    assert camera_px is not None
    return Detection(camera_px=camera_px, sigma_px=sigma_px, length_px=40.0, confidence=0.9)


def frames(
    position: Callable[[float], PointM | None],
    *,
    seconds: float,
    fps: float = 30.0,
    noise_px: float = 0.0,
    seed: int = 0,
) -> Iterator[FrameDetections]:
    """What a detector would say of a car at `position(t_s)`, track m, None where it is not seen."""
    random = np.random.default_rng(seed)
    for k in range(int(seconds * fps)):
        t_ns = round(k * 1e9 / fps)
        point = position(t_ns * 1e-9)
        found: tuple[Detection, ...] = ()
        if point is not None:
            exact = detection(point)
            u, v = exact.camera_px
            du, dv = random.normal(0, noise_px, 2) if noise_px else (0.0, 0.0)
            found = (Detection(camera_px=(u + du, v + dv), sigma_px=1.0, length_px=40.0, confidence=0.9),)
        yield FrameDetections(sequence=k, t_ns=t_ns, detections=found, full_frame=True)
