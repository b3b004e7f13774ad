"""The race loop: takes frames, asks the detector, steps the core, tells the listeners.

Knows the order of things and when a run ends. Threads are the feed's, the recorder's and the displays'; this is one plain
loop in the caller's thread.
"""

from __future__ import annotations

import logging
import re
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

from dnb_edge.capture.decode import decode_bgr
from dnb_edge.core import Core
from dnb_edge.daemon.catchup import ResumedCore
from dnb_edge.daemon.eye import Eye, nothing_in
from dnb_edge.daemon.meter import Meter
from dnb_edge.daemon.progress import Progress
from dnb_edge.daemon.several import Feed
from dnb_edge.daemon.sinks import Sink
from dnb_edge.daemon.vehicle import VehicleInbox
from dnb_edge.display.base import Display, DisplayStatus
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.machine.state import MachineState
from dnb_edge.record.writer import Recorder
from dnb_edge.values import (
    BgrImage,
    Clock,
    Event,
    Frame,
    FrameDetections,
    Health,
    Lap,
    Observation,
    RunSummary,
    SourceInfo,
)

TICK_S = 0.25
"""Longest wait for a frame before the loop looks after the watchdog and the stop signal."""

LAST_SYNC_S = 0.5
"""For how long the last Health waits for the disk to take the last lap."""

log = logging.getLogger(__name__)


class Stop(Protocol):
    """What says that a run is to end, such as an event that a signal sets."""

    def is_set(self) -> bool:
        """Whether it is to end; asked with each frame."""


