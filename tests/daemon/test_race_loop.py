"""The race loop with a real core and real sinks: how a run ends, and what it says of what goes wrong on the way."""

import logging
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import pytest
from played import PATIENCE_S, Camera, Clip, Panel, Watcher, frame, info, scene, wait_until

from dnb_edge.assembly import assemble
from dnb_edge.capture.picture_health import REMEDIES, PictureFault
from dnb_edge.capture.source import FrameSource
from dnb_edge.cli.demo import write_demo_config
from dnb_edge.config.load import load_config
from dnb_edge.core import Core, CoreSetup
from dnb_edge.daemon import feed as feed_module
from dnb_edge.daemon.eye import Eye
from dnb_edge.daemon.feed import FrameFeed
from dnb_edge.daemon.loop import Race
from dnb_edge.daemon.meter import Meter
from dnb_edge.daemon.sinks import BoardSink
from dnb_edge.display.base import DisplayStatus
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.errors import InputError
from dnb_edge.sim.rig import Rig
from dnb_edge.values import Event, Frame, FrameDetections, Health, RunSummary, StampSource


@dataclass
class Diary:
    """A listener that keeps all events."""

    events: list[Event] = field(default_factory=list)
    warnings: tuple[str, ...] = ()
    stamp_sources: set[StampSource | None] = field(default_factory=set)

    def frame(self, frame: Frame, found: FrameDetections) -> None:
        """Frames are not kept, but for what their detections say of their stamps."""
        self.stamp_sources.add(found.stamp_source)

    def event(self, event: Event) -> None:
        self.events.append(event)

    @property
    def healths(self) -> list[Health]:
        return [event for event in self.events if isinstance(event, Health)]


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> CoreSetup:
    """The demo's track and view."""
    config = load_config(write_demo_config(tmp_path_factory.mktemp("demo"), Rig(laps=1)))
    return assemble(config, info(live=False)).setup


class Track:
    """Makes races and keeps what they said."""

    def __init__(self, setup: CoreSetup) -> None:
        self._setup = setup
        self.diary = Diary()
        self.panel = Panel()
        self.stop = threading.Event()

    def race(self, feed: FrameFeed, watcher: Watcher | None = None, *, live: bool = False) -> Race:
        notifier = ServiceNotifier()
        return Race(
            info=info(live=live),
            feed=feed,
            eyes=[Eye(detector=watcher if watcher is not None else Watcher(), live=live)],
            core=Core(self._setup),
            meter=Meter(view_error_mean_px=None, view_error_mean_m=None),
            sinks=[BoardSink([self.panel], notifier, None), self.diary],
            displays=[self.panel],
            notifier=notifier,
            recorder=None,
            stop=self.stop,
        )


@pytest.fixture
def track(setup: CoreSetup, monkeypatch: pytest.MonkeyPatch) -> Track:
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    return Track(setup)


def never() -> FrameSource:
    raise AssertionError("a source that did not go away is not opened again")


def warned(caplog: pytest.LogCaptureFixture) -> list[str]:
    """What stderr would say."""
    return [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]


def test_a_run_ends_with_its_source(track: Track) -> None:
    """Every frame of a file is raced, a last Health closes the run, and the summary counts."""
    watcher = Watcher()
    with FrameFeed(Clip([frame(i) for i in range(120)]), never) as feed:
        summary = track.race(feed, watcher).run()
    assert watcher.seen == list(range(120))
    assert summary == RunSummary(frames=120, detected_frames=0, laps=0, recording=None)
    assert [(health.t_s, health.frames) for health in track.diary.healths] == [(1.0, 101), (pytest.approx(1.19), 120)]
    assert all(health.display == "online" for health in track.diary.healths)


def test_detections_tell_what_their_stamp_stands_for(track: Track) -> None:
    """Whatever the detector, blind pictures included: the race and a recording know what every frame's stamp means."""
    black = np.zeros((36, 64, 3), dtype=np.uint8)
    with FrameFeed(Clip([frame(0), frame(1), frame(2, bgr=black)]), never) as feed:
        track.race(feed).run()
    assert track.diary.stamp_sources == {StampSource.MEDIA}


def test_an_error_in_the_capture_thread_ends_the_run(track: Track) -> None:
    """Even where the race gets to the last good frame long after the error, the error is raised and not taken for the end."""
    watcher = Watcher()
    with FrameFeed(Clip([frame(0), frame(1)], fault=InputError("clip.mp4: bad")), never) as feed:
        wait_until(lambda: not feed._thread.is_alive())
        with pytest.raises(InputError, match=r"clip\.mp4: bad"):
            track.race(feed, watcher).run()
    assert watcher.seen == [0, 1]


