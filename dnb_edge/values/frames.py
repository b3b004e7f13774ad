"""Pictures, and what is found in them.

Frozen, slotted, keyword-only; units in the names; frames of reference and clocks as in `dnb_edge.values`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

BgrImage: TypeAlias = NDArray[np.uint8]
"""A picture, shape (height, width, 3), uint8, blue-green-red."""


Points: TypeAlias = NDArray[np.float64]
"""Points in the plane, shape (n, 2), float64; the frame of reference is named where it is used."""


PointPx: TypeAlias = tuple[float, float]
"""One pixel position (u, v)."""


PointM: TypeAlias = tuple[float, float]
"""One position (x, y) in metres on the track plane."""


class Clock(StrEnum):
    """The clock on which a source stamps its frames."""

    MONOTONIC = "monotonic"
    MEDIA = "media"
    SIMULATED = "simulated"


class StampSource(StrEnum):
    """The moment that a frame's stamp stands for."""

    START_OF_FRAME = "start_of_frame"
    END_OF_FRAME = "end_of_frame"
    ARRIVAL = "arrival"
    MEDIA = "media"
    SIMULATED = "simulated"


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraControl:
    """One setting of a camera: what was asked of it, and what it says it took."""

    name: str
    """The driver's name of it, such as `exposure_time_absolute`."""
    asked: float
    """In the driver's own units; V4L2's are whole numbers."""
    taken: float | None
    """The same, read back; None where the camera does not tell."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceInfo:
    """What a source of frames says about itself before its first frame."""

    uri: str
    width_px: int
    height_px: int
    nominal_fps: float | None
    """Frames per second as the device or container claims; for display only, nothing is timed by it."""
    clock: Clock
    live: bool
    """True where frames are lost if nobody takes them (a camera); a file waits."""
    camera_id: str | None = None
    """A stable identity of the device, such as its /dev/v4l/by-id name; None for files."""
    driver: str | None = None
    """The kernel's driver and the camera's own name, such as `uvcvideo: HD Webcam`; None for files."""
    pixel_format: str | None = None
    """FourCC of what the camera sends, such as `MJPG`; None where no camera is asked for one."""
    controls: tuple[CameraControl, ...] = ()
    """The camera's settings that were asked for, and what it really took; empty for files."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LostFrames:
    """Frames that never came to the detector, by reason."""

    reason: str
    """`overtaken`, `queue`, `gap`, `damaged`, `short`, `unreadable` or `stamp`."""
    frames: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Frame:
    """One picture with its stamp. Exactly one of `jpeg` and `bgr` is present."""

    sequence: int
    """The source's own frame counter; a jump of more than one is a gap."""
    t_ns: int
    stamp_source: StampSource
    width_px: int
    height_px: int
    jpeg: bytes | None = None
    """The JPEG bytes as the camera sent them."""
    bgr: BgrImage | None = None
    arrived_ns: int | None = None
    """When a camera's frame came out of its driver, ns of CLOCK_MONOTONIC; None for files and the simulator."""
    camera: int = 0
    """Which camera's it is, counted from 0; sources themselves know of one."""

    def __post_init__(self) -> None:
        if (self.jpeg is None) == (self.bgr is None):
            raise ValueError(f"frame {self.sequence}: needs exactly one of jpeg and bgr")


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchWindow:
    """Where a followed target is expected in the next frame, as the core tells `detect`."""

    target_id: int
    camera_px: PointPx
    length_px: float
    """Expected length of the car in camera px; sets the window's scale."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Detection:
    """One car-like thing in one frame."""

    camera_px: PointPx
    """The ground-contact point: the centre of the car's footprint on the floor, camera px. With `height_m`, the point so
    far above it."""
    sigma_px: float
    """One standard deviation of `camera_px` along either axis, camera px; positive."""
    length_px: float
    """The car's apparent size (longest side of its box), camera px; positive."""
    confidence: float
    """0..1."""
    heading_rad: float | None = None
    """Direction of travel in the picture, atan2 of (-v, u): 0 to the right, pi/2 up; None where the detector cannot tell."""
    moving: bool = False
    """True where the picture differs from the background at this point."""
    marker_id: int | None = None
    """Number of the roof marker that was read; None where there is none or the detector reads none."""
    colour_bgr: tuple[float, float, float] | None = None
    """Mean colour of the car's middle, 0..255 each; None where the detector does not tell."""
    height_m: float = 0.0
    """How far above the floor the thing seen at `camera_px` is, straight above the ground point (a roof marker); 0: on it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameDetections:
    """All that `detect` found in one frame: the pure core's only input."""

    sequence: int
    t_ns: int
    detections: tuple[Detection, ...]
    full_frame: bool
    """True where the whole picture was looked at, False where only the search windows were."""
    view_moved_m: float | None = None
    """How far the picture had moved from where it was calibrated, as far as that was known at this frame: the greatest
    displacement over the track, metres; None where it is not known to have moved."""
    stamp_source: StampSource | None = None
    """The moment that `t_ns` stands for; None in recordings from before detections told it."""
    camera: int = 0
    """Which camera's frame it is, counted from 0; all cameras' stamps are of one clock."""


def path_points(points: Sequence[PointM]) -> Points:
    """An (n, 2) float64 array of `points`; (0, 2) where there are none."""
    return np.asarray(points, dtype=np.float64).reshape(-1, 2)
