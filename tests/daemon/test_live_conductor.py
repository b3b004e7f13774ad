"""What follows what in a process that others can talk to, with runs that are told how to end."""

import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from played import Camera, Clip, Panel, frame, wait_until
from service_manager import Manager, environment

sys.path.insert(0, str(Path(__file__).parents[1] / "live"))

from caller import Caller

from dnb_edge.capture.source import FrameSource
from dnb_edge.cli.demo import write_demo_config
from dnb_edge.config.load import load_config
from dnb_edge.daemon import conductor as conductor_module
from dnb_edge.daemon.appliance import RunOptions, run_appliance
from dnb_edge.daemon.conductor import Conductor
from dnb_edge.daemon.live_run import LiveRun
from dnb_edge.daemon.notices import Notices
from dnb_edge.daemon.orders import Orders
from dnb_edge.display.base import Display
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.errors import DnbEdgeError, InputError, WorkError
from dnb_edge.live.messages import AimCamera, NewRun, Phase, ShowText, State, WatchPictures
from dnb_edge.live.server import LiveServer
from dnb_edge.sim.rig import Rig

NO_CAMERA = InputError("no camera is connected")


class Means:
    """Runs that begin and end as the test says, and a camera."""

    files: tuple[Path, ...] = ()

    def __init__(self, *ends: DnbEdgeError | None) -> None:
        self.notifier = ServiceNotifier()
        self.ends = list(ends)
        self.begun: list[str | None] = []
        self.resumes: list[bool] = []
        self.asked: list[dict[str, Any]] = []
        self.camera: Callable[[], FrameSource] = self._film
        self.panel = Panel()

    def race(self, live: LiveRun, entry: str | None) -> None:
        """A run that begins, and ends well or not; one that does not begin for an `InputError`; without an end, by a wish."""
        self.begun.append(entry)
        self.resumes.append(live.resumes)
        end = self.ends.pop(0) if self.ends else None
        if isinstance(end, InputError):
            raise end
        live._on_begin()
        if not self.ends and end is None:
            while not live.stop.is_set():
                threading.Event().wait(0.01)
        if end is not None:
            raise end

    def camera_uri(self) -> str:
        return "played:"

    def open_camera(self, uri: str, asked: Mapping[str, Any] | None = None) -> FrameSource:
        assert uri == "played:"
        self.asked.append(dict(asked or {}))
        return self.camera()

    @contextmanager
    def displays(self, *, terminal: bool) -> Iterator[Sequence[Display]]:
        yield [self.panel]

    def _film(self) -> FrameSource:
        camera = Camera()
        camera.shoot(*(frame(number) for number in range(3)))
        return camera


@pytest.fixture(autouse=True)
def no_manager(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)


@pytest.fixture
def conduct(tmp_path: Path) -> Callable[..., None]:
    """Conducts, while `talk(client)` runs in another thread; the process is told to end behind it."""
    notices = Notices()
    orders = Orders(notices, lambda entry: None)

    def run(means: Means, talk: Callable[[Caller], None] | None = None, *, stays: bool = True) -> None:
        def client() -> None:
            try:
                with Caller(tmp_path / "s") as caller:
                    assert talk is not None
                    talk(caller)
            except AssertionError as error:
                failed.append(error)
            finally:
                orders.end()

        failed: list[AssertionError] = []
        talker = threading.Thread(target=client)
        with LiveServer(tmp_path / "s", version="1", on_order=orders) as server:
            if talk is not None:
                talker.start()
            try:
                Conductor(means, server, orders, notices, stays=stays).conduct()
            finally:
                if talk is not None:
                    talker.join()
        if failed:
            raise failed[0]

    return run


def state(client: Caller, phase: Phase) -> State:
    """The next one of this phase."""
    found = client.hear_until(lambda one: isinstance(one, State) and one.phase is phase)[-1]
    assert isinstance(found, State)
    return found


def test_a_failed_recording_ends_no_process_that_stays(conduct: Callable[..., None]) -> None:
    """It is told, as the run is over; the next run is begun when it is asked for, and not before."""
    means = Means(WorkError("the disk\nis full"), None)

    def talk(client: Caller) -> None:
        assert state(client, Phase.FINISHED).reason == "the disk is full"
        client.say(WatchPictures, every_s=0.01)
        assert client.answer(client.say(ShowText, text="code", for_s=60.0)).done
        wait_until(lambda: any(shown.notice == "code" for shown in means.panel.shown))
        assert means.begun == [None]
        assert client.answer(client.say(NewRun, entry="net")).done

    conduct(means, talk)
    assert means.begun == [None, "net"]


