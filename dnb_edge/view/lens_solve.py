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
_DONE = 1e-12
_ROBUST_ROUNDS = 12


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
    """(4 + k,) fx, fy, cx, cy, then the distortion."""
    poses: Numbers
    """(views, 6) rotation vector and translation, board m to camera axes."""

    @property
    def matrix(self) -> Numbers:
        """(3, 3) intrinsic matrix, px."""
        fx, fy, cx, cy = self.lens[:4]
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])

    def off_px(self, seen: Sequence[Seen]) -> list[Points]:
        """(n, 2) for each view: where the corners should be less where they were seen, camera px."""
        return [self._projected(view, pose)[0] - view.camera_px for view, pose in zip(seen, self.poses, strict=True)]

    def linearised(self, view: Seen, pose: Numbers) -> tuple[Numbers, Numbers, Numbers]:
        """Residual (2n,) and its derivatives by the lens (2n, 4 + k) and by the pose (2n, 6)."""
        points, slopes = self._projected(view, pose)
        k = len(self.lens) - 4
        if self.model is LensModel.FISHEYE:
            by_lens, by_pose = slopes[:, :8], slopes[:, 8:14]
        else:
            by_lens, by_pose = slopes[:, 6 : 10 + k], slopes[:, :6]
        return (points - view.camera_px).ravel(), by_lens, by_pose

    def _projected(self, view: Seen, pose: Numbers) -> tuple[Points, Numbers]:
        flat = np.column_stack((view.board_m, np.zeros(len(view.board_m)))).reshape(-1, 1, 3)
        bent = np.ascontiguousarray(self.lens[4:])
        project = cv2.fisheye.projectPoints if self.model is LensModel.FISHEYE else cv2.projectPoints
        points, slopes = project(flat, pose[:3].copy(), pose[3:].copy(), self.matrix, bent)
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
        found = descend(found, seen, [1.0 / (1.0 + (away / scale) ** 2) for away in apart])
    return found


def descend(start: Solution, seen: Sequence[Seen], weights: Sequence[Numbers]) -> Solution:
    """The nearest minimum of the weighted sum of squares, from `start`; `weights`: (n,) for each view."""
    found, cost, damping = start, _cost(start, seen, weights), 1e-3
    for _ in range(_MOST_STEPS):
        normal, slope = normal_equations(found, seen, weights)
        scale = np.sqrt(np.maximum(np.diag(normal), 1e-30))
        scaled = normal / np.outer(scale, scale)
        while damping < 1e12:
            step = np.linalg.solve(scaled + damping * np.eye(len(scaled)), -slope / scale) / scale
            tried = _moved(found, step)
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


def normal_equations(at: Solution, seen: Sequence[Seen], weights: Sequence[Numbers]) -> tuple[Numbers, Numbers]:
    """J'WJ (p, p) and J'Wr (p,), the lens first, then each view's pose."""
    k, p = len(at.lens), len(at.lens) + 6 * len(seen)
    normal, slope = np.zeros((p, p)), np.zeros(p)
    for i, (view, weight) in enumerate(zip(seen, weights, strict=True)):
        off, by_lens, by_pose = at.linearised(view, at.poses[i])
        heavy = np.repeat(weight, 2)[:, None]
        own = slice(k + 6 * i, k + 6 * i + 6)
        normal[:k, :k] += by_lens.T @ (heavy * by_lens)
        normal[:k, own] = by_lens.T @ (heavy * by_pose)
        normal[own, :k] = normal[:k, own].T
        normal[own, own] = by_pose.T @ (heavy * by_pose)
        slope[:k] += by_lens.T @ (heavy[:, 0] * off)
        slope[own] = by_pose.T @ (heavy[:, 0] * off)
    return normal, slope


def lens_sigmas(at: Solution, seen: Sequence[Seen]) -> Numbers | None:
    """(4 + k,) sigma of each of the lens's numbers; None where the views do not determine them.

    The larger of two estimates: every corner errs for itself; or a view's corners err together (a bent board, say), in
    which case the views are the independent things (the sandwich of clustered regression).
    """
    ones = [np.ones(len(view.board_m)) for view in seen]
    normal, _ = normal_equations(at, seen, ones)
    spare = 2 * sum(len(view.board_m) for view in seen) - len(normal)
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-30))
    scaled = normal / np.outer(scale, scale)
    if spare <= 0 or np.linalg.cond(scaled) > 1e13:
        return None
    inverse = np.linalg.inv(scaled) / np.outer(scale, scale)
    k = len(at.lens)
    plain = np.diag(inverse)[:k] * 2.0 * _cost(at, seen, ones) / spare
    clustered = np.zeros(k)
    for i, view in enumerate(seen):
        off, by_lens, by_pose = at.linearised(view, at.poses[i])
        pull = inverse[:k, :k] @ (by_lens.T @ off) + inverse[:k, k + 6 * i : k + 6 * i + 6] @ (by_pose.T @ off)
        clustered += pull**2
    return np.asarray(np.sqrt(np.maximum(plain, clustered * len(seen) / max(1, len(seen) - 1))))


def _cost(at: Solution, seen: Sequence[Seen], weights: Sequence[Numbers]) -> float:
    """Half the weighted sum of squares, px^2."""
    total = 0.5 * sum(
        float(weight @ np.sum(off**2, axis=1)) for off, weight in zip(at.off_px(seen), weights, strict=True)
    )
    return total if np.isfinite(total) else np.inf


def _moved(at: Solution, step: Numbers) -> Solution:
    k = len(at.lens)
    return replace(at, lens=at.lens + step[:k], poses=at.poses + step[k:].reshape(-1, 6))


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
