"""The closed loop as a source: timed by the appliance as a real car is, the same twice, and whole where its driver fails."""

import threading

import pytest
import yaml

from dnb_edge.assembly import make_source
from dnb_edge.cli.demo import course_config
from dnb_edge.config.load import load_config
from dnb_edge.daemon.appliance import RunOptions, run_appliance
from dnb_edge.errors import InputError
from dnb_edge.nut.closed_loop import ClosedLoopSource
from dnb_edge.nut.pursuit import PurePursuit
from dnb_edge.record.reader import read_run
from dnb_edge.sim.control import Control, DriverFailed
from dnb_edge.sim.files import course_files
from dnb_edge.sim.task import LoopTask
from dnb_edge.values import Lap


def table(**changes):
    """A task on the oval on a table: short laps, a small room to draw."""
    return LoopTask(place="table", size_px=(640, 480), **changes)


class Told:
    """Drives straight on, and says what was asked of it and in which thread; fails after `pictures`."""

    name = "told"
    knows_truth = False

    def __init__(self, pictures=10**9):
        self._pictures = pictures
        self.calls = []

    def start(self, briefing):
        """Kept."""
        self.calls.append(("start", threading.get_ident()))

    def drive(self, sight):
        """Straight on, slowly."""
        self.calls.append(("drive", threading.get_ident()))
        if len(self.calls) > self._pictures:
            raise DriverFailed("told: it went out")
        return Control(steering=0.0, throttle=0.2)

    def close(self):
        """Kept."""
        self.calls.append(("close", threading.get_ident()))


class Heard:
    """Keeps a run's events."""

    warnings = ()

    def __init__(self):
        self.events = []

    def frame(self, frame, found):
        """Nothing is kept of frames."""

    def event(self, event):
        """Kept."""
        self.events.append(event)


def raced(directory, source):
    """The appliance's run of `source`: all events."""
    directory.mkdir()
    files = course_files(directory, source.world.circuit, source.world.camera)
    path = directory / "track.yaml"
    path.write_text(yaml.safe_dump(course_config(files, "test") | {"race": {"laps": source.world.task.laps}}))
    heard = Heard()
    options = RunOptions(source_uri=source.info.uri, record_directory=directory)
    run_appliance(load_config(path), options, listeners=[heard], source=source)
    return heard.events


def test_the_appliance_times_the_vehicle_within_8_ms_of_the_truth_and_the_same_twice(tmp_path):
    """A lap told through the overhead camera agrees with what was driven, and the same seed gives the same laps to the bit."""
    laps = []
    for number in range(2):
        source = ClosedLoopSource(table(seed=11, laps=1), PurePursuit())
        events = raced(tmp_path / str(number), source)
        laps.append([event for event in events if isinstance(event, Lap)])
        (told,), (true, *_) = laps[-1], source.world.truth().laps
        assert told.time_s == pytest.approx(true.time_s, abs=8e-3)
        assert told.valid
    assert laps[0] == laps[1]


def test_a_driver_that_fails_ends_the_run_with_its_reason_and_the_recording_is_whole(tmp_path):
    """What it said last is what the run ends with; all up to then is on the disk, finished."""
    driver = Told(pictures=20)
    with pytest.raises(DriverFailed, match="it went out"):
        raced(tmp_path / "run", ClosedLoopSource(table(), driver))
    (recording,) = (tmp_path / "run").glob("*.mcap")
    assert len(list(read_run(recording).detections())) == 19
    assert driver.calls[-1][0] == "close"


def test_the_driver_is_started_asked_and_closed_once_in_one_thread():
    """All of its calls come from the thread that takes the frames, the last from there too when another thread closes."""
    driver = Told()
    source = ClosedLoopSource(LoopTask(size_px=(160, 90), front_size_px=(32, 24)), driver)
    taken = []

    def take():
        for frame in source.frames():
            taken.append(frame)
            if len(taken) == 5:
                source.close()

    thread = threading.Thread(target=take)
    thread.start()
    ident = thread.ident
    thread.join(20.0)
    source.close()
    assert len(taken) == 5
    assert [name for name, _ in driver.calls] == ["start", *["drive"] * 5, "close"]
    assert {who for _, who in driver.calls} == {ident}
    assert [frame.sequence for frame in taken] == [0, 1, 2, 3, 4]
    assert list(source.frames()) == []


def test_a_paced_loop_gives_no_frame_before_its_time_and_ends_when_it_is_closed():
    """For an audience: frames come in real time, and closing ends the wait for one that is far off."""
    source = ClosedLoopSource(LoopTask(size_px=(160, 90), front_size_px=(32, 24)), Told(), pace=1e-4)
    frames = source.frames()
    assert next(frames).t_ns == 0
    threading.Timer(0.2, source.close).start()
    assert list(frames) == []


def test_a_source_that_nobody_takes_from_closes_its_driver():
    """Where the run ends before its first frame, the driver's process must not stay behind."""
    driver = Told()
    source = ClosedLoopSource(LoopTask(), driver)
    source.close()
    source.close()
    assert [name for name, _ in driver.calls] == ["close"]
    assert list(source.frames()) == []


def test_a_uri_names_driver_task_seed_and_laps():
    """`loop:` opens what `nut drive` would drive, with what is left out as there."""
    source = make_source("loop:pure-pursuit?task=camera-delay&seed=7&laps=2", None)
    assert isinstance(source, ClosedLoopSource)
    assert (source.world.task.kind, source.world.task.seed, source.world.task.laps) == ("camera-delay", 7, 2)
    assert source.info.uri == "loop:pure-pursuit?task=camera-delay&seed=7&laps=2"
    assert not source.info.live
    source.close()


@pytest.mark.parametrize(
    ("uri", "word"),
    [
        ("loop:", "names no driver"),
        ("loop:?seed=1", "names no driver"),
        ("loop:nobody", "no driver"),
        ("loop:pure-pursuit?task=flying", "flying"),
        ("loop:pure-pursuit?seed=x", "seed"),
        ("loop:pure-pursuit?laps=0", "laps"),
        ("loop:pure-pursuit?speed=3", "speed"),
        ("loop:pure-pursuit?pace=x", "pace"),
        ("loop:pure-pursuit?pace=-1", "pace"),
        ("loop:pure-pursuit?seed", "options"),
    ],
)
def test_a_uri_that_names_none_says_what_is_wrong(uri, word):
    """One line with the URI and the part that is wrong."""
    with pytest.raises(InputError, match=word) as error:
        make_source(uri, None)
    assert str(error.value).startswith(uri)
    assert "\n" not in str(error.value)
