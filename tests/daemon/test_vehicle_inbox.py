"""What vehicles say on its way into a race: in bounds, with the right stamps, and without any way to change the race."""

import json
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest
from conducted import Conducted, Truth, found_in, laps_of, race_live, setup_of
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge import wire
from dnb_edge.cli.demo import write_demo_config
from dnb_edge.daemon import loop, resume
from dnb_edge.daemon.live_sink import LiveSink
from dnb_edge.daemon.notices import Notices
from dnb_edge.daemon.orders import Orders
from dnb_edge.daemon.vehicle import BURST, MOST_A_FRAME, MOST_HZ, MOST_WAITING, OLDEST_NS, VehicleInbox
from dnb_edge.live.messages import VehicleSays
from dnb_edge.live.server import LiveServer
from dnb_edge.live.vehicle_word import VehicleWord
from dnb_edge.record.channels import DETECTIONS_TOPIC, EVENT_TOPICS
from dnb_edge.sim.rig import Rig
from dnb_edge.values import Clock, FrameDetections, VehicleReport

SECOND_NS = 1_000_000_000
NOW_NS = 1000 * SECOND_NS


class Hands:
    """A clock that stands where it is put."""

    def __init__(self) -> None:
        self.now_ns = NOW_NS

    def __call__(self) -> int:
        return self.now_ns


def word(came_ns: int = NOW_NS, **members: object) -> VehicleWord:
    return replace(VehicleWord(came_ns=came_ns, car=1, throttle=0.5), **members)  # type: ignore[arg-type]


def test_a_word_is_told_with_the_frame_behind_it() -> None:
    """On a live camera's clock the stamp is that of the arrival: it waits for a later frame, so that no word lies beyond the
    frames; what came before the run began is not the run's."""
    inbox = VehicleInbox(Hands())
    inbox.put([word(NOW_NS - 500), word(NOW_NS - 300), word(NOW_NS - 100, seq=7)])
    told = inbox.take(NOW_NS - 200, first_t_ns=NOW_NS - 400, monotonic=True)
    assert [(one.t_ns, one.came_ns, one.seq) for one in told] == [(NOW_NS - 300, NOW_NS - 300, None)]
    (late,) = inbox.take(NOW_NS, first_t_ns=NOW_NS - 400, monotonic=True)
    assert (late.t_ns, late.t_s, late.seq) == (NOW_NS - 100, pytest.approx(300e-9), 7)
    inbox.put([word(NOW_NS)])
    inbox.clear()
    assert inbox.take(NOW_NS, first_t_ns=0, monotonic=True) == []


def test_on_another_clock_a_word_has_the_frames_stamp() -> None:
    """The simulator's time has nothing to do with when a line came."""
    inbox = VehicleInbox(Hands())
    inbox.put([word(), word()])
    told = inbox.take(33_333_333, first_t_ns=0, monotonic=False)
    assert [(one.t_ns, one.t_s, one.came_ns) for one in told] == [(33_333_333, 33_333_333 * 1e-9, NOW_NS)] * 2


@pytest.mark.parametrize(
    "lie",
    [
        {"car": 0},
        {"car": 100},
        {"steering": 1.5},
        {"throttle": -1.01},
        {"inference_ms": -0.1},
        {"seq": -1},
        {"missing": -1},
        {"came_ns": NOW_NS + 1},
        {"came_ns": NOW_NS - OLDEST_NS - 1},
    ],
)
def test_what_cannot_be_meant_is_left_out(lie: dict[str, int | float]) -> None:
    """Whoever is on the socket: a member out of its bounds, a stamp of the future or of long ago."""
    inbox = VehicleInbox(Hands())
    inbox.put([word(**lie), word(seq=1)])
    assert [one.seq for one in inbox.take(NOW_NS, first_t_ns=0, monotonic=True)] == [1]
    assert inbox.left_out == 1


