"""The capture thread and its queue, with sources that play their parts."""

import errno
import itertools
import threading
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from played import PATIENCE_S, Camera, Clip, frame, wait_until

from dnb_edge.capture.source import FrameSource
from dnb_edge.daemon import feed as feed_module
from dnb_edge.daemon.feed import BACK_OFF_S, QUEUE_FRAMES, FrameFeed
from dnb_edge.errors import InputError, TemporaryFault, WorkError
from dnb_edge.values import Frame, LostFrames


def never() -> FrameSource:
    raise AssertionError("a source that did not go away is not opened again")


def taken(feed: FrameFeed) -> Frame:
    """The next frame, which must come."""
    one = feed.take(PATIENCE_S)
    assert one is not None
    return one


def test_a_file_loses_nothing_and_waits_for_the_race() -> None:
    """All frames come in order, and the file is never read further ahead than the queue is long."""
    clip = Clip([frame(i) for i in range(50)])
    with FrameFeed(clip, never) as feed:
        wait_until(lambda: clip.given > QUEUE_FRAMES)
        for i in range(50):
            assert clip.given <= i + QUEUE_FRAMES + 1
            assert not feed.ended
            assert taken(feed).sequence == i
        assert feed.take(PATIENCE_S) is None
        assert feed.ended
    assert clip.closed


def test_a_camera_never_waits_and_its_oldest_frames_go() -> None:
    """While the race takes nothing the camera goes on; what is there then are its newest frames."""
    camera = Camera()
    with FrameFeed(camera, never) as feed:
        camera.shoot(*(frame(i) for i in range(20)))
        wait_until(lambda: camera.given == 20)
        assert [taken(feed).sequence for _ in range(QUEUE_FRAMES)] == list(range(20))[-QUEUE_FRAMES:]
        assert feed.take(0.0) is None
        assert not feed.ended
    assert camera.closed


@pytest.mark.parametrize("fault", [InputError("clip.mp4: frame 2 is bad"), WorkError("full"), TemporaryFault("gone")])
def test_what_ends_a_file_badly_is_raised_after_its_last_frame(fault: Exception) -> None:
    """The frames before the fault are all raced; then it comes out of `take`, however late the race gets there."""
    clip = Clip([frame(0), frame(1)], fault=fault)
    with FrameFeed(clip, never) as feed:
        assert taken(feed).sequence == 0
        wait_until(lambda: not feed._thread.is_alive())
        assert taken(feed).sequence == 1
        assert not feed.ended
        with pytest.raises(type(fault)) as raised:
            feed.take(PATIENCE_S)
    assert raised.value is fault


def test_a_camera_that_comes_back_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is closed, then opened again after growing waits until that succeeds; `fault` says why no frames come meanwhile."""
    pauses_s = (0.01, 0.02, 0.04)
    monkeypatch.setattr(feed_module, "BACK_OFF_S", pauses_s)
    camera, back = Camera(), Camera()
    answers = [InputError("there is no such camera"), TemporaryFault("busy"), TemporaryFault("busy"), back]
    tried_s = [0.0]
    faults = []

    def reopen() -> FrameSource:
        assert camera.closed
        tried_s.append(time.monotonic())
        faults.append(feed.fault)
        answer = answers[len(faults) - 1]
        if isinstance(answer, Exception):
            raise answer
        return answer

    with FrameFeed(camera, reopen) as feed:
        camera.shoot(frame(0))
        assert taken(feed).sequence == 0
        assert feed.fault is None
        tried_s[0] = time.monotonic()
        camera.unplug()
        # The driver counts from 0 again; a recording of both must not run backwards, and real gaps stay.
        for sequence, told in ((0, 1), (1, 2), (3, 4)):
            back.shoot(frame(sequence))
            assert taken(feed).sequence == told
        assert feed.fault is None
        assert not feed.ended
    assert back.closed
    assert faults == ["/dev/video7: the camera went away", "there is no such camera", "busy", "busy"]
    waits_s = [b - a for a, b in itertools.pairwise(tried_s)]
    assert all(waited >= pause for waited, pause in zip(waits_s, (*pauses_s, pauses_s[-1]), strict=True))


def test_the_waits_grow_to_two_seconds() -> None:
    """A camera that is plugged in again is back within about two seconds, however long it was away."""
    assert list(BACK_OFF_S) == sorted(BACK_OFF_S)
    assert max(BACK_OFF_S) == 2.0


def test_closing_ends_the_wait_for_a_camera() -> None:
    """A run can be stopped while its camera is away."""
    camera = Camera()
    with FrameFeed(camera, never) as feed:
        camera.unplug()
        wait_until(lambda: feed.fault is not None)
    assert not feed._thread.is_alive()
    assert feed.ended


def test_closing_ends_a_file_that_waits_for_the_race() -> None:
    """A file with a full queue before it does not hold up the end."""
    clip = Clip([frame(i) for i in range(50)])
    with FrameFeed(clip, never) as feed:
        wait_until(lambda: clip.given > QUEUE_FRAMES)
    assert not feed._thread.is_alive()
    assert clip.given == QUEUE_FRAMES + 1


def test_a_camera_that_comes_back_too_late_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Opened while the run was being stopped, it is not left on."""
    monkeypatch.setattr(feed_module, "BACK_OFF_S", (0.0,))
    camera, late = Camera(), Camera()
    opening, go_on = threading.Event(), threading.Event()

    def reopen() -> FrameSource:
        opening.set()
        assert go_on.wait(PATIENCE_S)
        return late

    feed = FrameFeed(camera, reopen).__enter__()
    camera.unplug()
    assert opening.wait(PATIENCE_S)
    closer = threading.Thread(target=feed.close)
    closer.start()
    # It has closed the old camera a second time, and waits for the thread that is opening the new one.
    wait_until(lambda: camera.closings == 2)
    go_on.set()
    closer.join()
    assert late.closed


