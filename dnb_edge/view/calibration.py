"""A calibration: the ground map, what it was made from, and how wrong it may be at every point.

Knows the finished map and its covariance; knows no file (the YAML form is `config.calibration_file`'s) and does not make the
map: keypoints, markers and the refinement do, each in its own module.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.values import Points
from dnb_edge.view.ground import GroundMap
from dnb_edge.view.homography import CalibrationError
from dnb_edge.view.pose import CameraPose

Covariance9: TypeAlias = tuple[tuple[float, ...], ...]
"""A 9 x 9 symmetric matrix, row by row."""


class CalibrationMethod(StrEnum):
    """What the map was made from."""

    KEYPOINTS = "keypoints"
    MARKERS = "markers"
    REFINED = "refined"


@dataclass(frozen=True, slots=True, kw_only=True)
class InputFile:
    """A file that the calibration was made from."""

    name: str
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """The map of one camera in one place to one twin."""

    ground: GroundMap
    """For the size of picture on which it was made; its lens and camera's place with it, where they are known."""
    covariance: Covariance9 | None
    """Covariance of `ground.camera_to_twin`'s nine numbers, in their order and scale; None where there were no more points
    than the map needs and no sigma of a click was assumed."""
    error: CalibrationError
    """How far the points it was made from lie from where the map puts them, twin px and metres."""
    method: CalibrationMethod
    pose: CameraPose | None = None
    """Where the camera stands; None where neither points nor lens tell it."""
    camera_id: str | None = None
    """The stable identity of the camera (`SourceInfo.camera_id`); None where the pictures did not come from one."""
    made_at: str = ""
    """ISO 8601 with offset."""
    inputs: tuple[InputFile, ...] = ()
    reference: InputFile | None = None
    """The picture of the view as it was calibrated, in a file beside the calibration's; None where there was none."""
    notes: tuple[str, ...] = ()
    """What a user should know of it, such as an outlier that was set aside; sentences."""

    def sigma_m(self, camera_px: Points) -> NDArray[np.float64]:
        """One standard deviation of the mapped position, metres, of camera px (n, 2) on the floor: shape (n,).

        The root of the sum of both axes' variances. Raises `ValueError` where the covariance is not known or a point lies
        beyond the horizon.
        """
        covariance = self.covariance_m2(camera_px)
        return np.asarray(np.sqrt(covariance[:, 0, 0] + covariance[:, 1, 1]))

    def greatest_sigma_m(self, route_m: Points) -> float | None:
        """The greatest `sigma_m` over a route (n, 2), track m, as far as the picture shows it; None where it shows none of it,
        or the covariance is not known."""
        if self.covariance is None:
            return None
        seen = [point for x, y in route_m.tolist() if (point := self.ground.point_to_camera_px((x, y))) is not None]
        pixels = np.array(seen, dtype=np.float64).reshape(-1, 2)
        size = np.array([self.ground.width_px, self.ground.height_px])
        pixels = pixels[((pixels >= -0.5) & (pixels <= size - 0.5)).all(axis=1)]
        return float(self.sigma_m(pixels).max()) if len(pixels) else None

    def covariance_m2(self, camera_px: Points) -> NDArray[np.float64]:
        """Covariance (n, 2, 2), m^2 along x and y of the track plane, of where the map puts camera px (n, 2).

        First-order propagation of the homography's covariance (Hartley and Zisserman, Multiple View Geometry, 5.2.3). It says
        nothing of the detector, nor of the scale's own error. Raises `ValueError` as `sigma_m` does.
        """
        if self.covariance is None:
            raise ValueError("the covariance of this calibration is not known")
        jacobian = place_jacobian(self.ground, camera_px)
        return np.asarray(jacobian @ np.array(self.covariance) @ jacobian.transpose(0, 2, 1))

    def for_camera(self, *, width_px: int, height_px: int, camera_id: str | None) -> GroundMap:
        """The ground map for a camera's frames. Raises `InputError` where they are another camera's, or of another aspect.

        Sizes of one aspect ratio are taken for one mode of the sensor, scaled.
        """
        if self.camera_id is not None and camera_id is not None and camera_id != self.camera_id:
            raise InputError(
                f"the calibration was made with the camera {self.camera_id}, this one is {camera_id}: plug that camera in, or "
                "calibrate this one"
            )
        return self.ground.scaled_to(width_px, height_px)

    def scaled_to(self, width_px: int, height_px: int) -> Calibration:
        """The same calibration for frames of another size and the same aspect. Raises `InputError` for another aspect."""
        ground = self.ground.scaled_to(width_px, height_px)
        across, down = self.ground.width_px / width_px, self.ground.height_px / height_px
        if (across, down) == (1.0, 1.0):
            return self
        columns = np.tile((across, down, 1.0), 3)
        scaled = None
        if self.covariance is not None:
            scaled = tuple(map(tuple, (np.array(self.covariance) * np.outer(columns, columns)).tolist()))
        pose = None if self.pose is None else replace(self.pose, focal_px=self.pose.focal_px / across)
        return replace(self, ground=ground, covariance=scaled, pose=pose)

    def __post_init__(self) -> None:
        """Raises `InputError` where the covariance is no 9 x 9 matrix of finite numbers."""
        if self.covariance is None:
            return
        if [len(row) for row in self.covariance] != [9] * 9 or not all(
            math.isfinite(number) for row in self.covariance for number in row
        ):
            raise InputError("calibration: its covariance must be nine rows of nine finite numbers: calibrate again")


def place_jacobian(ground: GroundMap, camera_px: Points) -> NDArray[np.float64]:
    """d(track m)/d(`camera_to_twin`'s nine numbers), shape (n, 2, 9), at camera px (n, 2).

    Raises `ValueError` where a point lies beyond the horizon.
    """
    u, v = ground.to_ideal_px(camera_px).T
    h = np.array(ground.camera_to_twin).reshape(3, 3)
    x, y, w = h @ np.vstack((u, v, np.ones_like(u)))
    if not (w > 0).all():
        raise ValueError("a camera px beyond the horizon has no place on the floor")
    zero, one = np.zeros_like(u), np.ones_like(u)
    p = np.stack((u, v, one), axis=1) / w[:, None]
    none = np.stack((zero, zero, zero), axis=1)
    to_x = np.concatenate((p, none, -p * (x / w)[:, None]), axis=1)
    to_y = np.concatenate((none, p, -p * (y / w)[:, None]), axis=1)
    step = ground.scale.metres_per_px
    # y points up on the track plane and down on the twin.
    return np.asarray(np.stack((to_x, -to_y), axis=1) * step)
