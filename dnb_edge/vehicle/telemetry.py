"""A vehicle's line: what it may say, and what is wrong with a line that it may not say.

Knows bytes and words. Knows no channel, no clock and no race.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from dnb_edge.live.vehicle_word import VehicleWord, fault

MOST_LINE_BYTES = 512
_NUMBERS = ("inference_ms", "steering", "throttle")
_MOST_SHOWN = 40


class Nonsense(Exception):
    """A line that is no telemetry; its text says why, in a few words."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hello:
    """A vehicle that wants to hear signals and tells nothing else yet."""

    car: int | None
    """Its number; None where it does not say: then it hears of all cars' laps."""


def parse(line: bytes, came_ns: int) -> VehicleWord | Hello:
    """What `line`, without its line end, says; `came_ns` is when it came, CLOCK_MONOTONIC.

    Members that are not known are passed over. Raises `Nonsense`.
    """
    found = _object(line)
    if "hello" in found:
        hello = Hello(car=_whole(found, "car"))
        _check(VehicleWord(came_ns=came_ns, car=1 if hello.car is None else hello.car))
        return hello
    car = _whole(found, "car")
    inference_ms, steering, throttle = (_number(found, name) for name in _NUMBERS)
    if inference_ms is None and steering is None and throttle is None:
        raise Nonsense(f"none of {', '.join(_NUMBERS)}")
    word = VehicleWord(
        came_ns=came_ns,
        car=1 if car is None else car,
        seq=_whole(found, "seq"),
        inference_ms=inference_ms,
        steering=steering,
        throttle=throttle,
    )
    _check(word)
    return word


def _check(word: VehicleWord) -> None:
    wrong = fault(word)
    if wrong is not None:
        raise Nonsense(wrong)


def _object(line: bytes) -> dict[str, Any]:
    if len(line) > MOST_LINE_BYTES:
        raise Nonsense(f"longer than {MOST_LINE_BYTES} bytes")
    try:
        found = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise Nonsense("no JSON") from error
    if not isinstance(found, dict):
        raise Nonsense("no JSON object")
    return found


def _whole(found: dict[str, Any], name: str) -> int | None:
    value = found.get(name)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int):
        raise Nonsense(f"{name} {_shown(value)} is no whole number")
    return value


def _number(found: dict[str, Any], name: str) -> float | None:
    value = found.get(name)
    if value is None:
        return None
    # Beyond what a float holds a whole number cannot become one; whether one is within its bounds is asked later.
    if isinstance(value, bool) or not isinstance(value, int | float) or abs(value) > 1e300:
        raise Nonsense(f"{name} {_shown(value)} is no number")
    return float(value)


def _shown(value: object) -> str:
    text = repr(value) if isinstance(value, str | float | bool) else type(value).__name__
    return text if len(text) <= _MOST_SHOWN else f"{text[:_MOST_SHOWN]}..."
