"""A V4L2 camera through linuxpy: kernel stamps, the driver's own frame numbers, the newest frame first.

Knows one capture device. Frames that were overtaken while nobody took them are dropped here and show as a gap in the
sequence. Bad set-up raises `InputError`, a camera that goes away while it runs raises `TemporaryFault`.
"""

from __future__ import annotations

import errno
import os
import select
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from linuxpy.video import device as linux
from linuxpy.video import raw

from dnb_edge.capture.settings import CaptureSettings
from dnb_edge.capture.v4l2_setup import camera_id, configure, open_device, refusal
from dnb_edge.errors import InputError, TemporaryFault
from dnb_edge.values import BgrImage, Clock, Frame, LostFrames, SourceInfo, StampSource

_TIMESTAMP_MASK = 0xE000
_TIMESTAMP_MONOTONIC = 0x2000
_SOURCE_MASK = 0x70000
_SOURCE_START_OF_EXPOSURE = 0x10000
_ERROR = 0x40
_GONE = {errno.ENODEV, errno.ENXIO, errno.EIO, errno.EPIPE, errno.ESHUTDOWN, errno.EPROTO}


class V4l2Source:
    """One camera, streaming from the moment of opening."""

    def __init__(self, uri: str, path: Path, settings: CaptureSettings) -> None:
        """Opens, configures and starts the camera. Raises `InputError` naming the device and what to do."""
        self._path = path
        self._settings = settings
        self._lock = threading.Lock()
        self._closing = threading.Lock()
        self._closed = threading.Event()
        self._last: tuple[int, int] | None = None
        self.overtaken_frames = 0
        """Frames dropped unseen because a newer one was ready."""
        self.damaged_frames = 0
        """Frames dropped because the driver or their size says that they are damaged."""
        self._device = open_device(path)
        self._capture = linux.VideoCapture(self._device, size=settings.buffers, buffer_type=linux.MemoryMap)
        try:
            self._format = configure(self._device, path, settings)
            self._capture.open()
            self.info = SourceInfo(
                uri=uri,
                width_px=self._format.width,
                height_px=self._format.height,
                nominal_fps=self._format.fps,
                clock=Clock.MONOTONIC,
                live=True,
                camera_id=camera_id(path, self._device),
            )
        except OSError as error:
            self._let_go()
            raise refusal(path, error) from error
        except InputError:
            self._let_go()
            raise
        self._wake_read, self._wake_write = os.pipe()

    @property
    def lost(self) -> tuple[LostFrames, ...]:
        """Frames that were dropped here, by reason."""
        counts = (("damaged", self.damaged_frames), ("overtaken", self.overtaken_frames))
        return tuple(LostFrames(reason=reason, frames=frames) for reason, frames in counts if frames)

    def frames(self) -> Iterator[Frame]:
        """The newest frame each time one is asked for, until `close`.

        Raises `TemporaryFault` where the camera is unplugged or falls silent for longer than `stall_timeout_s`.
        """
        while True:
            with self._lock:
                if self._closed.is_set() or not self._wait():
                    return
                frame = self._newest()
            if frame is not None:
                yield frame

    def close(self) -> None:
        """Stop the camera and give it back; safe to repeat and to call from another thread, where it ends `frames`."""
        with self._closing:
            if self._closed.is_set():
                return
            self._closed.set()
            os.write(self._wake_write, b"x")
        with self._lock:
            try:
                self._capture.close()
            except OSError as error:
                # An unplugged camera cannot be told to stop; letting go of it below frees all there is.
                if error.errno not in _GONE:
                    raise
            finally:
                self._let_go()
                os.close(self._wake_read)
                os.close(self._wake_write)

    def _let_go(self) -> None:
        """Unmap the buffers that linuxpy has left, and close the device's file."""
        # Each mapping holds the device open by itself: the kernel would keep the node's number for the camera that has
        # gone, and give the same camera another one when it comes back.
        memory = self._capture.buffer
        for mapped in (memory.buffers or ()) if memory is not None else ():
            mapped.close()
        self._device.close()

    def _wait(self) -> bool:
        """Block until a frame is ready; False after `close`."""
        ready, _, _ = select.select([self._device, self._wake_read], [], [], self._settings.stall_timeout_s)
        if self._closed.is_set():
            return False
        if not ready:
            raise TemporaryFault(f"{self._path}: the camera gave no frame for {self._settings.stall_timeout_s:g} s")
        return True

    def _newest(self) -> Frame | None:
        """Take every ready buffer, keep the last: the others are old news. None where that one is damaged."""
        newest: tuple[raw.v4l2_buffer, bytes, int] | None = None
        try:
            while True:
                buffer = self._capture.dequeue_buffer(linux.Memory.MMAP)
                now_ns = time.monotonic_ns()
                if newest is not None:
                    self.overtaken_frames += 1
                newest = buffer, bytes(self._capture.buffer.buffers[buffer.index][: buffer.bytesused]), now_ns
                self._capture.enqueue_buffer(linux.Memory.MMAP, 0, buffer.index)
        except BlockingIOError:
            pass  # the queue is empty: what was taken last is the newest
        except OSError as error:
            if error.errno in _GONE:
                raise TemporaryFault(f"{self._path}: the camera is gone ({error.strerror})") from error
            raise
        return None if newest is None else self._frame(*newest)

    def _frame(self, buffer: raw.v4l2_buffer, data: bytes, dequeued_ns: int) -> Frame | None:
        stamp = buffer.timestamp
        t_ns, stamp_source = stamp_of(buffer.flags, stamp.secs, stamp.usecs, dequeued_ns)
        sequence = int(buffer.sequence)
        if self._last is not None:
            last_t_ns, last_sequence = self._last
            if t_ns <= last_t_ns:
                self.damaged_frames += 1
                return None
            # A few drivers leave the number at 0; a restarted one begins anew.
            sequence = sequence if sequence > last_sequence else last_sequence + 1
        picture = (
            None
            if self._format.is_jpeg
            else yuyv_to_bgr(data, self._format.width, self._format.height, self._format.bytes_per_line)
        )
        if buffer.flags & _ERROR or not data or (picture is None and not self._format.is_jpeg):
            self.damaged_frames += 1
            return None
        self._last = t_ns, sequence
        return Frame(
            sequence=sequence,
            t_ns=t_ns,
            stamp_source=stamp_source,
            width_px=self._format.width,
            height_px=self._format.height,
            jpeg=data if self._format.is_jpeg else None,
            bgr=picture,
        )


