"""Counts what the appliance itself does, and makes `Health` of it once a second of the frames' own time.

Reads no clock: the race tells it the latency where there is one. For files all numbers are the same in every run.
"""

from __future__ import annotations

import statistics
from collections import deque
from dataclasses import dataclass, field

from dnb_edge.capture.picture_health import REMEDIES, PictureFault
from dnb_edge.daemon.losses import GAP, QUEUE, STAMP, UNREADABLE, added, since
from dnb_edge.daemon.machine import MachineJudge
from dnb_edge.daemon.spread import Spread
from dnb_edge.machine.state import NOTHING_KNOWN, MachineState
from dnb_edge.values import Frame, Health, LostFrames, Observation

PERIOD_NS = 1_000_000_000

COUNTED_KEPT = 600
"""Frames that are remembered as counted: twice as many as observations can be held back."""

LOST_SHARE = 0.02
"""Share of a period's frames above which their loss is a warning."""

_LOSS_WORDS = {
    QUEUE: "this machine is too slow for the camera's rate",
    "overtaken": "this machine is too slow for the camera's rate",
    GAP: "the camera or its cable loses them",
    "damaged": "they come damaged, check the camera's cable",
    "short": "they come cut off, check the camera's cable",
    UNREADABLE: "they come damaged, check the camera's cable",
    STAMP: "the camera's stamps run backwards",
}


