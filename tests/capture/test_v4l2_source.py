"""The V4L2 source: set-up errors against the real kernel, streaming against a driver played below linuxpy."""

import os
import threading
import time
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kernel_camera import ERROR, MONOTONIC, START_OF_EXPOSURE

from dnb_edge.capture import v4l2
from dnb_edge.capture.settings import CaptureSettings
from dnb_edge.capture.source import open_source
from dnb_edge.capture.v4l2 import stamp_of, yuyv_to_bgr
from dnb_edge.capture.v4l2_setup import refusal
from dnb_edge.capture.v4l2_tally import Tally
from dnb_edge.errors import InputError, TemporaryFault
from dnb_edge.values import Clock, LostFrames, StampSource

SMALL = CaptureSettings(width_px=64, height_px=48, stall_timeout_s=10.0)


def jpeg(grey: int = 90) -> bytes:
    return cv2.imencode(".jpg", np.full((48, 64, 3), grey, dtype=np.uint8))[1].tobytes()


@pytest.mark.parametrize("name", ["/dev/null", "a regular file", "/dev/video-that-is-not-there"])
def test_what_is_no_camera_is_refused_by_name(name, tmp_path):
    """A missing node, a plain file and another kind of device each give one line that names the path and what there is."""
    path = Path(name)
    if name == "a regular file":
        path = tmp_path / "video0"
        path.write_bytes(b"not a camera")
    with pytest.raises(InputError) as caught:
        open_source(f"v4l2:{path}")
    assert str(path) in str(caught.value)
    assert "capture device" in str(caught.value) or "no such camera" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (16, "another program"),
        (13, "no permission"),
        (1, "DeviceAllow=char-video4linux"),
        (25, "not a capture device"),
        (5, "refuses to start"),
    ],
)
def test_kernel_errors_say_what_to_do(number, words):
    """Each errno at set-up becomes a line that names the device and the remedy."""
    error = refusal(Path("/dev/video3"), OSError(number, os.strerror(number)))
    assert words in str(error)
    assert str(error).startswith("/dev/video3: ")


@given(st.integers(0, 10**7), st.integers(0, 999_999), st.sampled_from([0, START_OF_EXPOSURE]))
def test_kernel_stamps_are_exact_nanoseconds(seconds, microseconds, source):
    """Seconds and microseconds become integer nanoseconds without a float between, and the flag says which moment."""
    t_ns, stamp_source = stamp_of(MONOTONIC | source, seconds, microseconds, 7)
    if seconds == microseconds == 0:
        assert (t_ns, stamp_source) == (7, StampSource.ARRIVAL)
    else:
        assert divmod(t_ns, 1000) == (seconds * 1_000_000 + microseconds, 0)
        assert stamp_source is (StampSource.START_OF_FRAME if source else StampSource.END_OF_FRAME)


@pytest.mark.parametrize("flags", [0, 0x4000, START_OF_EXPOSURE])
def test_stamps_of_another_clock_are_not_believed(flags):
    """Without the monotonic flag the stamp is the moment of arrival, and says so."""
    assert stamp_of(flags, 12, 5, 99) == (99, StampSource.ARRIVAL)


def test_yuyv_rows_may_be_padded_and_short_buffers_are_damaged():
    """The stride is the driver's, not twice the width; a buffer that ends early gives no picture."""
    grey = np.full((4, 12), 128, dtype=np.uint8)
    grey[:, :8:2] = 200
    picture = yuyv_to_bgr(grey.tobytes(), 4, 4, 12)
    assert picture is not None
    assert picture.shape == (4, 4, 3)
    assert np.ptp(picture) == 0
    assert yuyv_to_bgr(grey.tobytes()[:-1], 4, 4, 12) is None


