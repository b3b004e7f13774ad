"""Several cameras' frames as one stream, with sources that play their parts."""

import time
from contextlib import ExitStack

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from played import PATIENCE_S, Camera, Clip, frame, wait_until

from dnb_edge.capture.source import FrameSource
from dnb_edge.daemon.feed import FrameFeed
from dnb_edge.daemon.several import HOLD_S, SeveralFeeds
from dnb_edge.errors import InputError, WorkError

MS = 1_000_000
BLANK = frame(0).bgr


def never() -> FrameSource:
    raise AssertionError("a source that did not go away is not opened again")


def clip(stamps_ms: list[int]) -> Clip:
    return Clip([frame(i, t_ns=t * MS, bgr=BLANK) for i, t in enumerate(stamps_ms)])


def several(*sources: Clip | Camera, live: bool = False) -> SeveralFeeds:
    return SeveralFeeds([FrameFeed(source, never) for source in sources], live=live)


def all_of(feed: SeveralFeeds) -> list[tuple[int, int, int]]:
    """(stamp in ms, camera, number) of every frame to the end."""
    got = []
    while not feed.ended:
        one = feed.take(PATIENCE_S)
        if one is not None:
            got.append((one.t_ns // MS, one.camera, one.sequence))
    return got


STAMPS = st.lists(st.integers(0, 10_000), unique=True, max_size=12).map(sorted)


@settings(max_examples=40, deadline=None)
@given(st.lists(STAMPS, min_size=1, max_size=3))
def test_files_give_every_frame_once_in_the_order_of_stamps(stamps):
    """Whatever the stamps and however many frames each has, none is lost, none comes twice, and time never runs backwards."""
    with several(*(clip(one) for one in stamps)) as feed:
        got = all_of(feed)
    wanted = sorted((t, camera, k) for camera, one in enumerate(stamps) for k, t in enumerate(one))
    assert [one[:2] for one in got] == [one[:2] for one in wanted]
    assert sorted(got) == wanted


def test_a_live_frame_waits_for_an_earlier_one_of_another_camera():
    """The second camera's frame is here first, and the first camera's is older by its stamp: that one goes first."""
    one, other = Camera(), Camera()
    with several(one, other, live=True) as feed:
        other.shoot(frame(0, t_ns=20 * MS, bgr=BLANK))
        assert feed.take(0.01) is None
        one.shoot(frame(0, t_ns=10 * MS, bgr=BLANK))
        first, second = feed.take(PATIENCE_S), None
        assert first is not None
        while second is None:
            second = feed.take(PATIENCE_S)
        assert [(first.t_ns, first.camera), (second.t_ns, second.camera)] == [(10 * MS, 0), (20 * MS, 1)]


def test_a_camera_that_is_away_holds_nothing_up():
    """Where the first camera sends nothing the second one's frames come all the same, after a short wait each."""
    one, other = Camera(), Camera()
    with several(one, other, live=True) as feed:
        for k in range(3):
            other.shoot(frame(k, bgr=BLANK))
            begun_s = time.monotonic()
            got = feed.take(PATIENCE_S)
            assert got is not None
            assert (got.camera, got.sequence) == (1, k)
            assert time.monotonic() - begun_s >= 0.5 * HOLD_S
        assert not feed.ended


def test_what_ends_one_file_badly_ends_all():
    """A damaged clip is an error of the run, whichever camera's it is."""
    good, bad = clip([0, 10, 20]), Clip([frame(0, t_ns=5 * MS, bgr=BLANK)], fault=InputError("two.mp4: bad"))
    with several(good, bad) as feed, pytest.raises(InputError, match=r"two\.mp4"):
        all_of(feed)


def test_losses_faults_and_renewals_are_each_cameras_own():
    """What is lost is summed over the cameras, a fault names its camera, and a frozen one alone is opened anew."""
    one, other, back = Camera(), Camera(), Camera()
    feeds = [FrameFeed(one, never), FrameFeed(other, lambda: back)]
    with SeveralFeeds(feeds, live=True) as feed:
        assert (feed.fault, feed.last_fault, feed.outages, feed.lost) == (None, None, 0, ())
        other.shoot(frame(0, bgr=BLANK), frame(5, bgr=BLANK))
        wait_until(lambda: feed.take(0.01) is not None)
        wait_until(lambda: feed.take(0.01) is not None)
        assert [(lost.reason, lost.frames) for lost in feed.lost] == [("gap", 4)]
        feed.renew("the picture is frozen", 1)
        other.shoot(frame(6, bgr=BLANK))
        wait_until(lambda: feed.outages == 1)
        assert feed.last_fault == "camera 2: the picture is frozen"
        assert one.closings == 0
        wait_until(lambda: other.closed)
        back.shoot(frame(0, t_ns=900 * MS, bgr=BLANK))
        wait_until(lambda: feed.fault is None)


def test_a_camera_thread_that_hangs_does_not_hide_behind_another():
    """Progress stands still while one camera's does, so that the watchdog sees it."""
    one, other = Camera(), Camera()
    with ExitStack() as stack:
        feed = stack.enter_context(several(one, other, live=True))
        one.shoot(frame(0, bgr=BLANK))
        other.shoot(frame(0, bgr=BLANK))
        wait_until(lambda: feed.progress > 0)
        before = feed.progress
        one.shoot(frame(1, bgr=BLANK), frame(2, bgr=BLANK))
        wait_until(lambda: one.given == 3)
        assert feed.progress == before
        other.shoot(frame(1, bgr=BLANK))
        wait_until(lambda: feed.progress > before)


def test_nothing_stays_open():
    """All sources are closed with the stream, those that failed included."""
    good, bad = clip([0]), Clip([], fault=WorkError("full"))
    with pytest.raises(WorkError), several(good, bad) as feed:
        all_of(feed)
    assert good.closed
    assert bad.closed
