"""The listeners of a race: JSON lines and boards."""

import io
import json
import os

import pytest
from played import Panel, frame

from dnb_edge import wire
from dnb_edge.daemon.sinks import BoardSink, JsonSink
from dnb_edge.display.base import DisplayStatus
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.display.state import Phase
from dnb_edge.values import (
    Crossing,
    Direction,
    Event,
    FrameDetections,
    Health,
    Lap,
    Observation,
    RunSummary,
    Target,
    TargetState,
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
TARGET = Target(
    target_id=1,
    state=TargetState.CONFIRMED,
    t_ns=1,
    t_s=1e-9,
    track_m=(1.0, 0.5),
    velocity_mps=(1.0, 0.0),
    covariance_m2=(1e-4, 0.0, 1e-4),
)
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
LAP = Lap(
    number=1,
    start_t_ns=2_000_000_000,
    end_t_ns=12_000_000_000,
    start_s=2.0,
    time_s=10.0,
    sigma_s=0.002,
    valid=True,
    reasons=(),
    similarity_percent=95.78,
    observed_fraction=1.0,
)
HEALTH = Health(
    t_ns=12_000_000_000,
    t_s=12.0,
    frames=360,
    detected_frames=350,
    dropped_frames=0,
    fps=30.0,
    latency_ms=None,
    display="none",
    recording="none",
    view_error_mean_px=None,
    view_error_mean_m=None,
)
END = RunSummary(frames=360, detected_frames=350, laps=1, recording=None)
RACE: tuple[Event, ...] = (OBSERVATION, TARGET, CROSSING, LAP, HEALTH, END)


@pytest.mark.parametrize(
    ("observations", "kinds"),
    [
        (False, ["crossing", "lap", "health", "run"]),
        (True, ["observation", "crossing", "lap", "health", "run"]),
    ],
)
def test_a_line_for_each_event_in_order(observations: bool, kinds: list[str]) -> None:
    """One object a line, with the fields by which the value comes back exactly; targets never, observations on request."""
    stream = io.StringIO()
    sink = JsonSink(stream, observations=observations)
    sink.frame(frame(0), FrameDetections(sequence=0, t_ns=0, detections=(), full_frame=True))
    for event in RACE:
        sink.event(event)
    lines = [json.loads(line) for line in stream.getvalue().splitlines()]
    assert [line["event"] for line in lines] == kinds
    values = [event for event in RACE if wire.EVENT_NAMES[type(event)] in kinds]
    assert [wire.from_dict(type(value), line) for value, line in zip(values, lines, strict=True)] == values
    assert sink.warnings == ()


def test_a_lap_is_out_at_once() -> None:
    """Through a buffered stream a script reads each crossing and lap as it happens."""
    reading, writing = os.pipe()
    os.set_blocking(reading, False)
    with os.fdopen(reading, "rb") as reader, os.fdopen(writing, "w") as stream:
        sink = JsonSink(stream, observations=True)
        for event in (CROSSING, LAP, HEALTH, END):
            sink.event(OBSERVATION)
            sink.event(event)
            *_, last = reader.read().decode().splitlines()
            assert last == wire.event_to_json(event)


@pytest.fixture
def no_manager(monkeypatch: pytest.MonkeyPatch) -> ServiceNotifier:
    """A notifier outside a service."""
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    return ServiceNotifier()


def test_every_display_is_told_of_frames_and_events(no_manager: ServiceNotifier) -> None:
    """Each frame lets the running lap run on, from the first frame's stamp; each event changes the board; all see the same."""
    panels = [Panel(), Panel()]
    sink = BoardSink(panels, no_manager, 3)
    nothing = FrameDetections(sequence=0, t_ns=0, detections=(), full_frame=True)
    sink.frame(frame(0, t_ns=7_000_000_000), nothing)
    sink.event(TARGET)
    sink.event(CROSSING)
    sink.frame(frame(1, t_ns=10_500_000_000), nothing)
    board = panels[0].shown[-1]
    assert (board.phase, board.t_s, board.running_s, board.state_line) == (Phase.LAP, 3.5, 1.5, "lap 1 of 3")
    sink.event(LAP)
    sink.event(HEALTH)
    assert panels[0].shown[-1].last_lap == LAP
    assert panels[0].shown[-1].health == HEALTH
    sink.event(END)
    assert panels[0].shown[-1].phase is Phase.FINISHED
    assert len(panels[0].shown) == 7
    assert panels[0].shown == panels[1].shown


def test_displays_that_are_offline_are_told_with_their_fault(no_manager: ServiceNotifier) -> None:
    """A warning for each display that does not show the race, gone when it is back; the race is told to all the same."""
    panels = [Panel(), Panel(), Panel()]
    sink = BoardSink(panels, no_manager, None)
    assert sink.warnings == ()
    panels[0].status = panels[2].status = DisplayStatus.OFFLINE
    panels[2].fault = "/dev/ttyUSB0: no such file"
    assert sink.warnings == ("display offline", "display offline: /dev/ttyUSB0: no such file")
    sink.event(CROSSING)
    assert [len(panel.shown) for panel in panels] == [1, 1, 1]
    panels[0].status = panels[2].status = DisplayStatus.ONLINE
    assert sink.warnings == ()
