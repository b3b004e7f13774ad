"""What a vehicle may say of itself: the members of its line, and the bounds within which each is believed to be meant.

Knows values. Knows no line, no socket and no clock.
"""

from __future__ import annotations

from dataclasses import dataclass

MOST_CARS = 99
MOST_INFERENCE_MS = 60_000.0
MOST_SEQ = (1 << 53) - 1
"""The largest count that every JSON reader keeps exactly."""
MOST_RATE_HZ = 10_000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleWord:
    """One line of a vehicle, as the gateway hands it to the daemon; the members are those of `values.VehicleReport`."""

    came_ns: int
    """When it came, CLOCK_MONOTONIC."""
    car: int
    seq: int | None = None
    inference_ms: float | None = None
    steering: float | None = None
    throttle: float | None = None
    rate_hz: float | None = None
    missing: int = 0
    refused: int = 0


def fault(word: VehicleWord) -> str | None:
    """Which member is out of its bounds, and what these are; None where all are within."""
    bounds: tuple[tuple[str, float | None, float, float], ...] = (
        ("car", word.car, 1, MOST_CARS),
        ("seq", word.seq, 0, MOST_SEQ),
        ("inference_ms", word.inference_ms, 0.0, MOST_INFERENCE_MS),
        ("steering", word.steering, -1.0, 1.0),
        ("throttle", word.throttle, -1.0, 1.0),
        ("rate_hz", word.rate_hz, 0.0, MOST_RATE_HZ),
        ("missing", word.missing, 0, MOST_SEQ),
        ("refused", word.refused, 0, MOST_SEQ),
    )
    for name, value, least, most in bounds:
        if value is not None and not least <= value <= most:
            return f"{name} {value} is not within {least:g} to {most:g}"
    return None
