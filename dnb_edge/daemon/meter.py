"""Counts what the appliance itself does, and makes `Health` of it once a second of the frames' own time.

Reads no clock: the race tells it the latency where there is one. For files all numbers are the same in every run.
"""

from __future__ import annotations

import statistics
from collections import deque
from dataclasses import dataclass, field

from dnb_edge.capture.picture_health import REMEDIES, PictureFault
from dnb_edge.values import Frame, Health, Observation

PERIOD_NS = 1_000_000_000

COUNTED_KEPT = 600
"""Frames that are remembered as counted: twice as many as observations can be held back."""


@dataclass(slots=True, kw_only=True)
class Meter:
    """The running counts of one race."""

    view_error_mean_px: float | None
    view_error_mean_m: float | None
    view_sigma_m: float | None = None
    standing_warnings: tuple[str, ...] = ()
    """What is wrong all the time, such as a calibration that is too poor to score with."""
    frames: int = 0
    detected_frames: int = 0
    dropped_frames: int = 0
    unreadable_frames: int = 0
    picture: PictureFault | None = None
    """What is wrong with the picture at present."""
    view_moved_m: float | None = None
    """How far the camera is known to have moved over the track, metres."""
    view_warning: str | None = None
    """The same in words."""
    _first_t_ns: int | None = None
    _last: Frame | None = None
    _period_t_ns: int = 0
    _period_frames: int = 0
    """Frames after the one that began the period."""
    _counted: deque[int] = field(default_factory=lambda: deque(maxlen=COUNTED_KEPT))
    """Stamps of the latest frames in which a car was found."""
    _latencies_ms: list[float] = field(default_factory=list)

    def frame(self, frame: Frame) -> None:
        """Counts one frame that is raced, and those that the source lost before it."""
        if self._last is None:
            self._first_t_ns = self._period_t_ns = frame.t_ns
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

    @property
    def due(self) -> bool:
        """Whether a second has passed since the last `Health`."""
        return self._last is not None and self._last.t_ns - self._period_t_ns >= PERIOD_NS

    def health(
        self, *, display: str, recording: str, warnings: tuple[str, ...] = (), notes: tuple[str, ...] = ()
    ) -> Health:
        """The `Health` now; starts the next period."""
        t_ns = self._last.t_ns if self._last is not None else 0
        span_ns = t_ns - self._period_t_ns
        latency_ms = statistics.median(self._latencies_ms) if self._latencies_ms else None
        unreadable = (f"{self.unreadable_frames} unreadable pictures",) if self.unreadable_frames else ()
        picture = () if self.picture is None else (REMEDIES[self.picture],)
        moved = () if self.view_warning is None else (self.view_warning,)
        health = Health(
            t_ns=t_ns,
            t_s=(t_ns - (self._first_t_ns or 0)) * 1e-9,
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
            warnings=(*picture, *moved, *self.standing_warnings, *unreadable, *warnings),
            picture=None if self.picture is None else self.picture.value,
            view_moved_m=self.view_moved_m,
        )
        self._period_t_ns, self._period_frames = t_ns, 0
        self._latencies_ms.clear()
        return health
