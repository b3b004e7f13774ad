"""The part of the configuration that is about devices: the camera, the disk, the display.

Knows each key's type, default and meaning. Knows no driver.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import BaseModel, Field, model_validator

from dnb_edge.config.paths import ConfigPath
from dnb_edge.config.sections import STRICT, Number, Whole

_SLACK = 1.1
"""Cameras' rates are rounded: 30 may be 29.97."""

_V4L2_CONTROLS = {
    "exposure_us": ("exposure_time_absolute", "auto_exposure", "exposure", "exposure_absolute", "exposure_auto"),
    "gain": ("gain", "analogue_gain"),
    "white_balance_k": ("white_balance_temperature", "white_balance_automatic", "white_balance_temperature_auto"),
    "focus": ("focus_absolute", "focus_automatic_continuous", "focus_auto"),
    "power_line_hz": ("power_line_frequency",),
}
"""What each key sets, by the names of kernels new and old."""


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

    @model_validator(mode="after")
    def _possible(self) -> Self:
        frame_us = 1e6 / self.fps
        if isinstance(self.exposure_us, float) and self.exposure_us > frame_us:
            raise ValueError(
                f"exposure_us: {self.exposure_us:g} is longer than a frame lasts at {self.fps:g} a second ({frame_us:.0f}): "
                "lower exposure_us or fps"
            )
        if self.row_us * self.height_px > frame_us * _SLACK:
            raise ValueError(
                f"row_us: {self.height_px} rows of {self.row_us:g} take longer than a frame lasts at {self.fps:g} a second "
                f"({frame_us:.0f}): it is the time of one row, not of the picture"
            )
        for key, controls in _V4L2_CONTROLS.items():
            twice = next((name for name in self.controls if name in controls), None)
            if twice is not None and getattr(self, key) is not None:
                raise ValueError(f"give {key} or controls.{twice}, not both")
        return self


class RecordConfig(BaseModel):
    """The recording of the run."""

    model_config = STRICT

    directory: ConfigPath | None = None
    """Where recordings go; none for no recording. The command line's --record wins."""
    image_fps: Annotated[Number, Field(ge=0)] | None = None
    """Pictures per second that are kept; 0 for no pictures, none for 1 of a camera and 5 of a file or the simulator."""
    image_ring_mb: Annotated[Number, Field(ge=0)] = 2000.0
    """A camera's pictures lie beside the recording, megabytes at most, and the oldest go; the recording itself holds those of
    incidents. 0 to keep them all in the recording, which then grows by gigabytes a day. Files and the simulator always do."""
    fallback: tuple[ConfigPath, ...] = ()
    """Directories to go on in where the disk of `directory` fails, such as one on a USB stick. They must be there: one that is
    missing, since its stick is, is passed over."""
    keep_free_mb: Annotated[Number, Field(ge=0)] = 200.0
    """Room that recordings leave on the disk, megabytes, but a tenth of the disk at most: below it pictures are no longer
    recorded, below half of it no detections; laps always are."""
    max_total_gb: Annotated[Number, Field(gt=0)] | None = None
    """Most that the recordings in `directory` take together, gigabytes; none for no limit."""
    delete_oldest: bool = True
    """Whether old recordings go where these two limits want it, pictures first: only while a camera races, only recordings that
    still have their own name and no pin; see `dnb-edge runs pin`."""
    rotate_h: Annotated[Number, Field(gt=0)] | None = 24.0
    """A camera's recording goes on in another file after so many hours, behind the end of a lap; none for one file."""


class DisplayConfig(BaseModel):
    """What shows the race besides the terminal."""

    model_config = STRICT

    uri: str | None = None
    """serial:/dev/ttyUSB0, or spi:/dev/spidev0.0 for a MAX7219 panel on the box's own pins; none for no display. The command
    line's --display wins."""