@given(batches=st.lists(st.tuples(st.integers(0, 300), st.integers(0, 100_000_000)), max_size=60))
def test_no_flood_is_more_than_a_race_bears(batches: list[tuple[int, int]]) -> None:
    """However many words come: no more than the limit pass, few wait, and a frame is told few of them."""
    clock = Hands()
    inbox, said, told = VehicleInbox(clock), 0, 0
    for count, after_ns in batches:
        clock.now_ns += after_ns
        inbox.put([word(clock.now_ns)] * count)
        said += count
        some = inbox.take(clock.now_ns, first_t_ns=0, monotonic=True)
        assert len(some) <= MOST_A_FRAME
        told += len(some)
    assert told + inbox.left_out <= said
    assert said - inbox.left_out <= BURST + MOST_HZ * (clock.now_ns - NOW_NS) / SECOND_NS
    assert len(inbox._waiting) <= MOST_WAITING


def test_without_a_race_nothing_is_taken() -> None:
    """The asker is told so, and a race that begins later hears nothing of it."""
    desk, replies = Orders(Notices(), lambda entry: None), list[str | None]()
    desk(VehicleSays(ask=1, words=(word(time.monotonic_ns()),)), replies.append)
    desk.races = True
    desk(VehicleSays(ask=2, words=(word(time.monotonic_ns(), seq=2),)), replies.append)
    assert replies == ["no race is on", None]
    later_ns = time.monotonic_ns() + SECOND_NS
    assert [one.seq for one in desk.vehicles.take(later_ns, first_t_ns=0, monotonic=True)] == [2]


def test_a_run_that_was_cut_short_is_gone_on_with_whatever_cars_said() -> None:
    """What a vehicle said behind the last frame is no event of the core, which would be waited for in vain."""
    tally = resume._Tally()
    frame = FrameDetections(sequence=0, t_ns=0, detections=(), full_frame=True)
    tally.take(DETECTIONS_TOPIC, json.dumps(wire.to_dict(frame)).encode())
    tally.take(EVENT_TOPICS[VehicleReport], b"{}")
    assert (tally.frames, tally.after_last, tally.shown) == (1, 0, [])


def test_a_board_is_told_a_few_figures_a_second_of_each_car(tmp_path: Path) -> None:
    """Of a hundred words in a second some ten, of each of two cars; every one of them is of the latest."""
    with LiveServer(tmp_path / "s", version="1") as server:
        told: list[VehicleReport] = []
        server.tell = told.append  # type: ignore[assignment, method-assign]
        sink = LiveSink(server)
        inbox = VehicleInbox(clock := Hands())
        for number in range(100):
            clock.now_ns += 10_000_000
            inbox.put([word(clock.now_ns, car=car, seq=number) for car in (1, 2)])
            for report in inbox.take(clock.now_ns, first_t_ns=0, monotonic=True):
                sink.event(report)
    assert [one.seq for one in told if one.car == 1] == list(range(0, 100, 9))
    assert len(told) == 24


def test_a_flood_moves_no_lap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A race in which vehicles say all that is taken, and lie besides, has the laps of one in which nobody says a word, to the
    last bit; and the words are told in it."""
    rig = Rig(laps=1)
    setup = setup_of(write_demo_config(tmp_path, rig), rig)
    undisturbed = laps_of(setup, [found_in(rig, index, index) for index in range(rig.frames)])
    inbox, ended = VehicleInbox(), threading.Event()
    usual = loop.Race
    monkeypatch.setattr("conducted.Race", lambda **rooms: usual(**rooms, vehicles=inbox))

    def flood() -> None:
        while not ended.wait(0.002):
            inbox.put([word(time.monotonic_ns(), car=1 + number % 120, steering=number / 25) for number in range(50)])

    thread = threading.Thread(target=flood)
    thread.start()
    try:
        truth = Truth(rig)
        camera = Conducted(rig, truth)
        camera.info = replace(camera.info, clock=Clock.SIMULATED)
        diary = race_live(setup, camera, truth)
    finally:
        ended.set()
        thread.join()
    said = [event for event in diary.events if isinstance(event, VehicleReport)]
    assert said
    assert inbox.left_out > len(said)
    assert diary.laps == undisturbed
