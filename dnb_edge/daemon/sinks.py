"""Who listens to a race: the recording, the displays, the service manager and the JSON lines, as peers.

Each takes frames, detections and events and never makes the race wait beyond what its own room promises. Knows the
rooms' interfaces; knows nothing of how events come about.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from types import TracebackType
from typing import Protocol, Self, TextIO

from dnb_edge import wire
from dnb_edge.daemon.aside import Aside
from dnb_edge.daemon.notices import Notices
from dnb_edge.display.base import Display, DisplayStatus
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.display.state import BoardState
from dnb_edge.record.writer import Recorder
from dnb_edge.values import (
    Event,
    Frame,
    FrameDetections,
    Health,
    Observation,
    Running,
    Standings,
    Target,
    VehicleReport,
)


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

    def __init__(
        self,
        displays: Sequence[Display],
        notifier: ServiceNotifier,
        laps_wanted: int | None,
        *,
        first_t_ns: int | None = None,
        notices: Notices | None = None,
    ) -> None:
        """`first_t_ns`: stamp of the race's first frame; None where that is still to come. `notices` are shown as well."""
        self._displays = displays
        self._notifier = notifier
        self._state = BoardState(laps_wanted=laps_wanted)
        self._first_t_ns = first_t_ns
        self._notices = Notices() if notices is None else notices
        self._notices.on_change = self.show

    @property
    def state(self) -> BoardState:
        """The board, as far as the race goes."""
        return self._state

    def frame(self, frame: Frame, found: FrameDetections) -> None:  # noqa: ARG002 a board shows no detections
        """Lets the running lap run on."""
        if self._first_t_ns is None:
            self._first_t_ns = frame.t_ns
        self._post(self._state.at((frame.t_ns - self._first_t_ns) * 1e-9))

    def event(self, event: Event) -> None:
        """Shows the event; the service manager's line changes with it. No display shows what a vehicle says."""
        if isinstance(event, VehicleReport):
            return
        self._post(self._state.after(event))
        self._notifier.show(self._state)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Displays that are offline, with the reason."""
        faults = [display.fault for display in self._displays if display.status is DisplayStatus.OFFLINE]
        return tuple(f"display offline: {fault}" if fault else "display offline" for fault in faults)

    def show(self) -> None:
        """Shows the board as it stands, with a new notice, say; from any thread."""
        shown = self._state.noting(self._notices.text)
        for display in self._displays:
            display.post(shown)

    def _post(self, state: BoardState) -> None:
        self._state = state
        self.show()


def _hidden(*, observations: bool) -> tuple[type[Event], ...]:
    return (Target,) if observations else (Target, Observation, Running, VehicleReport)


class JsonSink:
    """One JSON object a line for each event, in order. The race waits for whoever reads, as it may with files."""

    def __init__(self, stream: TextIO, *, observations: bool) -> None:
        self._stream = stream
        self._hidden = _hidden(observations=observations)

    def frame(self, frame: Frame, found: FrameDetections) -> None:
        """Frames themselves have no line."""

    def event(self, event: Event) -> None:
        """Prints the event; laps and all but observations are flushed at once, so that scripts see them as they happen."""
        if isinstance(event, self._hidden):
            return
        self._stream.write(wire.event_to_json(event) + "\n")
        if not isinstance(event, Observation | Running | VehicleReport):
            self._stream.flush()

    @property
    def warnings(self) -> tuple[str, ...]:
        """None: a stream that is closed ends the run."""
        return ()


class LiveJsonSink:
    """The same lines for a live race, which never waits: a thread of its own writes them.

    Where nobody reads for long, observations, running laps, standings and health are left out and counted; laps, crossings and
    all the rest are kept.
    """

    CLOSE_S = 1.0
    """How long the last lines may take, seconds."""

    def __init__(self, descriptor: int, *, observations: bool) -> None:
        """`descriptor`: of the file to write to. Not a stream: one that hangs would hold up the end of the process."""
        self._descriptor = descriptor
        self._hidden = _hidden(observations=observations)
        self._lines: Aside[bytes] = Aside("json", self._write)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._lines.close(self.CLOSE_S)

    def frame(self, frame: Frame, found: FrameDetections) -> None:
        """Frames themselves have no line."""

    def event(self, event: Event) -> None:
        """Hands the event's line over. Raises `OSError` where the reader went away: that ends the run."""
        if self._lines.failure is not None:
            raise self._lines.failure
        if not isinstance(event, self._hidden):
            vital = not isinstance(event, Observation | Running | Standings | Health | VehicleReport)
            self._lines.put((wire.event_to_json(event) + "\n").encode(), vital=vital)

    @property
    def warnings(self) -> tuple[str, ...]:
        """How many lines were left out, once there are any."""
        lost = self._lines.lost
        return (f"{lost} JSON lines left out: nobody reads them",) if lost else ()

    def _write(self, line: bytes) -> None:
        rest = memoryview(line)
        while rest:
            rest = rest[os.write(self._descriptor, rest) :]
