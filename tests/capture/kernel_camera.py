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
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

from linuxpy.video import raw

MONOTONIC, START_OF_EXPOSURE, ERROR = 0x2000, 0x10000, 0x40
IOC = raw.IOC
AUTO_EXPOSURE, EXPOSURE, DYNAMIC_FRAMERATE = 0x009A0901, 0x009A0902, 0x009A0903
FOCUS, AUTO_FOCUS = 0x009A090A, 0x009A090C
BRIGHTNESS, AUTO_WHITE, AUTO_GAIN, GAIN = 0x00980900, 0x0098090C, 0x00980912, 0x00980913
POWER_LINE, WHITE_KELVIN = 0x00980918, 0x0098091A


@dataclass
class PlayedControl:
    """One control and how it misbehaves."""

    ident: int
    name: str
    value: int
    least: int = 0
    most: int = 255
    step: int = 1
    menu: dict[int, str] = field(default_factory=dict)
    held_by: tuple[int, int] | None = None
    """(control, value): settable only while that control has that value, as the kernel has it for what is automatic."""
    kind: raw.CtrlType = raw.CtrlType.INTEGER
    flags: int = 0
    unreadable: bool = False


def webcam_controls() -> list[PlayedControl]:
    """The controls of a common UVC webcam under today's kernel, all automatic."""
    switch = {"most": 1, "kind": raw.CtrlType.BOOLEAN}
    exposure = {1: "Manual Mode", 3: "Aperture Priority Mode"}
    lines = {0: "Disabled", 1: "50 Hz", 2: "60 Hz"}
    return [
        PlayedControl(0x00980001, "User Controls", 0, kind=raw.CtrlType.CTRL_CLASS),
        PlayedControl(BRIGHTNESS, "Brightness", 9),
        PlayedControl(AUTO_WHITE, "White Balance, Automatic", 1, **switch),
        PlayedControl(GAIN, "Gain", 64),
        PlayedControl(POWER_LINE, "Power Line Frequency", 2, most=2, menu=lines),
        PlayedControl(WHITE_KELVIN, "White Balance Temperature", 4000, 2800, 6500, 10, held_by=(AUTO_WHITE, 0)),
        PlayedControl(AUTO_EXPOSURE, "Auto Exposure", 3, most=3, menu=exposure),
        PlayedControl(EXPOSURE, "Exposure Time, Absolute", 156, 3, 2047, held_by=(AUTO_EXPOSURE, 1)),
        PlayedControl(DYNAMIC_FRAMERATE, "Exposure, Dynamic Framerate", 1, **switch),
        PlayedControl(FOCUS, "Focus, Absolute", 30, 0, 250, 5, held_by=(AUTO_FOCUS, 0)),
        PlayedControl(AUTO_FOCUS, "Focus, Automatic Continuous", 1, **switch),
    ]


