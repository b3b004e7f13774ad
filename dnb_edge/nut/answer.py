"""What a driver from outside answered, judged: two finite numbers between -1 and 1, or one line that says what was wrong.

Knows neither how the answer came here nor what it does to a vehicle.
"""

from __future__ import annotations

import math
from typing import Any

from dnb_edge.sim.control import Control, DriverFailed

MOST_QUOTED = 80


def control_of(name: str, t_ns: int, steering: Any, throttle: Any) -> Control:
    """The control that driver `name` answered to the picture at `t_ns`. Raises `DriverFailed` for anything else."""
    numbers = [_number(value) for value in (steering, throttle)]
    for word, value, number in zip(("steering", "throttle"), (steering, throttle), numbers, strict=True):
        if number is None or not (math.isfinite(number) and -1.0 <= number <= 1.0):
            raise DriverFailed(f"{name}: {word} {quoted(value)} {at(t_ns)}: must be a number between -1 and 1")
    return Control(steering=numbers[0] or 0.0, throttle=numbers[1] or 0.0)


def at(t_ns: int) -> str:
    """Which picture it is about."""
    return f"to the picture at {t_ns * 1e-9:.3f} s"


def quoted(value: object) -> str:
    """Anything, in one short line of plain characters."""
    text = ascii(value)
    return text if len(text) <= MOST_QUOTED else f"{text[:MOST_QUOTED]}..."


def _number(value: Any) -> float | None:
    """None where it is none; a scalar of NumPy or PyTorch is one, a text or a truth is not."""
    if isinstance(value, str | bytes | bool):
        return None
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return None
