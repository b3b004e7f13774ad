"""Every value that crosses from one room to another: frozen, slotted, keyword-only, units in the names.

Frames of reference:

- *camera px*: pixel (u, v) of the picture as delivered, u to the right, v down, origin at the centre of the top-left pixel.
- *twin px*: pixel (u, v) of the digital twin's image, same convention.
- *track m*: metres on the track plane, right-handed: x to the twin's right, y to the twin's top, origin at the bottom-left
  corner of the twin's image.

Clocks: every `t_ns` is an integer of nanoseconds on the *source's* clock: CLOCK_MONOTONIC for a live camera, time from the
start of the medium for a file, simulated time for the simulator. `SourceInfo.clock` says which. `t_s` is seconds from the
first frame of the run on the same clock.

This module knows no arithmetic beyond validation, no file and no device.
"""

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Observation:
    """A detection brought to the track plane."""

    t_ns: int
    t_s: float
    camera_px: PointPx
    track_m: PointM
    covariance_m2: tuple[float, float, float]
    """Covariance of `track_m`, (xx, xy, yy), m^2."""
    confidence: float
    length_px: float
    """Apparent length of the car, camera px."""
    target_id: int | None = None
    """The target that it was taken for; None before that is known."""


class TargetState(StrEnum):
    """Life cycle of a target."""

    TENTATIVE = "tentative"
    CONFIRMED = "confirmed"
    COASTING = "coasting"
    LOST = "lost"


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """One car followed over time, as estimated at `t_ns`."""

    target_id: int
    state: TargetState
    t_ns: int
    t_s: float
    track_m: PointM
    velocity_mps: tuple[float, float]
    covariance_m2: tuple[float, float, float]
    """Covariance of `track_m`, (xx, xy, yy), m^2."""


class Direction(StrEnum):
    """Sense in which a directed line is crossed."""

    FORWARD = "forward"
    REVERSE = "reverse"


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossing:
    """The interpolated instant at which the car's ground point crossed a line."""

    t_ns: int
    t_s: float
    line: str
    direction: Direction
    sigma_s: float
    """One standard deviation of the instant, seconds."""
    track_m: PointM
    target_id: int
    estimated: bool
    """True where the crossing fell into a gap without observations."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lap:
    """One complete lap, from start line to start line."""

    number: int
    start_t_ns: int
    end_t_ns: int
    start_s: float
    """Start of the lap, seconds from the first frame."""
    time_s: float
    sigma_s: float
    valid: bool
    reasons: tuple[str, ...]
    """Why the lap is not valid, as sentences; empty where it is."""
    similarity_percent: float | None
    """Path similarity by the run's metric, 0..100; None where the lap could not be scored."""
    observed_fraction: float
    """Share of the lap's frames in which the car was seen, 0..1."""
    target_id: int | None = None
    """The target that drove it; None in recordings from before laps told it."""
    suspect: tuple[str, ...] = ()
    """Why its numbers may be wrong though the drive was valid (the camera was bumped), as sentences; empty where nothing is
    known against them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """How well one lap's path matches the route."""

    lap: int
    metric: str
    """The metric behind `similarity_percent`: `dtw` or `frechet`."""
    similarity_percent: float
    dtw_mean_m: float
    """DTW distance divided by the number of points of the route, metres."""
    frechet_m: float
    clamp_m: float | None
    baseline_m: float
    completion_time_s: float
    lateral_mean_m: float
    lateral_max_m: float
    path_length_m: float
    route_length_m: float
    target_id: int | None = None
    """The target that drove the lap; None in recordings from before scores told it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Health:
    """How the appliance itself is doing. Fields that depend on the machine's speed are None for sources that are not live."""

    t_ns: int
    t_s: float
    frames: int
    detected_frames: int
    dropped_frames: int
    """Frames lost before the detector, from gaps in the source's sequence and full queues."""
    fps: float | None
    """Frames per second over the last period, by the frames' stamps."""
    latency_ms: float | None
    """Median time from a frame's stamp to its events, over the last period; None where the source is not live."""
    display: str
    """`none`, `online` or `offline`."""
    recording: str
    """`none`, `recording` or `failed`."""
    view_error_mean_px: float | None
    view_error_mean_m: float | None
    """Both: of the points that the view was calibrated by."""
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    """What is not wrong but wants somebody's hand, such as a car that has not moved yet; sentences."""
    picture: str | None = None
    """What is wrong with the picture: `black`, `overexposed`, `covered` or `frozen`; None where it shows something."""
    view_moved_m: float | None = None
    """How far the picture has moved from where it was calibrated, the greatest displacement over the track, metres; None
    where it is not known to have moved."""
    view_sigma_m: float | None = None
    """One standard deviation of the position that the map from picture to track gives, metres, where on the route it is
    greatest; None where the calibration does not tell it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSummary:
    """The last event of a run."""

    frames: int
    detected_frames: int
    laps: int
    recording: str | None
    """Path of the finished recording; None where none was asked for."""
    bad_pictures: tuple[str, ...] = ()
    """What was wrong with the picture and for how long, such as `black for 2.4 s`; empty where it was good."""


Event: TypeAlias = Observation | Target | Crossing | Lap | Score | Health | RunSummary
"""Anything that the core or the appliance says about a race."""


def path_points(points: Sequence[PointM]) -> Points:
    """An (n, 2) float64 array of `points`; (0, 2) where there are none."""
    return np.asarray(points, dtype=np.float64).reshape(-1, 2)
