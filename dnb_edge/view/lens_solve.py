"""Least squares for a lens: the matrix, distortion and board poses that explain corners seen in several pictures.

Knows both of OpenCV's lens formulas (through its projections and their derivatives) and Levenberg and Marquardt's method; the
start comes from trying focal lengths. One way for both models, since OpenCV's own two differ in flags, in the errors that
they tell and between its versions. Judges nothing: `lens_fit` does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import Points
from dnb_edge.view.lens import LensModel

Numbers = NDArray[np.float64]

_FOCAL_RATIOS = {
    LensModel.PINHOLE: np.geomspace(0.3, 4.0, 14),
    LensModel.FISHEYE: np.geomspace(0.15, 1.2, 12),
}
"""Focal lengths to start from, as shares of the picture's longer side."""
_WIDEST_RAD = 1.45
_MOST_STEPS = 200
_DONE = 1e-10
_ROBUST_ROUNDS = 12
_SETTLED = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Seen:
    """One picture's corners."""

    board_m: Points
    """(n, 2) board m."""
    camera_px: Points
    """(n, 2) camera px."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution:
    """A lens and the board's poses before it."""

    model: LensModel
    lens: Numbers
    """(4 + k,) fx, fy, cx, cy, then the first k coefficients of the distortion; the others are nought."""
    poses: Numbers
    """(views, 6) rotation vector and translation, board m to camera axes."""

    @property
    def matrix(self) -> Numbers:
        """(3, 3) intrinsic matrix, px."""
        fx, fy, cx, cy = self.lens[:4]
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])

    @property
    def distortion(self) -> Numbers:
        """(4,), or as many as are fitted where those are more: OpenCV takes no fewer."""
        return np.concatenate((self.lens[4:], np.zeros(max(0, 8 - len(self.lens)))))

    def off_px(self, seen: Sequence[Seen]) -> list[Points]:
        """(n, 2) for each view: where the corners should be less where they were seen, camera px."""
        return [self._projected(view, pose)[0] - view.camera_px for view, pose in zip(seen, self.poses, strict=True)]

    def linearised(self, view: Seen, pose: Numbers) -> tuple[Numbers, Numbers, Numbers]:
        """Residual (2n,) and its derivatives by the lens (2n, 4 + k) and by the pose (2n, 6)."""
        points, slopes = self._projected(view, pose)
        k = len(self.lens) - 4
        if self.model is LensModel.FISHEYE:
            by_lens, by_pose = slopes[:, : 4 + k], slopes[:, 8:14]
        else:
            by_lens, by_pose = slopes[:, 6 : 10 + k], slopes[:, :6]
        return (points - view.camera_px).ravel(), by_lens, by_pose

    def _projected(self, view: Seen, pose: Numbers) -> tuple[Points, Numbers]:
        flat = np.column_stack((view.board_m, np.zeros(len(view.board_m)))).reshape(-1, 1, 3)
        project = cv2.fisheye.projectPoints if self.model is LensModel.FISHEYE else cv2.projectPoints
        points, slopes = project(flat, pose[:3].copy(), pose[3:].copy(), self.matrix, self.distortion)
        return np.asarray(points, dtype=np.float64).reshape(-1, 2), np.asarray(slopes, dtype=np.float64)


def solve(
    seen: Sequence[Seen], size_px: tuple[int, int], model: LensModel, coefficients: int, *, robust: bool = False
) -> Solution:
    """The solution with the least sum of squares over all corners of all views. `robust`: corners that lie far from the
    rest count less (Cauchy's weights), so that a wrong view cannot pull the others along. `size_px`: width, height.
    """
    found = descend(_start(seen, size_px, model, coefficients), seen, [np.ones(len(view.board_m)) for view in seen])
    if not robust:
        return found
    for _ in range(_ROBUST_ROUNDS):
        apart = [np.linalg.norm(off, axis=1) for off in found.off_px(seen)]
        scale = max(1e-6, 2.0 * float(np.median(np.concatenate(apart))))
        before = found
        found = descend(found, seen, [1.0 / (1.0 + (away / scale) ** 2) for away in apart])
        if np.abs(found.lens / before.lens - 1.0).max() < _SETTLED:
            break
    return found


def descend(start: Solution, seen: Sequence[Seen], weights: Sequence[Numbers]) -> Solution:
    """The nearest minimum of the weighted sum of squares, from `start`; `weights`: (n,) for each view."""
    found, cost, damping = start, _cost(start, seen, weights), 1e-3
    for _ in range(_MOST_STEPS):
        normal = normal_equations(found, seen, weights)
        while damping < 1e12:
            tried = _moved(found, normal.step(damping))
            new = _cost(tried, seen, weights)
            if new < cost:
                break
            damping *= 10.0
        else:
            return found
        gained, found, cost, damping = cost - new, tried, new, max(1e-12, damping / 10.0)
        if gained <= _DONE * cost:
            return found
    return found


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Normal:
    """The normal equations in blocks: a view's pose meets the lens only, no other view's pose."""

    lens: Numbers
    """(k, k)"""
    both: Numbers
    """(views, k, 6)"""
    poses: Numbers
    """(views, 6, 6)"""
    lens_slope: Numbers
    """(k,)"""
    pose_slopes: Numbers
    """(views, 6)"""

    def reduced(self, damping: float = 0.0) -> tuple[Numbers, Numbers]:
        """(k, k) for the lens alone, the poses being free, and (views, 6, k) how the poses follow it; Marquardt's damping."""
        lens = self.lens + damping * np.diag(np.diag(self.lens))
        poses = self.poses + damping * self.poses * np.eye(6)
        follow = np.linalg.solve(poses, self.both.transpose(0, 2, 1))
        return np.asarray(lens - np.einsum("vki,vij->kj", self.both, follow)), np.asarray(follow)

    def step(self, damping: float) -> tuple[Numbers, Numbers]:
        """What to add to the lens (k,) and to the poses (views, 6)."""
        reduced, follow = self.reduced(damping)
        slope = self.lens_slope - np.einsum("vik,vi->k", follow, self.pose_slopes)
        scale = np.sqrt(np.maximum(np.diag(self.lens), 1e-30))
        lens = -np.linalg.lstsq(reduced / np.outer(scale, scale), slope / scale, rcond=1e-15)[0] / scale
        poses = self.poses + damping * self.poses * np.eye(6)
        own = np.linalg.solve(poses, self.pose_slopes[:, :, None])[:, :, 0]
        return lens, -own - follow @ lens


