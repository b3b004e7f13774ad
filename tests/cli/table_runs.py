"""Recordings of cars on a round track, seen by a camera straight above: exact input for the tests of `table`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dnb_edge.core import CoreSetup
from dnb_edge.motion.settings import MotionSettings
from dnb_edge.race.crossing import CrossingSettings
from dnb_edge.race.rules import LapRules
from dnb_edge.record.header import RunHeader
from dnb_edge.record.identity import identity_of
from dnb_edge.record.writer import Recorder, RecordingSettings
from dnb_edge.score.similarity import ScoreSettings
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.line import line_across
from dnb_edge.track.model import Track
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import (
    Clock,
    Detection,
    EntryInfo,
    Frame,
    FrameDetections,
    Health,
    PointM,
    SourceInfo,
    StampSource,
    VehicleReport,
)
from dnb_edge.view.ground import GroundMap

FPS = 30.0
SCALE = TwinScale(metres_per_px=0.01, height_px=400.0)
GROUND = GroundMap(camera_to_twin=(0.4, 0, 0, 0, 0.4, 0, 0, 0, 1.0), scale=SCALE, width_px=1000, height_px=1000)
SOURCE = SourceInfo(uri="sim:", width_px=1000, height_px=1000, nominal_fps=FPS, clock=Clock.SIMULATED, live=False)


def on_circle(angle_rad: float, radius_m: float = 1.0) -> PointM:
    return 2.0 + radius_m * math.cos(angle_rad), 2.0 + radius_m * math.sin(angle_rad)


def circle(name: str = "circle", *, radius_m: float = 1.0, reverse: bool = False, line_at_m: float = 0.0) -> Track:
    """A round track driven anticlockwise unless `reverse`."""
    angles = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    half = np.full(200, 0.15)
    points = np.array([on_circle(-angle if reverse else angle, radius_m) for angle in angles])
    centreline = Centreline(points_m=points, half_left_m=half, half_right_m=half)
    start = line_across(centreline, line_at_m, name="start", margin_m=0.05)
    return Track(name=name, scale=SCALE, centreline=centreline, start_line=start)


def setup(**changes: Any) -> CoreSetup:
    parts: dict[str, Any] = {
        "track": circle(),
        "ground": GROUND,
        "motion": MotionSettings(),
        "crossing": CrossingSettings(),
        "laps": LapRules(),
        "score": ScoreSettings(),
    }
    return CoreSetup(**(parts | changes))


@dataclass(frozen=True)
class Car:
    """Drives its laps in these times, so far beside the centreline."""

    lap_times_s: Sequence[float]
    off_m: float = 0.0
    start_rad: float = -0.6

    def at(self, t_s: float) -> PointM:
        """Where it is; the first time also gives the pace before the first lap, the last after the last."""
        angle, left_s = self.start_rad, t_s
        pace = 2 * math.pi / self.lap_times_s[0]
        stages = [(-self.start_rad, pace), *((2 * math.pi, 2 * math.pi / time_s) for time_s in self.lap_times_s)]
        for turn_rad, omega in stages:
            lasts_s = turn_rad / omega
            if left_s < lasts_s:
                return on_circle(angle + left_s * omega, 1.0 - self.off_m)
            angle, left_s, pace = angle + turn_rad, left_s - lasts_s, omega
        return on_circle(angle + left_s * pace, 1.0 - self.off_m)

    @property
    def lasts_s(self) -> float:
        return sum(self.lap_times_s) + self.lap_times_s[0] * -self.start_rad / (2 * math.pi) + 0.6


def record(
    directory: Path,
    file: str,
    *cars: Car,
    made: CoreSetup | None = None,
    image_fps: float | None = None,
    health: Sequence[Health] = (),
    vehicle: Sequence[VehicleReport] = (),
    **header: Any,
) -> Path:
    """A finished recording of `cars` in `file`, with grey pictures where `image_fps` is given; keywords are the header's."""
    made = made if made is not None else setup()
    told: dict[str, Any] = {"name": "net", "source": SOURCE, "config": {}} | header
    start = RunHeader(
        setup={"core": made.to_dict(), "calibration": {}, "sha256": {}}, identity=identity_of(made).to_dict(), **told
    )
    if "entry" in header:
        start = replace(start, name=header["entry"].name)
    directory.mkdir(parents=True, exist_ok=True)
    writer = Recorder(
        RecordingSettings(directory=directory, image_fps=image_fps, lossless=True, sync_period_s=3600.0), start, None
    )
    for k in range(int(max((car.lasts_s for car in cars), default=1.0) * FPS)):
        t_ns = round(k * 1e9 / FPS)
        found = tuple(_detection(car, t_ns * 1e-9) for car in cars)
        if image_fps is not None:
            writer.add_frame(_picture(k, t_ns))
        writer.add_detections(FrameDetections(sequence=k, t_ns=t_ns, detections=found, full_frame=True))
    for one in (*health, *vehicle):
        writer.add_event(one)
    return writer.close().rename(directory / file)


def _picture(sequence: int, t_ns: int) -> Frame:
    grey = np.full((GROUND.height_px, GROUND.width_px, 3), 90, np.uint8)
    return Frame(
        sequence=sequence, t_ns=t_ns, stamp_source=StampSource.SIMULATED, width_px=1000, height_px=1000, bgr=grey
    )


def entry(name: str, version: str = "", checkpoint: str | None = None) -> EntryInfo:
    return EntryInfo(name=name, version=version, checkpoint_sha256=checkpoint)


def _detection(car: Car, t_s: float) -> Detection:
    camera_px = GROUND.point_to_camera_px(car.at(t_s))
    assert camera_px is not None
    return Detection(camera_px=camera_px, sigma_px=1.0, length_px=40.0, confidence=0.9)
