"""One contract for every source of frames: files, recordings, the simulator, and cameras played and real."""

import os
import threading
from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice, pairwise

import cv2
import numpy as np
import pytest
from clips import write_clip

from dnb_edge.capture.recording import RecordingSource
from dnb_edge.capture.settings import CaptureSettings
from dnb_edge.capture.source import FrameSource, open_source
from dnb_edge.values import Clock, Frame, SourceInfo, StampSource

CAMERA = os.environ.get("DNB_EDGE_TEST_CAMERA")
LIBCAMERA = os.environ.get("DNB_EDGE_TEST_LIBCAMERA")


@dataclass(frozen=True)
class Case:
    """How to open one kind of source, and, for one that needs it, how to have a frame made."""

    open: Callable[[], FrameSource]
    take: int
    prompt: Callable[[int], None] = lambda _i: None


def video_case(fixture) -> Case:
    clip = write_clip(fixture("tmp_path") / "clip.mp4")
    return Case(open=lambda: open_source(f"file:{clip}"), take=12)


def simulator_case(fixture) -> Case:
    return Case(open=lambda: open_source("sim:?laps=1&seed=4&fps=5"), take=8)


def recording_case(fixture) -> Case:
    info = SourceInfo(uri="mcap:a.mcap", width_px=32, height_px=16, nominal_fps=None, clock=Clock.MONOTONIC, live=False)
    jpeg = cv2.imencode(".jpg", np.zeros((16, 32, 3), dtype=np.uint8))[1].tobytes()
    frames = [
        Frame(sequence=s, t_ns=s * 7, stamp_source=StampSource.END_OF_FRAME, width_px=32, height_px=16, jpeg=jpeg)
        for s in (3, 4, 9, 10)
    ]
    opened = lambda uri, path: RecordingSource(uri, info, frames)  # noqa: E731
    return Case(open=lambda: open_source("mcap:a.mcap", open_recording=opened), take=4)


def played_camera_case(fixture) -> Case:
    camera = fixture("play_camera")()
    jpeg = cv2.imencode(".jpg", np.zeros((48, 64, 3), dtype=np.uint8))[1].tobytes()
    settings = CaptureSettings(width_px=64, height_px=48)
    return Case(
        open=lambda: open_source(f"v4l2:{camera.path}", settings),
        take=9,
        prompt=lambda i: camera.finish(jpeg, sequence=i, t_us=1000 + 33_333 * i),
    )


def real_camera_case(fixture) -> Case:
    if CAMERA is None:
        pytest.skip("no camera to test with: set DNB_EDGE_TEST_CAMERA=/dev/video0 (and _SIZE=640x480, _FPS=15) to one")
    width, height = os.environ.get("DNB_EDGE_TEST_CAMERA_SIZE", "1280x720").split("x")
    fps = float(os.environ.get("DNB_EDGE_TEST_CAMERA_FPS", "30"))
    settings = CaptureSettings(width_px=int(width), height_px=int(height), fps=fps)
    return Case(open=lambda: open_source(f"v4l2:{CAMERA}", settings), take=20)


def played_libcamera_case(fixture) -> Case:
    camera = fixture("play_libcamera").plug()
    jpeg = cv2.imencode(".jpg", np.zeros((48, 64, 3), dtype=np.uint8))[1].tobytes()
    settings = CaptureSettings(width_px=64, height_px=48)
    return Case(
        open=lambda: open_source(f"libcamera:{camera.id}", settings),
        take=9,
        prompt=lambda i: camera.finish(jpeg, sequence=i, sensor_ns=1000 + 33_333_000 * i),
    )


def real_libcamera_case(fixture) -> Case:
    if LIBCAMERA is None:
        pytest.skip("no libcamera camera to test with: set DNB_EDGE_TEST_LIBCAMERA=0 (and DNB_EDGE_TEST_CAMERA_SIZE)")
    width, height = os.environ.get("DNB_EDGE_TEST_CAMERA_SIZE", "1280x720").split("x")
    settings = CaptureSettings(width_px=int(width), height_px=int(height))
    return Case(open=lambda: open_source(f"libcamera:{LIBCAMERA}", settings), take=20)


CASES = [
    video_case,
    simulator_case,
    recording_case,
    played_camera_case,
    real_camera_case,
    played_libcamera_case,
    real_libcamera_case,
]


@pytest.fixture(params=CASES)
def case(request) -> Case:
    return request.param(request.getfixturevalue)


def taken(case: Case, source: FrameSource, count: int) -> list[Frame]:
    frames, result = source.frames(), []
    for i in range(count):
        case.prompt(i)
        result.extend(islice(frames, 1))
    return result


def test_frames_keep_order_size_and_kind(case):
    """Stamps and sequence numbers strictly increase, every size is the announced one, and a picture comes in one form."""
    source = case.open()
    frames = taken(case, source, case.take)
    source.close()
    assert len(frames) == case.take
    for before, after in pairwise(frames):
        assert after.t_ns > before.t_ns
        assert after.sequence > before.sequence
    for frame in frames:
        assert (frame.width_px, frame.height_px) == (source.info.width_px, source.info.height_px)
        assert (frame.jpeg is None) != (frame.bgr is None)
        assert isinstance(frame.t_ns, int)
        if frame.bgr is not None:
            assert frame.bgr.shape == (frame.height_px, frame.width_px, 3)
            assert frame.bgr.dtype == np.uint8
        assert (frame.arrived_ns is not None) == source.info.live


def test_every_missing_frame_is_accounted_for(case):
    """Numbers that are missing among the frames and frames that the source says it lost are as many, after each frame; what
    waits to be taken loses none. Another thread may ask."""
    source = case.open()
    frames = source.frames()
    case.prompt(0)
    first = next(frames)
    before = sum(lost.frames for lost in source.lost)
    asked = []
    for i in range(1, min(case.take, 8)):
        case.prompt(i)
        frame = next(frames)
        asker = threading.Thread(target=lambda: asked.append(source.lost))
        asker.start()
        asker.join()
        missing = frame.sequence - first.sequence - i
        if source.info.live:
            assert sum(lost.frames for lost in asked[-1]) - before == missing
        else:
            assert asked[-1] == ()
    source.close()
    assert all(lost.frames > 0 for lost in source.lost)


def test_what_a_source_says_of_itself(case):
    """A camera tells who it is, its driver and format; a file has none of them."""
    source = case.open()
    info = source.info
    source.close()
    told = (info.camera_id, info.driver, info.pixel_format)
    assert all(told) if info.live else not any(told)
    assert info.controls == ()


def test_close_is_repeatable_and_ends_the_frames(case):
    """After `close`, also from another thread and more than once, the iteration ends without an error."""
    source = case.open()
    frames = source.frames()
    case.prompt(0)
    next(frames)
    closer = threading.Thread(target=source.close)
    closer.start()
    closer.join()
    source.close()
    assert list(frames) == []
    assert list(source.frames()) == []


def test_opening_again_gives_the_same_frames(case):
    """A medium that waits gives the same stamps, numbers and pixels each time; a camera opens again after `close`."""
    first_source = case.open()
    first = taken(case, first_source, 3)
    first_source.close()
    second_source = case.open()
    second = taken(case, second_source, 3)
    second_source.close()
    assert len(first) == len(second) == 3
    if first_source.info.live:
        return
    for a, b in zip(first, second, strict=True):
        assert (a.sequence, a.t_ns, a.jpeg) == (b.sequence, b.t_ns, b.jpeg)
        assert (a.bgr is None) == (b.bgr is None)
        assert a.bgr is None or np.array_equal(a.bgr, b.bgr)