@dataclass(slots=True, kw_only=True)
class Race:
    """One run, from the first frame to the last event."""

    info: SourceInfo
    feed: Feed
    eyes: Sequence[Eye]
    """What looks at each camera's pictures, by its number."""
    core: Core | ResumedCore
    meter: Meter
    sinks: Sequence[Sink]
    displays: Sequence[Display]
    notifier: ServiceNotifier
    recorder: Recorder | None
    stop: Stop
    machine: Callable[[], MachineState] | None = None
    """The machine's latest state, which never blocks; None for files and the simulator."""
    on_ready: Callable[[], None] | None = None
    """Called once, when the first frame is raced; must not block."""
    vehicles: VehicleInbox | None = None
    """What vehicles say of themselves; the core never hears of it."""
    laps: int = 0
    _last_t_ns: int | None = None
    _told_fault: str | None = None
    _told_outages: int = 0
    _known_warnings: frozenset[str] = frozenset()
    _progress: Progress = field(init=False)
    _earlier_laps: int = field(init=False)
    """Laps that the disk had before this race began: of the one that it goes on with."""

    def __post_init__(self) -> None:
        self._earlier_laps = self.laps
        self._progress = Progress(self.notifier, self.recorder)

    def run(self) -> RunSummary:
        """Races until the source ends, the wanted laps are complete or `stop` is set; returns the summary so far.

        The summary has no recording yet: that is known when the caller has closed it.
        """
        while not self.stop.is_set() and not self.core.finished and not self.feed.ended:
            frame = self.feed.take(TICK_S)
            if frame is not None:
                self._race(frame)
            elif self.feed.fault != self._told_fault:
                # No frame comes that could make the next one due.
                self._tell(self._health())
            self._progress.stepped(captured=self.feed.progress)
        for event in self.core.finish():
            self._tell(event)
        if self.info.live and self.recorder is not None and self.recorder.state == "recording":
            self.recorder.wait_saved(timeout_s=LAST_SYNC_S)
        self._tell(self._health())
        return RunSummary(
            frames=self.meter.frames,
            detected_frames=self.meter.detected_frames,
            laps=self.laps,
            recording=None,
            bad_pictures=tuple(
                f"{fault} for {lasted:.1f} s" for eye in self.eyes for fault, lasted in eye.pictures.lasted_s.items()
            ),
        )

    def _race(self, frame: Frame) -> None:
        image = self._picture(frame)
        if image is None:
            return
        if self._last_t_ns is None:
            self._ready()
        self._last_t_ns = frame.t_ns
        self.meter.frame(frame)
        eye = self.eyes[frame.camera]
        changed = eye.look(image, frame, renew=lambda reason: self.feed.renew(reason, frame.camera))
        self._note_eyes()
        found = replace(
            self._detect(image, frame, eye),
            view_moved_m=eye.moved_m,
            stamp_source=frame.stamp_source,
            camera=frame.camera,
        )
        for sink in self.sinks:
            sink.frame(frame, found)
        events = self.core.step(found)
        self.meter.observed([event for event in events if isinstance(event, Observation)])
        if self.info.live and self.info.clock is Clock.MONOTONIC:
            self.meter.latency((time.monotonic_ns() - frame.t_ns) * 1e-6)
        for event in events:
            self._tell(event)
        self._tell_vehicles(frame.t_ns)
        failed = self.feed.outages != self._told_outages
        if self.meter.due or changed or failed:
            self._tell(self._health())

    def _picture(self, frame: Frame) -> BgrImage | None:
        """The frame's picture; None, counted, where it is not to be raced."""
        self.meter.lost_before = self.feed.lost
        if self._last_t_ns is not None and frame.t_ns <= self._last_t_ns:
            self.meter.misstamped_frames += 1
            if self.meter.misstamped_frames == 1:
                log.warning("frame %d: its stamp is not later than the one before: left out", frame.sequence)
            return None
        image = decode_bgr(frame)
        if image is None:
            self.meter.unreadable_frames += 1
        return image

    def _ready(self) -> None:
        self.notifier.ready()
        if self.on_ready is not None:
            self.on_ready()

    def _note_eyes(self) -> None:
        """What is wrong with the cameras' pictures and places: of several cameras the first that is amiss."""
        self.meter.picture = next((eye.pictures.fault for eye in self.eyes if eye.pictures.fault is not None), None)
        worst = max(self.eyes, key=lambda eye: eye.moved_m or 0.0)
        self.meter.view_moved_m = worst.moved_m
        self.meter.view_warning = None if worst.drift is None else worst.drift.warning

    def _detect(self, image: BgrImage, frame: Frame, eye: Eye) -> FrameDetections:
        """What is found in the picture, where the core would have it looked for."""
        if not self.core.is_awaited(frame.t_ns, frame.camera):
            return nothing_in(frame)
        return eye.detect(image, frame, self.core.windows(frame.t_ns, frame.camera))

    def _tell(self, event: Event) -> None:
        self.laps += isinstance(event, Lap)
        for sink in self.sinks:
            sink.event(event)

    def _tell_vehicles(self, t_ns: int) -> None:
        """What vehicles said until the frame at `t_ns`."""
        first_t_ns, monotonic = self.meter.first_t_ns, self.info.clock is Clock.MONOTONIC
        if self.vehicles is not None and first_t_ns is not None:
            for report in self.vehicles.take(t_ns, first_t_ns=first_t_ns, monotonic=monotonic):
                self._tell(report)

    def _health(self) -> Health:
        fault = self._camera_fault()
        faults = () if fault is None else (fault,)
        warnings = (*faults, *(warning for sink in self.sinks for warning in sink.warnings))
        unwatched = [eye.drift.note for eye in self.eyes if eye.drift is not None and eye.drift.note is not None]
        notes = (*self.core.notes(), *unwatched)
        health = self.meter.health(
            display=self._display(),
            recording=self._recording(),
            warnings=warnings,
            notes=notes,
            machine=None if self.machine is None else self.machine(),
            queued_frames=self.feed.most_queued() if self.info.live else None,
            saved_laps=self._saved_laps(),
        )
        self._warn(health.warnings)
        return health

    def _camera_fault(self) -> str | None:
        """Why no frames come; told once, too, where they come again before anybody could tell."""
        outages = self.feed.outages
        failed, self._told_outages = outages != self._told_outages, outages
        self._told_fault = self.feed.fault
        return self.feed.last_fault if failed and self._told_fault is None else self._told_fault

    def _warn(self, warnings: tuple[str, ...]) -> None:
        """Says each warning once, when it appears; counts in it may grow. A failed recording is the run's error at its end."""
        kinds = {re.sub(r"\d+", "#", warning): warning for warning in warnings}
        for kind, warning in kinds.items():
            if kind not in self._known_warnings and not warning.startswith("recording failed"):
                log.warning("%s", warning)
        self._known_warnings = frozenset(kinds)

    def _display(self) -> str:
        statuses = {display.status for display in self.displays}
        if not statuses:
            return "none"
        return "offline" if DisplayStatus.OFFLINE in statuses else "online"

    def _saved_laps(self) -> int | None:
        """None for files too: how far the disk is depends on the machine's speed."""
        if self.recorder is None or not self.info.live:
            return None
        return self._earlier_laps + self.recorder.health().saved_laps

    def _recording(self) -> str:
        return "none" if self.recorder is None else self.recorder.state
