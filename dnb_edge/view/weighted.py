"""The homography of greatest likelihood for points whose places in the picture and on the twin are known to stated sigmas.

Knows points, the covariance of each, and Gauss and Newton's way to the best map. Knows no names, no outliers and no file:
`fit` makes a calibration of it, `outliers` judges the points by it.

The map G takes twin px to ideal px. With the click at p (ideal px, covariance C) and its twin point at q (variance t of either
coordinate), the residual e = p - G(q) has to first order the covariance S = C + t K K', K = dG/dq; the sum of e' S^-1 e is
least. Without noise on the twin that is maximum likelihood (the reprojection error of Hartley and Zisserman, Multiple View
Geometry, 4.2.3); with it, Sampson's first-order form of it, S taken at the current map. G has nine numbers and eight freedoms:
steps are taken in the tangent of the unit sphere of nine, on points normalised as ibid. 4.4.4, and the covariance of the eight
(ibid. 5.2.2) is carried to the nine of the inverse, ideal px -> twin px.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import Points
from dnb_edge.view.ground import Matrix3

Floats = NDArray[np.float64]

_STEPS = 60
_DONE = 1e-14
"""Squared length of a step, in sigmas, after which the map is taken as found."""
_DAMPED_AWAY = 1e12
_LEAST_DEPTH = 1e-9


class NoFitError(Exception):
    """The points fix no map with all of them on the floor."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WeightedPoints:
    """n places, in the picture and on the twin, with what is known of their noise."""

    ideal_px: Points
    """(n, 2), through the lens."""
    twin_px: Points
    """(n, 2)."""
    click_cov_px2: Floats
    """(n, 2, 2), covariance of `ideal_px`."""
    twin_var_px2: Floats
    """(n,), variance of either coordinate of `twin_px`."""

    def __len__(self) -> int:
        return len(self.ideal_px)

    def at(self, chosen: NDArray[np.intp]) -> WeightedPoints:
        """Some of the places."""
        return WeightedPoints(
            ideal_px=self.ideal_px[chosen],
            twin_px=self.twin_px[chosen],
            click_cov_px2=self.click_cov_px2[chosen],
            twin_var_px2=self.twin_var_px2[chosen],
        )

    def without(self, left_out: list[int]) -> WeightedPoints:
        """All places but those."""
        return self.at(np.delete(np.arange(len(self)), left_out))


@dataclass(frozen=True)  # no slots: the covariance is computed when it is first asked for
class WeightedFit:
    """The best map, in normalised coordinates, with its information."""

    twin_to_ideal: Floats
    """(3, 3), normalised twin -> normalised ideal; its third coordinate is positive at the points."""
    information: Floats
    """(8, 8), of the step's eight numbers."""
    basis: Floats
    """(9, 8): the step's eight numbers as the nine of `twin_to_ideal`."""
    normalise_ideal: Floats
    normalise_twin: Floats
    """(3, 3), from px to normalised coordinates."""
    chi_squared: float
    """Sum of e' S^-1 e at the map: about 2 n - 8 where the stated noise is true."""
    depth: float
    """Third coordinate, ideal px -> twin px, that the points have on average; set to 1 in the stored matrix."""

    @cached_property
    def inverse_covariance(self) -> Floats:
        """(8, 8), the covariance of the step's eight numbers."""
        # The pseudo-inverse: places that hardly fix the map must give a great sigma and not an error.
        return np.asarray(np.linalg.pinv(self.information, hermitian=True, rcond=1e-15))

    @property
    def matrix(self) -> Floats:
        """(3, 3) ideal px -> twin px, about 1 in its third coordinate at the points."""
        inverse = np.linalg.solve(self.twin_to_ideal, self.normalise_ideal)
        return np.asarray(np.linalg.solve(self.normalise_twin, inverse) / self.depth)

    @property
    def camera_to_twin(self) -> Matrix3:
        """`matrix`, row by row."""
        a, b, c, d, e, f, g, h, i = self.matrix.ravel().tolist()
        return a, b, c, d, e, f, g, h, i

    def covariance(self, factor: float = 1.0) -> Floats:
        """(9, 9), of rank 8: covariance of `camera_to_twin`'s nine numbers, `factor` times that of the stated noise."""
        # d(G^-1) = -G^-1 dG G^-1, and for numbers row by row A dG B is kron(A, B').
        left = np.linalg.inv(self.twin_to_ideal @ self.normalise_twin) / self.depth
        right = np.linalg.solve(self.twin_to_ideal, self.normalise_ideal)
        carried = np.kron(left, right.T) @ self.basis
        covariance = carried @ (self.inverse_covariance * factor) @ carried.T
        return np.asarray(0.5 * (covariance + covariance.T))

    def to_twin_px(self, ideal_px: Points) -> Points:
        """Twin px (n, 2) of ideal px (n, 2); raises `NoFitError` beyond the horizon."""
        x = _homogeneous(ideal_px) @ self.matrix.T
        if not (x[:, 2] > 0).all():
            raise NoFitError
        return np.asarray(x[:, :2] / x[:, 2:])

    def apart(self, points: WeightedPoints) -> tuple[Floats, Floats]:
        """Residuals (n, 2), ideal px, of any places, and their covariance (n, 2, 2) if they took no part in the fit: noise
        of the place and of the map. Infinite residuals, and no covariance, for places behind the camera.
        """
        at = _Normalised.of(points, self.normalise_ideal, self.normalise_twin).anywhere(self.twin_to_ideal)
        by_step = at.by_nine @ self.basis
        covariance = at.noise + by_step @ self.inverse_covariance @ by_step.transpose(0, 2, 1)
        behind = at.depth <= _LEAST_DEPTH
        residual = np.where(behind[:, None], np.inf, at.residual)
        covariance = np.where(behind[:, None, None], np.eye(2), covariance)
        px = 1.0 / self.normalise_ideal[0, 0]
        return residual * px, covariance * px**2

    def distances(self, points: WeightedPoints) -> Floats:
        """(n,) squared distances, in sigmas, of any places from where the map puts them, as if they took no part in the fit;
        infinite behind the camera.
        """
        residual, covariance = self.apart(points)
        seen = np.isfinite(residual).all(axis=1)
        squares = np.full(len(points), np.inf)
        squares[seen] = ((_whitener(covariance[seen]) @ residual[seen, :, None]) ** 2).sum(axis=(1, 2))
        return squares


