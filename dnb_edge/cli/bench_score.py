"""How long it takes to score a recording again: a drive is recorded as a race records it, and raced again from its file.

The detections are simulated from where the car truly was, with a network's scatter, a missed frame in a hundred, and something
else in every third frame: no picture is drawn, so an hour is recorded in a minute. Knows the rooms that record and replay.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dnb_edge.archive.replayed import replay
from dnb_edge.assembly import assemble, make_header, make_scene
from dnb_edge.capture.simulated import SimulatedSource, SimulatorOptions
from dnb_edge.config.schema import Config
from dnb_edge.core import Core
from dnb_edge.record.channels import DETECTIONS_TOPIC
from dnb_edge.record.reader import read_run
from dnb_edge.record.writer import Recorder, RecordingSettings
from dnb_edge.sim.rig import Rig, floor_to_camera_px
from dnb_edge.values import Detection, Frame, FrameDetections, Health, StampSource

HOUR_FRAMES = 108_000
"""At 30 frames a second."""

IMAGE_FRAMES = 6
"""A picture in so many frames: five a second."""

SIGMA_PX = 1.5
MISSED = 0.01
OTHERS = 0.37
"""Share of frames in which something besides the car is found: what the network finds in the demo."""

PLACES = 12
"""Places in the picture at which that is."""


def rescore_times(config: Config, directory: Path, *, laps: int, jpeg: bytes) -> dict[str, Any]:
    """Time of this process for scoring a drive of `laps` laps of the demo again, and what an hour at that rate takes."""
    path = record_drive(config, directory, laps=laps, jpeg=jpeg)
    frames = read_run(path).counts[DETECTIONS_TOPIC]
    began = time.process_time()
    replay(path)
    spent_s = time.process_time() - began
    return {
        "rescored_frames": frames,
        "rescore_us_per_frame": spent_s / frames * 1e6,
        "rescore_hour_s": spent_s / frames * HOUR_FRAMES,
    }


def record_drive(config: Config, directory: Path, *, laps: int, jpeg: bytes) -> Path:
    """Records a race of `laps` laps of the demo, live events and all, with pictures that are all `jpeg`; returns its file.

    `config` is the demo's. Raises `WorkError` where the recording cannot be written.
    """
    info = SimulatedSource("sim:", SimulatorOptions()).info
    assembly = assemble(config, info)
    settings = RecordingSettings(directory=directory, lossless=True)
    recorder = Recorder(settings, make_header(config, assembly, info), make_scene(assembly.setup))
    core = Core(assembly.setup)
    for found in drive_detections(Rig(seed=1, laps=laps)):
        if found.sequence % IMAGE_FRAMES == 0:
            recorder.add_frame(_picture(found, jpeg, info.width_px, info.height_px))
        recorder.add_detections(found)
        for event in core.step(found):
            recorder.add_event(event)
        if found.sequence % 30 == 0:
            recorder.add_event(_health(found))
    for event in core.finish():
        recorder.add_event(event)
    return recorder.close()


def drive_detections(rig: Rig) -> Iterator[FrameDetections]:
    """What a network would find in the frames of the rig's drive. The same rig gives the same bytes."""
    random = np.random.default_rng(rig.frames)
    at_px = floor_to_camera_px(rig.camera, np.array([rig.frame_truth(i).track_m for i in range(rig.frames)]))
    at_px += random.normal(0.0, SIGMA_PX, at_px.shape)
    size_px = (rig.camera.width_px, rig.camera.height_px)
    places = random.uniform((0, 0), size_px, (PLACES, 2))
    for i, (seen, other) in enumerate(zip(random.random(rig.frames) >= MISSED, random.random(rig.frames), strict=True)):
        found = [_detection(at_px[i], confidence=0.8, length_px=85.0)] if seen else []
        if other < OTHERS:
            place = places[int(random.integers(PLACES))] + random.normal(0.0, SIGMA_PX, 2)
            found.append(_detection(place, confidence=0.2, length_px=35.0))
        yield FrameDetections(
            sequence=i,
            t_ns=rig.t_ns(i),
            detections=tuple(found),
            full_frame=False,
            stamp_source=StampSource.SIMULATED,
        )


def _detection(at_px: Any, *, confidence: float, length_px: float) -> Detection:
    u, v = at_px.tolist()
    return Detection(
        camera_px=(u, v),
        sigma_px=SIGMA_PX,
        length_px=length_px + u % 1.0,
        confidence=confidence,
        heading_rad=v % 3.0,
        moving=True,
        colour_bgr=(72.0 + u % 1.0, 84.0 + v % 1.0, 86.0),
    )


def _picture(found: FrameDetections, jpeg: bytes, width_px: int, height_px: int) -> Frame:
    return Frame(
        sequence=found.sequence,
        t_ns=found.t_ns,
        stamp_source=StampSource.SIMULATED,
        width_px=width_px,
        height_px=height_px,
        jpeg=jpeg,
    )


def _health(found: FrameDetections) -> Health:
    return Health(
        t_ns=found.t_ns,
        t_s=found.t_ns * 1e-9,
        frames=found.sequence,
        detected_frames=found.sequence,
        dropped_frames=0,
        fps=30.0,
        latency_ms=None,
        display="none",
        recording="recording",
        view_error_mean_px=1.0,
        view_error_mean_m=0.001,
    )
