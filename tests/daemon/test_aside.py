"""Work in a thread of its own: lines and logs that nobody takes hold nobody up."""

import io
import json
import logging
import os
import threading

import pytest
from played import PATIENCE_S, wait_until

from dnb_edge.daemon.aside import CAPACITY, Aside
from dnb_edge.daemon.log_aside import log_aside
from dnb_edge.daemon.sinks import LiveJsonSink
from dnb_edge.values import Crossing, Direction, Observation, RunSummary

CROSSING = Crossing(
    t_ns=2_000_000_000,
    t_s=2.0,
    line="start",
    direction=Direction.FORWARD,
    sigma_s=0.0015,
    track_m=(1.0, 0.5),
    target_id=1,
    estimated=False,
)
OBSERVATION = Observation(
    t_ns=1,
    t_s=1e-9,
    camera_px=(0.1, 2 / 3),
    track_m=(0.1, 0.2),
    covariance_m2=(1e-4, 0.0, 1e-4),
    confidence=0.9,
    length_px=40.0,
)
END = RunSummary(frames=360, detected_frames=350, laps=1, recording=None)


def test_items_are_worked_on_in_order_and_to_the_last() -> None:
    """`close` lets the thread do what waits."""
    done: list[int] = []
    aside: Aside[int] = Aside("test", done.append)
    for item in range(1000):
        aside.put(item)
    assert aside.close(PATIENCE_S)
    assert done == list(range(1000))
    assert aside.lost == 0


def test_a_full_queue_refuses_all_but_what_is_vital() -> None:
    """While the work hangs, the plain items beyond the capacity are counted as lost; vital ones get in, in order."""
    gate, begun, done = threading.Event(), threading.Event(), []

    def work(item: str) -> None:
        begun.set()
        gate.wait()
        done.append(item)

    aside: Aside[str] = Aside("test", work, capacity=2)
    aside.put("first")
    assert begun.wait(PATIENCE_S)
    for item in ("a", "b", "c", "d"):
        aside.put(item)
    aside.put("lap", vital=True)
    assert aside.lost == 2
    assert not aside.close(0.01)
    gate.set()
    assert aside.close(PATIENCE_S)
    assert done == ["first", "a", "b", "lap"]


def test_the_first_error_of_the_system_ends_the_work() -> None:
    """It is kept for whoever asks; nothing is put any more."""

    def work(item: int) -> None:
        raise BrokenPipeError(32, "Broken pipe")

    aside: Aside[int] = Aside("test", work)
    aside.put(1)
    wait_until(lambda: aside.failure is not None)
    aside.put(2)
    assert not aside.close(PATIENCE_S)
    assert isinstance(aside.failure, BrokenPipeError)


def test_json_lines_of_a_live_race_come_whole_and_in_order() -> None:
    """As of any race, once the sink is closed."""
    reading, writing = os.pipe()
    with os.fdopen(reading) as reader, LiveJsonSink(writing, observations=True) as sink:
        for event in (OBSERVATION, CROSSING, END):
            sink.event(event)
        lines = [json.loads(reader.readline())["event"] for _ in range(3)]
    os.close(writing)
    assert lines == ["observation", "crossing", "run"]


def test_json_lines_that_nobody_reads_are_left_out_but_for_what_counts() -> None:
    """Observations beyond the queue are lost and told of; the crossing after them comes once somebody reads."""
    reading, writing = os.pipe()
    sink = LiveJsonSink(writing, observations=True)
    for _ in range(3 * CAPACITY):
        sink.event(OBSERVATION)
    sink.event(CROSSING)
    (warning,) = sink.warnings
    assert warning.endswith("JSON lines left out: nobody reads them")
    with os.fdopen(reading) as reader:
        while (line := json.loads(reader.readline()))["event"] != "crossing":
            assert line["event"] == "observation"
    os.close(writing)


def test_a_reader_of_json_lines_that_went_away_ends_the_run() -> None:
    """As with files: the next event raises what the pipe said."""
    reading, writing = os.pipe()
    os.close(reading)
    with LiveJsonSink(writing, observations=False) as sink:
        sink.event(CROSSING)
        wait_until(lambda: sink._lines.failure is not None)
        with pytest.raises(BrokenPipeError):
            sink.event(CROSSING)
    os.close(writing)


def test_a_log_that_is_stuck_holds_nobody_up() -> None:
    """What is logged meanwhile comes once the stream takes it; afterwards the handlers are as they were."""
    logger = logging.Logger("stuck")
    gate, text = threading.Event(), io.StringIO()

    class Stuck(logging.StreamHandler):
        def emit(self, record: logging.LogRecord) -> None:
            gate.wait(PATIENCE_S)
            super().emit(record)

    handler = Stuck(text)
    logger.addHandler(handler)
    with log_aside(logger):
        for number in range(5):
            logger.warning("line %d", number)
        assert text.getvalue() == ""
        gate.set()
    assert text.getvalue() == "".join(f"line {number}\n" for number in range(5))
    assert logger.handlers == [handler]