def fit_weighted(points: WeightedPoints, start: Floats | None = None) -> WeightedFit:
    """The best map through at least four places; `start` (3, 3), ideal px -> twin px, is a guess of it (None: plain least
    squares). Raises `NoFitError` where the places fix none, or only one that folds them over the horizon.
    """
    if start is None:
        start = plain_fit(points.ideal_px, points.twin_px)
    to_ideal, to_twin = _normaliser(points.ideal_px), _normaliser(points.twin_px)
    given = _Normalised.of(points, to_ideal, to_twin)
    g = _signed(to_ideal @ np.linalg.inv(start) @ np.linalg.inv(to_twin), given.twin)
    at = given.at(g)
    if at is None:
        raise NoFitError
    damping = 1e-9
    for _ in range(_STEPS):
        basis = _tangent(g)
        white = _whitener(at.noise)
        by_step = (white @ at.by_nine @ basis).reshape(-1, 8)
        residual = (white @ at.residual[:, :, None]).ravel()
        information, slope = by_step.T @ by_step, by_step.T @ residual
        chi_squared = float(residual @ residual)
        moved = None
        while moved is None:
            step = _solve(information + damping * np.diag(np.diag(information)), slope)
            moved = given.at(_unit(g + (basis @ step).reshape(3, 3)))
            # Judged by the weights of before the step: those of after it belong to another sum.
            if moved is None or _sum(white, moved.residual) > chi_squared * (1 + 1e-9) + 1e-12:
                moved, damping = None, max(damping, 1e-6) * 10.0
                if damping > _DAMPED_AWAY:
                    break
        length = float(step @ information @ step)
        if moved is None or length < _DONE:
            break
        g, at, damping = moved.map, moved, damping / 10.0
    depths = (_homogeneous(points.ideal_px) @ _inverse_map(g, to_ideal, to_twin).T)[:, 2]
    if not (depths > 0).all():
        raise NoFitError
    return WeightedFit(
        twin_to_ideal=g, information=information, basis=basis, normalise_ideal=to_ideal, normalise_twin=to_twin,
        chi_squared=chi_squared, depth=float(depths.mean()),
    )  # fmt: skip


