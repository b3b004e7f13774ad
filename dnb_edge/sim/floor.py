"""The floor of the simulated room seen from straight above: concrete, the lane of dark vinyl, its white tape.

Knows textures and where the track lies on the floor. Knows no camera and no car.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.sim.circuit import Circuit, edge_line
from dnb_edge.values import BgrImage, Points

RESOLUTION_M = 0.0015
_TAPE_WIDTH_M = 0.018
_TAPE_GAP_M = 0.010
_SUBPIXEL_BITS = 4

Plane = NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Floor:
    """A picture of the floor."""

    bgr: BgrImage
    """(height, width, 3); one px is `RESOLUTION_M`."""
    track_to_px: NDArray[np.float64]
    """(3, 3) track m to px of `bgr`."""


def draw_floor(circuit: Circuit, low_m: tuple[float, float], high_m: tuple[float, float], seed: int) -> Floor:
    """The floor between the corners `low_m` and `high_m` (x, y), track m."""
    random = np.random.default_rng([seed, 3])
    width = round((high_m[0] - low_m[0]) / RESOLUTION_M)
    height = round((high_m[1] - low_m[1]) / RESOLUTION_M)
    scale = 1.0 / RESOLUTION_M
    to_px = np.array([[scale, 0.0, -low_m[0] * scale], [0.0, -scale, high_m[1] * scale], [0.0, 0.0, 1.0]])
    picture = _concrete((height, width), random)
    _lay_lane(picture, circuit, to_px, random)
    _lay_tape(picture, circuit, to_px, random)
    return Floor(bgr=np.clip(picture, 0.0, 255.0).astype(np.uint8), track_to_px=to_px)


def smooth_noise(shape: tuple[int, int], cell_px: float, random: np.random.Generator) -> Plane:
    """(h, w) float32 noise of unit variance at the nodes of a grid of `cell_px`, interpolated between them."""
    rows, columns = (max(2, round(n / cell_px) + 1) for n in shape)
    grid = random.standard_normal((rows, columns), dtype=np.float32)
    return np.asarray(cv2.resize(grid, (shape[1], shape[0]), interpolation=cv2.INTER_CUBIC), dtype=np.float32)


def _concrete(shape: tuple[int, int], random: np.random.Generator) -> Plane:
    """Polished concrete: clouds of several sizes, fine grain, a few stains and specks."""
    clouds = sum(a * smooth_noise(shape, cell, random) for a, cell in ((4.5, 420), (3.0, 150), (1.8, 45), (1.2, 14)))
    grain = 2.2 * random.standard_normal(shape, dtype=np.float32)
    tint = np.array([156.0, 164.0, 166.0], dtype=np.float32)
    warmth = 1.6 * smooth_noise(shape, 300, random)
    picture = tint + (clouds + grain)[..., None] + warmth[..., None] * np.array([-1.0, 0.0, 0.8], dtype=np.float32)
    marks = np.zeros(shape, dtype=np.uint8)
    for _ in range(70):
        x, y = int(random.integers(shape[1])), int(random.integers(shape[0]))
        axes = (int(random.integers(1, 5)), int(random.integers(1, 4)))
        cv2.ellipse(
            marks, (x, y), axes, float(random.uniform(0, 180)), 0, 360, float(random.integers(60, 200)), -1, cv2.LINE_AA
        )
    picture += marks[..., None].astype(np.float32) * 0.16
    joint = np.zeros(shape, dtype=np.uint8)
    column = int(0.31 * shape[1])
    cv2.line(joint, (column, 0), (column + int(0.02 * shape[1]), shape[0]), 255.0, 3, cv2.LINE_AA)
    picture -= cv2.GaussianBlur(joint, (0, 0), 1.2)[..., None].astype(np.float32) * 0.14
    return np.asarray(picture, dtype=np.float32)


def _lay_lane(picture: Plane, circuit: Circuit, to_px: NDArray[np.float64], random: np.random.Generator) -> None:
    """Dark vinyl in sheets of slightly different shade, with seams and scratches."""
    shape = (picture.shape[0], picture.shape[1])
    mask = np.zeros(shape, dtype=np.uint8)
    left, right = (_pieces(circuit, side * 0.5 * circuit.lane_width_m, 0.10, 0.0025, random) for side in (1.0, -1.0))
    cv2.fillPoly(mask, [_fixed(left, to_px), _fixed(right, to_px)], 255.0, cv2.LINE_AA, _SUBPIXEL_BITS)
    shade = 3.0 * smooth_noise(shape, 260, random) + 2.0 * smooth_noise(shape, 20, random)
    shade += 2.6 * random.standard_normal(shape, dtype=np.float32)
    vinyl = np.array([60.0, 57.0, 56.0], dtype=np.float32) + shade[..., None]
    _seams_and_scratches(vinyl, circuit, to_px, random)
    alpha = mask[..., None].astype(np.float32) / np.float32(255.0)
    picture += alpha * (vinyl - picture)


def _seams_and_scratches(
    vinyl: Plane, circuit: Circuit, to_px: NDArray[np.float64], random: np.random.Generator
) -> None:
    marks = np.zeros(vinyl.shape[:2], dtype=np.uint8)
    line = circuit.centreline
    for s in np.arange(0.0, line.length_m, 0.31) + random.uniform(-0.06, 0.06, int(np.ceil(line.length_m / 0.31))):
        at, left, ahead = (f(np.array([s]))[0] for f in (line.at, line.normal, line.tangent))
        skew = random.uniform(-0.02, 0.02) * ahead
        ends = np.array([at + 0.13 * left + skew, at - 0.13 * left - skew])
        _stroke(marks, _fixed(ends, to_px), float(random.integers(50, 110)), 1)
    for _ in range(160):
        s, d = random.uniform(0.0, line.length_m), random.uniform(-0.11, 0.11)
        at = (line.at(np.array([s])) + d * line.normal(np.array([s])))[0]
        ends = np.array([at, at + random.normal(0.0, 0.025, 2)])
        _stroke(marks, _fixed(ends, to_px), float(random.integers(25, 110)), 1)
    vinyl += marks[..., None].astype(np.float32) * 0.35


def _lay_tape(picture: Plane, circuit: Circuit, to_px: NDArray[np.float64], random: np.random.Generator) -> None:
    """White tape in straight pieces along both borders, and the start line of white tape across the lane."""
    shape = (picture.shape[0], picture.shape[1])
    mask = np.zeros(shape, dtype=np.uint8)
    thickness = round(_TAPE_WIDTH_M / RESOLUTION_M)
    for side in (1.0, -1.0):
        offset = side * (0.5 * circuit.lane_width_m + _TAPE_GAP_M + 0.5 * _TAPE_WIDTH_M)
        border = _pieces(circuit, offset, 0.14, 0.002, random)
        _stroke(mask, _fixed(border, to_px), 255.0, thickness, closed=True)
    ends = np.asarray(circuit.start_line_m)
    inset = 0.03 / float(np.linalg.norm(ends[1] - ends[0])) * (ends[1] - ends[0])
    start = _fixed(np.array([ends[0] + inset, ends[1] - inset]), to_px)
    _stroke(mask, start, 255.0, round(0.022 / RESOLUTION_M))
    tape = (
        np.float32(226.0)
        + 4.0 * smooth_noise(shape, 60, random)
        + 2.0 * random.standard_normal(shape, dtype=np.float32)
    )
    alpha = mask[..., None].astype(np.float32) / np.float32(255.0 / 0.96)
    picture += alpha * (tape[..., None] - picture)


def _pieces(circuit: Circuit, offset_m: float, step_m: float, jitter_m: float, random: np.random.Generator) -> Points:
    """An edge line as people lay it: straight pieces of about `step_m`, their ends off by `jitter_m`."""
    points = edge_line(circuit, offset_m, step_m)
    return np.asarray(points + random.normal(0.0, jitter_m, points.shape))


def _stroke(
    mask: NDArray[np.uint8], points: NDArray[np.int32], value: float, thickness: int, *, closed: bool = False
) -> None:
    cv2.polylines(mask, [points], closed, value, thickness, cv2.LINE_AA, _SUBPIXEL_BITS)


def _fixed(points_m: Points, to_px: NDArray[np.float64]) -> NDArray[np.int32]:
    homogeneous = np.column_stack((points_m, np.ones(len(points_m)))) @ to_px.T
    return np.asarray(np.rint(homogeneous[:, :2] * (1 << _SUBPIXEL_BITS)), dtype=np.int32)