def test_a_camera_that_goes_when_the_run_is_over_begins_no_other(
    conduct: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is a fault while it lasts; then the run is over as before."""
    monkeypatch.setattr(conductor_module, "WAITS_S", (0.01,))
    means = Means(None, None)
    film, tries = means.camera, []

    def camera() -> FrameSource:
        tries.append(1)
        if len(tries) < 3:
            raise NO_CAMERA
        return film()

    means.camera = camera

    def talk(client: Caller) -> None:
        assert state(client, Phase.FAULT).reason == str(NO_CAMERA)
        state(client, Phase.FINISHED)
        assert means.begun == [None]

    conduct(means, talk)


def test_whoever_aims_without_a_camera_is_told(conduct: Callable[..., None], monkeypatch: pytest.MonkeyPatch) -> None:
    """And the race goes on, as another run."""
    monkeypatch.setattr(conductor_module, "WAITS_S", (0.01,))
    means = Means(None)

    def camera() -> FrameSource:
        raise NO_CAMERA

    means.camera = camera

    def talk(client: Caller) -> None:
        assert client.answer(client.say(AimCamera, aim=True)).reason == str(NO_CAMERA)
        assert client.answer(client.say(AimCamera, aim=False)).done

    conduct(means, talk)
    assert len(means.begun) >= 2


def test_settings_are_tried_while_somebody_aims(conduct: Callable[..., None]) -> None:
    """What is asked of the camera opens it anew with that, each time; without it is opened as configured."""
    means = Means(None)

    def talk(client: Caller) -> None:
        for camera in ({"exposure_us": 4000.0}, {"gain": 2.0}):
            assert client.answer(client.say(AimCamera, aim=True, camera=camera)).done
        assert client.answer(client.say(AimCamera, aim=False)).done
        assert client.answer(client.say(AimCamera, aim=True)).done

    conduct(means, talk)
    assert [asked for asked in means.asked if asked] == [{"exposure_us": 4000.0}, {"gain": 2.0}]
    assert means.asked[-1] == {}


def test_a_clip_is_shown_over_and_over(conduct: Callable[..., None]) -> None:
    """A source that ends is opened again, for as long as somebody aims."""
    means = Means(None)
    opened = []

    def camera() -> FrameSource:
        opened.append(1)
        return Clip([frame(1), frame(2)])

    means.camera = camera

    def talk(client: Caller) -> None:
        assert client.answer(client.say(AimCamera, aim=True)).done
        for _ in range(3):
            state(client, Phase.SETUP)

    conduct(means, talk)
    assert len(opened) >= 3


def test_only_the_first_race_of_a_process_goes_on_with_another(
    conduct: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Tried again where it could not begin; never where somebody asks for another, though the last one's recording failed."""
    monkeypatch.setattr(conductor_module, "WAITS_S", (0.01,))
    means = Means(NO_CAMERA, WorkError("the disk is full"), None)

    def camera() -> FrameSource:
        raise NO_CAMERA

    means.camera = camera

    def talk(client: Caller) -> None:
        client.hear_until(lambda one: isinstance(one, State) and one.reason == "the disk is full")
        assert client.answer(client.say(NewRun)).done

    conduct(means, talk)
    assert means.resumes == [True, True, False]


def test_a_run_that_is_asked_for_first_goes_on_with_none(
    conduct: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor where the process has not raced yet."""
    monkeypatch.setattr(conductor_module, "WAITS_S", (60.0,))
    means = Means(NO_CAMERA, None)
    film = means.camera

    def camera() -> FrameSource:
        if len(means.begun) < 2:
            raise NO_CAMERA
        return film()

    means.camera = camera

    def talk(client: Caller) -> None:
        state(client, Phase.FAULT)
        assert client.answer(client.say(NewRun)).done

    conduct(means, talk)
    assert means.resumes == [True, False]


def test_the_manager_waits_for_no_camera(
    conduct: Callable[..., None], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A fault that is told is all that a start can come to: READY, or the process would be ended and started for ever; food in
    each phase, and more patience only while a run is built."""
    pytest.importorskip("systemd.daemon", reason="the systemd binding is not installed")
    monkeypatch.setattr(conductor_module, "WAITS_S", (0.01,))
    manager = Manager(tmp_path / "notify")
    for name, value in environment(manager.path, watchdog_s=10.0).items():
        monkeypatch.setenv(name, value)
    means = Means(NO_CAMERA, None, None)
    film, told = means.camera, list[str]()

    def camera() -> FrameSource:
        if len(means.begun) < 2:
            told.extend(manager.heard())
            raise NO_CAMERA
        return film()

    means.camera = camera

    def talk(client: Caller) -> None:
        state(client, Phase.FINISHED)

    conduct(means, talk)
    manager_heard = told + manager.heard()
    manager.close()
    assert means.begun == [None, None]
    ready = manager_heard.index("READY=1")
    assert manager_heard[:ready] == [f"STATUS=cannot start yet: {NO_CAMERA}"]
    fed = [one for one in manager_heard[ready:] if one.startswith("WATCHDOG")]
    assert fed[:5] == ["WATCHDOG=1", "WATCHDOG_USEC=60000000", "WATCHDOG=1", "WATCHDOG_USEC=10000000", "WATCHDOG=1"]
    assert fed[5:].count("WATCHDOG_USEC=10000000") == 0


def test_a_run_that_is_to_end_before_it_begins_leaves_nothing(tmp_path: Path) -> None:
    """A wish, or SIGTERM, while a model is loaded: no recording without a frame, no race told to anybody."""
    ended, begun = threading.Event(), list[int]()
    ended.set()
    config = load_config(write_demo_config(tmp_path, Rig(laps=1)))
    with LiveServer(tmp_path / "s", version="1") as server:
        live = LiveRun(
            server,
            stop=ended,
            notices=Notices(),
            goes_on=lambda: True,
            on_begin=lambda: begun.append(1),
            resumes=True,
        )
        summary = run_appliance(config, RunOptions(source_uri="sim:", record_directory=tmp_path / "runs"), live=live)
    assert (summary.frames, summary.laps, summary.recording) == (0, 0, None)
    assert begun == []
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize("end", [WorkError("the disk is full"), NO_CAMERA])
def test_without_setup_a_run_is_all_there_is(conduct: Callable[..., None], end: DnbEdgeError) -> None:
    """It ends the process as ever: with its own error, and well where it went well."""
    with pytest.raises(type(end), match=str(end)):
        conduct(Means(end, None), stays=False)
    well = Means(None, None)
    well.ends = [None, None]
    conduct(well, stays=False)
    assert well.begun == [None]
