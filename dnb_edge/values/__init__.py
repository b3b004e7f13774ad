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

from dnb_edge.values.following import Observation, Target, TargetState
from dnb_edge.values.frames import (
    BgrImage,
    CameraControl,
    Clock,
    Detection,
    Frame,
    FrameDetections,
    LostFrames,
    PointM,
    PointPx,
    Points,
    SearchWindow,
    SourceInfo,
    StampSource,
    path_points,
)
from dnb_edge.values.racing import (
    Crossing,
    Direction,
    Incident,
    IncidentKind,
    Lap,
    PassStatus,
    Penalty,
    Score,
    SectorTime,
)
from dnb_edge.values.telling import (
    EntryInfo,
    Event,
    Health,
    RacePhase,
    RaceState,
    Running,
    RunSummary,
    Standing,
    Standings,
    VehicleReport,
)

__all__ = [
    "BgrImage",
    "CameraControl",
    "Clock",
    "Crossing",
    "Detection",
    "Direction",
    "EntryInfo",
    "Event",
    "Frame",
    "FrameDetections",
    "Health",
    "Incident",
    "IncidentKind",
    "Lap",
    "LostFrames",
    "Observation",
    "PassStatus",
    "Penalty",
    "PointM",
    "PointPx",
    "Points",
    "RacePhase",
    "RaceState",
    "RunSummary",
    "Running",
    "Score",
    "SearchWindow",
    "SectorTime",
    "SourceInfo",
    "StampSource",
    "Standing",
    "Standings",
    "Target",
    "TargetState",
    "VehicleReport",
    "path_points",
]
