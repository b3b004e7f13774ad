"""The part of the configuration that is about devices: the camera, the disk, the display.

Knows each key's type, default and meaning. Knows no driver.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, Field

from dnb_edge.config.paths import ConfigPath
from dnb_edge.config.sections import STRICT, Number, Whole


class CaptureConfig(BaseModel):
    """Where frames come from."""

    model_config = STRICT

    source: str | None = None
    """v4l2:/dev/video0, v4l2:/dev/v4l/by-id/..., libcamera:0, file:clip.mp4, mcap:run.mcap or sim:; the command line's --source
    wins."""
    width_px: Annotated[Whole, Field(ge=16)] = 1280
    """Width asked of a camera, px."""
    height_px: Annotated[Whole, Field(ge=16)] = 720
    """Height asked of a camera, px."""
    fps: Annotated[Number, Field(gt=0)] = 30.0
    """Rate asked of a camera, frames per second."""
    row_us: Annotated[Number, Field(ge=0)] = 0.0
    """Time from one row of the picture to the next of a rolling shutter, microseconds; 0 where it is not known or all rows are
    seen at once. A webcam that takes most of 1/30 s to read its 720 rows needs about 40."""
    pixel_format: Literal["MJPG", "YUYV"] | None = None
    """Pixel format asked of a V4L2 camera; none for MJPG where the camera has it, else YUYV."""
    exposure_us: Literal["auto"] | Annotated[Number, Field(gt=0)] | None = None
    """Exposure time, microseconds, or auto; none leaves the camera as it is."""
    gain: Annotated[Number, Field(ge=0)] | None = None
    """Gain, in the camera's own units (libcamera: a factor); none leaves the camera as it is."""
    white_balance_k: Literal["auto"] | Annotated[Number, Field(gt=0)] | None = None
    """Colour temperature of the light, kelvin, or auto; none leaves the camera as it is."""
    focus: Literal["auto"] | Annotated[Number, Field(ge=0)] | None = None
    """Focus, in the camera's own units (libcamera: dioptres), or auto; none leaves the camera as it is."""
    power_line_hz: Literal["off", "auto", 50, 60] | None = None
    """Frequency of the mains that lamps flicker by; none leaves the camera as it is."""
    controls: dict[str, Whole] = {}
    """Any other V4L2 control by its driver's name, such as sharpness; set after those above."""


class RecordConfig(BaseModel):
    """The recording of the run."""

    model_config = STRICT

    directory: ConfigPath | None = None
    """Where recordings go; none for no recording. The command line's --record wins."""
    image_fps: Annotated[Number, Field(ge=0)] = 5.0
    """Pictures per second that are kept; 0 for none."""


class DisplayConfig(BaseModel):
    """What shows the race besides the terminal."""

    model_config = STRICT

    uri: str | None = None
    """serial:/dev/ttyUSB0; none for no display. The command line's --display wins."""