@dataclass(slots=True, kw_only=True)
class Meter:
    """The running counts of one race."""

    view_error_mean_px: float | None
    view_error_mean_m: float | None
    view_sigma_m: float | None = None
    standing_warnings: tuple[str, ...] = ()
    """What is wrong all the time, such as a calibration that is too poor to score with."""
    first_t_ns: int | None = None
    """Stamp of the race's first frame; None before that is known."""
    frames: int = 0
    detected_frames: int = 0
    dropped_frames: int = 0
    unreadable_frames: int = 0
    misstamped_frames: int = 0
    """Frames whose stamp was not later than the one before."""
    lost_before: tuple[LostFrames, ...] = ()
    """What the feed lost before the latest frame."""
    picture: PictureFault | None = None
    """What is wrong with the picture at present."""
    view_moved_m: float | None = None
    """How far the camera is known to have moved over the track, metres."""
    view_warning: str | None = None
    """The same in words."""
    _last: Frame | None = None
    _period_t_ns: int = 0
    _period_frames: int = 0
    """Frames after the one that began the period."""
    _counted: deque[int] = field(default_factory=lambda: deque(maxlen=COUNTED_KEPT))
    """Stamps of the latest frames in which a car was found."""
    _latencies_ms: list[float] = field(default_factory=list)
    _all_latencies: Spread = field(default_factory=Spread)
    _judge: MachineJudge = field(default_factory=MachineJudge)
    _losing: tuple[str, ...] = ()
    """The warning of frames that are lost, as it last stood."""
    _losing_t_ns: int = 0
    """Since when losses are being judged: for a second at least, or a `Health` out of turn would switch the warning off."""
    _losing_frames: int = 0
    _losing_lost: tuple[LostFrames, ...] = ()
    """What had been lost by then."""

    def frame(self, frame: Frame) -> None:
        """Counts one frame that is raced, and those that the source lost before it."""
        if self._last is None:
            self.first_t_ns = frame.t_ns if self.first_t_ns is None else self.first_t_ns
            self._period_t_ns = self._losing_t_ns = frame.t_ns
        else:
            # After a camera came back its counter starts anew: no gap can be told from it.
            self.dropped_frames += max(0, frame.sequence - self._last.sequence - 1)
            self._period_frames += 1
        self._last = frame
        self.frames += 1

    def observed(self, observations: list[Observation]) -> None:
        """Counts the frames in which a car was found; several cars may tell of the same frame at different times."""
        new = {observation.t_ns for observation in observations} - set(self._counted)
        self._counted.extend(sorted(new))
        self.detected_frames += len(new)

    def latency(self, milliseconds: float) -> None:
        """Notes the time from a frame's stamp to its events."""
        self._latencies_ms.append(milliseconds)
        self._all_latencies.add(milliseconds)

    @property
    def lost(self) -> tuple[LostFrames, ...]:
        """Frames that never came to the detector, by reason."""
        own = (
            LostFrames(reason=STAMP, frames=self.misstamped_frames),
            LostFrames(reason=UNREADABLE, frames=self.unreadable_frames),
        )
        return added(self.lost_before, own)

    @property
    def due(self) -> bool:
        """Whether a second has passed since the last `Health`."""
        return self._last is not None and self._last.t_ns - self._period_t_ns >= PERIOD_NS

    def health(
        self,
        *,
        display: str,
        recording: str,
        warnings: tuple[str, ...] = (),
        notes: tuple[str, ...] = (),
        machine: MachineState | None = None,
        queued_frames: int | None = None,
        saved_laps: int | None = None,
    ) -> Health:
        """The `Health` now; starts the next period. `machine` and what stands behind it come with a live source only."""
        t_ns = self._last.t_ns if self._last is not None else 0
        span_ns = t_ns - self._period_t_ns
        latency_ms = statistics.median(self._latencies_ms) if self._latencies_ms else None
        unreadable = (f"{self.unreadable_frames} unreadable pictures",) if self.unreadable_frames else ()
        picture = () if self.picture is None else (REMEDIES[self.picture],)
        if t_ns - self._losing_t_ns >= PERIOD_NS:
            self._judge_losses(t_ns)
        live = () if machine is None else (*self._losing, *self._judge.warnings(machine))
        machine = machine or NOTHING_KNOWN
        moved = () if self.view_warning is None else (self.view_warning,)
        health = Health(
            t_ns=t_ns,
            t_s=(t_ns - (self.first_t_ns or 0)) * 1e-9,
            frames=self.frames,
            detected_frames=self.detected_frames,
            dropped_frames=self.dropped_frames,
            fps=self._period_frames * 1e9 / span_ns if span_ns > 0 else None,
            latency_ms=latency_ms,
            display=display,
            recording=recording,
            view_error_mean_px=self.view_error_mean_px,
            view_error_mean_m=self.view_error_mean_m,
            view_sigma_m=self.view_sigma_m,
            notes=notes,
            # Boards show the first few: without a picture nothing else matters.
            warnings=(*picture, *moved, *self.standing_warnings, *unreadable, *warnings, *live),
            picture=None if self.picture is None else self.picture.value,
            view_moved_m=self.view_moved_m,
            latency_p95_ms=self._all_latencies.percentile(95.0),
            latency_p99_ms=self._all_latencies.percentile(99.0),
            lost=self.lost,
            queued_frames=queued_frames,
            disk_free_bytes=machine.disk_free_bytes,
            temperature_c=machine.temperature_c,
            throttled=machine.throttled,
            memory_bytes=machine.memory_bytes,
            saved_laps=saved_laps,
        )
        self._period_t_ns, self._period_frames = t_ns, 0
        self._latencies_ms.clear()
        return health

    def _judge_losses(self, t_ns: int) -> None:
        """Warns where too many of the frames since the last time were lost, with what most of them were lost by."""
        lost = since(self._losing_lost, self.lost)
        lost_frames, raced_frames = sum(one.frames for one in lost), self.frames - self._losing_frames
        self._losing = ()
        if lost_frames > LOST_SHARE * (lost_frames + raced_frames):
            worst = max(lost, key=lambda one: one.frames)
            share = 100.0 * lost_frames / (lost_frames + raced_frames)
            self._losing = (f"{share:.0f} % of frames lost: {_LOSS_WORDS.get(worst.reason, worst.reason)}",)
        self._losing_t_ns, self._losing_frames, self._losing_lost = t_ns, self.frames, self.lost