def test_streams_with_kernel_stamps_and_numbers(play_camera):
    """Four buffers, MJPEG, the driver's stamps and frame numbers: a jump in the numbers stays a jump."""
    camera = play_camera()
    source = open_source(f"v4l2:{camera.path}", SMALL)
    assert (source.info.width_px, source.info.height_px, source.info.nominal_fps) == (64, 48, 30.0)
    assert (source.info.clock, source.info.live) == (Clock.MONOTONIC, True)
    assert source.info.camera_id == "Played Camera (usb-test-1)"
    assert (source.info.driver, source.info.pixel_format) == ("played: Played Camera", "MJPG")
    assert camera.streaming
    assert len(camera.buffers) == 4
    frames = source.frames()
    for sequence in (0, 1, 5, 6, 9, 10):
        before_ns = time.monotonic_ns()
        camera.finish(jpeg(sequence), sequence=sequence, t_us=1_000_000 + sequence * 33_333)
        frame = next(frames)
        assert (frame.sequence, frame.t_ns) == (sequence, 1_000_000_000 + sequence * 33_333_000)
        assert frame.jpeg == jpeg(sequence)
        assert frame.stamp_source is StampSource.START_OF_FRAME
        assert frame.arrived_ns is not None
        assert before_ns < frame.arrived_ns < time.monotonic_ns()
    source.close()
    assert source.lost == lost(gap=5)
    assert not camera.streaming


def test_the_newest_frame_wins(play_camera):
    """After a pause the newest of the waiting frames is given, the others are counted, and every buffer is queued again."""
    camera = play_camera()
    source = open_source(f"v4l2:{camera.path}", SMALL)
    frames = source.frames()
    for sequence in range(3):
        camera.finish(jpeg(sequence), sequence=sequence, t_us=1_000_000 + sequence)
    assert next(frames).sequence == 2
    assert source.lost == lost(overtaken=2)
    assert len(camera.queued) == 4
    source.close()


def test_frames_that_are_lost_are_counted_by_reason(play_camera):
    """Every number that is missing has its reason: the error flag, no start or no end of the JPEG, nothing at all, a stamp that
    steps back, a jump of the driver's own counter. Between two frames the account is of what lay before the second.
    """
    camera = play_camera()
    source = open_source(f"v4l2:{camera.path}", SMALL)
    frames = source.frames()
    camera.finish(jpeg(), sequence=1, t_us=1_000_000)
    assert next(frames).sequence == 1
    assert source.lost == ()
    bad = [
        (jpeg(), 1_033_000, MONOTONIC | ERROR),
        (b"", 1_066_000, MONOTONIC),
        (jpeg()[:-40], 1_100_000, MONOTONIC),
    ]
    for sequence, (data, t_us, flags) in enumerate(bad, start=2):
        camera.finish(data, sequence=sequence, t_us=t_us, flags=flags)
    camera.finish(jpeg(), sequence=7, t_us=1_200_000)
    assert next(frames).sequence == 7
    assert source.lost == lost(damaged=1, short=2, gap=2)
    camera.finish(jpeg(), sequence=8, t_us=900_000)
    camera.finish(jpeg(7), sequence=9, t_us=1_233_000)
    camera.finish(b"no jpeg" + jpeg(), sequence=10, t_us=1_266_000)
    frame = next(frames)
    assert (frame.sequence, frame.jpeg) == (9, jpeg(7))
    assert source.lost == lost(damaged=1, short=2, gap=2, stamp=1)
    camera.finish(jpeg(), sequence=11, t_us=1_300_000)
    assert next(frames).sequence == 11
    assert source.lost == lost(damaged=2, short=2, gap=2, stamp=1)
    source.close()


@given(
    st.lists(st.tuples(st.sampled_from(["good", "damaged", "short"]), st.integers(1, 3), st.booleans()), max_size=40)
)
def test_every_missing_number_has_a_reason(buffers):
    """Whatever comes in whatever portions: among the frames given, missing numbers and losses told are as many."""
    tally = Tally()
    number, frames, portion = 0, [], None
    for kind, step, ends in buffers:
        number = number + step if number else 1
        assert tally.number(number, number * 33_000_000) == number
        if kind == "good":
            if portion is not None:
                tally.lose("overtaken")
            tally.give()
            portion = number
        else:
            tally.lose(kind)
        if ends:
            tally.publish(given=portion is not None)
            if portion is not None:
                frames.append((portion, sum(one.frames for one in tally.lost)))
            portion = None
    for (first, lost_before), (second, lost_after) in pairwise(frames):
        assert second - first - 1 == lost_after - lost_before


