"""A race that is followed over the live socket: what is told of it, and that it does not notice."""

import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from conducted import Conducted, Truth, camera_info, laps_of, race_live, setup_of

from dnb_edge.cli.demo import write_demo_config
from dnb_edge.core import CoreSetup
from dnb_edge.daemon.live_sink import LiveSink
from dnb_edge.daemon.scenery import make_scenery
from dnb_edge.live.messages import FromDaemon, Picture, Told, WatchPictures
from dnb_edge.live.server import MOST_CLIENTS, LiveServer
from dnb_edge.sim.rig import Rig
from dnb_edge.values import Event, Lap, Target

sys.path.insert(0, str(Path(__file__).parents[1] / "live"))

from caller import Caller


@pytest.fixture(scope="module")
def rig() -> Rig:
    """Two laps."""
    return Rig(laps=2)


@pytest.fixture(scope="module")
def setup(rig: Rig, tmp_path_factory: pytest.TempPathFactory) -> CoreSetup:
    """The demo's track and view."""
    return setup_of(write_demo_config(tmp_path_factory.mktemp("demo"), rig), rig)


@pytest.fixture
def server(tmp_path: Path) -> Iterator[LiveServer]:
    """At `tmp_path / "s"`."""
    with LiveServer(tmp_path / "s", version="1") as one:
        yield one


class Reader(threading.Thread):
    """A client that reads all there is, pictures included."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.caller = Caller(path)
        self.caller.follow()
        self.caller.answer(self.caller.say(WatchPictures, every_s=0.02))
        self.heard: list[FromDaemon] = []
        self.start()

    def run(self) -> None:
        while (message := self.caller.hear_or_end()) is not None:
            self.heard.append(message)

    def events(self, kind: str) -> list[dict[str, object]]:
        return [one.event for one in self.heard if isinstance(one, Told) and one.event["event"] == kind]


def test_eight_clients_of_which_one_never_reads_move_no_lap(
    rig: Rig, setup: CoreSetup, server: LiveServer, tmp_path: Path
) -> None:
    """Every frame is raced, every lap and its time is that of a race that nobody follows; who reads is told every lap, and
    where the car is, in fewer frames than there are."""
    readers = [Reader(tmp_path / "s") for _ in range(MOST_CLIENTS - 1)]
    lazy = Caller(tmp_path / "s")
    lazy.follow()
    lazy.say(WatchPictures, every_s=0.02)
    truth = Truth(rig)
    diary = race_live(setup, Conducted(rig, truth), truth, sinks=[LiveSink(server)])
    server.close()
    for reader in readers:
        reader.join(20.0)
        reader.caller.close()
    lazy.close()
    alone = laps_of(setup, truth.seen)
    assert [_times(lap) for lap in diary.laps] == [_times(lap) for lap in alone]
    assert len(alone) == 2
    assert diary.healths[-1].lost == ()
    assert diary.healths[-1].frames == rig.frames
    for reader in readers:
        assert [lap["time_s"] for lap in reader.events("lap")] == [lap.time_s for lap in alone]
        assert 0 < len(reader.events("target")) <= rig.frames // 2 + 1
        assert any(isinstance(one, Picture) for one in reader.heard)


def _times(lap: Lap) -> tuple[int, float, float]:
    return lap.start_t_ns, lap.time_s, lap.sigma_s


class Notebook(LiveServer):
    """Writes down of which frames the car was told."""

    def tell(self, event: Event) -> None:
        if isinstance(event, Target):
            self.told_ns.append(event.t_ns)

    told_ns: list[int]


def test_about_fifteen_frames_a_second_are_told(rig: Rig, setup: CoreSetup, tmp_path: Path) -> None:
    """Of thirty every other one, by their stamps, however fast the race goes."""
    truth = Truth(rig)
    with Notebook(tmp_path / "s", version="1") as notebook:
        notebook.told_ns = []
        race_live(setup, Conducted(rig, truth, last=300), truth, sinks=[LiveSink(notebook)])
    apart = np.diff(notebook.told_ns)
    assert apart.min() > 60e6
    assert 14.0 < 1e9 / np.median(apart) < 16.0


def test_the_scenery_is_what_the_camera_sees(rig: Rig, setup: CoreSetup) -> None:
    """The centreline goes round once; its places are seen where the ground map sees them (the demo's lens bends nothing)."""
    scenery = make_scenery(setup)
    points = np.array(scenery.centreline_m)
    around = np.vstack((points, points[:1]))
    assert np.hypot(*np.diff(around, axis=0).T).sum() == pytest.approx(scenery.length_m, rel=1e-3)
    assert np.hypot(*np.diff(around, axis=0).T).max() < 0.021
    seen = np.column_stack((points, np.ones(len(points)))) @ np.array(scenery.camera_from_track).T
    assert (seen[:, 2] > 0).all()
    assert seen[:, :2] / seen[:, 2:] == pytest.approx(setup.ground.to_camera_px(points), abs=1e-6)
    assert scenery.frame_px == (camera_info(rig).width_px, camera_info(rig).height_px)
    assert [line.name for line in scenery.lines] == ["start"]
    assert scenery.lane_width_m == pytest.approx(0.26, abs=0.02)
