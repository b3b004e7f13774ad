"""Where exactly a printed square lies in a picture, from all edges between its black and its white cells.

Knows grey levels, the printed code and a lens; knows no family and no floor. Blur, the camera's tone curve and ink make every
dark area seem smaller or larger by the same fraction of a pixel. The square's rim alone cannot tell that from its size (a third
of a pixel is 1 % of the camera's height), its cells can: their edges face both ways. So the homography of the square and that
one shift are fitted together, by least squares over all edges.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import Points
from dnb_edge.view.lens import Lens

FloatArray = NDArray[np.float64]

_PROFILE = 25
"""Grey levels along one profile across an edge."""
_ACROSS = 6
"""Profiles averaged along one edge."""
_REACH = 0.46
"""How far a profile goes to each side, as a share of the distance to the next parallel line of the square's cells."""
_LONGEST_REACH_PX = 4.0
_LEAST_CONTRAST = 18.0
"""Grey levels between black and white below which an edge is none."""
_LEAST_SHARE = 0.7
"""Share of a marker's edges that must be seen."""
_ROUNDS = 4
_SHIFT_SIGMA_PX = 0.5
"""How large the shift of dark areas' edges may be before anything is measured."""
_SHIFT_VARIES_PX = 0.02
"""By how much the shift differs over a picture."""
_FLOOR_PX = 0.015
"""No corner is placed better than this, however clean the picture."""
_SMALL_PX = 1.2
_SMALL_CELL_PX = 2.0
"""Blur mixes the edges of small cells: a corner is then wrong by about `_SMALL_PX` exp(-cell / `_SMALL_CELL_PX`), as measured
on rendered markers."""
_WORST_RESIDUAL_PX = 1.0
_CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
_STEP_PX = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MarkerFit:
    """One marker, placed."""

    number: int
    camera_px: FloatArray
    """(4, 2) corners, camera px, clockwise from the top left corner as printed."""
    noise_px2: FloatArray
    """(8, 8) covariance of the corners u0 v0 u1 v1 ... that comes of the picture's noise, camera px squared."""
    floor_px: float
    """One standard deviation of each coordinate that is there in every picture, camera px."""
    side_px: float
    """Mean side, camera px."""

    @property
    def covariance_px2(self) -> FloatArray:
        """(8, 8) covariance of the corners, camera px squared."""
        return np.asarray(self.noise_px2 + np.eye(8) * self.floor_px**2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Edges:
    """Every edge between a black and a white cell, in units of the square's side, u right and v down."""

    middle: FloatArray
    """(n, 2)"""
    along: FloatArray
    """(n, 2) from end to end."""
    dark: FloatArray
    """(n, 2) unit vectors towards the dark side."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Solved:
    corners: FloatArray
    covariance: FloatArray
    """(9, 9) of the corners and the shift."""
    shift_px: float
    shift_sigma_px: float


def fit_markers(
    grey: NDArray[np.uint8], found: Mapping[int, tuple[NDArray[np.bool_], FloatArray]], lens: Lens | None
) -> list[MarkerFit]:
    """The markers that can be placed. `found` has each number's printed cells and rough corners (4, 2), camera px.

    Those whose edges are not seen well enough are left out.
    """
    picture = np.asarray(cv2.GaussianBlur(grey, (0, 0), 0.5), dtype=np.float32)
    starts = {number: (_edges(cells), corners) for number, (cells, corners) in found.items()}
    first = {
        number: _solve(picture, edges, corners, lens, shift=(0.0, _SHIFT_SIGMA_PX))
        for number, (edges, corners) in starts.items()
    }
    solved = {number: one for number, one in first.items() if one is not None}
    if not solved:
        return []
    # Optics, exposure and paper are one for the whole picture: what all markers say of the shift helps each.
    weights = np.array([one.shift_sigma_px**-2 for one in solved.values()])
    shift = float(np.average([one.shift_px for one in solved.values()], weights=weights))
    sigma = float(np.hypot(weights.sum() ** -0.5, _SHIFT_VARIES_PX))
    fits = []
    for number, one in solved.items():
        final = _solve(picture, starts[number][0], one.corners, lens, shift=(shift, sigma))
        if final is not None:
            fits.append(_fit(number, final, cells=len(found[number][0])))
    return fits


def _fit(number: int, solved: _Solved, *, cells: int) -> MarkerFit:
    sides = np.linalg.norm(solved.corners - np.roll(solved.corners, 1, axis=0), axis=1)
    shorter = float(min(sides[0] + sides[2], sides[1] + sides[3])) / 2.0
    floor_px = _FLOOR_PX + _SMALL_PX * float(np.exp(-shorter / cells / _SMALL_CELL_PX))
    return MarkerFit(
        number=number,
        camera_px=solved.corners,
        noise_px2=solved.covariance[:8, :8],
        floor_px=floor_px,
        side_px=float(sides.mean()),
    )


def _edges(cells: NDArray[np.bool_]) -> _Edges:
    """The edges of a printed code with its white surroundings."""
    count = len(cells)
    white = np.pad(cells, 1, constant_values=True)
    middles, alongs, darks = [], [], []
    for turned in (False, True):
        grid = white.T if turned else white
        # Between columns k - 1 and k of the code lies the line x = k.
        rows, columns = np.nonzero(grid[1:-1, :-1] != grid[1:-1, 1:])
        x, y = columns.astype(np.float64), rows + 0.5
        towards = np.where(grid[1:-1, :-1][rows, columns], 1.0, -1.0)
        zero, one = np.zeros_like(x), np.ones_like(x)
        parts = [
            np.column_stack(pair) / scale
            for pair, scale in (((x, y), count), ((zero, one), count), ((towards, zero), 1))
        ]
        middle, along, dark = (part[:, ::-1] if turned else part for part in parts)
        middles.append(middle)
        alongs.append(along)
        darks.append(dark)
    return _Edges(middle=np.concatenate(middles), along=np.concatenate(alongs), dark=np.concatenate(darks))


def _solve(
    picture: NDArray[np.float32], edges: _Edges, corners: FloatArray, lens: Lens | None, *, shift: tuple[float, float]
) -> _Solved | None:
    """Corners (camera px) and shift by Gauss-Newton; None where too few edges are seen or they fit no square."""
    shift_px, residual_px = shift[0], np.inf
    inverse: FloatArray = np.eye(9)
    for _ in range(_ROUNDS):
        at, normal, reach = _lines(edges, corners, lens)
        off, good = _measured(picture, at, normal, reach, _tangent(edges, corners, lens))
        if good.mean() < _LEAST_SHARE:
            return None
        jacobian = np.column_stack((_jacobian(edges, corners, lens, normal), np.ones(len(off))))[good]
        # A positive shift moves every edge into the dark.
        rest = off[good] - shift_px
        weight = 1.0 / max(residual_px if np.isfinite(residual_px) else 0.1, 0.02)
        normal_matrix = weight**2 * jacobian.T @ jacobian
        normal_matrix[8, 8] += shift[1] ** -2
        right = weight**2 * jacobian.T @ rest
        right[8] += (shift[0] - shift_px) * shift[1] ** -2
        inverse = np.asarray(np.linalg.inv(normal_matrix), dtype=np.float64)
        step = inverse @ right
        corners, shift_px = corners + step[:8].reshape(4, 2), shift_px + float(step[8])
        freedom = max(1, len(rest) - 8)
        residual_px = float(np.sqrt(((rest - jacobian @ step) ** 2).sum() / freedom))
        if float(np.abs(step[:8]).max()) > 5.0:
            return None
    if residual_px > _WORST_RESIDUAL_PX:
        return None
    return _Solved(corners=corners, covariance=inverse, shift_px=shift_px, shift_sigma_px=float(np.sqrt(inverse[8, 8])))


def _lines(edges: _Edges, corners: FloatArray, lens: Lens | None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of every edge as `corners` have it: the middle and the unit normal towards the dark, camera px, and a profile's reach."""
    count = round(1.0 / float(np.abs(edges.along).max()))
    at = _placed(edges.middle, corners, lens)
    tangent = _tangent(edges, corners, lens)
    inward = _placed(edges.middle + edges.dark / count / 2.0, corners, lens) - at
    length = np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-9)
    normal = np.column_stack((-tangent[:, 1], tangent[:, 0])) / length
    across = (inward * normal).sum(axis=1)
    normal *= np.where(across < 0.0, -1.0, 1.0)[:, None]
    # Half a cell was stepped: a whole one is twice as far.
    return at, normal, np.minimum(2.0 * np.abs(across) * _REACH, _LONGEST_REACH_PX)


