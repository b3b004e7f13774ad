"""The capture thread and its queue, with sources that play their parts."""

import itertools
import threading
import time

import pytest
from played import PATIENCE_S, Camera, Clip, frame, wait_until

from dnb_edge.capture.source import FrameSource
from dnb_edge.daemon import feed as feed_module
from dnb_edge.daemon.feed import BACK_OFF_S, QUEUE_FRAMES, FrameFeed
from dnb_edge.errors import InputError, TemporaryFault, WorkError
from dnb_edge.values import Frame


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
