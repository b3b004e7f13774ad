"""Where one more keypoint would help most, and what the ones there are can and cannot tell.

Knows a calibration with its covariance, the places at which it matters and the noise of a click. Knows no file. The sigma after
one more click is foretold from the covariance alone, as a Kalman filter's update would make it; no click is needed for that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.track.model import Track
from dnb_edge.values import PointPx, Points
from dnb_edge.view.calibration import Calibration, place_jacobian
from dnb_edge.view.fit import KeypointFit
from dnb_edge.view.ground import GroundMap
from dnb_edge.view.outliers import most_outliers

_LANE_POINTS = 120
_GRID = 24
_MARGIN = 0.03
"""New keypoints keep this share of the picture's width from its rim and from one another."""
_WORTH_IT = 0.95
"""A new keypoint that leaves more than this share of the greatest sigma is not worth advising."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Addition:
    """The most useful place for one more keypoint."""

    camera_px: PointPx
    sigma_m: float
    """The map's sigma there as it is."""
    greatest_before_m: float
    """The greatest sigma over the places that matter as it is..."""
    greatest_after_m: float
    """...and with the point."""


def lane_px(ground: GroundMap, track: Track) -> Points:
    """Camera px (n, 2) of places all over the lane that the picture shows: its middle and both edges."""
    line = track.centreline
    step = max(1, len(line.points_m) // _LANE_POINTS)
    chosen = range(0, len(line.points_m), step)
    places_m = np.array(
        [
            line.point_at(float(line.s_m[k]), d_m)
            for k in chosen
            for d_m in (0.0, float(line.half_left_m[k]), -float(line.half_right_m[k]))
        ]
    )
    return seen_px(ground, places_m)


def seen_px(ground: GroundMap, track_m: Points) -> Points:
    """Camera px (m, 2) of those of the places, track m (n, 2), that lie in the picture."""
    twin_px = ground.scale.to_twin_px(track_m)
    back = np.linalg.inv(np.array(ground.camera_to_twin).reshape(3, 3))
    ahead = (np.column_stack((twin_px, np.ones(len(twin_px)))) @ back.T)[:, 2] > 0
    camera_px = ground.to_camera_px(track_m[ahead])
    return camera_px[_inside(ground, camera_px)]


def hull_px(camera_px: Points) -> Points:
    """Camera px (n, 2) of a grid over the polygon that the keypoints, camera px, span, and of its corners."""
    corners = cv2.convexHull(camera_px.astype(np.float32))
    (low_u, low_v), (high_u, high_v) = camera_px.min(axis=0), camera_px.max(axis=0)
    grid = _grid(low_u, high_u, low_v, high_v)
    within = [cv2.pointPolygonTest(corners, (float(u), float(v)), measureDist=False) >= 0 for u, v in grid]
    return np.vstack((grid[np.array(within)], corners.reshape(-1, 2).astype(np.float64)))


def best_addition(found: KeypointFit, camera_px: Points, places_px: Points) -> Addition | None:
    """The place in the picture at which one more click lowers the greatest sigma over `places_px`, camera px (n, 2), most;
    `camera_px` (m, 2) are the keypoints there are. None where no place is left to click on.
    """
    calibration = found.calibration
    candidates = _candidates(calibration.ground, camera_px, places_px)
    if not len(candidates):
        return None
    covariance = np.array(calibration.covariance)
    at_places = place_jacobian(calibration.ground, places_px)
    at_new = place_jacobian(calibration.ground, candidates)
    now = at_places @ covariance @ at_places.transpose(0, 2, 1)
    shared = np.einsum("pia,ab,cjb->cpij", at_places, covariance, at_new, optimize=True)
    there = at_new @ covariance @ at_new.transpose(0, 2, 1)
    gain = np.linalg.inv(there + _noise_m2(found, candidates))
    lowered = np.einsum("cpij,cjk,cpik->cp", shared, gain, shared, optimize=True)
    left = np.sqrt(np.maximum(np.trace(now, axis1=1, axis2=2)[None] - lowered, 0.0)).max(axis=1)
    best = int(np.argmin(left))
    u, v = candidates[best].tolist()
    return Addition(
        camera_px=(u, v),
        sigma_m=float(np.sqrt(np.trace(there[best]))),
        greatest_before_m=float(calibration.sigma_m(places_px).max()),
        greatest_after_m=float(left[best]),
    )


def advise(found: KeypointFit, camera_px: Points, places_px: Points, say: Callable[[float], str]) -> tuple[str, ...]:
    """Up to three sentences on what to do next; `say` puts a length in metres into words."""
    addition = best_addition(found, camera_px, places_px)
    sentences = [] if addition is None else [_sentence(addition, found.calibration, say)]
    sentences.append(_on_count(len(camera_px)))
    if found.misfit and found.calibration.ground.lens is None:
        sentences.append(
            "a lens that bends the picture looks like this, too: calibrate it (calibrate lens) and give --lens"
        )
    return tuple(sentences)


def compass(camera_px: PointPx, *, width_px: int, height_px: int) -> str:
    """Where in the picture a point lies, in words: `top left`, `left`, `middle`, ..."""
    across = ("left", "", "right")[min(2, max(0, int(3 * camera_px[0] / width_px)))]
    down = ("top", "", "bottom")[min(2, max(0, int(3 * camera_px[1] / height_px)))]
    return f"{down} {across}".strip() or "middle"


def _sentence(addition: Addition, calibration: Calibration, say: Callable[[float], str]) -> str:
    before, after = say(addition.greatest_before_m), say(addition.greatest_after_m)
    if addition.greatest_after_m > _WORTH_IT * addition.greatest_before_m:
        return f"one more point would hardly help: the greatest sigma is {before}"
    ground, (u, v) = calibration.ground, addition.camera_px
    where = compass((u, v), width_px=ground.width_px, height_px=ground.height_px)
    return (
        f"add a point near the {where} of the picture, about ({u:.0f}, {v:.0f}) px: sigma there is {say(addition.sigma_m)}, "
        f"and the greatest sigma falls from {before} to {after}"
    )


def _on_count(count: int) -> str:
    if count == 4:
        return "4 points are the least, and nothing checks them: of 6 a wrong one can be named"
    if count == 5:
        return "5 points show that one is wrong but not which: of 6 a wrong one can be named"
    most = most_outliers(count)
    return f"of {count} points {'a wrong one' if most == 1 else f'up to {most} wrong ones'} can be named"


def _candidates(ground: GroundMap, camera_px: Points, places_px: Points) -> Points:
    """Places of the picture on the floor about the track at which no keypoint is yet, camera px (n, 2)."""
    margin = _MARGIN * ground.width_px
    grid = _grid(margin, ground.width_px - 1 - margin, margin, ground.height_px - 1 - margin)
    grid = grid[ground.sees_ground(grid)]
    on_floor, places_m = ground.to_track_m(grid), ground.to_track_m(np.vstack((places_px, camera_px)))
    low, high = places_m.min(axis=0), places_m.max(axis=0)
    free = np.linalg.norm(grid[:, None] - camera_px[None], axis=2).min(axis=1) > margin
    return np.asarray(grid[free & ((on_floor >= low) & (on_floor <= high)).all(axis=1)])


def _grid(low_u: float, high_u: float, low_v: float, high_v: float) -> Points:
    u, v = np.meshgrid(np.linspace(low_u, high_u, _GRID), np.linspace(low_v, high_v, _GRID))
    return np.column_stack((u.ravel(), v.ravel()))


def _inside(ground: GroundMap, camera_px: Points) -> NDArray[np.bool_]:
    within = (camera_px >= -0.5) & (camera_px <= (ground.width_px - 0.5, ground.height_px - 0.5))
    return np.asarray(within.all(axis=1))


def _noise_m2(found: KeypointFit, camera_px: Points) -> NDArray[np.float64]:
    """(n, 2, 2), m^2: what clicks at camera px (n, 2) and their twin points add, as the covariance was scaled."""
    ground = found.calibration.ground
    bends = np.array([ground.jacobian((float(u), float(v))) for u, v in camera_px])
    twin_m = found.twin_sigma_px * ground.scale.metres_per_px
    clicks = found.click_sigma_px**2 * bends @ bends.transpose(0, 2, 1)
    return np.asarray((clicks + twin_m**2 * np.eye(2)) * found.caution)