def _tangent(edges: _Edges, corners: FloatArray, lens: Lens | None) -> FloatArray:
    """(n, 2) from end to end of every edge, camera px."""
    half = edges.along / 2.0
    return _placed(edges.middle + half, corners, lens) - _placed(edges.middle - half, corners, lens)


def _measured(
    picture: NDArray[np.float32], at: FloatArray, normal: FloatArray, reach: FloatArray, tangent: FloatArray
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """How far along its normal (towards the dark) each edge is seen from where it was expected, px; and which are seen.

    The place of an edge is where a step from one end's level to the other's would have the same mean.
    """
    steps = np.linspace(-1.0, 1.0, _PROFILE)
    aside = np.linspace(-0.3, 0.3, _ACROSS)
    points = (
        at[:, None, None, :]
        + aside[None, :, None, None] * tangent[:, None, None, :]
        + steps[None, None, :, None] * reach[:, None, None, None] * normal[:, None, None, :]
    ).astype(np.float32)
    n = len(at)
    flat = points.reshape(n * _ACROSS, _PROFILE, 2)
    level = cv2.remap(picture, flat[..., 0], flat[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    profile = np.asarray(level, dtype=np.float64).reshape(n, _ACROSS, _PROFILE).mean(axis=1)
    light, dark = profile[:, :3].mean(axis=1), profile[:, -3:].mean(axis=1)
    contrast = light - dark
    mean = (profile[:, :-1] + profile[:, 1:]).mean(axis=1) / 2.0
    good = contrast > _LEAST_CONTRAST
    share = (mean - dark) / np.where(good, contrast, 1.0)
    height, width = picture.shape
    margin = reach + 1.0
    inside = (at > margin[:, None]).all(axis=1) & (at[:, 0] < width - 1 - margin) & (at[:, 1] < height - 1 - margin)
    seen = good & inside & (share > 0.05) & (share < 0.95)
    return np.where(seen, (2.0 * share - 1.0) * reach, 0.0), seen


def _jacobian(edges: _Edges, corners: FloatArray, lens: Lens | None, normal: FloatArray) -> FloatArray:
    """(n, 8): how far each edge moves along its normal for a step of each corner's coordinates."""
    columns = []
    for k in range(8):
        step = np.zeros(8)
        step[k] = _STEP_PX
        plus = _placed(edges.middle, corners + step.reshape(4, 2), lens)
        minus = _placed(edges.middle, corners - step.reshape(4, 2), lens)
        columns.append(((plus - minus) * normal).sum(axis=1) / (2.0 * _STEP_PX))
    return np.column_stack(columns)


def _placed(points: Points, corners: FloatArray, lens: Lens | None) -> Points:
    """Camera px (n, 2) of points (n, 2) of the square whose corners (4, 2) are camera px; `lens` bends its sides."""
    matrix = square_homography(corners if lens is None else lens.to_ideal_px(corners))
    homogeneous = np.column_stack((points, np.ones(len(points)))) @ matrix.T
    ideal = homogeneous[:, :2] / homogeneous[:, 2:]
    return ideal if lens is None else lens.to_camera_px(ideal)


def square_homography(corners: FloatArray) -> FloatArray:
    """(3, 3) from the unit square, clockwise from (0, 0) with v down, to `corners` (4, 2). After Heckbert (1989), 2.2.3."""
    (x0, y0), (x1, y1), (x2, y2), (x3, y3) = corners.tolist()
    dx1, dx2, sx = x1 - x2, x3 - x2, x0 - x1 + x2 - x3
    dy1, dy2, sy = y1 - y2, y3 - y2, y0 - y1 + y2 - y3
    det = dx1 * dy2 - dx2 * dy1
    g, h = (sx * dy2 - dx2 * sy) / det, (dx1 * sy - sx * dy1) / det
    return np.array([[x1 - x0 + g * x1, x3 - x0 + h * x3, x0], [y1 - y0 + g * y1, y3 - y0 + h * y3, y0], [g, h, 1.0]])
