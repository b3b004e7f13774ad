"""Who listens to a race: the recording, the displays, the service manager and the JSON lines, as peers.

Each takes frames, detections and events and never makes the race wait beyond what its own room promises. Knows the
rooms' interfaces; knows nothing of how events come about.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, TextIO

from dnb_edge import wire
from dnb_edge.display.base import Display, DisplayStatus
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.display.state import BoardState
from dnb_edge.record.writer import Recorder
from dnb_edge.values import Event, Frame, FrameDetections, Observation, Running, Target


class Sink(Protocol):
    """A listener."""

    def frame(self, frame: Frame, found: FrameDetections) -> None:
        """One frame was raced, with what the detector found in it."""

    def event(self, event: Event) -> None:
        """Something happened."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is wrong with this listener at present, in words; empty where all is well."""


class RecordSink:
    """Hands everything to the recorder."""

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder

    def frame(self, frame: Frame, found: FrameDetections) -> None:
        """Records the detections, and the picture where one is due."""
        self._recorder.add_frame(frame)
        self._recorder.add_detections(found)

    def event(self, event: Event) -> None:
        """Records the event; laps and scores are synced at once by the recorder."""
        self._recorder.add_event(event)

    @property
    def warnings(self) -> tuple[str, ...]:
        """The recorder's own."""
        return self._recorder.health().warnings


class BoardSink:
    """Keeps the board's state and posts it to displays and the service manager."""

    def __init__(self, displays: Sequence[Display], notifier: ServiceNotifier, laps_wanted: int | None) -> None:
        self._displays = displays
        self._notifier = notifier
        self._state = BoardState(laps_wanted=laps_wanted)
        self._first_t_ns: int | None = None

    def frame(self, frame: Frame, found: FrameDetections) -> None:  # noqa: ARG002 a board shows no detections
        """Lets the running lap run on."""
        if self._first_t_ns is None:
            self._first_t_ns = frame.t_ns
        self._post(self._state.at((frame.t_ns - self._first_t_ns) * 1e-9))

    def event(self, event: Event) -> None:
        """Shows the event; the service manager's line changes with it."""
        self._post(self._state.after(event))
        self._notifier.show(self._state)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Displays that are offline, with the reason."""
        faults = [display.fault for display in self._displays if display.status is DisplayStatus.OFFLINE]
        return tuple(f"display offline: {fault}" if fault else "display offline" for fault in faults)

    def _post(self, state: BoardState) -> None:
        self._state = state
        for display in self._displays:
            display.post(state)


class JsonSink:
    """One JSON object a line for each event, in order."""

    def __init__(self, stream: TextIO, *, observations: bool) -> None:
        self._stream = stream
        self._hidden = (Target,) if observations else (Target, Observation, Running)

    def frame(self, frame: Frame, found: FrameDetections) -> None:
        """Frames themselves have no line."""

    def event(self, event: Event) -> None:
        """Prints the event; laps and all but observations are flushed at once, so that scripts see them as they happen."""
        if isinstance(event, self._hidden):
            return
        self._stream.write(wire.event_to_json(event) + "\n")
        if not isinstance(event, Observation | Running):
            self._stream.flush()

    @property
    def warnings(self) -> tuple[str, ...]:
        """None: a stream that is closed ends the run."""
        return ()