@pytest.mark.parametrize(
    ("told", "numbers"),
    [
        ([(0, 10), (0, 20), (0, 30)], [0, 1, 2]),
        ([(7, 10), (8, 20), (0, 30), (1, 40), (3, 60)], [7, 8, 9, 10, 12]),
        ([(1, 10), (4, 40), (3, 30), (2, 20), (5, 50)], [1, 4, None, None, 5]),
        ([(99, 10), (5, 5), (6, 6)], [99, 100, 101]),
    ],
    ids=["stands still", "begins anew", "wrong order", "begins anew with an older clock"],
)
def test_numbers_go_on_where_a_driver_does_not_count(told, numbers):
    """A counter that stands still or begins anew costs no frame its number; only a jump ahead is a gap, and what comes late
    into it is no second loss."""
    tally = Tally()
    assert [tally.number(sequence, t_ns) for sequence, t_ns in told] == numbers


def test_a_buffer_that_comes_late_is_one_loss(play_camera):
    """Where the driver hands two buffers over in the wrong order, the later one is given, the other is in the gap before it."""
    camera = play_camera()
    source = open_source(f"v4l2:{camera.path}", SMALL)
    frames = source.frames()
    for sequence in (1, 3, 2, 4):
        camera.finish(jpeg(sequence), sequence=sequence, t_us=1_000_000 + sequence * 33_333)
        if sequence != 2:
            assert next(frames).sequence == sequence
    source.close()
    assert source.lost == lost(gap=1)


def test_a_camera_that_sends_only_rubbish_is_a_temporary_fault(play_camera):
    """Buffers that come without end but hold no whole picture are not taken for life: the camera is to be opened anew."""
    camera = play_camera()
    source = open_source(f"v4l2:{camera.path}", CaptureSettings(width_px=64, height_px=48, stall_timeout_s=0.05))
    dequeue, sent, until_s = camera._dqbuf, [], time.monotonic() + 10.0

    def always_ready(fd, buffer):
        try:
            dequeue(fd, buffer)
        except BlockingIOError:
            if time.monotonic() < until_s:
                camera.finish(jpeg()[:-40], sequence=len(sent), t_us=1_000_000 + len(sent))
            sent.append(1)
            raise

    camera._dqbuf = always_ready
    camera.finish(jpeg()[:-40], sequence=0, t_us=1)
    with pytest.raises(TemporaryFault, match="no whole frame"):
        next(source.frames())
    assert time.monotonic() < until_s
    assert source.lost[0].reason == "short"
    source.close()


def test_the_frame_before_the_unplugging_is_given(play_camera):
    """What a camera sent before it went is raced; the fault comes with the next call."""
    camera = play_camera()
    source = open_source(f"v4l2:{camera.path}", SMALL)
    camera.finish(jpeg(), sequence=3, t_us=1_000_000)
    camera.gone_after = 1
    frames = source.frames()
    assert next(frames).sequence == 3
    with pytest.raises(TemporaryFault, match="gone"):
        next(frames)
    source.close()


@pytest.mark.parametrize("grants", [1, 2, 4])
def test_a_driver_may_grant_fewer_buffers(play_camera, grants):
    """Some drivers have fewer than four buffers; frames come all the same, and all are queued again."""
    camera = play_camera(grants=grants)
    source = open_source(f"v4l2:{camera.path}", SMALL)
    frames = source.frames()
    for sequence in range(3):
        camera.finish(jpeg(), sequence=sequence, t_us=1_000_000 + sequence)
        assert next(frames).sequence == sequence
    assert len(camera.buffers) == len(camera.queued) == grants
    source.close()


def test_an_unplugged_camera_is_a_temporary_fault(play_camera):
    """Taking a frame from a camera that is gone asks for another try, and closing it afterwards is quiet."""
    camera = play_camera()
    source = open_source(f"v4l2:{camera.path}", SMALL)
    camera.unplug()
    with pytest.raises(TemporaryFault, match=str(camera.path)):
        next(source.frames())
    source.close()
    source.close()
    # A mapping that stays holds the node: the camera would come back under another number.
    assert [mapped.closed for mapped in camera.buffers] == [True] * 4