CYCLES = 200


class Flaky(Camera):
    """A camera that gives three frames, numbered from 0 and one of them missing, and then goes away in its own way."""

    def __init__(self, cycle: int) -> None:
        super().__init__()
        self.shoot(*(frame(i, t_ns=cycle * 10**9 + i) for i in (0, 1, 3)))
        ways = (TemporaryFault("unplugged"), OSError(errno.ENODEV, "No such device"), OSError(errno.EIO, "I/O error"))
        self._shots.put(ways[cycle % len(ways)])

    def close(self) -> None:
        super().close()
        if self.closings % 2:
            # As a driver whose device is gone.
            raise OSError(errno.ENODEV, "No such device")


def test_two_hundred_replugs_lose_nothing(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    """200 of 200: each time in one of the ways in which cameras go, with attempts in vain before it is back. Numbers go on,
    every camera is closed, and no thread is left over.
    """
    monkeypatch.setattr(feed_module, "BACK_OFF_S", (0.0001,))
    cameras = [Flaky(0)]
    last = Camera()
    last.shoot(frame(0, t_ns=CYCLES * 10**9))
    vain = itertools.cycle([True, False, True, True, False])

    def reopen() -> FrameSource:
        if next(vain):
            raise InputError("there is no such camera")
        if len(cameras) == CYCLES:
            return last
        cameras.append(Flaky(len(cameras)))
        return cameras[-1]

    before = threading.active_count()
    with FrameFeed(cameras[0], reopen) as feed:
        stamps, sequences = [], []
        while not stamps or stamps[-1] < CYCLES * 10**9:
            one = taken(feed)
            stamps.append(one.t_ns)
            sequences.append(one.sequence)
        assert feed.fault is None
        lost = {one.reason: one.frames for one in feed.lost}
    assert len(cameras) == CYCLES
    assert all(camera.closed for camera in cameras)
    assert stamps == sorted(stamps)
    assert lost["gap"] == CYCLES
    assert sequences == sorted(set(sequences))
    assert len(stamps) + sum(lost.values()) == sequences[-1] + 1
    assert threading.active_count() == before
    assert all("closing the camera" in record.getMessage() for record in caplog.records)


@given(
    moves=st.lists(st.sampled_from(["take", "shoot", "skip", "overtake"]), max_size=60),
)
@settings(max_examples=60, deadline=None)
def test_every_missing_number_among_the_frames_taken_has_a_reason(moves: list[str]) -> None:
    """However capture and race are out of step: after each frame taken, what was lost before it is exactly what is missing."""
    camera, sequence, sent = Camera(), 0, 0
    with FrameFeed(camera, never) as feed:
        first: int | None = None
        got = 0

        def take() -> None:
            nonlocal first, got
            one = feed.take(0.0)
            if one is None:
                return
            first = one.sequence if first is None else first
            got += 1
            assert sum(lost.frames for lost in feed.lost) - before_first == one.sequence - first + 1 - got

        before_first = 0
        for move in moves:
            match move:
                case "take":
                    if first is None and feed._frames:
                        before_first = sum(lost.frames for lost in feed._frames[0][1]) + feed._overflown
                    take()
                case "skip":
                    sequence += 2
                case "overtake":
                    sequence += 1
                    told = sum(lost.frames for lost in camera.lost)
                    camera.lost = (LostFrames(reason="overtaken", frames=told + 1),)
                case "shoot":
                    camera.shoot(frame(sequence))
                    sequence += 1
                    sent += 1
                    wait_until(lambda now=sent: camera.given == now)


def test_a_camera_is_renewed_on_request(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that gives frames but no sense is closed and opened again; `fault` says why meanwhile, and the run goes on."""
    monkeypatch.setattr(feed_module, "BACK_OFF_S", (0.001,))
    camera, back = Camera(), Camera()
    faults = []

    def reopen() -> FrameSource:
        faults.append(feed.fault)
        return back

    with FrameFeed(camera, reopen) as feed:
        camera.shoot(frame(0))
        assert taken(feed).sequence == 0
        feed.renew("picture frozen")
        camera.shoot(frame(1))
        assert taken(feed).sequence == 1
        back.shoot(frame(0), frame(1))
        assert [taken(feed).sequence for _ in range(2)] == [2, 3]
        assert not back.closed
    assert camera.closed
    assert faults == ["picture frozen"]


def test_how_full_the_queue_was() -> None:
    """Most frames that waited since it was last asked."""
    camera = Camera()
    with FrameFeed(camera, never) as feed:
        assert feed.most_queued() == 0
        camera.shoot(*(frame(i) for i in range(5)))
        wait_until(lambda: camera.given == 5)
        taken(feed)
        taken(feed)
        assert feed.most_queued() == QUEUE_FRAMES
        assert feed.most_queued() == 0
