"""How far an int8 network's answers are from the float network's. Pure: knows points with confidences, and arrays."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import PointPx


@dataclass(frozen=True, slots=True, kw_only=True)
class Spot:
    """One find: its point and how far another may be to be the same, in the same px."""

    at_px: PointPx
    reach_px: float
    confidence: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Apart:
    """Float against int8 on held-out footage."""

    inputs: int
    finds: int
    """Finds of the float network."""
    lost: int
    """Those of them that int8 does not find."""
    new: int
    """Finds of int8 that are none of the float network's."""
    moved_p95_px: float | None
    """95th percentile of how far common finds moved; None where there are none."""
    confidence_largest: float
    """Largest difference of a common find's confidence."""
    output_largest: float | None = None
    """Largest difference of any number in the raw output; None where outputs mix units."""
    output_mean: float | None = None
    """Mean absolute difference of the same."""


def apart(
    pairs: Iterable[tuple[Sequence[Spot], Sequence[Spot]]],
    outputs: Iterable[tuple[NDArray[np.float32], NDArray[np.float32]]] = (),
) -> Apart:
    """The finds of (float, int8) on each input, and optionally their raw outputs, compared."""
    inputs = finds = lost = new = 0
    moved: list[float] = []
    confidence = 0.0
    for before, after in pairs:
        inputs, finds = inputs + 1, finds + len(before)
        left = list(after)
        for one in sorted(before, key=lambda spot: -spot.confidence):
            near = min(left, key=lambda spot: math.dist(spot.at_px, one.at_px), default=None)
            if near is None or math.dist(near.at_px, one.at_px) > one.reach_px:
                lost += 1
                continue
            left.remove(near)
            moved.append(math.dist(near.at_px, one.at_px))
            confidence = max(confidence, abs(near.confidence - one.confidence))
        new += len(left)
    differences = [np.abs(before - after) for before, after in outputs]
    return Apart(
        inputs=inputs,
        finds=finds,
        lost=lost,
        new=new,
        moved_p95_px=float(np.percentile(moved, 95)) if moved else None,
        confidence_largest=confidence,
        output_largest=max(float(one.max()) for one in differences) if differences else None,
        output_mean=float(np.mean([float(one.mean()) for one in differences])) if differences else None,
    )
