"""The residuals of floor markers about one start, and the solution with the least of them: bundle adjustment.

Knows corners with their covariance and what was measured; which markers count is `marker_solve`'s knowledge. After Triggs et
al., Bundle Adjustment - A Modern Synthesis (2000), over the plane's tilt and distance and each square's place and turn; where
no lens is known also its focal length, its optical centre and its first radial coefficient, the last two held near what lenses
have.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.view.least_squares import Fit, fit_at, minimise
from dnb_edge.view.marker_edges import MarkerFit
from dnb_edge.view.marker_solution import (
    BASE,
    MarkerSolution,
    MeasuredPoint,
    Optics,
    fit_frame,
    floor_homography,
    lens_like,
    to_frame,
)
from dnb_edge.view.marker_start import CORNERS, Start, local_points, turn

FloatArray = NDArray[np.float64]

_HEIGHT_SIGMA = 0.01
"""How well people measure the camera's height, as a share of it, one standard deviation."""
_OFF_CENTRE_SIGMA = 0.01
"""How far an unknown lens's optical centre is from the picture's middle along either axis, as a share of the width."""
_BENDING_SIGMA = 0.15
"""Size of k1 of an unknown lens."""
_STEP = 1e-6
_UNBEND_ROUNDS = 12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MarkerProblem:
    """The residuals of one set of markers about one start."""

    markers: tuple[MarkerFit, ...]
    optics: Optics
    size_m: float
    height_m: float | None
    measured: tuple[MeasuredPoint, ...]
    start: Start

    def solve(self, aside: tuple[int, ...]) -> MarkerSolution | None:
        """The solution nearest to the start; None where there is none."""
        count = len(self.markers)
        middles = np.column_stack((self._middles_px(), self.start.places[:, 2]))
        first = np.concatenate((np.zeros(BASE), middles.ravel(), np.zeros(3)))
        free = np.ones(len(first), dtype=np.bool_)
        free[3:BASE] = self.optics.lens is None
        free[-3:] = bool(self.measured)
        # By tilt, height and places on the floor every step would have to turn all of them at once; by the middles' pixels,
        # and the height in focal lengths, it need not, and the search arrives. The covariance is that of the former.
        found = minimise(lambda q: self._residuals(self._on_floor(q)), first, free)
        fit = None if found is None else fit_at(self._residuals, self._on_floor(found.parameters), free)
        if fit is None:
            return None
        misfit = math.sqrt(fit.cost / fit.freedom)
        p = fit.parameters
        try:
            lens = self.optics.lens if self.optics.lens is not None else lens_like(self.start.lens, p)
        except InputError:
            return None  # bent so far that the picture folds over: no lens does that
        return MarkerSolution(
            optics=self.optics,
            size_m=self.size_m,
            rotation=self._rotation(p),
            height_m=self._height(p),
            lens=lens,
            numbers=tuple(marker.number for marker in self.markers),
            corners_px=np.array([marker.camera_px for marker in self.markers]),
            places=p[BASE : BASE + 3 * count].reshape(count, 3),
            frame=p[-3:],
            covariance=self._with_lens_sigmas(fit, max(1.0, misfit) ** 2),
            residual_px=np.linalg.norm(self._apart(p), axis=2),
            aside=aside,
            misfit=misfit,
        )

    def _middles_px(self) -> FloatArray:
        """(n, 2) middles of the squares as the start has them, ideal px of its lens."""
        lens = self.start.lens
        matrix = floor_homography(lens.matrix, self.start.rotation, self.start.height_m)
        at = np.column_stack((self.start.places[:, :2], np.ones(len(self.markers)))) @ matrix.T
        return np.asarray(at[:, :2] / at[:, 2:])

    def _on_floor(self, q: FloatArray) -> FloatArray:
        """The parameters for `q`, which has the logarithm of the height in focal lengths, the squares' middles in px, and the
        measured frame as what is to be added to the one that fits best."""
        p = q.copy()
        p[2] += q[3]
        lens = self.start.lens
        focal = np.array([lens.fx_px, lens.fy_px]) * math.exp(min(float(q[3]), 50.0))
        bent = (q[BASE:-3].reshape(-1, 3)[:, :2] - (lens.cx_px, lens.cy_px) - q[4:6]) / focal
        ahead = bent
        for _ in range(_UNBEND_ROUNDS):
            ahead = bent / (1.0 + q[6] * (ahead**2).sum(axis=1, keepdims=True))
        down = np.column_stack((ahead, np.ones(len(ahead)))) @ self._rotation(p)
        reach = self._height(p) / np.where(down[:, 2] < 0.0, -down[:, 2], np.nan)
        places = p[BASE:-3].reshape(-1, 3)
        places[:, :2] = down[:, :2] * reach[:, None]
        if self.measured:
            p[-3:] += self._best_frame(places)
        return p

    def _rotation(self, p: FloatArray) -> FloatArray:
        return np.asarray(self.start.rotation @ turn(np.array([p[0], p[1], 0.0])))

    def _height(self, p: FloatArray) -> float:
        return self.start.height_m * math.exp(min(float(p[2]), 50.0))

    def _apart(self, p: FloatArray) -> FloatArray:
        """(n, 4, 2) of where the corners are seen less where `p` has them, ideal px of a known lens, else camera px."""
        flat = floor_homography(np.eye(3), self._rotation(p), self._height(p))
        x, y, angle = p[BASE:-3].reshape(-1, 3).T[:, :, None]
        across, up = self.size_m * CORNERS.T[:, None, :]
        points = np.stack(
            (x + np.cos(angle) * across - np.sin(angle) * up, y + np.sin(angle) * across + np.cos(angle) * up), axis=2
        )
        homogeneous = np.concatenate((points, np.ones((*points.shape[:2], 1))), axis=2) @ flat.T
        depth = homogeneous[..., 2:]
        ahead = homogeneous[..., :2] / np.where(depth > 0.0, depth, np.nan)
        # What is not estimated is zero in `p`: a known lens is one without bending.
        bent = ahead * (1.0 + p[6] * (ahead**2).sum(axis=2, keepdims=True))
        lens = self.start.lens
        focal = np.array([lens.fx_px, lens.fy_px]) * math.exp(min(float(p[3]), 50.0))
        return np.asarray(ideal_px(self.markers, self.optics) - bent * focal - (lens.cx_px, lens.cy_px) - p[4:6])

    def _residuals(self, p: FloatArray) -> FloatArray:
        apart = self._apart(p).reshape(len(self.markers), 8)
        parts = [np.einsum("nij,nj->ni", self._whitening(), apart).ravel()]
        if self.optics.lens is None:
            parts += [p[4:6] / (_OFF_CENTRE_SIGMA * self.optics.width_px), p[6:7] / _BENDING_SIGMA]
        if self.height_m is not None:
            parts.append(np.array([math.log(self._height(p) / self.height_m) / _HEIGHT_SIGMA]))
        places = dict(zip((marker.number for marker in self.markers), p[BASE:-3].reshape(-1, 3), strict=True))
        for point in self.measured:
            at = local_points([point.local], places[point.number], self.size_m)
            parts.append((to_frame(at, p[-3:])[0] - point.at_m) / point.sigma_m)
        return np.concatenate(parts)

    def _whitening(self) -> FloatArray:
        # With L L^T = C^-1 the elements of L^T r are independent and of unit variance.
        inverse = np.linalg.inv(np.array([marker.covariance_px2 for marker in self.markers]))
        return np.asarray(np.linalg.cholesky(inverse).transpose(0, 2, 1))

    def _with_lens_sigmas(self, fit: Fit, factor: float) -> FloatArray:
        """The covariance where the given lens is not quite right either: its numbers are not estimated, but count ("consider"
        parameters; Jazwinski, Stochastic Processes and Filtering Theory, 1970, 8.4)."""
        total = fit.inverse * factor
        sigmas = self.optics.lens_sigmas
        if self.optics.lens is None or not any(sigmas):
            return total
        for k, sigma in zip((3, 4, 5), sigmas, strict=True):
            step = np.zeros(len(fit.parameters))
            step[k] = _STEP
            slope = (self._residuals(fit.parameters + step) - self._residuals(fit.parameters - step)) / (2.0 * _STEP)
            moved = -fit.inverse @ fit.jacobian.T @ slope
            moved[k] = 1.0
            total = total + np.outer(moved, moved) * sigma**2
        return np.asarray(total)

    def _best_frame(self, places: FloatArray) -> FloatArray:
        """The measured frame (3,) that fits `places` (n, 3) best."""
        if not np.isfinite(places).all():
            return np.full(3, np.nan)
        by_number = dict(zip((marker.number for marker in self.markers), places, strict=True))
        here = np.array([local_points([m.local], by_number[m.number], self.size_m)[0] for m in self.measured])
        return fit_frame(here, np.array([m.at_m for m in self.measured]))


def ideal_px(markers: Sequence[MarkerFit], optics: Optics) -> FloatArray:
    """(n, 4, 2) corners, ideal px where the lens is known, else camera px."""
    corners = np.array([marker.camera_px for marker in markers])
    return corners if optics.lens is None else optics.lens.to_ideal_px(corners.reshape(-1, 2)).reshape(-1, 4, 2)
