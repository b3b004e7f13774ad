"""Several cameras' frames as one stream, in the order of their stamps: what the race loop takes from.

Each camera has its own feed, with its own thread and queue. A frame goes out once no other camera can still have an earlier
one: at once where each has one waiting, and for live cameras after `HOLD_S` at the latest, so that one that is away holds
nothing up. Knows feeds; knows nothing of pictures.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Sequence
from dataclasses import replace
from types import TracebackType
from typing import Protocol, Self

from dnb_edge.daemon.feed import FrameFeed
from dnb_edge.daemon.losses import added
from dnb_edge.values import Frame, LostFrames

HOLD_S = 0.1
"""Longest time for which a live camera's frame waits for another's earlier one: three frames at 30 a second."""
_SLICE_S = 0.005


class Feed(Protocol):
    """Where the race loop takes its frames from: one camera's feed, or several cameras'."""

    @property
    def fault(self) -> str | None:
        """Why no frames come at present, in one line; None where all is well."""

    @property
    def outages(self) -> int:
        """How often a live source has failed so far."""

    @property
    def last_fault(self) -> str | None:
        """Why one failed last; stays when it is back."""

    @property
    def lost(self) -> tuple[LostFrames, ...]:
        """What was lost, by reason, before the frames taken last."""

    @property
    def progress(self) -> int:
        """Grows with each frame and each attempt to open a camera: stands still where a thread hangs."""

    @property
    def ended(self) -> bool:
        """True once the sources have ended well and the last frame was taken."""

    def most_queued(self) -> int:
        """Most frames that have waited since this was last asked."""

    def renew(self, reason: str, camera: int = 0) -> None:
        """Closes a live source that gives frames but no sense, and opens it again."""

    def take(self, timeout_s: float) -> Frame | None:
        """The next frame; None where none came within `timeout_s`. Raises what ended a source badly."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None: ...


class SeveralFeeds:
    """The frames of several cameras, each marked with its camera's number."""

    def __init__(self, feeds: Sequence[FrameFeed], *, live: bool) -> None:
        """`live`: nothing waits for a camera that sends nothing; else a frame waits until each source has one, or has ended."""
        self._feeds = tuple(feeds)
        self._hold_s = HOLD_S if live else None
        self._waiting: dict[int, tuple[Frame, float]] = {}
        """By camera, its next frame and when it was taken, monotonic."""
        self._open = contextlib.ExitStack()
        self._progress = [0] * len(self._feeds)
        self._moves = 0

    def __enter__(self) -> Self:
        for feed in self._feeds:
            self._open.enter_context(feed)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._open.close()

    @property
    def fault(self) -> str | None:
        """Of the first camera that has one, with its number."""
        faults = [(number, feed.fault) for number, feed in enumerate(self._feeds)]
        return next((f"camera {number + 1}: {fault}" for number, fault in faults if fault is not None), None)

    @property
    def outages(self) -> int:
        """Of all cameras together."""
        return sum(feed.outages for feed in self._feeds)

    @property
    def last_fault(self) -> str | None:
        """Of the first camera that has failed."""
        faults = [(number, feed.last_fault) for number, feed in enumerate(self._feeds)]
        return next((f"camera {number + 1}: {fault}" for number, fault in faults if fault is not None), None)

    @property
    def lost(self) -> tuple[LostFrames, ...]:
        """Of all cameras together, by reason."""
        lost: tuple[LostFrames, ...] = ()
        for feed in self._feeds:
            lost = added(lost, feed.lost)
        return lost

    @property
    def progress(self) -> int:
        """Grows only once every camera's thread has moved: one that hangs must not hide behind the others."""
        now = [feed.progress for feed in self._feeds]
        if all(new != old or feed.ended for new, old, feed in zip(now, self._progress, self._feeds, strict=True)):
            self._progress = now
            self._moves += 1
        return self._moves

    @property
    def ended(self) -> bool:
        """True once all have ended and their last frames were taken."""
        return not self._waiting and all(feed.ended for feed in self._feeds)

    def most_queued(self) -> int:
        """Of the camera that had most."""
        return max(feed.most_queued() for feed in self._feeds)

    def renew(self, reason: str, camera: int = 0) -> None:
        """Of that camera."""
        self._feeds[camera].renew(reason)

    def take(self, timeout_s: float) -> Frame | None:
        """The earliest frame, once none can be earlier; None where none came within `timeout_s`."""
        deadline_s = time.monotonic() + timeout_s
        while True:
            due = self._due()
            if due is not None:
                return due
            left_s = deadline_s - time.monotonic()
            if left_s <= 0.0 or self.ended:
                return None
            self._fill(min(_SLICE_S, left_s))

    def _due(self) -> Frame | None:
        """The earliest waiting frame, if nothing need be waited for any more."""
        self._fill(0.0)
        if not self._waiting:
            return None
        number, (frame, since_s) = min(self._waiting.items(), key=lambda item: (item[1][0].t_ns, item[0]))
        missing = [k for k, feed in enumerate(self._feeds) if k not in self._waiting and not feed.ended]
        if missing and (self._hold_s is None or time.monotonic() - since_s < self._hold_s):
            return None
        del self._waiting[number]
        return frame

    def _fill(self, wait_s: float) -> None:
        """Takes each camera's next frame where it is there; waits for the first one that is missing."""
        for number, feed in enumerate(self._feeds):
            if number in self._waiting or feed.ended:
                continue
            frame = feed.take(wait_s)
            wait_s = 0.0
            if frame is not None:
                self._waiting[number] = (replace(frame, camera=number), time.monotonic())
