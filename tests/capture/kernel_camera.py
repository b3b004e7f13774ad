"""A V4L2 driver played at the ioctl boundary, for machines without a camera.

Everything above the system call is the real thing: linuxpy, its structures, select on a real file descriptor. The node is a
pseudo-terminal, since that is a character device that a test may make and that becomes readable when the test says so: one
byte in it is one finished buffer.
"""

import errno
import mmap
import os
import tty
from collections import deque
from pathlib import Path

from linuxpy.video import raw

MONOTONIC, START_OF_EXPOSURE, ERROR = 0x2000, 0x10000, 0x40
BRIGHTNESS = 0x00980900
IOC = raw.IOC


class KernelCamera:
    """One camera that answers linuxpy's ioctls. `finish` completes the next buffer."""

    def __init__(
        self, *, formats=("YUYV", "MJPG"), size=(64, 48), caps=0x04000001, busy_at=None, rates=True, brightness=None
    ):
        self.master, slave = os.openpty()
        tty.setraw(slave)
        self.path = Path(os.ttyname(slave))
        self._slave = slave
        self.formats, self.size, self.caps, self.busy_at, self.rates = formats, size, caps, busy_at, rates
        self.brightness = brightness
        self.granted = formats[0] if formats else "YUYV"
        self.buffers: list[mmap.mmap] = []
        self.queued: deque[int] = deque()
        self.done: deque[tuple[int, int, int, int, int]] = deque()
        self.streaming = False
        self.gone = False
        self.requested: list[str] = []

    def close(self):
        os.close(self.master)
        os.close(self._slave)

    def finish(self, data: bytes, *, sequence: int, t_us: int, flags: int = MONOTONIC | START_OF_EXPOSURE):
        """The driver fills the oldest queued buffer; with none queued it has to drop the frame, as real ones do."""
        if not self.queued:
            return
        index = self.queued.popleft()
        self.buffers[index][: len(data)] = data
        self.done.append((index, len(data), sequence, t_us, flags))
        os.write(self.master, b"x")

    def unplug(self):
        self.gone = True
        os.write(self.master, b"x")

    def map_memory(self, fd, length, offset):
        return self.buffers[offset]

    def ioctl(self, fd, request, *args):
        self.requested.append(IOC(request).name)
        if self.gone:
            raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))
        if self.busy_at == IOC(request).name:
            raise OSError(errno.EBUSY, os.strerror(errno.EBUSY))
        getattr(self, f"_{IOC(request).name.lower()}")(fd, *args)
        return args[0] if args else None

    def _querycap(self, fd, caps):
        caps.driver, caps.card, caps.bus_info = b"played", b"Played Camera", b"usb-test-1"
        caps.capabilities = self.caps | 0x80000000
        caps.device_caps = self.caps

    def _enum_fmt(self, fd, fmt):
        if fmt.index >= len(self.formats):
            raise OSError(errno.EINVAL, "end of list")
        fmt.pixelformat = raw.v4l2_fourcc(*self.formats[fmt.index])

    def _s_fmt(self, fd, fmt):
        fourcc = fmt.fmt.pix.pixelformat.to_bytes(4, "little").decode()
        self.granted = fourcc if fourcc in self.formats else self.formats[0]

    def _g_fmt(self, fd, fmt):
        fmt.fmt.pix.width, fmt.fmt.pix.height = self.size
        fmt.fmt.pix.pixelformat = raw.v4l2_fourcc(*self.granted)
        fmt.fmt.pix.bytesperline = 2 * self.size[0] if self.granted == "YUYV" else 0
        fmt.fmt.pix.sizeimage = 2 * self.size[0] * self.size[1]

    def _s_parm(self, fd, parm):
        if not self.rates:
            raise OSError(errno.ENOTTY, "no rates")

    def _g_parm(self, fd, parm):
        parm.parm.capture.timeperframe.numerator = 1
        parm.parm.capture.timeperframe.denominator = 30

    def _reqbufs(self, fd, request):
        self.buffers = [mmap.mmap(-1, 2 * self.size[0] * self.size[1]) for _ in range(request.count)]
        self.queued.clear()

    def _querybuf(self, fd, buffer):
        buffer.length = len(self.buffers[buffer.index])
        buffer.m.offset = buffer.index

    def _qbuf(self, fd, buffer):
        assert buffer.index not in self.queued
        self.queued.append(buffer.index)
        # As the kernel's vb2 does: queueing wipes what dequeueing had said.
        buffer.sequence = buffer.flags = buffer.bytesused = 0

    def _dqbuf(self, fd, buffer):
        if not self.done:
            raise BlockingIOError(errno.EAGAIN, "nothing is ready")
        os.read(fd.fileno(), 1)
        buffer.index, buffer.bytesused, buffer.sequence, t_us, buffer.flags = self.done.popleft()
        buffer.timestamp.secs, buffer.timestamp.usecs = divmod(t_us, 1_000_000)

    def _query_ext_ctrl(self, fd, control):
        if self.brightness is None or control.id & 0x0FFFFFFF >= BRIGHTNESS:
            raise OSError(errno.EINVAL, "no more controls")
        control.id, control.type, control.name = BRIGHTNESS, raw.CtrlType.INTEGER, b"Brightness"
        control.minimum, control.maximum, control.step = 0, 255, 1

    def _s_ext_ctrls(self, fd, controls):
        self.brightness = controls.controls[0].value

    def _streamon(self, fd, kind):
        self.streaming = True

    def _streamoff(self, fd, kind):
        self.streaming = False