def normal_equations(at: Solution, seen: Sequence[Seen], weights: Sequence[Numbers]) -> Normal:
    """J'WJ and J'Wr at a solution; `weights`: (n,) for each view."""
    k, count = len(at.lens), len(seen)
    lens, lens_slope = np.zeros((k, k)), np.zeros(k)
    both, poses, pose_slopes = np.zeros((count, k, 6)), np.zeros((count, 6, 6)), np.zeros((count, 6))
    for i, (view, weight) in enumerate(zip(seen, weights, strict=True)):
        off, by_lens, by_pose = at.linearised(view, at.poses[i])
        heavy = np.repeat(weight, 2)
        lens += by_lens.T @ (heavy[:, None] * by_lens)
        lens_slope += by_lens.T @ (heavy * off)
        both[i] = by_lens.T @ (heavy[:, None] * by_pose)
        poses[i] = by_pose.T @ (heavy[:, None] * by_pose)
        pose_slopes[i] = by_pose.T @ (heavy * off)
    return Normal(lens=lens, both=both, poses=poses, lens_slope=lens_slope, pose_slopes=pose_slopes)


def lens_sigmas(at: Solution, seen: Sequence[Seen]) -> Numbers | None:
    """(4 + k,) sigma of each of the lens's numbers; None where the views do not determine them.

    The larger of two estimates: every corner errs for itself; or a view's corners err together (a bent board, say), in
    which case the views are the independent things (the sandwich of clustered regression).
    """
    ones = [np.ones(len(view.board_m)) for view in seen]
    reduced, follow = normal_equations(at, seen, ones).reduced()
    spare = 2 * sum(len(view.board_m) for view in seen) - len(at.lens) - at.poses.size
    scale = np.sqrt(np.maximum(np.diag(reduced), 1e-30))
    scaled = reduced / np.outer(scale, scale)
    if spare <= 0 or not np.isfinite(scaled).all() or np.linalg.cond(scaled) > 1e13:
        return None
    inverse = np.linalg.inv(scaled) / np.outer(scale, scale)
    plain = np.diag(inverse) * 2.0 * _cost(at, seen, ones) / spare
    clustered = np.zeros(len(at.lens))
    for view, pose, follows in zip(seen, at.poses, follow, strict=True):
        off, by_lens, by_pose = at.linearised(view, pose)
        clustered += (inverse @ ((by_lens - by_pose @ follows).T @ off)) ** 2
    return np.asarray(np.sqrt(np.maximum(plain, clustered * len(seen) / max(1, len(seen) - 1))))


def _cost(at: Solution, seen: Sequence[Seen], weights: Sequence[Numbers]) -> float:
    """Half the weighted sum of squares, px^2."""
    total = 0.5 * sum(
        float(weight @ np.sum(off**2, axis=1)) for off, weight in zip(at.off_px(seen), weights, strict=True)
    )
    return total if np.isfinite(total) else np.inf


def _moved(at: Solution, step: tuple[Numbers, Numbers]) -> Solution:
    return replace(at, lens=at.lens + step[0], poses=at.poses + step[1])


def _start(seen: Sequence[Seen], size_px: tuple[int, int], model: LensModel, coefficients: int) -> Solution:
    """No distortion, centre in the middle, and of all focal lengths tried the one that explains the corners best."""
    width, height = size_px
    best, least = None, np.inf
    for ratio in _FOCAL_RATIOS[model]:
        focal = ratio * max(width, height)
        lens = np.array([focal, focal, (width - 1) / 2, (height - 1) / 2, *[0.0] * coefficients])
        poses = np.array([pose_of(view, lens, model) for view in seen])
        tried = Solution(model=model, lens=lens, poses=poses)
        cost = _cost(tried, seen, [np.ones(len(view.board_m)) for view in seen])
        if best is None or cost < least:
            best, least = tried, cost
    assert best is not None
    return best


def pose_of(view: Seen, lens: Numbers, model: LensModel) -> Numbers:
    """(6,) the pose of one board seen through a lens without distortion."""
    rays = (view.camera_px - lens[2:4]) / lens[:2]
    if model is LensModel.FISHEYE:
        angle = np.maximum(np.hypot(rays[:, 0], rays[:, 1]), 1e-12)
        rays = rays * (np.tan(np.minimum(angle, _WIDEST_RAD)) / angle)[:, None]
    flat = np.column_stack((view.board_m, np.zeros(len(view.board_m))))
    _, turn, shift = cv2.solvePnP(flat, np.ascontiguousarray(rays), np.eye(3), np.zeros(4), flags=cv2.SOLVEPNP_IPPE)
    return np.concatenate((np.asarray(turn).ravel(), np.asarray(shift).ravel()))
