"""libcamera's Python bindings as of 0.4.0, played for machines without libcamera or without a camera.

Written from what the real ones do over a webcam in a Debian 13 guest: names, errors (RuntimeError with the kernel's words), the
references that they hold for queued requests, that a camera that is unplugged never finishes those it has, and that libcamera
ends the process where such a camera is stopped before it has heard of that. The buffers are real shared memory, the queue's
descriptor a real eventfd.
"""

import ctypes
import errno
import os
from collections import deque
from dataclasses import dataclass, field
from enum import Enum
from types import SimpleNamespace

DEVICES = (81 << 8,)
FOUR_CC = {"MJPEG": "MJPG", "RGB888": "RG24", "YUV420": "YU12"}


class Status(Enum):
    """As FrameMetadata.Status."""

    Success = 0
    Error = 1
    Cancelled = 2


class Validity(Enum):
    """As CameraConfiguration.Status."""

    Valid = 0
    Adjusted = 1
    Invalid = 2


@dataclass(eq=False)
class ControlId:
    """As libcamera.ControlId; `kind` is the type's name."""

    name: str
    kind: str

    @property
    def type(self):
        return SimpleNamespace(name=self.kind)


@dataclass(frozen=True)
class PixelFormat:
    name: str

    def __str__(self):
        return self.name

    @property
    def fourcc(self):
        return int.from_bytes(FOUR_CC.get(self.name, self.name[:4]).encode(), "little")


@dataclass(frozen=True)
class Size:
    width: int
    height: int

    def __str__(self):
        return f"{self.width}x{self.height}"


@dataclass(eq=False)
class Buffer:
    """A frame buffer: planes in one file, and what is said about what is in them."""

    planes: list
    metadata: SimpleNamespace


@dataclass(eq=False)
class Request:
    cookie: int
    buffers: dict = field(default_factory=dict)
    controls: dict = field(default_factory=dict)
    metadata: dict = field(default_factory=dict)

    def add_buffer(self, stream, buffer):
        self.buffers[stream] = buffer

    def set_control(self, control, value):
        self.controls[control.name] = value

    def reuse(self):
        self.controls, self.metadata = {}, {}


class Configuration:
    """As CameraConfiguration with one stream."""

    empty = False

    def __init__(self, formats, sizes):
        self._formats, self._sizes = formats, sizes
        stream_formats = SimpleNamespace(
            pixel_formats=[PixelFormat(name) for name in formats], sizes=lambda _format: [Size(*size) for size in sizes]
        )
        self._stream = SimpleNamespace(formats=stream_formats, stream=object(), stride=0, buffer_count=1)

    def at(self, _index):
        return self._stream

    def validate(self):
        asked = self._stream
        size = (asked.size.width, asked.size.height)
        nearest = min(self._sizes, key=lambda known: abs(known[0] - size[0]))
        asked.size = Size(*nearest)
        return Validity.Valid if nearest == size else Validity.Adjusted


