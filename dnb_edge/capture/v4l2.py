"""A V4L2 camera through linuxpy: kernel stamps, the driver's own frame numbers, the newest frame first.

Knows one capture device. Buffers that become no frame (overtaken by a newer one, damaged, cut off) are dropped here, counted
by reason, and show as a gap in the numbers. Bad set-up raises `InputError`, a camera that goes away while it runs raises
`TemporaryFault`.
"""

from __future__ import annotations

import errno
import os
import select
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from linuxpy.video import device as linux
from linuxpy.video import raw

from dnb_edge.capture.settings import CaptureSettings, changed_rate
from dnb_edge.capture.v4l2_controls import apply, read_controls, taken, wishes
from dnb_edge.capture.v4l2_nodes import camera_id
from dnb_edge.capture.v4l2_setup import agree, open_device, refusal
from dnb_edge.capture.v4l2_tally import OVERTAKEN, STAMP, Tally, fault_of
from dnb_edge.errors import InputError, TemporaryFault
from dnb_edge.values import BgrImage, Clock, Frame, LostFrames, SourceInfo, StampSource

_TIMESTAMP_MASK = 0xE000
_TIMESTAMP_MONOTONIC = 0x2000
_SOURCE_MASK = 0x70000
_SOURCE_START_OF_EXPOSURE = 0x10000
UNPLUGGED_S = 0.3
"""How long the kernel may take a device away before its file is closed. Both at once crash Linux 6.12 (a NULL pointer in
__media_device_unregister_entity), and the thread that closes is gone: once in some hundred unplugged cameras."""
_GONE = {errno.ENODEV, errno.ENXIO, errno.EIO, errno.EPIPE, errno.ESHUTDOWN, errno.EPROTO}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Taken:
    """A whole picture, copied out of its buffer."""

    number: int
    t_ns: int
    stamp_source: StampSource
    arrived_ns: int
    data: bytes


class _Capture(linux.VideoCapture):  # type: ignore[misc]  # linuxpy is not typed
    """linuxpy's, with as many buffers as the driver grants: some give fewer than they are asked for, or more."""

    size: int

    def create_buffers(self, memory: linux.Memory) -> list[raw.v4l2_buffer]:
        """Request and describe the buffers."""
        granted = int(self.device.request_buffers(self.type, memory, self.size).count)
        described = [self.query_buffer(memory, index) for index in range(granted)]
        self.size, self.buffers = granted, described
        return described


class V4l2Source:
    """One camera, streaming from the moment of opening."""

    def __init__(self, uri: str, path: Path, settings: CaptureSettings) -> None:
        """Opens, configures and starts the camera. Raises `InputError` naming the device and what to do."""
        self._path = path
        self._settings = settings
        self._lock = threading.Lock()
        self._closing = threading.Lock()
        self._closed = threading.Event()
        self._tally = Tally()
        self._last_t_ns: int | None = None
        self._device = open_device(path)
        self._capture = _Capture(self._device, size=settings.buffers, buffer_type=linux.MemoryMap)
        try:
            self._format = agree(self._device, path, settings)
            wanted = wishes(path, read_controls(self._device), settings)
            apply(self._device, path, wanted)
            self._capture.open()
            self.info = SourceInfo(
                uri=uri,
                width_px=self._format.width,
                height_px=self._format.height,
                nominal_fps=self._format.fps,
                clock=Clock.MONOTONIC,
                live=True,
                camera_id=camera_id(path, self._device),
                driver=f"{self._device.info.driver}: {self._device.info.card}",
                pixel_format=self._format.pixel_format,
                # Read once the stream runs: some cameras begin it with values of their own.
                controls=(*taken(self._device, wanted), *changed_rate(settings.fps, self._format.fps)),
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
        """Frames that were lost before the latest one given, by reason: `gap`, `overtaken`, `damaged`, `short`, `stamp`."""
        return self._tally.lost

    def frames(self) -> Iterator[Frame]:
        """The newest whole frame each time one is asked for, until `close`.

        Raises `TemporaryFault` where the camera is unplugged, or gives no whole frame for longer than `stall_timeout_s`.
        """
        while (frame := self._next()) is not None:
            yield frame

    def _next(self) -> Frame | None:
        """The next frame; None after `close`."""
        deadline_s = time.monotonic() + self._settings.stall_timeout_s
        while True:
            with self._lock:
                if self._closed.is_set() or not self._wait(deadline_s):
                    return None
                newest = self._newest()
            if newest is not None:
                return self._frame(newest)

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
                time.sleep(UNPLUGGED_S)
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

    def _wait(self, deadline_s: float) -> bool:
        """Block until a buffer is ready; False after `close`."""
        left_s = max(0.0, deadline_s - time.monotonic())
        ready, _, _ = select.select([self._device, self._wake_read], [], [], left_s)
        if self._closed.is_set():
            return False
        if not ready or left_s == 0.0:
            raise TemporaryFault(
                f"{self._path}: the camera gave no whole frame for {self._settings.stall_timeout_s:g} s"
            )
        return True

    def _newest(self) -> _Taken | None:
        """Take every ready buffer, keep the last whole one: older ones are old news. None where there is none."""
        newest: _Taken | None = None
        try:
            while True:
                buffer = self._capture.dequeue_buffer(linux.Memory.MMAP)
                arrived_ns = time.monotonic_ns()
                data = bytes(self._capture.buffer.buffers[buffer.index][: buffer.bytesused])
                found = self._judged(buffer, data, arrived_ns)
                if found is not None:
                    if newest is not None:
                        self._tally.lose(OVERTAKEN)
                    self._tally.give()
                    newest = found
                self._capture.enqueue_buffer(linux.Memory.MMAP, 0, buffer.index)
        except BlockingIOError:
            pass  # the queue is empty: what was taken last is the newest
        except OSError as error:
            if error.errno not in _GONE:
                raise
            # What came before it went is given first; the next call finds it gone again.
            if newest is None:
                raise TemporaryFault(f"{self._path}: the camera is gone ({error.strerror})") from error
        self._tally.publish(given=newest is not None)
        return newest

    def _judged(self, buffer: raw.v4l2_buffer, data: bytes, arrived_ns: int) -> _Taken | None:
        """The buffer's picture with number and stamp; None, counted, where it is not to be used."""
        stamp = buffer.timestamp
        t_ns, stamp_source = stamp_of(buffer.flags, stamp.secs, stamp.usecs, arrived_ns)
        number = self._tally.number(int(buffer.sequence), t_ns)
        if number is None:
            return None
        fault = fault_of(buffer.flags, data, self._format)
        if fault is None and self._last_t_ns is not None and t_ns <= self._last_t_ns:
            fault = STAMP
        if fault is not None:
            self._tally.lose(fault)
            return None
        self._last_t_ns = t_ns
        return _Taken(number=number, t_ns=t_ns, stamp_source=stamp_source, arrived_ns=arrived_ns, data=data)

    def _frame(self, taken: _Taken) -> Frame:
        form = self._format
        return Frame(
            sequence=taken.number,
            t_ns=taken.t_ns,
            stamp_source=taken.stamp_source,
            width_px=form.width,
            height_px=form.height,
            jpeg=taken.data if form.is_jpeg else None,
            bgr=None if form.is_jpeg else yuyv_to_bgr(taken.data, form.width, form.height, form.bytes_per_line),
            arrived_ns=taken.arrived_ns,
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
