"""The capture thread and its queue: frames from a source to the race, which takes them at its own pace.

A live source never waits: where the race is slow the oldest frame in the queue is thrown away and counted. A file or the
simulator does wait, so that every frame is raced and two runs are alike. Knows threads and sources; knows nothing of pictures.
"""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from types import TracebackType
from typing import Self

from dnb_edge.capture.source import FrameSource
from dnb_edge.daemon.losses import QUEUE, Ledger, added
from dnb_edge.errors import InputError, TemporaryFault
from dnb_edge.values import Frame, LostFrames

QUEUE_FRAMES = 2
BACK_OFF_S = (0.25, 0.5, 1.0, 2.0)
"""Waits between attempts to open a camera that went away; the last one repeats. Frames come within 5 s of its return."""
CLOSE_S = 1.0

log = logging.getLogger(__name__)


class FrameFeed:
    """Runs `source` in a thread of its own and hands its frames over one by one.

    A live source that goes away, or whose stream fails, is opened again with back-off through `reopen`; `fault` says
    meanwhile what is wrong.
    """

    def __init__(
        self, source: FrameSource, reopen: Callable[[], FrameSource], *, last_sequence: int | None = None
    ) -> None:
        """`last_sequence`: number of the last frame of the run that this one goes on with; None for a new run."""
        self._source = source
        self._reopen = reopen
        self._lossless = not source.info.live
        self._frames: deque[tuple[Frame, tuple[LostFrames, ...]]] = deque()
        """Each with what was lost before it."""
        self._changed = threading.Condition()
        self._stop = threading.Event()
        self._ended = False
        self._failure: BaseException | None = None
        self._fault: str | None = None
        self.outages = 0
        """How often a live source has failed so far; may be read from any thread."""
        self.last_fault: str | None = None
        """Why it failed last, in one line; stays when it is back."""
        self._sequence = last_sequence
        self._renumber_by: int | None = 0 if last_sequence is None else None
        """What is added to the source's numbers; None until the first frame of a source that came back."""
        self._ledger = Ledger()
        self._overflown = 0
        self._lost: tuple[LostFrames, ...] = ()
        self._most_queued = 0
        self._renew: str | None = None
        self.progress = 0
        """Grows with each frame and each attempt to open the camera: stands still where the thread hangs."""
        self._thread = threading.Thread(target=self._run, name="capture", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    @property
    def fault(self) -> str | None:
        """Why no frames come at present, in one line; None where all is well."""
        return self._fault

    @property
    def lost(self) -> tuple[LostFrames, ...]:
        """What was lost, by reason, before the frame taken last; every number that is missing among the frames taken."""
        return self._lost

    def most_queued(self) -> int:
        """Most frames that have waited here since this was last asked."""
        with self._changed:
            most, self._most_queued = self._most_queued, len(self._frames)
            return most

    def renew(self, reason: str, camera: int = 0) -> None:  # noqa: ARG002 it has but one
        """Closes a live source that gives frames but no sense, and opens it again; `fault` is `reason` meanwhile."""
        self._renew = reason

    @property
    def ended(self) -> bool:
        """True once the source has ended well and its last frame was taken; what ended it badly comes out of `take`."""
        with self._changed:
            return self._ended and not self._frames and self._failure is None

    def take(self, timeout_s: float) -> Frame | None:
        """The next frame; None where the source has ended or none came within `timeout_s`.

        Raises what ended the capture thread, if it was an error.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._frames or self._ended, timeout_s)
            if self._frames:
                frame, lost = self._frames.popleft()
                # Only older frames than this one ever overflow.
                self._lost = added(lost, (LostFrames(reason=QUEUE, frames=self._overflown),))
                self._changed.notify_all()
                return frame
            if self._failure is not None:
                raise self._failure
            return None

    def close(self) -> None:
        """Stops the thread and closes the source, within a second if that lets itself be closed."""
        self._stop.set()
        with self._changed:
            self._frames.clear()
            self._changed.notify_all()
        self._source.close()
        self._thread.join(timeout=CLOSE_S)

    def _run(self) -> None:
        try:
            while not self._stop.is_set() and self._drain():
                pass
            # Again, in case it came back while `close` was closing its predecessor.
            self._source.close()
        except Exception as error:  # noqa: BLE001 handed to the race's thread, which raises it
            self._failure = error
        finally:
            with self._changed:
                self._ended = True
                self._changed.notify_all()

    def _drain(self) -> bool:
        """Hands over frames until the source ends (False) or has gone away and come back (True)."""
        try:
            for frame in self._source.frames():
                self._fault = None
                self.progress += 1
                self._ledger.frame(frame.sequence, self._source.lost)
                self._put(self._numbered(frame))
                if self._stop.is_set():
                    return False
                if self._renew is not None and self._source.info.live:
                    raise TemporaryFault(self._renew)
        except (TemporaryFault, OSError) as fault:
            if not self._source.info.live:
                raise
            self._fault = self.last_fault = _words(fault)
            self.outages += 1
            return self._bring_back()
        return False

    def _bring_back(self) -> bool:
        self._close_broken()
        attempt = 0
        while not self._stop.wait(BACK_OFF_S[min(attempt, len(BACK_OFF_S) - 1)]):
            attempt += 1
            self.progress += 1
            try:
                self._source = self._reopen()
            except (InputError, TemporaryFault, OSError) as error:
                self._fault = _words(error)
            else:
                self._renew = None
                self._ledger.reopened()
                if self._sequence is not None:
                    self._renumber_by = None
                return True
        return False

    def _close_broken(self) -> None:
        """Closes a source that has failed already; what it says to that is no reason not to open it again."""
        try:
            self._source.close()
        except OSError as error:
            log.warning("closing the camera: %s", _words(error))

    def _numbered(self, frame: Frame) -> Frame:
        """`frame` with its number going on where the camera left off before it went away."""
        if self._renumber_by is None:
            assert self._sequence is not None
            self._renumber_by = self._sequence + 1 - frame.sequence
        self._sequence = frame.sequence + self._renumber_by
        return frame if self._renumber_by == 0 else replace(frame, sequence=self._sequence)

    def _put(self, frame: Frame) -> None:
        with self._changed:
            if self._lossless:
                self._changed.wait_for(lambda: len(self._frames) < QUEUE_FRAMES or self._stop.is_set())
            elif len(self._frames) >= QUEUE_FRAMES:
                self._frames.popleft()
                self._overflown += 1
            if not self._stop.is_set():
                self._frames.append((frame, self._ledger.lost))
                self._most_queued = max(self._most_queued, len(self._frames))
                self._changed.notify_all()


def _words(fault: Exception) -> str:
    """`fault` in one line, the system's words where it is the system's."""
    if isinstance(fault, OSError) and fault.strerror:
        return (
            f"the camera fails: {fault.strerror}" if fault.filename is None else f"{fault.filename}: {fault.strerror}"
        )
    return str(fault)
