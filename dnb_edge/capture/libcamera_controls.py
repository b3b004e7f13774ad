"""From a user's choices to libcamera's controls, checked against those that the camera has.

Knows libcamera's names, units and ranges. Knows no stream.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

from dnb_edge.capture.settings import CaptureSettings
from dnb_edge.errors import InputError
from dnb_edge.values import CameraControl

Value: TypeAlias = bool | int | float | tuple[int, int]

_BY_ITSELF, _BY_HAND = 0, 1
_AF_BY_HAND, _AF_CONTINUOUS = 0, 2
# Lamps flicker twice in a period of the mains; libcamera wants that time, microseconds.
_FLICKER: dict[str | int, dict[str, Value]] = {
    "off": {"AeFlickerMode": 0},
    50: {"AeFlickerMode": 1, "AeFlickerPeriod": 10_000},
    60: {"AeFlickerMode": 1, "AeFlickerPeriod": 8_333},
    "auto": {"AeFlickerMode": 2},
}
_RATE = "FrameDurationLimits"


@dataclass(frozen=True, slots=True, kw_only=True)
class Wish:
    """One control to set, and which of the user's choices it comes from."""

    key: str
    """The choice's name, such as `exposure_us`."""
    value: Value


def wishes(settings: CaptureSettings, has: Mapping[str, Any]) -> dict[str, Wish]:
    """libcamera's controls for `settings`, by name. `has`: the camera's controls; libcamera 0.5 and later tell the modes of
    exposure and gain apart where 0.4 has one switch for both.
    """
    by_key = {
        "exposure_us": _exposure(settings, split="ExposureTimeMode" in has),
        "gain": _gain(settings, split="AnalogueGainMode" in has),
        "white_balance_k": _white_balance(settings),
        "focus": _focus(settings),
        "power_line_hz": {} if settings.power_line_hz is None else _FLICKER[settings.power_line_hz],
        "controls": dict(settings.controls),
    }
    return {name: Wish(key=key, value=value) for key, values in by_key.items() for name, value in values.items()}


def _exposure(settings: CaptureSettings, *, split: bool) -> Mapping[str, Value]:
    asked = settings.exposure_us
    if asked is None:
        return {}
    if asked == "auto":
        return {"ExposureTimeMode": _BY_ITSELF} if split else {"AeEnable": True}
    mode: dict[str, Value] = {"ExposureTimeMode": _BY_HAND} if split else {"AeEnable": False}
    return mode | {"ExposureTime": round(asked)}


def _gain(settings: CaptureSettings, *, split: bool) -> Mapping[str, Value]:
    if settings.gain is None:
        return {}
    mode: dict[str, Value] = {"AnalogueGainMode": _BY_HAND} if split else {}
    return mode | {"AnalogueGain": float(settings.gain)}


def _white_balance(settings: CaptureSettings) -> Mapping[str, Value]:
    asked = settings.white_balance_k
    if asked is None or asked == "auto":
        return {} if asked is None else {"AwbEnable": True}
    return {"AwbEnable": False, "ColourTemperature": round(asked)}


def _focus(settings: CaptureSettings) -> Mapping[str, Value]:
    asked = settings.focus
    if asked is None or asked == "auto":
        return {} if asked is None else {"AfMode": _AF_CONTINUOUS}
    return {"AfMode": _AF_BY_HAND, "LensPosition": float(asked)}


def to_set(uri: str, settings: CaptureSettings, offered: Mapping[Any, Any]) -> tuple[dict[Any, Value], dict[str, Wish]]:
    """The bindings' controls to set with their values, and the user's wishes behind them, the rate apart.

    `offered`: the bindings' `Camera.controls`. Raises `InputError` naming a control that the camera has not, or its range.
    """
    has = {control.name: (control, info) for control, info in offered.items()}
    asked = wishes(settings, has)
    values: dict[Any, Value] = {}
    for name, wish in asked.items():
        if name not in has:
            raise InputError(
                f"{uri}: {wish.key}: the camera has no control {name!r}: it has {', '.join(sorted(has)) or 'none'}"
            )
        control, info = has[name]
        values[control] = _checked(uri, name, wish, control, info)
    if _RATE in has:
        duration_us = round(_duration_us(settings, has[_RATE][1]))
        values[has[_RATE][0]] = (duration_us, duration_us)
    return values, asked


def nominal_fps(settings: CaptureSettings, offered: Mapping[Any, Any]) -> float | None:
    """The rate that the camera was asked for, within what it can; None where libcamera cannot set it."""
    for control, info in offered.items():
        if control.name == _RATE:
            return 1e6 / _duration_us(settings, info)
    return None


def _duration_us(settings: CaptureSettings, info: Any) -> float:
    """Time from frame to frame, the nearest to the one asked for that the camera has."""
    return min(max(1e6 / settings.fps, info.min or 0.0), info.max or float("inf"))


def taken(asked: Mapping[str, Wish], metadata: Mapping[str, Any]) -> tuple[CameraControl, ...]:
    """What was asked beside what the camera says about its first frame (`metadata`, by name)."""
    return tuple(
        CameraControl(name=name, asked=_number(wish.value), taken=_number(metadata.get(name)))
        for name, wish in sorted(asked.items())
    )


def _number(value: Any) -> Any:
    """A plain number, or None: some controls tell several, or text."""
    return value + 0 if isinstance(value, bool | int | float) else None


def _checked(uri: str, name: str, wish: Wish, control: Any, info: Any) -> Value:
    """The value in the control's own type. Raises `InputError` where it lies outside the control's range."""
    kind = control.type.name
    value: Value = wish.value
    if kind == "Float" and isinstance(value, int):
        value = float(value)
    elif kind == "Bool":
        value = bool(value)
    low, high = info.min, info.max
    numbers = all(isinstance(bound, int | float) for bound in (low, high))
    if numbers and low < high and isinstance(value, int | float) and not low <= value <= high:
        raise InputError(f"{uri}: {wish.key}: {name} must lie between {low:g} and {high:g}, not {value:g}")
    return value