def test_an_unplugged_camera_is_let_go_of_a_moment_later(play_camera, monkeypatch):
    """The kernel is still taking it away, and may crash where its file is closed meanwhile. One that is there is closed now."""
    waited = []
    monkeypatch.setattr(v4l2.time, "sleep", lambda seconds: waited.append((seconds, source._device.closed)))
    camera = play_camera()
    source = open_source(f"v4l2:{camera.path}", SMALL)
    source.close()
    assert waited == []
    camera = play_camera()
    source = open_source(f"v4l2:{camera.path}", SMALL)
    camera.unplug()
    source.close()
    assert waited == [(v4l2.UNPLUGGED_S, False)]
    assert source._device.closed


def test_a_silent_camera_is_a_temporary_fault(play_camera):
    """A camera that stays plugged in and sends nothing does not block the appliance for ever."""
    camera = play_camera()
    source = open_source(f"v4l2:{camera.path}", CaptureSettings(width_px=64, height_px=48, stall_timeout_s=0.01))
    with pytest.raises(TemporaryFault, match="no whole frame"):
        next(source.frames())
    source.close()


def test_close_ends_a_blocked_read(play_camera):
    """Another thread may close while `frames` waits; it then ends without an error."""
    camera = play_camera()
    source = open_source(f"v4l2:{camera.path}", CaptureSettings(width_px=64, height_px=48, stall_timeout_s=60.0))
    taken = []
    reader = threading.Thread(target=lambda: taken.extend(source.frames()), daemon=True)
    reader.start()
    wait_for(source._lock.locked)
    closer = threading.Thread(target=source.close, daemon=True)
    closer.start()
    closer.join(10)
    reader.join(10)
    assert not closer.is_alive()
    assert not reader.is_alive()
    assert taken == []


def test_a_raw_camera_gives_pictures(play_camera):
    """Without MJPEG the YUYV picture is converted, a part of one is left out; a driver that knows no rate claims none."""
    camera = play_camera(formats=("YUYV",), rates=False)
    source = open_source(f"v4l2:{camera.path}", SMALL)
    assert source.info.nominal_fps is None
    camera.finish(bytes([200, 128]) * (64 * 48), sequence=0, t_us=1)
    frames = source.frames()
    frame = next(frames)
    assert frame.jpeg is None
    assert frame.bgr is not None
    assert frame.bgr.shape == (48, 64, 3)
    camera.finish(bytes([200, 128]) * (64 * 48 - 1), sequence=1, t_us=2)
    camera.finish(bytes([200, 128]) * (64 * 48), sequence=2, t_us=3)
    assert next(frames).sequence == 2
    assert source.lost == lost(short=1)
    source.close()


@pytest.mark.parametrize(
    ("played", "settings", "words"),
    [
        ({"busy_at": "S_FMT"}, SMALL, "another program"),
        ({"busy_at": "STREAMON"}, SMALL, "another program"),
        ({"caps": 0x04800000}, SMALL, "not a capture device but a camera's second node"),
        ({"caps": 0x04001000}, SMALL, "use libcamera:0"),
        ({"caps": 0x04000002}, SMALL, "not a capture device"),
        ({"formats": ("H264",)}, SMALL, "H264"),
        ({"formats": ()}, SMALL, "no format"),
        ({}, CaptureSettings(), "64x48"),
    ],
)
def test_cameras_that_cannot_do_as_asked_are_refused(play_camera, played, settings, words):
    """Busy, a metadata node, no usable format, another size: one line each, and the device is given back."""
    camera = play_camera(**played)
    with pytest.raises(InputError, match=words) as caught:
        open_source(f"v4l2:{camera.path}", settings)
    assert str(caught.value).startswith(f"{camera.path}: ")
    assert "\n" not in str(caught.value)
    assert all(mapped.closed for mapped in camera.buffers)


def lost(**counts: int) -> tuple[LostFrames, ...]:
    return tuple(LostFrames(reason=reason, frames=frames) for reason, frames in sorted(counts.items()))


def wait_for(condition) -> None:
    """Let the other thread get there; gives up after ten seconds."""
    pause = threading.Event()
    for _ in range(10_000):
        if condition():
            return
        pause.wait(0.001)
    raise AssertionError("the other thread never got there")
