"""The homography that fits keypoint pairs best, and how wrong it is.

Knows pairs of points in camera px and twin px. Knows no frame and no car; `ground` carries the result to the core, `gate`
decides whether it is good enough. The fit is OpenCV's least squares over all pairs (findHomography with method 0), and
every error is a distance in twin px between a mapped camera point and its twin point.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import Points
from dnb_edge.view.ground import GroundMap, Matrix3
from dnb_edge.view.keypoints import KeypointPairs
from dnb_edge.view.lens import Lens

_FEWEST = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationError:
    """How far the fitted homography puts the keypoints from where they lie on the twin."""

    per_point_px: tuple[float, ...]
    """Twin px, in the pairs' order."""
    mean_px: float
    sum_px: float
    """The paper's accumulated error."""
    max_px: float
    leave_one_out_mean_px: float | None
    """Mean error of each pair under the fit to all others; None below five pairs, where the others fix no fit."""
    mean_m: float | None = None
    """The same four in metres on the track; None where the twin's scale is not known."""
    sum_m: float | None = None
    max_m: float | None = None
    leave_one_out_mean_m: float | None = None

    def in_metres(self, metres_per_px: float) -> CalibrationError:
        """The same error with its metres filled in."""
        loo = self.leave_one_out_mean_px
        return replace(
            self,
            mean_m=self.mean_px * metres_per_px,
            sum_m=self.sum_px * metres_per_px,
            max_m=self.max_px * metres_per_px,
            leave_one_out_mean_m=None if loo is None else loo * metres_per_px,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class CountError:
    """The error over all pairs of the homography fitted to the first `points` of them."""

    points: int
    mean_px: float
    sum_px: float


def fit_homography(pairs: KeypointPairs) -> Matrix3:
    """The least-squares homography camera px -> twin px, its third coordinate positive at every keypoint.

    Raises `InputError` where the pairs fix none, or one with keypoints on both sides of the horizon.
    """
    matrix = _fit(pairs.camera_array(), pairs.twin_array())
    fault = f"{pairs.source}: no homography fits the keypoints"
    remedy = "check that each camera point has its own twin point, in the same order"
    if matrix is None:
        raise InputError(f"{fault}: {remedy}, and spread over the whole track")
    depth = _homogeneous(matrix, pairs.camera_array())[:, 2]
    if not (np.all(depth > 0) or np.all(depth < 0)):
        odd = [name for name, d in zip(pairs.names, depth, strict=True) if (d > 0) != (np.median(depth) > 0)]
        raise InputError(f"{fault}: {', '.join(odd)} would lie beyond the horizon: {remedy}")
    a, b, c, d, e, f, g, h, i = (matrix * np.sign(depth[0])).ravel().tolist()
    return a, b, c, d, e, f, g, h, i


def fit_ground_map(
    pairs: KeypointPairs, scale: TwinScale, *, width_px: int, height_px: int, lens: Lens | None = None
) -> GroundMap:
    """The ground map of pairs clicked on a picture of the given size. Raises `InputError` as `fit_homography` does."""
    check_inside(pairs, width_px=width_px, height_px=height_px)
    lens = None if lens is None else lens.scaled_to(width_px, height_px)
    matrix = fit_homography(ideal_pairs(pairs, lens))
    return GroundMap(camera_to_twin=matrix, scale=scale, width_px=width_px, height_px=height_px, lens=lens)


def check_inside(pairs: KeypointPairs, *, width_px: int, height_px: int) -> None:
    """Raises `InputError` where camera points lie outside the picture of the given size."""
    outside = [
        name
        for name, (u, v) in zip(pairs.names, pairs.camera_px, strict=True)
        if not (-0.5 <= u <= width_px - 0.5 and -0.5 <= v <= height_px - 0.5)
    ]
    if outside:
        raise InputError(
            f"{pairs.source}: camera keypoints {', '.join(outside)} lie outside the picture of {width_px}x{height_px} "
            "px: give the size of the picture on which they were clicked (image_size)"
        )


def ideal_pairs(pairs: KeypointPairs, lens: Lens | None) -> KeypointPairs:
    """The same pairs with ideal px in place of camera px, for a lens of the size of picture on which they were clicked."""
    if lens is None:
        return pairs
    return replace(pairs, camera_px=tuple((u, v) for u, v in lens.to_ideal_px(pairs.camera_array()).tolist()))


def calibration_error(pairs: KeypointPairs, *, metres_per_px: float | None = None) -> CalibrationError:
    """The error of the homography fitted to all pairs. Raises `InputError` as `fit_homography` does."""
    matrix = np.array(fit_homography(pairs)).reshape(3, 3)
    errors = _errors(matrix, pairs.camera_array(), pairs.twin_array())
    result = CalibrationError(
        per_point_px=tuple(errors.tolist()),
        mean_px=float(errors.mean()),
        sum_px=float(errors.sum()),
        max_px=float(errors.max()),
        leave_one_out_mean_px=_leave_one_out(pairs),
    )
    return result if metres_per_px is None else result.in_metres(metres_per_px)


def error_by_count(pairs: KeypointPairs) -> tuple[CountError, ...]:
    """For N = 4 .. n: the homography fitted to the first N pairs, its error over all n (the paper's figure on
    transformation error). Few pairs may lie badly, three on one line say: that shows as a large error. A count for which
    OpenCV finds no homography at all is left out.
    """
    camera, twin = pairs.camera_array(), pairs.twin_array()
    rows = []
    for count in range(_FEWEST, len(pairs) + 1):
        matrix = _fit(camera[:count], twin[:count])
        if matrix is not None:
            errors = _errors(matrix, camera, twin)
            rows.append(CountError(points=count, mean_px=float(errors.mean()), sum_px=float(errors.sum())))
    return tuple(rows)


def _leave_one_out(pairs: KeypointPairs) -> float | None:
    """Mean error of each pair under the fit to all others; None where the others do not always fix a fit."""
    if len(pairs) <= _FEWEST:
        return None
    camera, twin = pairs.camera_array(), pairs.twin_array()
    errors = []
    for k in range(len(pairs)):
        matrix = _fit(np.delete(camera, k, axis=0), np.delete(twin, k, axis=0))
        if matrix is None:
            return None
        errors.append(float(_errors(matrix, camera[k : k + 1], twin[k : k + 1])[0]))
    return float(np.mean(errors))


def _fit(camera_px: Points, twin_px: Points) -> NDArray[np.float64] | None:
    """OpenCV's least-squares homography (3, 3); None where the points fix none."""
    matrix, _ = cv2.findHomography(camera_px, twin_px, 0)
    if matrix is None or matrix.shape != (3, 3) or not np.isfinite(matrix).all():
        return None
    return np.asarray(matrix, dtype=np.float64)


def _homogeneous(matrix: NDArray[np.float64], points: Points) -> NDArray[np.float64]:
    return np.column_stack((points, np.ones(len(points)))) @ matrix.T


def _errors(matrix: NDArray[np.float64], camera_px: Points, twin_px: Points) -> NDArray[np.float64]:
    # perspectiveTransform puts a point of no depth at the twin's origin, so a degenerate fit has a finite, large error
    # instead of one that rounding decides.
    mapped = cv2.perspectiveTransform(np.ascontiguousarray(camera_px, dtype=np.float64)[:, None, :], matrix)[:, 0]
    apart = np.asarray(mapped, dtype=np.float64) - twin_px
    return np.asarray(np.hypot(apart[:, 0], apart[:, 1]), dtype=np.float64)
