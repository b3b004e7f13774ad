"""Where the camera stands, from the floor's homography: what places a thing above the floor on the floor below it.

With a calibrated lens its focal lengths and optical centre are used; without one, square pixels and an optical centre in the
middle of the picture are assumed. Knows one ground map and, where it is given, the camera's measured height. Knows no
keypoints and no car. Pure geometry.

The floor's homography, track m to camera px about the picture's middle, is H ~ K [r1 r2 t] with K = diag(f, f, 1) (Hartley
and Zisserman, Multiple View Geometry, 8.1.1). r1 and r2 being orthogonal and of one length gives f; r1, r2 and t then give the
camera's place. Seen from straight above, every f fits: the height must then be measured, or the lens calibrated.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.view.ground import GroundMap

STEEPEST_DEG = 80.0
"""Pitch below the horizon above which the homography alone does not tell the height well enough."""

_FIELD_OF_VIEW_DEG = (15.0, 160.0)
"""Horizontal angles that lenses have; a map that asks for another comes of poor keypoints."""

_USUAL_FIELD_DEG = 65.0
"""Horizontal angle of the lenses that most webcams and the Pi's cameras have."""

_UNEVEN_SIGMA = 0.002
"""By how much clicked keypoints make the floor's two axes differ in length, one standard deviation."""

_HEIGHT_SIGMA = 0.01
"""How well people measure a height, as a share of it, one standard deviation."""

_HEIGHT_TOLERANCE = 0.08

_REMEDY = "measure the camera's height above the floor and set view.camera_height_m"


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraPose:
    """Where a camera stands over the track plane, and how it looks down."""

    position_m: tuple[float, float, float]
    """Optical centre: x and y as track m, z metres above the floor."""
    focal_px: float
    """Focal length, camera px of the ground map's size of frame; the calibrated lens's horizontal one where there is one."""
    pitch_deg: float
    """Angle of the optical axis below the horizon, 0..90 degrees."""


def find_pose(ground: GroundMap, *, height_m: float | None = None) -> CameraPose:
    """The pose of the camera behind `ground`; `height_m` is its height above the floor where that was measured.

    Raises `InputError` where the homography fits no camera, or looks so steeply down that it does not tell the height.
    """
    if height_m is not None and not (math.isfinite(height_m) and height_m > 0):
        raise InputError(f"view.camera_height_m: {height_m:g} is not a height above the floor: give metres")
    if ground.lens is not None:
        pose = _pose(_floor_to_centred_px(ground), ground.lens.fx_px)
        _check_height(pose, height_m)
    elif height_m is not None:
        pose = _pose_at_height(_floor_to_centred_px(ground), ground, height_m)
    else:
        h = _floor_to_centred_px(ground)
        pose = _pose(h, _focal_px(h, ground))
        if pose.pitch_deg > STEEPEST_DEG:
            raise InputError(
                f"view: the camera looks {pose.pitch_deg:.0f} degrees down, too steeply for its height to be told from the "
                f"keypoints: {_REMEDY}"
            )
    if not pose.position_m[2] > 0:
        raise InputError("view: the keypoints show the floor from below: the twin or the picture is mirrored")
    return pose


def likely_pose(ground: GroundMap, *, height_m: float | None = None) -> CameraPose | None:
    """`find_pose`, or where the height is wrong, the keypoints' own pose, or where neither tells, that of a lens as most
    webcams have it; None where that fits no floor either.

    Good enough for what hardly depends on the lens, such as which way things lean; not for placing what is above the floor.
    """
    # A height measured wrongly must not cost what the keypoints tell without it.
    for known_m in (None,) if height_m is None else (height_m, None):
        with suppress(InputError):
            return find_pose(ground, height_m=known_m)
    focal_px = 0.5 * ground.width_px / math.tan(math.radians(0.5 * _USUAL_FIELD_DEG))
    pose = _pose(_floor_to_centred_px(ground), focal_px)
    return pose if pose.position_m[2] > 0 else None


def with_camera(ground: GroundMap, *, height_m: float | None = None, tallest_m: float = 0.0) -> GroundMap:
    """`ground` that knows its camera's place, so that it can place things up to `tallest_m` above the floor. A place that it
    has already stays, unless a height was measured.

    Raises `InputError` as `find_pose` does, and where the camera is not higher than that.
    """
    if ground.camera_m is not None and height_m is None:
        position_m = ground.camera_m
    else:
        position_m = find_pose(ground, height_m=height_m).position_m
    if not position_m[2] > tallest_m:
        raise InputError(
            f"view: the camera is {position_m[2]:.2f} m above the floor, not above what lies {tallest_m:g} m high: check the "
            "twin's scale and the marker's height"
        )
    return replace(ground, camera_m=position_m)