def stamp_of(flags: int, seconds: int, microseconds: int, dequeued_ns: int) -> tuple[int, StampSource]:
    """A buffer's stamp in integer ns of CLOCK_MONOTONIC, and the moment that it stands for.

    By the kernel's V4L2_BUF_FLAG_TIMESTAMP_MASK and V4L2_BUF_FLAG_TSTAMP_SRC_MASK. A driver that stamps on another clock, or
    not at all, leaves us the moment `dequeued_ns` at which the frame arrived.
    """
    if flags & _TIMESTAMP_MASK != _TIMESTAMP_MONOTONIC or (seconds == 0 and microseconds == 0):
        return dequeued_ns, StampSource.ARRIVAL
    t_ns = seconds * 1_000_000_000 + microseconds * 1_000
    at_start = flags & _SOURCE_MASK == _SOURCE_START_OF_EXPOSURE
    return t_ns, StampSource.START_OF_FRAME if at_start else StampSource.END_OF_FRAME


def yuyv_to_bgr(data: bytes, width_px: int, height_px: int, bytes_per_line: int) -> BgrImage | None:
    """The picture in a YUYV (4:2:2) buffer whose rows take `bytes_per_line`; None where the buffer is too short."""
    if len(data) < bytes_per_line * height_px:
        return None
    rows = np.frombuffer(data, dtype=np.uint8, count=bytes_per_line * height_px).reshape(height_px, bytes_per_line)
    pairs = np.ascontiguousarray(rows[:, : 2 * width_px]).reshape(height_px, width_px, 2)
    return np.asarray(cv2.cvtColor(pairs, cv2.COLOR_YUV2BGR_YUYV), dtype=np.uint8)
