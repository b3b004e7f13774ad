"""From the network's maps to peaks in its input's pixels. Pure: knows no frame, no window, no background."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.detect.onnx import STRIDE_PX, CentreMaps

REFERENCE_LENGTH_PX = 32.0
"""The length that `size` 0 stands for, input px."""
KNOWN_HEADING = 0.5
"""Least length of the heading's vector at which the heading is told."""

_NEIGHBOURS: NDArray[np.uint8] = np.ones((3, 3), dtype=np.uint8)


@dataclass(frozen=True, slots=True, kw_only=True)
class Peak:
    """One maximum of the heat, in the network's input px (pixel centres at whole numbers)."""

    u_px: float
    v_px: float
    length_px: float
    sigma_px: float
    confidence: float
    heading_rad: float | None
    """atan2 of (-v, u); None where the network does not tell."""


def _sigmoid(logit: float) -> float:
    return 1.0 / (1.0 + math.exp(-max(-30.0, min(30.0, logit))))


def _at(maps: CentreMaps, row: int, column: int) -> Peak:
    """The peak at a cell: its neighbours vote for the ground point, each with its own heat.

    Plain floats: for nine cells that is several times faster than arrays.
    """
    top, left = max(0, row - 1), max(0, column - 1)
    heat, offset_u, offset_v = maps.values[:3, top : row + 2, left : column + 2].tolist()
    own_u = column + offset_u[row - top][column - left]
    own_v = row + offset_v[row - top][column - left]
    total = sum_u = sum_v = 0.0
    for i, (heats, us, vs) in enumerate(zip(heat, offset_u, offset_v, strict=True), start=top):
        for j, (logit, u, v) in enumerate(zip(heats, us, vs, strict=True), start=left):
            # a neighbour that points elsewhere belongs to another car, or to none
            if (j + u - own_u) ** 2 + (i + v - own_v) ** 2 < 1.0:
                weight = _sigmoid(logit)
                total, sum_u, sum_v = total + weight, sum_u + weight * (j + u), sum_v + weight * (i + v)
    cell = maps.values[:, row, column].tolist()
    return Peak(
        u_px=(sum_u / total + 0.5) * STRIDE_PX - 0.5,
        v_px=(sum_v / total + 0.5) * STRIDE_PX - 0.5,
        length_px=REFERENCE_LENGTH_PX * math.exp(max(-2.0, min(2.5, cell[3]))),
        sigma_px=STRIDE_PX * math.exp(max(-4.0, min(2.0, cell[-1]))),
        confidence=_sigmoid(cell[0]),
        heading_rad=heading_of(cell[4:-1]),
    )


def heading_of(vector: Sequence[float]) -> float | None:
    """The heading a, radians, from (cos a, sin a) or (cos 2a, sin 2a, cos a, sin a); None where the vector is too short.

    Of four, the first two tell the axis, and whether it is known; the last two tell which of its ends is the nose.
    """
    if math.hypot(vector[0], vector[1]) < KNOWN_HEADING:
        return None
    angle = math.atan2(vector[1], vector[0])
    if len(vector) == 2:
        return angle
    axis = angle / 2
    backwards = math.cos(axis) * vector[2] + math.sin(axis) * vector[3] < 0.0
    if not backwards:
        return axis
    return axis - math.pi if axis > 0.0 else axis + math.pi


def peaks(maps: CentreMaps, *, least_confidence: float, most: int) -> list[Peak]:
    """The heat's local maxima of at least `least_confidence`, strongest first (then by row and column), at most `most`."""
    heat = maps.heat
    least_logit = math.log(least_confidence / (1.0 - least_confidence))
    if float(heat.max()) < least_logit:
        return []
    highest = cv2.dilate(heat, _NEIGHBOURS)
    rows, columns = np.nonzero((heat >= highest) & (heat >= np.float32(least_logit)))
    best = sorted(zip((-heat[rows, columns]).tolist(), rows.tolist(), columns.tolist(), strict=True))[:most]
    return _without_doubles([_at(maps, row, column) for _, row, column in best])


def _without_doubles(found: list[Peak]) -> list[Peak]:
    """Of peaks whose ground points lie within a third of the stronger one's length, only the stronger."""
    kept: list[Peak] = []
    for peak in found:
        near = (
            math.hypot(peak.u_px - other.u_px, peak.v_px - other.v_px) < max(5.0, 0.33 * other.length_px)
            for other in kept
        )
        if not any(near):
            kept.append(peak)
    return kept