def test_stop_ends_the_run_between_two_frames(track: Track) -> None:
    """Once asked to stop, the race ends after the frame in hand, with a last Health."""
    gate = threading.Event()
    with FrameFeed(Clip([frame(i) for i in range(1000)]), never) as feed:
        race = track.race(feed, Watcher(gate))
        track.stop.set()
        gate.set()
        summary = race.run()
    assert summary.frames <= 1
    assert len(track.diary.healths) == 1


@pytest.fixture
def in_background() -> Iterator[list[threading.Thread]]:
    """Threads that must have ended by the end of the test."""
    threads: list[threading.Thread] = []
    yield threads
    for thread in threads:
        thread.join(timeout=10.0)
        assert not thread.is_alive()


def test_a_lost_camera_is_told_and_the_run_goes_on(
    track: Track,
    in_background: list[threading.Thread],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    """While a camera is away Health says so at once, and stderr once; when it is back the run goes on and Health is clean."""
    monkeypatch.setattr(feed_module, "BACK_OFF_S", (0.02,))
    camera, back = Camera(), Camera()
    plugged = threading.Event()

    def reopen() -> FrameSource:
        if not plugged.is_set():
            raise InputError("/dev/video7: there is no such camera")
        return back

    summaries = []
    with FrameFeed(camera, reopen) as feed:
        race = track.race(feed, live=True)
        thread = threading.Thread(target=lambda: summaries.append(race.run()))
        in_background.append(thread)
        thread.start()
        camera.shoot(frame(0), frame(1))
        wait_until(lambda: race.meter.frames == 2)
        camera.unplug()
        gone = ("/dev/video7: there is no such camera",)
        wait_until(lambda: any(health.warnings == gone for health in track.diary.healths))
        assert track.panel.shown[-1].health.warnings == gone
        plugged.set()
        back.shoot(frame(0, t_ns=2_000_000_000))
        wait_until(lambda: race.meter.frames == 3)
        wait_until(lambda: track.diary.healths[-1].warnings == ())
        track.stop.set()
        thread.join()
    (summary,) = summaries
    assert summary.frames == 3
    assert warned(caplog).count(*gone) == 1


def test_a_camera_that_is_back_at_once_is_told_all_the_same(
    track: Track,
    in_background: list[threading.Thread],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    """A stream that fails and is opened again while the race is still at an earlier frame is in one Health and in the log."""
    monkeypatch.setattr(feed_module, "BACK_OFF_S", (0.001,))
    camera, back = Camera(), Camera()
    detecting, again = threading.Event(), threading.Event()

    class Slow(Watcher):
        def detect(self, image, *, sequence, t_ns, windows):
            detecting.set()
            assert again.wait(PATIENCE_S)
            return super().detect(image, sequence=sequence, t_ns=t_ns, windows=windows)

    with FrameFeed(camera, lambda: back) as feed:
        race = track.race(feed, Slow(), live=True)
        thread = threading.Thread(target=race.run)
        in_background.append(thread)
        thread.start()
        camera.shoot(frame(0))
        assert detecting.wait(PATIENCE_S)
        camera.unplug()
        back.shoot(frame(0, t_ns=100_000_000), frame(1, t_ns=200_000_000))
        wait_until(lambda: feed.fault is None and feed.most_queued() == 2)
        again.set()
        wait_until(lambda: race.meter.frames == 3)
        track.stop.set()
        thread.join()
    gone = "/dev/video7: the camera went away"
    assert [health.warnings for health in track.diary.healths] == [(gone,), ()]
    assert warned(caplog) == [gone]


def test_unreadable_pictures_are_counted_and_told_once(track: Track, caplog: pytest.LogCaptureFixture) -> None:
    """A JPEG that cannot be decoded is no frame of the race; the growing count is in Health, one line on stderr."""
    frames = [frame(i, jpeg=b"\xff\xd8 torn" if i % 10 == 5 else None) for i in range(310)]
    watcher = Watcher()
    with FrameFeed(Clip(frames), never) as feed:
        summary = track.race(feed, watcher).run()
    assert summary.frames == 310 - 31
    assert [health.warnings for health in track.diary.healths] == [
        (f"{count} unreadable pictures",) for count in (10, 20, 30, 31)
    ]
    assert warned(caplog) == ["10 unreadable pictures"]


def test_a_stamp_that_is_not_later_is_left_out(track: Track, caplog: pytest.LogCaptureFixture) -> None:
    """Time never runs backwards in a race: such a frame is told and skipped."""
    frames = [frame(0), frame(1), frame(2, t_ns=10_000_000), frame(3)]
    watcher = Watcher()
    with FrameFeed(Clip(frames), never) as feed:
        assert track.race(feed, watcher).run().frames == 3
    assert watcher.seen == [0, 1, 3]
    assert warned(caplog) == ["frame 2: its stamp is not later than the one before: left out"]


def test_a_warning_is_told_again_only_after_it_was_gone(track: Track, caplog: pytest.LogCaptureFixture) -> None:
    """A display that goes, comes back and goes again is two warnings, not one a second; Health has the state each time."""
    offline = {1: True, 2: True, 3: False, 4: True}

    class Moody(Watcher):
        def detect(self, image, *, sequence, t_ns, windows):
            track.panel.fault = "unplugged"
            away = offline.get((sequence - 1) // 100 + 1, True)
            track.panel.status = DisplayStatus.OFFLINE if away else DisplayStatus.ONLINE
            return super().detect(image, sequence=sequence, t_ns=t_ns, windows=windows)

    with FrameFeed(Clip([frame(i) for i in range(401)]), never) as feed:
        track.race(feed, Moody()).run()
    assert [health.display for health in track.diary.healths][:4] == ["offline", "offline", "online", "offline"]
    assert warned(caplog) == ["display offline: unplugged"] * 2


def test_every_frame_that_is_missing_is_told_with_its_reason(track: Track) -> None:
    """A gap in the source's numbers, an unreadable picture and a stamp out of order: together they are what was dropped."""
    frames = [frame(i) for i in range(120) if i not in (30, 31)]
    frames[50] = frame(frames[50].sequence, jpeg=b"\xff\xd8 torn")
    frames[60] = frame(frames[60].sequence, t_ns=0)
    with FrameFeed(Clip(frames), never) as feed:
        track.race(feed).run()
    last = track.diary.healths[-1]
    assert [(one.reason, one.frames) for one in last.lost] == [("gap", 2), ("stamp", 1), ("unreadable", 1)]
    assert last.dropped_frames == 4
    assert (last.queued_frames, last.memory_bytes, last.latency_p95_ms, last.saved_laps) == (None, None, None, None)


def test_a_camera_that_repeats_its_picture_is_opened_anew(
    track: Track, in_background: list[threading.Thread], monkeypatch: pytest.MonkeyPatch
) -> None:
    """After 5 s by its stamps it is renewed, after 10 s more again if that did not help; then it shows something new."""
    monkeypatch.setattr(feed_module, "BACK_OFF_S", (0.001,))
    cameras = [Camera(), Camera(), Camera()]
    back = iter(cameras[1:])
    with FrameFeed(cameras[0], lambda: next(back)) as feed:
        race = track.race(feed, live=True)
        thread = threading.Thread(target=race.run)
        in_background.append(thread)
        thread.start()

        def film_until_closed(camera: Camera, since_s: float) -> float:
            """Shoots the same picture ten times a second; the stamp of the last one, seconds."""
            for tenth in range(round(since_s * 10), 400):
                raced = race.meter.frames
                camera.shoot(frame(tenth, t_ns=tenth * 100_000_000, bgr=scene(1)))
                wait_until(lambda before=raced: camera.closed or race.meter.frames > before)
                if camera.closed:
                    return tenth / 10
            raise AssertionError("never closed")

        first_s = film_until_closed(cameras[0], 0.0)
        second_s = film_until_closed(cameras[1], first_s + 0.1)
        raced = race.meter.frames
        cameras[2].shoot(*(frame(i, t_ns=30_000_000_000 + i * 200_000_000) for i in range(2)))
        wait_until(lambda: race.meter.frames == raced + 2)
        track.stop.set()
        thread.join()
    assert 5.0 <= first_s <= 5.8
    assert 10.0 <= second_s - first_s <= 10.8
    assert any(REMEDIES[PictureFault.FROZEN] in health.warnings for health in track.diary.healths)


def test_ready_is_told_once_with_the_first_frame(track: Track) -> None:
    """A configuration is good once it races, not before."""
    told: list[int] = []
    with FrameFeed(Clip([frame(0, jpeg=b"\xff\xd8 torn"), frame(1), frame(2)]), never) as feed:
        race = track.race(feed)
        race.on_ready = lambda: told.append(race.meter.frames)
        race.run()
    assert told == [0]
