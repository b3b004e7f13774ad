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
from dnb_edge.view.marker_patch import marker_patch

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
_MORE_ROUNDS = 2
_PRE_BLUR_PX = 0.5
"""Noise is smoothed by so much."""
_BLURS_PX = (0.3, 0.5, 0.7, 0.9, 1.2, 1.6)
_LARGE_CELL_PX = 12.0
"""Larger cells' edges do not mix."""
_LEAST_RESIDUAL_PX = 0.02
_SHIFT_VARIES_PX = 0.02
"""By how much the shift differs over a picture."""
_FLOOR_PX = 0.02
"""No corner is placed better than this, however clean the picture."""
_SMALL_PX = 0.2
_SMALL_CELL_PX = 2.0
"""Blur mixes the edges of small cells: a corner is then wrong by about `_SMALL_PX` exp(-cell / `_SMALL_CELL_PX`), as measured
on rendered markers."""
_WORST_RESIDUAL_PX = 1.0
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

    cells: NDArray[np.bool_]
    """The code, True where it is white."""
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
    residual_px: float
    """Of one edge, one standard deviation."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Blur:
    """What the camera does to edges, as far as that is known before."""

    px: float | None = None
    """Standard deviation of its blur, px; None where small cells are taken as they seem."""
    shift_px: float = 0.0
    """How far into the dark every edge lies."""
    shift_sigma_px: float = 0.5


def fit_markers(
    grey: NDArray[np.uint8], found: Mapping[int, tuple[NDArray[np.bool_], FloatArray]], lens: Lens | None
) -> list[MarkerFit]:
    """The markers that can be placed. `found` has each number's printed cells and rough corners (4, 2), camera px.

    Those whose edges are not seen well enough are left out.
    """
    picture = np.asarray(cv2.GaussianBlur(grey, (0, 0), _PRE_BLUR_PX), dtype=np.float32)
    codes = {number: _edges(cells) for number, (cells, _) in found.items()}
    rough = {number: _solve(picture, codes[number], found[number][1], lens, _Blur()) for number in found}
    solved = {number: one for number, one in rough.items() if one is not None}
    if not solved:
        return []
    blur = _common_blur(picture, codes, solved, lens)
    finals = {number: _solve(picture, codes[number], one.corners, lens, blur) for number, one in solved.items()}
    return [_fit(number, one, codes[number]) for number, one in finals.items() if one is not None]


def _common_blur(
    picture: NDArray[np.float32], codes: Mapping[int, _Edges], solved: Mapping[int, _Solved], lens: Lens | None
) -> _Blur:
    """The blur at which the markers fit best, and the shift that goes with it. Optics, exposure and paper are one for the whole
    picture, so what all markers say helps each."""
    best, least = _Blur(), np.inf
    small = any(_cell_px(codes[number], one.corners) <= _LARGE_CELL_PX for number, one in solved.items())
    for blur_px in _BLURS_PX if small else _BLURS_PX[:1]:
        tried = [_solve(picture, codes[number], one.corners, lens, _Blur(px=blur_px)) for number, one in solved.items()]
        found = [one for one in tried if one is not None]
        rest = sum(one.residual_px**2 for one in found) if len(found) == len(tried) else np.inf
        if rest < least:
            weights = np.array([one.shift_sigma_px**-2 for one in found])
            shift = float(np.average([one.shift_px for one in found], weights=weights))
            sigma = float(np.hypot(weights.sum() ** -0.5, _SHIFT_VARIES_PX))
            best, least = _Blur(px=blur_px, shift_px=shift, shift_sigma_px=sigma), rest
    return best


def _fit(number: int, solved: _Solved, edges: _Edges) -> MarkerFit:
    sides = np.linalg.norm(solved.corners - np.roll(solved.corners, 1, axis=0), axis=1)
    floor_px = _FLOOR_PX + _SMALL_PX * float(np.exp(-_cell_px(edges, solved.corners) / _SMALL_CELL_PX))
    return MarkerFit(
        number=number,
        camera_px=solved.corners,
        noise_px2=solved.covariance[:8, :8],
        floor_px=floor_px,
        side_px=float(sides.mean()),
    )


def _cell_px(edges: _Edges, corners: FloatArray) -> float:
    """The shorter side of a cell, px."""
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    return float(min(sides[0] + sides[2], sides[1] + sides[3])) / 2.0 / len(edges.cells)


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
    return _Edges(cells=cells, middle=np.concatenate(middles), along=np.concatenate(alongs), dark=np.concatenate(darks))


def _solve(
    picture: NDArray[np.float32], edges: _Edges, corners: FloatArray, lens: Lens | None, blur: _Blur
) -> _Solved | None:
    """Corners (camera px) and shift by Gauss-Newton; None where too few edges are seen or they fit no square."""
    shift_px, residual_px = blur.shift_px, 0.1
    inverse: FloatArray = np.eye(9)
    for _ in range(_ROUNDS if blur.px is None else _MORE_ROUNDS):
        at, normal, reach = _lines(edges, corners, lens)
        off, good = _measured(picture, at, normal, reach, _tangent(edges, corners, lens))
        if good.mean() < _LEAST_SHARE:
            return None
        off = off - _mixing(edges, corners, blur)
        jacobian = np.column_stack((_jacobian(edges, corners, lens, normal), np.ones(len(off))))[good]
        # A positive shift moves every edge into the dark.
        rest = off[good] - shift_px
        weight = 1.0 / max(residual_px, _LEAST_RESIDUAL_PX)
        normal_matrix = weight**2 * jacobian.T @ jacobian
        normal_matrix[8, 8] += blur.shift_sigma_px**-2
        right = weight**2 * jacobian.T @ rest
        right[8] += (blur.shift_px - shift_px) * blur.shift_sigma_px**-2
        inverse = np.asarray(np.linalg.inv(normal_matrix), dtype=np.float64)
        step = inverse @ right
        corners, shift_px = corners + step[:8].reshape(4, 2), shift_px + float(step[8])
        freedom = max(1, len(rest) - 8)
        residual_px = float(np.sqrt(((rest - jacobian @ step) ** 2).sum() / freedom))
        if float(np.abs(step[:8]).max()) > 5.0:
            return None
    if residual_px > _WORST_RESIDUAL_PX:
        return None
    return _Solved(
        corners=corners,
        covariance=inverse,
        shift_px=shift_px,
        shift_sigma_px=float(np.sqrt(inverse[8, 8])),
        residual_px=residual_px,
    )


def _mixing(edges: _Edges, corners: FloatArray, blur: _Blur) -> FloatArray:
    """How far along its normal each edge seems to lie from where it is, since the blur mixes it with its neighbours, px."""
    if blur.px is None or _cell_px(edges, corners) > _LARGE_CELL_PX:
        return np.zeros(len(edges.middle))
    patch, first = marker_patch(edges.cells, corners, float(np.hypot(blur.px, _PRE_BLUR_PX)))
    there = corners - first
    off, _ = _measured(patch, *_lines(edges, there, None), _tangent(edges, there, None))
    return off


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
    # All sixteen squares with one corner moved at once: a lens's formula costs far more by the call than by the point.
    steps = np.concatenate((np.eye(8), -np.eye(8))).reshape(16, 4, 2) * _STEP_PX
    moved = (corners + steps).reshape(-1, 2)
    ideal = (moved if lens is None else lens.to_ideal_px(moved)).reshape(16, 4, 2)
    points = np.concatenate([_mapped(square_homography(square), edges.middle) for square in ideal])
    placed = (points if lens is None else lens.to_camera_px(points)).reshape(2, 8, -1, 2)
    return np.asarray(((placed[0] - placed[1]) * normal).sum(axis=2).T / (2.0 * _STEP_PX))


def _placed(points: Points, corners: FloatArray, lens: Lens | None) -> Points:
    """Camera px (n, 2) of points (n, 2) of the square whose corners (4, 2) are camera px; `lens` bends its sides."""
    ideal = _mapped(square_homography(corners if lens is None else lens.to_ideal_px(corners)), points)
    return ideal if lens is None else lens.to_camera_px(ideal)


def _mapped(matrix: FloatArray, points: Points) -> Points:
    homogeneous = points @ matrix[:, :2].T + matrix[:, 2]
    return np.asarray(homogeneous[:, :2] / homogeneous[:, 2:])


def square_homography(corners: FloatArray) -> FloatArray:
    """(3, 3) from the unit square, clockwise from (0, 0) with v down, to `corners` (4, 2). After Heckbert (1989), 2.2.3."""
    (x0, y0), (x1, y1), (x2, y2), (x3, y3) = corners.tolist()
    dx1, dx2, sx = x1 - x2, x3 - x2, x0 - x1 + x2 - x3
    dy1, dy2, sy = y1 - y2, y3 - y2, y0 - y1 + y2 - y3
    det = dx1 * dy2 - dx2 * dy1
    g, h = (sx * dy2 - dx2 * sy) / det, (dx1 * sy - sx * dy1) / det
    return np.array([[x1 - x0 + g * x1, x3 - x0 + h * x3, x0], [y1 - y0 + g * y1, y3 - y0 + h * y3, y0], [g, h, 1.0]])