class PlayedCamera:
    """One camera. `finish` completes the oldest queued request."""

    def __init__(self, manager, name, *, formats, sizes, controls, plane_sizes, stride, refuse_at, node):
        self.id = name
        self.properties = {
            ControlId("Location", "Integer32"): 2,
            ControlId("Model", "String"): "Played Camera",
            ControlId("SystemDevices", "Integer64"): () if node is None else DEVICES,
        }
        self.node = node
        self.controls = controls
        self._manager, self._formats, self._sizes = manager, formats, sizes
        self._plane_sizes, self._stride, self.refuse_at = plane_sizes, stride, refuse_at
        self.taken, self.running, self.gone = False, False, False
        self.started_with = {}
        self.seen_controls = {}
        self.queued = deque()
        self.files = []

    def _refuse(self, step, number=errno.EBUSY):
        if self.refuse_at == step or self.gone:
            raise RuntimeError(f"Failed to {step} camera: {os.strerror(errno.ENODEV if self.gone else number)}")

    def acquire(self):
        self._refuse("acquire")
        self.taken = True

    def release(self):
        self.taken = False

    def generate_configuration(self, _roles):
        return Configuration(self._formats, self._sizes) if self._formats else None

    def configure(self, configuration):
        self._refuse("configure", errno.EINVAL)
        configuration.at(0).stride = self._stride
        self._buffers = configuration.at(0).buffer_count

    def create_request(self, cookie):
        return Request(cookie)

    def allocate(self):
        """What FrameBufferAllocator gives."""
        buffers = []
        for _ in range(self._buffers):
            fd = os.memfd_create("buffer")
            self.files.append(fd)
            os.ftruncate(fd, sum(self._plane_sizes))
            planes, at = [], 0
            for length in self._plane_sizes:
                planes.append(SimpleNamespace(fd=fd, offset=at, length=length))
                at += length
            about = SimpleNamespace(status=Status.Success, sequence=0, timestamp=0, planes=[])
            buffers.append(Buffer(planes, about))
        return buffers

    def start(self, controls):
        self._refuse("start", errno.EACCES)
        self.running = True
        self.started_with = {control.name: value for control, value in controls.items()}

    def stop(self):
        # A camera that is gone is taken for a stopped one: nothing is cancelled.
        if self.pulled and not self.gone and self.queued:
            raise SystemExit(
                "FATAL default pipeline_handler.cpp: assertion data->queuedRequests_.empty() failed in stop()"
            )
        if self.running and not self.gone:
            while self.queued:
                self._manager.complete(self.queued.popleft())
        self.running = False

    def queue_request(self, request):
        self._refuse("queue")
        assert not any(request is queued for queued in self.queued)
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(request))
        self.seen_controls.update(request.controls)
        self.queued.append(request)
        if self.pulled:
            self.queued.pop()
            (buffer,) = request.buffers.values()
            buffer.metadata.status = Status.Cancelled
            self._manager.complete(request)

    def finish(self, *planes, sequence, sensor_ns=None, buffer_ns=0, status=Status.Success, metadata=()):
        """The camera fills the oldest queued buffer; with none queued it has to drop the frame, as real ones do."""
        if not self.queued:
            return
        request = self.queued.popleft()
        (buffer,) = request.buffers.values()
        for plane, data in zip(buffer.planes, planes, strict=False):
            os.pwrite(plane.fd, data, plane.offset)
        about = buffer.metadata
        about.status, about.sequence, about.timestamp = status, sequence, buffer_ns
        about.planes = [SimpleNamespace(bytes_used=len(data)) for data in planes]
        request.metadata = {ControlId(name, "Float"): value for name, value in dict(metadata).items()}
        if sensor_ns is not None:
            request.metadata[ControlId("SensorTimestamp", "Integer64")] = sensor_ns
        self._manager.complete(request)

    def pull(self):
        """The plug is pulled, and libcamera has not heard of it yet."""
        self.node.unlink()

    @property
    def pulled(self):
        return self.node is not None and not self.node.exists()

    def unplug(self):
        """The plug is pulled, and libcamera has heard of it."""
        if self.node is not None and not self.pulled:
            self.pull()
        self.gone = True
        self._manager.cameras.remove(self)


class PlayedManager:
    """As CameraManager, the one of the process."""

    version = "v0.4.0"

    def __init__(self):
        self.cameras = []
        self.event_fd = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._ready = []

    def complete(self, request):
        self._ready.append(request)
        os.eventfd_write(self.event_fd, 1)

    def get_ready_requests(self):
        try:
            os.eventfd_read(self.event_fd)
        except BlockingIOError:
            return []
        ready, self._ready = self._ready, []
        for request in ready:
            ctypes.pythonapi.Py_DecRef(ctypes.py_object(request))
        return ready

    def close(self):
        os.close(self.event_fd)
        for camera in self.cameras:
            for fd in camera.files:
                os.close(fd)


class PlayedLibcamera:
    """Stands in for the module `libcamera`."""

    PixelFormat, Size = PixelFormat, Size
    StreamRole = SimpleNamespace(VideoRecording="video")
    CameraConfiguration = SimpleNamespace(Status=Validity)
    FrameMetadata = SimpleNamespace(Status=Status)

    def __init__(self):
        self.manager = PlayedManager()
        self.CameraManager = SimpleNamespace(singleton=lambda: self.manager, version=PlayedManager.version)
        self.buffers = []

    def FrameBufferAllocator(self, camera):  # noqa: N802
        return SimpleNamespace(allocate=lambda _stream: None, buffers=lambda _stream: camera.allocate())

    def plug(
        self,
        name="played-1",
        *,
        formats=("MJPEG", "YUYV"),
        sizes=((64, 48), (128, 96)),
        controls=(),
        plane_sizes=(64 * 48 * 2,),
        stride=0,
        refuse_at=None,
        node=None,
    ):
        """One more camera; `controls`: (name, type, least, most) of each; `node`: stands for its device in /sys/dev/char."""
        infos = {ControlId(n, kind): SimpleNamespace(min=low, max=high) for n, kind, low, high in controls}
        camera = PlayedCamera(
            self.manager, name, formats=formats, sizes=sizes, controls=infos, plane_sizes=plane_sizes, stride=stride,
            refuse_at=refuse_at, node=node,
        )  # fmt: skip
        self.manager.cameras.append(camera)
        return camera
