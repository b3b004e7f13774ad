"""The capture thread and its queue: frames from a source to the race, which takes them at its own pace.

A live source never waits: where the race is slow the oldest frame in the queue is thrown away. A file or the simulator
does wait, so that every frame is raced and two runs are alike. Knows threads and sources; knows nothing of pictures.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from types import TracebackType
from typing import Self

from dnb_edge.capture.source import FrameSource
from dnb_edge.errors import InputError, TemporaryFault
from dnb_edge.values import Frame

QUEUE_FRAMES = 2
BACK_OFF_S = (0.25, 0.5, 1.0, 2.0, 3.0)
"""Waits between attempts to open a camera that went away; the last one repeats."""


class FrameFeed:
    """Runs `source` in a thread of its own and hands its frames over one by one.

    A live source that goes away is opened again with back-off through `reopen`; `fault` says meanwhile what is wrong.
    """

    def __init__(self, source: FrameSource, reopen: Callable[[], FrameSource]) -> None:
        self._source = source
        self._reopen = reopen
        self._lossless = not source.info.live
        self._frames: deque[Frame] = deque()
        self._changed = threading.Condition()
        self._stop = threading.Event()
        self._ended = False
        self._failure: BaseException | None = None
        self._fault: str | None = None
        self._sequence: int | None = None
        self._renumber_by = 0
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
                frame = self._frames.popleft()
                self._changed.notify_all()
                return frame
            if self._failure is not None:
                raise self._failure
            return None

    def close(self) -> None:
        """Stops the thread and closes the source."""
        self._stop.set()
        with self._changed:
            self._frames.clear()
            self._changed.notify_all()
        self._source.close()
        self._thread.join(timeout=5.0)

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
                self._put(self._numbered(frame))
                if self._stop.is_set():
                    return False
        except TemporaryFault as fault:
            if not self._source.info.live:
                raise
            self._fault = str(fault)
            return self._bring_back()
        return False

    def _bring_back(self) -> bool:
        self._source.close()
        attempt = 0
        while not self._stop.wait(BACK_OFF_S[min(attempt, len(BACK_OFF_S) - 1)]):
            attempt += 1
            try:
                self._source = self._reopen()
            except (InputError, TemporaryFault) as error:
                self._fault = str(error)
            else:
                return True
        return False

    def _numbered(self, frame: Frame) -> Frame:
        """`frame` with its number going on where the camera left off, if that has begun anew since it came back."""
        if self._sequence is not None and frame.sequence + self._renumber_by <= self._sequence:
            self._renumber_by = self._sequence + 1 - frame.sequence
        self._sequence = frame.sequence + self._renumber_by
        return frame if self._renumber_by == 0 else replace(frame, sequence=self._sequence)

    def _put(self, frame: Frame) -> None:
        with self._changed:
            if self._lossless:
                self._changed.wait_for(lambda: len(self._frames) < QUEUE_FRAMES or self._stop.is_set())
            elif len(self._frames) >= QUEUE_FRAMES:
                self._frames.popleft()
            if not self._stop.is_set():
                self._frames.append(frame)
                self._changed.notify_all()
