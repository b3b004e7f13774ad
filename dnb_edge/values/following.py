"""What is known of a car from frame to frame.

Frozen, slotted, keyword-only; units in the names; frames of reference and clocks as in `dnb_edge.values`."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from dnb_edge.values.frames import PointM, PointPx


@dataclass(frozen=True, slots=True, kw_only=True)
class Observation:
    """A detection brought to the track plane."""

    t_ns: int
    t_s: float
    camera_px: PointPx
    track_m: PointM
    covariance_m2: tuple[float, float, float]
    """Covariance of `track_m`, (xx, xy, yy), m^2."""
    confidence: float
    length_px: float
    """Apparent length of the car, camera px."""
    target_id: int | None = None
    """The target that it was taken for; None before that is known."""
    camera: int = 0
    """The camera whose picture `camera_px` is in, counted from 0."""


class TargetState(StrEnum):
    """Life cycle of a target."""

    TENTATIVE = "tentative"
    CONFIRMED = "confirmed"
    COASTING = "coasting"
    LOST = "lost"


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """One car followed over time, as estimated at `t_ns`."""

    target_id: int
    state: TargetState
    t_ns: int
    t_s: float
    track_m: PointM
    velocity_mps: tuple[float, float]
    covariance_m2: tuple[float, float, float]
    """Covariance of `track_m`, (xx, xy, yy), m^2."""
