"""A camera through libcamera: a Raspberry Pi's own cameras, and USB cameras too; the newest frame first.

Knows one camera of the process's one camera manager, whose finished requests come all in one queue: one source at a time.
Bad set-up raises `InputError`, a camera that goes away while it runs raises `TemporaryFault`.
"""

from __future__ import annotations

import ctypes
import os
import select
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from dnb_edge.capture.libcamera_clock import Moment, now, stamp_of
from dnb_edge.capture.libcamera_controls import Wish, nominal_fps, taken, to_set
from dnb_edge.capture.libcamera_pictures import JPEG, MappedBuffer, fault_of, to_bgr
from dnb_edge.capture.libcamera_setup import (
    bindings,
    configure,
    find_camera,
    is_listed,
    is_plugged_in,
    is_settled,
    refusal,
    start_manager,
)
from dnb_edge.capture.settings import CaptureSettings, changed_rate
from dnb_edge.capture.v4l2_tally import DAMAGED, OVERTAKEN, STAMP, Tally
from dnb_edge.errors import TemporaryFault
from dnb_edge.values import Clock, Frame, LostFrames, SourceInfo, StampSource

_LOOK_S = 0.25
"""How often a silent camera is looked for: the bindings have no signal for one that is unplugged."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Taken:
    """A whole picture, copied out of its buffer."""

    number: int
    t_ns: int
    stamp_source: StampSource
    arrived_ns: int
    planes: list[bytes]


class LibcameraSource:
    """One camera, streaming from the moment of opening."""

    def __init__(self, uri: str, settings: CaptureSettings) -> None:
        """Opens, configures and starts the camera. Raises `InputError` naming the camera and what to do."""
        self._uri = uri
        self._settings = settings
        self._lock = threading.Lock()
        self._closing = threading.Lock()
        self._closed = threading.Event()
        self._tally = Tally()
        self._last_t_ns: int | None = None
        self._libcamera: Any = bindings(uri)
        self._manager: Any = start_manager(uri, self._libcamera)
        self._camera: Any = None
        self._allocator: Any = None
        self._requests: list[Any] = []
        self._memory: list[MappedBuffer] = []
        self._queued: set[int] = set()
        self._running = False
        self._wake_read, self._wake_write = os.pipe()
        try:
            self._camera = find_camera(uri, self._manager)
            self.info = self._start()
        except BaseException as error:
            camera = self._camera
            self._let_go()
            if isinstance(error, RuntimeError):
                raise refusal(uri, error, camera) from error
            raise

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
            self._let_go()

    def _start(self) -> SourceInfo:
        """Take the camera, set it up and let it run. Raises `InputError`, and `RuntimeError` where libcamera refuses."""
        camera = self._camera
        camera.acquire()
        self._format, self._stream = configure(self._uri, self._libcamera, camera, self._settings)
        values, asked = to_set(self._uri, self._settings, camera.controls)
        self._allocator = self._libcamera.FrameBufferAllocator(camera)
        self._allocator.allocate(self._stream)
        for cookie, buffer in enumerate(self._allocator.buffers(self._stream)):
            request = camera.create_request(cookie)
            request.add_buffer(self._stream, buffer)
            self._requests.append(request)
            self._memory.append(MappedBuffer(buffer.planes))
        camera.start(values)
        self._running = True
        # Some pipelines take controls at the start, some (USB cameras) from a request only.
        for control, value in values.items():
            self._requests[0].set_control(control, value)
        for request in self._requests:
            self._queue(request)
        model = next((text for key, text in camera.properties.items() if key.name == "Model"), "camera")
        rate_fps = nominal_fps(self._settings, camera.controls)
        return SourceInfo(
            uri=self._uri,
            width_px=self._format.width,
            height_px=self._format.height,
            nominal_fps=rate_fps,
            clock=Clock.MONOTONIC,
            live=True,
            camera_id=camera.id,
            driver=f"libcamera {self._libcamera.CameraManager.version}: {model}",
            pixel_format=self._format.four_cc,
            controls=(*self._taken(asked), *changed_rate(self._settings.fps, rate_fps)),
        )

    def _taken(self, asked: dict[str, Wish]) -> Any:
        """What of the controls the camera took, by its first frame, which is waited for where there are any."""
        metadata: dict[str, Any] = {}
        if asked and select.select([self._manager.event_fd], [], [], self._settings.stall_timeout_s)[0]:
            for request in self._finished():
                metadata = _named(request.metadata)
                self._again(request)
        return taken(asked, metadata)

    def _wait(self, deadline_s: float) -> bool:
        """Block until a request is finished; False after `close`."""
        while True:
            left_s = max(0.0, deadline_s - time.monotonic())
            ready, _, _ = select.select([self._manager.event_fd, self._wake_read], [], [], min(_LOOK_S, left_s))
            if self._closed.is_set():
                return False
            if ready and left_s > 0.0:
                return True
            if self._is_gone():
                raise TemporaryFault(f"{self._uri}: the camera is gone")
            if left_s == 0.0:
                raise TemporaryFault(
                    f"{self._uri}: the camera gave no whole frame for {self._settings.stall_timeout_s:g} s"
                )

    def _is_gone(self) -> bool:
        return not is_plugged_in(self._camera) or not is_listed(self._camera, self._manager)

    def _finished(self) -> list[Any]:
        """This source's finished requests, in order; the bindings give each back once."""
        own = [
            request
            for request in self._manager.get_ready_requests()
            if any(request is known for known in self._requests) and request.cookie in self._queued
        ]
        self._queued.difference_update(request.cookie for request in own)
        return own

    def _newest(self) -> _Taken | None:
        """Take every finished request, keep the last whole one: older ones are old news. None where there is none."""
        newest: _Taken | None = None
        for request in self._finished():
            found = self._judged(request, now())
            if found is not None:
                if newest is not None:
                    self._tally.lose(OVERTAKEN)
                self._tally.give()
                newest = found
            try:
                self._again(request)
            except TemporaryFault:
                # What came before it went is given first; the next call finds it gone again.
                if newest is None:
                    raise
        self._tally.publish(given=newest is not None)
        if newest is None and self._is_gone():
            # It would take each buffer and give it back cancelled, as fast as it can.
            raise TemporaryFault(f"{self._uri}: the camera is gone")
        return newest

    def _judged(self, request: Any, arrived: Moment) -> _Taken | None:
        """The picture in a finished request with number and stamp; None, counted, where it is not to be used."""
        about, form = request.buffers[self._stream].metadata, self._format
        t_ns, stamp_source = stamp_of(_named(request.metadata).get("SensorTimestamp"), about.timestamp, arrived)
        number = self._tally.number(int(about.sequence), t_ns)
        if number is None:
            return None
        planes = self._memory[request.cookie].read([plane.bytes_used for plane in about.planes])
        fault = fault_of(form.name, planes, form.width, form.height, form.stride)
        if about.status != self._libcamera.FrameMetadata.Status.Success:
            fault = DAMAGED
        if fault is None and self._last_t_ns is not None and t_ns <= self._last_t_ns:
            fault = STAMP
        if fault is not None:
            self._tally.lose(fault)
            return None
        self._last_t_ns = t_ns
        return _Taken(
            number=number, t_ns=t_ns, stamp_source=stamp_source, arrived_ns=arrived.monotonic_ns, planes=planes
        )

    def _frame(self, taken: _Taken) -> Frame:
        form = self._format
        is_jpeg = form.name == JPEG
        return Frame(
            sequence=taken.number,
            t_ns=taken.t_ns,
            stamp_source=taken.stamp_source,
            width_px=form.width,
            height_px=form.height,
            jpeg=taken.planes[0] if is_jpeg else None,
            bgr=None if is_jpeg else to_bgr(form.name, taken.planes, form.width, form.height, form.stride),
            arrived_ns=taken.arrived_ns,
        )

    def _again(self, request: Any) -> None:
        """Give a finished request back to the camera."""
        request.reuse()
        try:
            self._queue(request)
        except RuntimeError as error:
            raise TemporaryFault(f"{self._uri}: the camera is gone ({error})") from error

    def _queue(self, request: Any) -> None:
        self._camera.queue_request(request)
        self._queued.add(request.cookie)

    def _let_go(self) -> None:
        """Stop, and give back all there is, whatever state it is in."""
        try:
            if self._running and not self._stop():
                # What libcamera cannot stop it must keep: the references for queued requests stay with it.
                self._queued.clear()
                self._camera = None
        finally:
            self._running = False
            for request in self._requests:
                if request.cookie in self._queued:
                    # For a queued request the bindings hold a reference until it is finished, and those of a camera that
                    # was unplugged never are: each would keep its buffer's memory, the camera and the manager for ever.
                    ctypes.pythonapi.Py_DecRef(ctypes.py_object(request))
            for memory in self._memory:
                memory.close()
            self._queued.clear()
            self._memory.clear()
            self._requests.clear()
            self._stream = self._allocator = None
            if self._camera is not None:
                self._camera.release()
            self._camera = self._manager = None
            os.close(self._wake_read)
            os.close(self._wake_write)

    def _stop(self) -> bool:
        """Stop the camera; False where that is not to be done.

        To stop an unplugged camera that still has buffers makes libcamera 0.4 end the whole process (an assertion), unless it
        has heard that the camera is gone.
        """
        self._finished()
        if self._queued and not is_plugged_in(self._camera):
            is_settled(self._manager)
            if is_listed(self._camera, self._manager):
                return False
        self._camera.stop()
        self._finished()
        return True


def _named(metadata: Any) -> dict[str, Any]:
    """The bindings' metadata by the controls' names."""
    return {control.name: value for control, value in metadata.items()}
