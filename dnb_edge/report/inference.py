"""How long a network under test takes for one picture, as the table tells it. Knows numbers; knows no network and no file."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

TOLD_BY_VEHICLE = "told by the vehicle"


@dataclass(frozen=True, slots=True, kw_only=True)
class Inference:
    """Times for one picture, milliseconds."""

    p50_ms: float
    p95_ms: float
    p99_ms: float
    source: str
    """Where the figures are from, such as the machine that a benchmark ran on."""


def told_inference(times_ms: Iterable[float]) -> Inference | None:
    """What a vehicle's own times come to; None without any. A percentile is the least time that so many do not exceed."""
    ordered = sorted(times_ms)
    if not ordered:
        return None

    def percentile(share: float) -> float:
        return ordered[max(0, math.ceil(share * len(ordered)) - 1)]

    return Inference(p50_ms=percentile(0.5), p95_ms=percentile(0.95), p99_ms=percentile(0.99), source=TOLD_BY_VEHICLE)


def ms_text(time_ms: float) -> str:
    """A time in three figures, whether it is microseconds or seconds."""
    return f"{time_ms:.0f}" if time_ms >= 100.0 else f"{time_ms:.3g}"
