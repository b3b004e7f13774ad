"""The recording keeps a camera's JPEGs byte for byte: what a run is judged by is what the camera saw."""

import cv2
import numpy as np
import pytest
from kernel_camera import webcam_controls

from dnb_edge.capture.settings import CaptureSettings
from dnb_edge.capture.source import open_source
from dnb_edge.record.header import RunHeader, software_versions
from dnb_edge.record.reader import iter_frames, read_run
from dnb_edge.record.writer import Recorder, RecordingSettings


def picture(grey: int, **options: int) -> bytes:
    """A JPEG with a little of everything that an encoder may do otherwise than ours."""
    image = np.full((48, 64, 3), grey, dtype=np.uint8)
    cv2.circle(image, (grey % 40 + 10, 20), 9, (10, 200, 90), -1)
    flags = [value for name, number in options.items() for value in (getattr(cv2, f"IMWRITE_JPEG_{name}"), number)]
    return cv2.imencode(".jpg", image, flags)[1].tobytes()


@pytest.mark.parametrize(
    "sent",
    [
        [picture(g) for g in (20, 90, 160)],
        [picture(g, QUALITY=31) for g in (20, 90, 160)],
        [picture(g, PROGRESSIVE=1, OPTIMIZE=1) for g in (20, 90, 160)],
        [picture(g) + bytes(37) for g in (20, 90, 160)],
        [picture(g)[:2] + b"\xff\xfe\x00\x06cam\x00" + picture(g)[2:] for g in (20, 90, 160)],
    ],
    ids=["plain", "coarse", "progressive", "padded with zeros", "with a camera's comment"],
)
def test_recorded_pictures_are_the_cameras_bytes(play_camera, tmp_path, sent):
    """From the driver's buffer through source and recorder into the MCAP and out again: not a byte is another."""
    camera = play_camera(controls=webcam_controls())
    source = open_source(f"v4l2:{camera.path}", CaptureSettings(width_px=64, height_px=48, gain=7))
    header = RunHeader(name="a car", setup={}, config={}, source=source.info, versions=software_versions())
    recorder = Recorder(RecordingSettings(directory=tmp_path, image_fps=1000.0, lossless=True), header)
    frames = source.frames()
    for i, data in enumerate(sent):
        camera.finish(data, sequence=i, t_us=1_000_000 + 33_333 * i)
        recorder.add_frame(next(frames))
    source.close()
    path = recorder.close()
    assert read_run(path).header.source == source.info
    kept = list(iter_frames(path))
    assert [frame.jpeg for frame in kept] == sent
    assert [(frame.sequence, frame.t_ns) for frame in kept] == [(i, 1_000_000_000 + 33_333_000 * i) for i in range(3)]