class KernelCamera:
    """One camera that answers linuxpy's ioctls. `finish` completes the next buffer."""

    def __init__(
        self,
        *,
        formats=("YUYV", "MJPG"),
        size=(64, 48),
        caps=0x04000001,
        busy_at=None,
        rates=True,
        controls=(),
        sizes=None,
        grants=None,
        keeps_fps=None,
    ):
        """`sizes`: {FourCC: [((width, height), [fps, ...]) or ((least), (most), (step), (slowest, fastest) fps)]}; None for a
        driver that does not tell. `grants`: how many buffers it gives at most. `rates` False: it knows none. `keeps_fps`:
        frames and seconds of the rate that it keeps, whatever it is asked."""
        self.master, slave = os.openpty()
        tty.setraw(slave)
        self.path = Path(os.ttyname(slave))
        self._slave = slave
        self.formats, self.size, self.caps, self.busy_at, self.rates = formats, size, caps, busy_at, rates
        self.controls = {control.ident: control for control in controls}
        self.sizes, self.grants = sizes, grants
        self.fps = (30, 1) if keeps_fps is None else keeps_fps
        self.keeps_fps = keeps_fps
        self.granted = formats[0] if formats else "YUYV"
        self.buffers: list[mmap.mmap] = []
        self.queued: deque[int] = deque()
        self.done: deque[tuple[int, int, int, int, int]] = deque()
        self.streaming = False
        self.gone = False
        self.gone_after: int | None = None
        """Gone once so many buffers were dequeued."""
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

    def vanish(self):
        """As `unplug`, in the middle of a call."""
        self.gone = True
        raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))

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

    def _enum_framesizes(self, fd, entry):
        offered = self._offered(entry.pixel_format)
        if entry.index >= len(offered):
            raise OSError(errno.EINVAL, "end of list")
        size = offered[entry.index]
        if len(size) == 2:
            entry.type = raw.Frmsizetypes.DISCRETE
            entry.discrete.width, entry.discrete.height = size[0]
            return
        entry.type = raw.Frmsizetypes.STEPWISE
        step = entry.stepwise
        (step.min_width, step.min_height), (step.max_width, step.max_height) = size[:2]
        step.step_width, step.step_height = size[2]

    def _enum_frameintervals(self, fd, entry):
        for size in self._offered(entry.pixel_format):
            if len(size) == 2 and size[0] == (entry.width, entry.height):
                if entry.index >= len(size[1]):
                    break
                entry.type = raw.Frmivaltypes.DISCRETE
                rate = Fraction(size[1][entry.index])
                entry.discrete.numerator, entry.discrete.denominator = rate.denominator, rate.numerator
                return
            if len(size) == 4 and entry.index == 0:
                entry.type = raw.Frmivaltypes.CONTINUOUS
                for interval, fps in zip((entry.stepwise.max, entry.stepwise.min), size[3], strict=True):
                    interval.numerator, interval.denominator = 1, fps
                return
        raise OSError(errno.EINVAL, "end of list")

    def _offered(self, pixel_format):
        if self.sizes is None:
            raise OSError(errno.ENOTTY, "does not tell")
        return self.sizes[pixel_format.to_bytes(4, "little").decode()]

    def _s_fmt(self, fd, fmt):
        fourcc = fmt.fmt.pix.pixelformat.to_bytes(4, "little").decode()
        self.granted = fourcc if fourcc in self.formats else self.formats[0]
        if self.sizes is not None:
            self.size = fmt.fmt.pix.width, fmt.fmt.pix.height

    def _g_fmt(self, fd, fmt):
        fmt.fmt.pix.width, fmt.fmt.pix.height = self.size
        fmt.fmt.pix.pixelformat = raw.v4l2_fourcc(*self.granted)
        fmt.fmt.pix.bytesperline = 2 * self.size[0] if self.granted == "YUYV" else 0
        fmt.fmt.pix.sizeimage = 2 * self.size[0] * self.size[1]

    def _s_parm(self, fd, parm):
        if not self.rates:
            raise OSError(errno.ENOTTY, "no rates")
        asked = parm.parm.capture.timeperframe
        if self.keeps_fps is None:
            self.fps = asked.denominator, asked.numerator

    def _g_parm(self, fd, parm):
        granted = parm.parm.capture.timeperframe
        granted.denominator, granted.numerator = self.fps

    def _reqbufs(self, fd, request):
        request.count = request.count if self.grants is None else min(request.count, self.grants)
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
        if self.gone_after is not None:
            self.gone_after -= 1
            if self.gone_after == 0:
                self.unplug()

    def _query_ext_ctrl(self, fd, control):
        after = control.id & 0x0FFFFFFF
        for ident, one in sorted(self.controls.items()):
            if ident > after:
                control.id, control.type, control.name = ident, one.kind, one.name.encode()
                if one.menu:
                    control.type = raw.CtrlType.MENU
                control.minimum, control.maximum, control.step, control.flags = one.least, one.most, one.step, one.flags
                return
        raise OSError(errno.EINVAL, "no more controls")

    def _querymenu(self, fd, entry):
        menu = self.controls[entry.id].menu
        if entry.index not in menu:
            raise OSError(errno.EINVAL, "a hole")
        entry.name = menu[entry.index].encode()

    def _s_ext_ctrls(self, fd, controls):
        for i in range(controls.count):
            one, value = self.controls[controls.controls[i].id], controls.controls[i].value
            if one.held_by is not None and self.controls[one.held_by[0]].value != one.held_by[1]:
                raise OSError(errno.EACCES, os.strerror(errno.EACCES))
            one.value = one.least + (value - one.least) // one.step * one.step

    def _g_ext_ctrls(self, fd, controls):
        for i in range(controls.count):
            one = self.controls[controls.controls[i].id]
            if one.unreadable:
                raise OSError(errno.EIO, os.strerror(errno.EIO))
            controls.controls[i].value = one.value

    def _streamon(self, fd, kind):
        self.streaming = True

    def _streamoff(self, fd, kind):
        self.streaming = False