def plain_fit(ideal_px: Points, twin_px: Points) -> Floats:
    """OpenCV's least squares, (3, 3) ideal px -> twin px. Raises `NoFitError` where there is none."""
    matrix, _ = cv2.findHomography(ideal_px, twin_px, 0)
    if matrix is None or not np.isfinite(matrix).all() or abs(np.linalg.det(matrix)) < 1e-30:
        raise NoFitError
    return np.asarray(matrix, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class _At:
    """What the normalised points say of one map."""

    map: Floats
    residual: Floats
    noise: Floats
    by_nine: Floats
    """(n, 2, 9), derivative of the predicted point by the map's nine numbers."""
    depth: Floats
    """(n,), third coordinate; positive ahead of the camera."""


@dataclass(frozen=True, slots=True)
class _Normalised:
    ideal: Points
    twin: Floats
    """(n, 3), homogeneous."""
    click_cov: Floats
    twin_var: Floats

    @classmethod
    def of(cls, points: WeightedPoints, to_ideal: Floats, to_twin: Floats) -> _Normalised:
        ideal = points.ideal_px * to_ideal[0, 0] + to_ideal[:2, 2]
        twin = points.twin_px * to_twin[0, 0] + to_twin[:2, 2]
        return cls(
            ideal,
            _homogeneous(twin),
            points.click_cov_px2 * to_ideal[0, 0] ** 2,
            points.twin_var_px2 * to_twin[0, 0] ** 2,
        )

    def at(self, g: Floats) -> _At | None:
        """None where a point would lie behind the camera."""
        return self.anywhere(g) if ((self.twin @ g[2]) > _LEAST_DEPTH).all() else None

    def anywhere(self, g: Floats) -> _At:
        """The same with numbers that mean nothing for points behind the camera."""
        x = self.twin @ g.T
        depth = x[:, 2]
        w = np.maximum(depth, _LEAST_DEPTH)
        predicted = x[:, :2] / w[:, None]
        by_twin = (g[None, :2, :2] - predicted[:, :, None] * g[None, 2:, :2]) / w[:, None, None]
        noise = self.click_cov + self.twin_var[:, None, None] * (by_twin @ by_twin.transpose(0, 2, 1))
        scaled = self.twin / w[:, None]
        by_nine = np.zeros((len(w), 2, 9))
        by_nine[:, 0, 0:3] = scaled
        by_nine[:, 1, 3:6] = scaled
        by_nine[:, :, 6:9] = -predicted[:, :, None] * scaled[:, None, :]
        return _At(g, self.ideal - predicted, noise, by_nine, depth)


def _sum(white: Floats, residual: Floats) -> float:
    return float(((white @ residual[:, :, None]) ** 2).sum())


def _whitener(noise: Floats) -> Floats:
    """(n, 2, 2) W with W' W the inverse of each covariance."""
    a, b, d = noise[:, 0, 0], noise[:, 0, 1], noise[:, 1, 1]
    root = np.sqrt(a)
    lower = b / root
    # Near the horizon the twin's noise is so long and thin that rounding may make its square negative.
    rest = np.sqrt(np.maximum(d - lower**2, 1e-12 * d))
    white = np.zeros_like(noise)
    white[:, 0, 0] = 1.0 / root
    white[:, 1, 0] = -lower / (root * rest)
    white[:, 1, 1] = 1.0 / rest
    return white


def _solve(matrix: Floats, right: Floats) -> Floats:
    try:
        return np.asarray(np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(matrix, hermitian=True) @ right)


def _tangent(g: Floats) -> Floats:
    """(9, 8): an orthonormal basis of the steps that leave the length of g's nine numbers."""
    _, _, vt = np.linalg.svd(g.reshape(1, 9))
    return np.asarray(vt[1:].T)


def _unit(g: Floats) -> Floats:
    return np.asarray(g / np.linalg.norm(g))


def _signed(g: Floats, twin: Floats) -> Floats:
    """g at unit length, of the sign that has most points ahead of the camera."""
    ahead = float(np.median((twin @ g.T)[:, 2]))
    return _unit(-g if ahead < 0 else g)


def _inverse_map(g: Floats, to_ideal: Floats, to_twin: Floats) -> Floats:
    return np.asarray(np.linalg.solve(to_twin, np.linalg.solve(g, to_ideal)))


def _homogeneous(points: Points) -> Floats:
    return np.column_stack((points, np.ones(len(points))))


def _normaliser(points: Points) -> Floats:
    """(3, 3): the middle of the points to the origin, their mean distance from it to the root of 2."""
    middle = points.mean(axis=0)
    k = float(np.sqrt(2.0) / max(np.hypot(*(points - middle).T).mean(), 1e-12))
    return np.array([[k, 0.0, -k * middle[0]], [0.0, k, -k * middle[1]], [0.0, 0.0, 1.0]])
