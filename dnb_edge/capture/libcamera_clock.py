"""libcamera's stamps on CLOCK_MONOTONIC.

libcamera says that `SensorTimestamp` is on CLOCK_BOOTTIME, which goes on while the machine sleeps. What it hands on is the
driver's own stamp, and most drivers stamp on CLOCK_MONOTONIC, which does not. The two are one until a machine has slept.
Knows clocks; knows no camera.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

from dnb_edge.values import StampSource


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """One moment on both clocks."""

    monotonic_ns: int
    slept_ns: int
    """How far CLOCK_BOOTTIME is ahead: the time that the machine has slept."""


def now() -> Moment:
    """This moment. Measured for each frame, since a machine may sleep between two."""
    before_ns = time.monotonic_ns()
    boot_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME)
    after_ns = time.monotonic_ns()
    # Within the bracket the difference is the time between two readings, and no sleep.
    slept_ns = 0 if before_ns <= boot_ns <= after_ns else boot_ns - (before_ns + after_ns) // 2
    return Moment(monotonic_ns=after_ns, slept_ns=slept_ns)


def stamp_of(sensor_ns: int | None, buffer_ns: int, arrived: Moment) -> tuple[int, StampSource]:
    """A frame's stamp in ns of CLOCK_MONOTONIC, and the moment that it stands for.

    `sensor_ns`: SensorTimestamp, when the first row began; None where the camera does not tell. Then `buffer_ns`, when the
    buffer was filled, 0 where that is not told either; then the moment at which the frame `arrived`.
    """
    if sensor_ns:
        return _monotonic_ns(sensor_ns, arrived), StampSource.START_OF_FRAME
    if buffer_ns:
        return _monotonic_ns(buffer_ns, arrived), StampSource.END_OF_FRAME
    return arrived.monotonic_ns, StampSource.ARRIVAL


def _monotonic_ns(stamp_ns: int, arrived: Moment) -> int:
    """A frame's stamp lies before its arrival: one that does not, on CLOCK_MONOTONIC, is on CLOCK_BOOTTIME."""
    return stamp_ns if stamp_ns <= arrived.monotonic_ns else stamp_ns - arrived.slept_ns
