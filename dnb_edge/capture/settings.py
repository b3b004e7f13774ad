"""What a user may choose about capture, and what a camera made of it. Plain values: the configuration room fills them in, the
sources obey them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

from dnb_edge.values import CameraControl


@dataclass(frozen=True, slots=True, kw_only=True)
class CaptureSettings:
    """Choices for a live camera; files, recordings and the simulator have their own size and rate.

    What is None leaves the camera as it is. The names are those of the configuration's section `capture`.
    """

    width_px: int = 1280
    height_px: int = 720
    fps: float = 30.0
    pixel_format: str | None = None
    """`MJPG` or `YUYV`; None takes MJPEG where the camera has it at this size and rate, else YUYV."""
    exposure_us: Literal["auto"] | float | None = None
    """Exposure time, microseconds, or auto."""
    gain: float | None = None
    """In the camera's own units; libcamera: a factor."""
    white_balance_k: Literal["auto"] | float | None = None
    """Colour temperature of the light, kelvin, or auto."""
    focus: Literal["auto"] | float | None = None
    """In the camera's own units (libcamera: dioptres), or auto."""
    power_line_hz: Literal["off", "auto", 50, 60] | None = None
    """Frequency of the mains that lamps flicker by."""
    controls: dict[str, int] = field(default_factory=dict)
    """Further V4L2 controls by their driver's names (`sharpness` ...), set after those above."""
    buffers: int = 4
    """Kernel buffers; four let the newest be taken while the driver still has some to fill."""
    stall_timeout_s: float = 2.0
    """A camera that gives no whole frame for so long counts as gone."""


RATE_SHARE = 0.01
"""A rate counts as the one asked for within this share: many cameras call 29.97 what they sell as 30."""


def changed_rate(asked_fps: float, granted_fps: float | None) -> tuple[CameraControl, ...]:
    """The frame rate as one more control, where the driver claims another one than it was asked for; else nothing."""
    if granted_fps is None or abs(granted_fps - asked_fps) <= RATE_SHARE * asked_fps:
        return ()
    return (CameraControl(name="frame rate", asked=asked_fps, taken=granted_fps),)


def changed_controls(controls: Iterable[CameraControl]) -> tuple[str, ...]:
    """In words, a line each: the controls that the camera took otherwise than asked."""
    return tuple(
        f"camera: {control.name} is {_number(control.taken)}, not {_number(control.asked)} as asked"
        for control in controls
        if control.taken is not None and control.taken != control.asked
    )


def _number(value: float) -> str:
    """V4L2's are whole numbers, which keep all their digits."""
    return f"{value:.6g}" if isinstance(value, float) else f"{value}"
