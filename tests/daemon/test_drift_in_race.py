"""The drift watch beside a race: what it sees goes to the detections, to Health and to the boards, and costs no frame."""

from __future__ import annotations

import logging
import threading
from dataclasses import replace

import cv2
import numpy as np
import pytest
from played import Clip, Panel, Watcher, info

from dnb_edge.assembly import assemble
from dnb_edge.assembly.pictures import in_size
from dnb_edge.capture.source import FrameSource
from dnb_edge.cli.demo import write_demo_config
from dnb_edge.config.load import load_config
from dnb_edge.core import Core, CoreSetup
from dnb_edge.daemon.eye import Eye
from dnb_edge.daemon.feed import FrameFeed
from dnb_edge.daemon.loop import Race
from dnb_edge.daemon.meter import Meter
from dnb_edge.daemon.sinks import BoardSink
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.errors import InputError
from dnb_edge.sim.rig import Rig
from dnb_edge.values import Event, Frame, FrameDetections, Health, StampSource
from dnb_edge.view.drift import DriftWatch
from dnb_edge.view.drift_judge import watched_track

FPS = 6.0
SIZE_PX = (640, 360)
BUMP_S = 7.0


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> CoreSetup:
    """The demo's track and view, in pictures of `SIZE_PX`."""
    config = load_config(write_demo_config(tmp_path_factory.mktemp("demo"), Rig(laps=1)))
    return assemble(config, replace(info(live=False), width_px=SIZE_PX[0], height_px=SIZE_PX[1])).setup


def never() -> FrameSource:
    raise AssertionError("a source that did not go away is not opened again")


class Diary:
    """A listener that keeps detections and Health."""

    warnings: tuple[str, ...] = ()

    def __init__(self) -> None:
        self.found: list[FrameDetections] = []
        self.healths: list[Health] = []

    def frame(self, frame: Frame, found: FrameDetections) -> None:
        self.found.append(found)

    def event(self, event: Event) -> None:
        if isinstance(event, Health):
            self.healths.append(event)


def clip(shift_px: float, *, seconds: float = 14.0) -> Clip:
    """A floor that jumps to the right by `shift_px` at `BUMP_S`."""
    random = np.random.default_rng(4)
    width, height = SIZE_PX
    blotches = cv2.GaussianBlur(random.normal(0.0, 1.0, (height, width + 60)).astype(np.float32), (0, 0), 4)
    floor = np.clip(128 + 30 * blotches / blotches.std(), 5, 250).astype(np.uint8)
    frames = []
    for number in range(round(seconds * FPS)):
        right = shift_px if number / FPS >= BUMP_S else 0.0
        seen = cv2.warpAffine(floor, np.array([[1, 0, right - 30], [0, 1, 0.0]]), SIZE_PX).astype(np.int16)
        noisy = np.clip(seen + random.integers(-3, 4, seen.shape), 0, 255).astype(np.uint8)
        frames.append(
            Frame(
                sequence=number,
                t_ns=round(number / FPS * 1e9),
                stamp_source=StampSource.MEDIA,
                width_px=width,
                height_px=height,
                bgr=np.repeat(noisy[..., None], 3, axis=2),
            )
        )
    return Clip(frames)


def raced(setup: CoreSetup, source: Clip) -> tuple[Diary, Panel]:
    """What a race over the clip says and shows."""
    diary, panel, notifier = Diary(), Panel(), ServiceNotifier()
    watched = watched_track(setup.ground, setup.track.centreline.points_m)
    with FrameFeed(source, never) as feed:
        Race(
            info=info(live=False),
            feed=feed,
            eyes=[
                Eye(
                    detector=Watcher(),
                    live=False,
                    drift=DriftWatch(watched),
                )
            ],
            core=Core(setup),
            meter=Meter(view_error_mean_px=None, view_error_mean_m=None),
            sinks=[BoardSink([panel], notifier, None), diary],
            displays=[panel],
            notifier=notifier,
            recorder=None,
            stop=threading.Event(),
        ).run()
    return diary, panel


def test_a_bump_is_in_the_detections_and_in_health_at_once(
    setup: CoreSetup, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """From the frame in which it is told on, every frame carries it; a Health comes with it, and one line on stderr."""
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    diary, panel = raced(setup, clip(2.0))
    moved = [one.view_moved_m for one in diary.found]
    first = next(number for number, metres in enumerate(moved) if metres is not None)
    assert BUMP_S < first / FPS <= BUMP_S + 5.0
    assert all(metres is None for metres in moved[:first])
    assert all(metres is not None for metres in moved[first:])
    told = next(health for health in diary.healths if health.view_moved_m is not None)
    assert told.t_ns == diary.found[first].t_ns
    assert told.view_moved_m == moved[first]
    (warning,) = told.warnings
    assert warning == f"camera moved {moved[first] * 1e3:.0f} mm: laps are suspect, calibrate again"
    assert panel.shown[-1].health.view_moved_m is not None
    assert [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING] == [warning]


def test_a_still_camera_is_told_nothing_of(setup: CoreSetup, monkeypatch: pytest.MonkeyPatch) -> None:
    """No member, no warning, no note."""
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    diary, _ = raced(setup, clip(0.0, seconds=8.0))
    assert {one.view_moved_m for one in diary.found} == {None}
    assert {(health.view_moved_m, health.warnings, health.notes) for health in diary.healths} == {(None, (), ())}


def test_a_plain_floor_is_a_note(setup: CoreSetup, monkeypatch: pytest.MonkeyPatch) -> None:
    """What cannot be watched is asked for, in words, with every Health from then on."""
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    plain = clip(0.0, seconds=8.0)
    for one in plain._frames:
        one.bgr[:, 160:] = 128
    diary, _ = raced(setup, plain)
    assert diary.healths[0].notes == ()
    assert diary.healths[-1].notes == (
        "the floor shows too little for the camera's place to be watched: lay down markers",
    )


def test_the_calibrations_picture_is_brought_to_the_size_of_the_frames() -> None:
    """Another size of the same aspect is scaled, another aspect is refused by name."""
    picture = np.zeros((720, 1280, 3), np.uint8)
    assert in_size(picture, 640, 360, name="view.yaml").shape == (360, 640, 3)
    assert in_size(picture, 1280, 720, name="view.yaml") is picture
    with pytest.raises(InputError, match=r"view\.yaml: its picture is 1280x720, frames are 640x480"):
        in_size(picture, 640, 480, name="view.yaml")