def _floor_to_centred_px(ground: GroundMap) -> NDArray[np.float64]:
    """(3, 3) track m -> square ideal px about the optical centre; its third coordinate is positive ahead of the camera."""
    scale = ground.scale.metres_per_px
    twin_to_track = np.array([[scale, 0.0, 0.0], [0.0, -scale, scale * ground.scale.height_px], [0.0, 0.0, 1.0]])
    to_track = twin_to_track @ np.array(ground.camera_to_twin).reshape(3, 3)
    lens = ground.lens
    if lens is None:
        tall, u, v = 1.0, (ground.width_px - 1) / 2.0, (ground.height_px - 1) / 2.0
    else:
        tall, u, v = lens.fx_px / lens.fy_px, lens.cx_px, lens.cy_px
    centred = np.array([[1.0, 0.0, -u], [0.0, tall, -v * tall], [0, 0, 1.0]])
    return np.asarray(centred @ np.linalg.inv(to_track), dtype=np.float64)


def _focal_px(h: NDArray[np.float64], ground: GroundMap) -> float:
    """The focal length at which the floor's two axes are orthogonal and of one length, in the least-squares sense.

    With p = h1 + i h2 both conditions are (p0^2 + p1^2) / f^2 + p2^2 = 0, whichever way the track plane's axes are turned.
    """
    p = h[:, 0] + 1j * h[:, 1]
    across, deep = p[0] ** 2 + p[1] ** 2, p[2] ** 2
    inverse_square = -float((across * deep.conjugate()).real) / max(abs(across) ** 2, 1e-300)
    widest, narrowest = _focal_range_px(ground)
    if not (inverse_square > 0 and widest <= inverse_square**-0.5 <= narrowest):
        raise InputError(
            f"view: the keypoints fit no camera with its optical centre in the middle of the picture, or one that looks "
            f"straight down: {_REMEDY}, or check the keypoints"
        )
    return float(inverse_square**-0.5)


def _pose(h: NDArray[np.float64], focal_px: float) -> CameraPose:
    """The pose for a known focal length; r1 and r2 are made orthonormal by the nearest such pair."""
    m = h / np.array([[focal_px], [focal_px], [1.0]])
    u, lengths, vt = np.linalg.svd(m[:, :2], full_matrices=False)
    axes = u @ vt
    rotation = np.column_stack((axes, np.cross(axes[:, 0], axes[:, 1])))
    x, y, z = (-rotation.T @ (m[:, 2] / lengths.mean())).tolist()
    # Row 2 of the rotation is the optical axis in the world; downwards is -z.
    pitch_deg = math.degrees(math.asin(min(1.0, max(-1.0, -float(rotation[2, 2])))))
    return CameraPose(position_m=(x, y, z), focal_px=focal_px, pitch_deg=pitch_deg)


def _pose_at_height(h: NDArray[np.float64], ground: GroundMap, height_m: float) -> CameraPose:
    """The pose whose focal length agrees best with both the homography and the measured height.

    A steep view hardly minds the focal length and the height decides; a slanting one tells it well, and its height hardly
    depends on it.
    """
    widest, narrowest = _focal_range_px(ground)

    def disagreement(focal_px: float) -> float:
        lengths = np.linalg.svd(h[:, :2] / np.array([[focal_px], [focal_px], [1.0]]), compute_uv=False)
        uneven = float((lengths[0] - lengths[1]) / (lengths[0] + lengths[1]))
        wrong = _pose(h, focal_px).position_m[2] / height_m - 1.0
        return (uneven / _UNEVEN_SIGMA) ** 2 + (wrong / _HEIGHT_SIGMA) ** 2

    candidates = np.geomspace(widest, narrowest, 200)
    best = int(np.argmin([disagreement(float(f)) for f in candidates]))
    near = np.geomspace(candidates[max(0, best - 1)], candidates[min(len(candidates) - 1, best + 1)], 200)
    pose = _pose(h, float(near[np.argmin([disagreement(float(f)) for f in near])]))
    _check_height(pose, height_m)
    return pose


def _check_height(pose: CameraPose, height_m: float | None) -> None:
    """Raises `InputError` where a measured height contradicts the pose."""
    if height_m is not None and abs(pose.position_m[2] / height_m - 1.0) > _HEIGHT_TOLERANCE:
        raise InputError(
            f"view.camera_height_m: by the keypoints the camera stands about {pose.position_m[2]:.2f} m above the floor, not "
            f"{height_m:g} m: measure again, from the floor to the lens, and check the twin's scale"
        )


def _focal_range_px(ground: GroundMap) -> tuple[float, float]:
    """The shortest and the longest focal length that a lens may have, camera px."""
    low, high = (0.5 * ground.width_px / math.tan(math.radians(0.5 * angle)) for angle in _FIELD_OF_VIEW_DEG[::-1])
    return low, high
