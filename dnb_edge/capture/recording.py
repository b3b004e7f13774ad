"""Recordings as a source: the frames that another room reads from a file, given again as they were.

Knows an iterable of frames and what to say about it. Knows no file format: the recording room reads the file, and whoever
joins the rooms passes its frames in.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator

from dnb_edge.errors import InputError
from dnb_edge.values import Frame, LostFrames, SourceInfo


class RecordingSource:
    """Frames of an earlier run, with the stamps and sequence numbers of that run, so that its gaps stay gaps."""

    lost: tuple[LostFrames, ...] = ()
    """Nothing: frames wait to be taken."""

    def __init__(self, uri: str, info: SourceInfo, frames: Iterable[Frame]) -> None:
        self._uri = uri
        self.info = info
        self._frames = frames
        self._closed = threading.Event()

    def frames(self) -> Iterator[Frame]:
        """The frames in the order of the recording, to its end or until `close`.

        Raises `InputError` where stamps or sequence numbers run backwards: the file is not a recording of one run.
        """
        last: Frame | None = None
        for frame in self._frames:
            if self._closed.is_set():
                return
            if last is not None and (frame.t_ns <= last.t_ns or frame.sequence <= last.sequence):
                raise InputError(
                    f"{self._uri}: frame {frame.sequence} comes before frame {last.sequence} in time or number"
                )
            last = frame
            yield frame

    def close(self) -> None:
        """End the iteration; safe to repeat and to call from another thread."""
        self._closed.set()
