"""Recordings and values to fill them with, shared by the tests of this room."""

from pathlib import Path

import numpy as np
from mcap.reader import make_reader

from dnb_edge.record.channels import TrackScene
from dnb_edge.record.header import RunHeader, software_versions
from dnb_edge.record.writer import Recorder, RecordingSettings
from dnb_edge.values import (
    Clock,
    Detection,
    Frame,
    FrameDetections,
    Lap,
    SourceInfo,
    StampSource,
    Target,
    TargetState,
)

SOURCE = SourceInfo(uri="sim:", width_px=64, height_px=36, nominal_fps=30.0, clock=Clock.SIMULATED, live=False)
HEADER = RunHeader(
    name="demo driver",
    setup={"route_m": [[0.1, 0.2], [1e-17, 3.3]], "lap": {"minimum_s": None}},
    config={"track": {"image": "twin.png"}},
    source=SOURCE,
    versions=software_versions(),
)
SCENE = TrackScene(route_m=np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]), lines_m={"start": ((0.5, -0.1), (0.5, 0.1))})


def recorder(directory: Path, **changes) -> Recorder:
    return Recorder(RecordingSettings(**({"directory": directory, "lossless": True} | changes)), HEADER, SCENE)


def frame(sequence: int, t_ns: int, *, jpeg: bytes | None = None) -> Frame:
    bgr = np.full((36, 64, 3), sequence % 256, np.uint8) if jpeg is None else None
    return Frame(
        sequence=sequence,
        t_ns=t_ns,
        stamp_source=StampSource.SIMULATED,
        width_px=64,
        height_px=36,
        jpeg=jpeg,
        bgr=bgr,
    )


def found(sequence: int, t_ns: int) -> FrameDetections:
    one = Detection(camera_px=(12.5 + sequence, 7.25), sigma_px=0.5, length_px=9.0, confidence=0.9)
    return FrameDetections(sequence=sequence, t_ns=t_ns, detections=(one,), full_frame=True)


def target(t_ns: int) -> Target:
    return Target(
        target_id=1,
        state=TargetState.CONFIRMED,
        t_ns=t_ns,
        t_s=t_ns / 1e9,
        track_m=(0.25, 0.5),
        velocity_mps=(0.0, 1.0),
        covariance_m2=(1e-4, 0.0, 1e-4),
    )


def lap(number: int, end_t_ns: int) -> Lap:
    return Lap(
        number=number,
        start_t_ns=0,
        end_t_ns=end_t_ns,
        start_s=0.0,
        time_s=end_t_ns / 1e9,
        sigma_s=0.002,
        valid=True,
        reasons=(),
        similarity_percent=95.78,
        observed_fraction=1.0,
    )


def small_run(directory: Path, *, frames: int = 60, laps_every: int = 20, **changes) -> Path:
    """A finished recording of detections and targets, with a lap, and so a chunk, every `laps_every` frames."""
    writer = recorder(directory, **({"image_fps": None, "sync_period_s": 3600.0} | changes))
    for sequence in range(frames):
        t_ns = sequence * 33_000_000
        writer.add_frame(frame(sequence, t_ns))
        writer.add_detections(found(sequence, t_ns))
        writer.add_event(target(t_ns))
        if sequence % laps_every == laps_every - 1:
            assert writer.wait_saved(writer.add_event(lap(sequence // laps_every + 1, t_ns)))
    return writer.close()


def chunk_spans(path: Path) -> list[tuple[int, int]]:
    """(start, end) offset of each chunk of a whole file, by the stock reader's index."""
    with path.open("rb") as stream:
        indexes = make_reader(stream).get_summary().chunk_indexes
    return sorted((one.chunk_start_offset, one.chunk_start_offset + one.chunk_length) for one in indexes)
