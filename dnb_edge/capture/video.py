"""Video files: every frame with the presentation time stamp that its container gives it.

Knows files that FFmpeg reads. Time is the frame's own stamp, so clips of variable or fractional frame rate come out right:
OpenCV's FFmpeg backend returns it as CAP_PROP_POS_MSEC, the exact rational pts in float64 milliseconds, far finer than a
nanosecond. Nothing is derived from frame count or frame rate.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from dnb_edge.errors import InputError
from dnb_edge.values import BgrImage, Clock, Frame, LostFrames, SourceInfo, StampSource

_NANOSECONDS_PER_MS = 1_000_000


class VideoSource:
    """A video file as a source. Its clock starts at 0 with the first frame, and its frames wait to be taken."""

    lost: tuple[LostFrames, ...] = ()
    """Nothing: frames wait to be taken."""

    def __init__(self, uri: str, path: Path) -> None:
        """Opens `path` and decodes its first frame. Raises `InputError` where that cannot be done."""
        self._path = path
        _check_file(path)
        self._reader = _open_reader(path)
        self._lock = threading.Lock()
        self._closed = threading.Event()
        first = self._read()
        if first is None:
            self.close()
            raise InputError(f"{path}: no picture can be decoded from this video: is it damaged or cut off?")
        self._first_stamp_ns, picture = first
        self._pending: tuple[int, BgrImage] | None = first
        self._next_sequence = 0
        fps = self._reader.get(cv2.CAP_PROP_FPS)
        self.info = SourceInfo(
            uri=uri,
            width_px=picture.shape[1],
            height_px=picture.shape[0],
            nominal_fps=fps if np.isfinite(fps) and fps > 0.0 else None,
            clock=Clock.MEDIA,
            live=False,
        )

    def frames(self) -> Iterator[Frame]:
        """The frames in order of presentation, each once, to the end of the clip or until `close`.

        Raises `InputError` where a frame's stamp does not come after the one before: nothing can be timed by such a clip.
        """
        last_ns: int | None = None
        while not self._closed.is_set():
            taken = self._take()
            if taken is None:
                return
            stamp_ns, picture = taken
            t_ns = stamp_ns - self._first_stamp_ns
            if last_ns is not None and t_ns <= last_ns:
                raise InputError(
                    f"{self._path}: frame {self._next_sequence} has no time stamp of its own: "
                    "put the clip into a container that keeps stamps (MP4, Matroska)"
                )
            last_ns = t_ns
            yield Frame(
                sequence=self._next_sequence,
                t_ns=t_ns,
                stamp_source=StampSource.MEDIA,
                width_px=self.info.width_px,
                height_px=self.info.height_px,
                bgr=picture,
            )
            self._next_sequence += 1

    def close(self) -> None:
        """Give the file back; safe to repeat and to call from another thread."""
        self._closed.set()
        with self._lock:
            self._reader.release()

    def _take(self) -> tuple[int, BgrImage] | None:
        pending, self._pending = self._pending, None
        taken = pending if pending is not None else self._read()
        if taken is not None and taken[1].shape[:2] != (self.info.height_px, self.info.width_px):
            raise InputError(f"{self._path}: the picture changes its size at frame {self._next_sequence}")
        return taken

    def _read(self) -> tuple[int, BgrImage] | None:
        """(stamp on the container's clock, ns; picture), None at the end."""
        with self._lock:
            if self._closed.is_set():
                return None
            found, picture = self._reader.read()
            if not found:
                return None
            stamp_ns = round(self._reader.get(cv2.CAP_PROP_POS_MSEC) * _NANOSECONDS_PER_MS)
        return stamp_ns, np.asarray(picture, dtype=np.uint8)


def _open_reader(path: Path) -> cv2.VideoCapture:
    # FFmpeg writes its own words to stderr, beside the one line that we owe the user; read once, at the first opening.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_ERROR)
    try:
        reader = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    finally:
        cv2.utils.logging.setLogLevel(level)
    if not reader.isOpened():
        raise InputError(f"{path}: FFmpeg finds no video in this file: is it a video, whole and not cut off?")
    return reader


def _check_file(path: Path) -> None:
    """Raises `InputError` for what can be told without decoding."""
    try:
        if path.is_dir():
            raise InputError(f"{path}: is a folder, not a video file")
        size = path.stat().st_size
        if size == 0:
            raise InputError(f"{path}: the file is empty")
        missing = _missing_bytes(path, size)
    except OSError as error:
        raise InputError(f"{path}: cannot read this video ({error.strerror}): check the path") from error
    if missing > 0:
        raise InputError(f"{path}: the file is cut off, {missing} bytes are missing at its end: copy it again")


def _missing_bytes(path: Path, size: int) -> int:
    """How many bytes the file lacks by its own top-level boxes, 0 for kinds other than MP4, QuickTime and AVI.

    FFmpeg plays such a file up to the cut without a word, and the laps after it would be missing in silence. Boxes: ISO/IEC
    14496-12, 4.2 (size, big-endian, of the whole box, then its type); RIFF: type, then little-endian size of what follows.
    """
    with path.open("rb") as file:
        head = file.read(16)
        if head[4:8] != b"ftyp" and head[:4] != b"RIFF":
            return 0
        at = 0
        while at < size:
            file.seek(at)
            length = _riff_length(file.read(8)) if head[:4] == b"RIFF" else _box_length(file.read(16))
            if length is None:
                return 0
            at += length
    return at - size


def _riff_length(head: bytes) -> int | None:
    length = int.from_bytes(head[4:8], "little") + 8
    return length + length % 2 if head[:4] == b"RIFF" and length > 8 else None


def _box_length(head: bytes) -> int | None:
    length = int.from_bytes(head[:4], "big")
    if length == 1:
        length = int.from_bytes(head[8:16], "big")
    return length if length >= 8 else None
