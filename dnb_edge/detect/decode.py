"""From the network's maps to peaks in its input's pixels. Pure: knows no frame, no window, no background."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.detect.onnx import STRIDE_PX, CentreMaps

REFERENCE_LENGTH_PX = 32.0
"""The length that `size` 0 stands for, input px."""


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
    """The peak at a cell: its neighbours vote for the ground point, each with its own heat."""
    rows, columns = maps.heat.shape
    top, bottom = max(0, row - 1), min(rows, row + 2)
    left, right = max(0, column - 1), min(columns, column + 2)
    weight = 1.0 / (1.0 + np.exp(-maps.heat[top:bottom, left:right].astype(np.float64)))
    grid_v, grid_u = np.mgrid[top:bottom, left:right]
    votes_u = grid_u + maps.offset[0, top:bottom, left:right]
    votes_v = grid_v + maps.offset[1, top:bottom, left:right]
    own_u = column + float(maps.offset[0, row, column])
    own_v = row + float(maps.offset[1, row, column])
    # a neighbour that points elsewhere belongs to another car, or to none
    weight = weight * ((votes_u - own_u) ** 2 + (votes_v - own_v) ** 2 < 1.0)
    total = float(weight.sum())
    cell_u, cell_v = (
        (float((weight * votes).sum()) / total for votes in (votes_u, votes_v)) if total > 0 else (own_u, own_v)
    )
    cosine, sine = float(maps.heading[0, row, column]), float(maps.heading[1, row, column])
    size = max(-2.0, min(2.5, float(maps.size[row, column])))
    spread = max(-4.0, min(2.0, float(maps.spread[row, column])))
    return Peak(
        u_px=(cell_u + 0.5) * STRIDE_PX - 0.5,
        v_px=(cell_v + 0.5) * STRIDE_PX - 0.5,
        length_px=REFERENCE_LENGTH_PX * math.exp(size),
        sigma_px=STRIDE_PX * math.exp(spread),
        confidence=_sigmoid(float(maps.heat[row, column])),
        heading_rad=math.atan2(sine, cosine) if math.hypot(cosine, sine) > 0.5 else None,
    )


def peaks(maps: CentreMaps, *, least_confidence: float, most: int) -> list[Peak]:
    """The heat's local maxima of at least `least_confidence`, strongest first (then by row and column), at most `most`."""
    least_logit = math.log(least_confidence / (1.0 - least_confidence))
    highest: NDArray[np.float32] = cv2.dilate(maps.heat, np.ones((3, 3), np.uint8)).astype(np.float32)
    rows, columns = np.nonzero((maps.heat >= highest) & (maps.heat >= np.float32(least_logit)))
    order = np.lexsort((columns, rows, -maps.heat[rows, columns]))[:most]
    found = [_at(maps, int(rows[number]), int(columns[number])) for number in order]
    return _without_doubles(found)


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
