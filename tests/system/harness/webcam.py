"""A USB webcam on this machine, plugged into the guest: the stock uvcvideo driver binds to it and it can really be unplugged.

Plays a reel of pictures at the rate that the guest asks for. Like a camera it keeps its own time: where the host takes a
frame too slowly, the next ones are left out. Knows the USB side and ready pictures; knows no track.
"""

from __future__ import annotations

import enum
import logging
import math
import threading
import time
from collections.abc import Callable, Sequence

import cv2
import numpy as np

from harness import uvc
from harness.guest import HOST, Guest
from harness.usbip import BUS_ID, Pipe, Setup, UsbIpServer

Pictures = Callable[[tuple[int, int]], Sequence[bytes]]
"""All JPEGs of one cycle, for a (width, height)."""

VENDOR, PRODUCT = 0x1D6B, 0x0102
MAKER, NAME = "Paddock", "Played camera"

PICTURES_PER_S = 30
"""Of a cycle, as they were drawn; at another rate of the camera some are left out or shown again."""
_LATEST = 0.5
"""Share of an interval by which a frame may be late before the next one is sent in its place."""

_END_OF_HEADER, _ERROR, _END_OF_FRAME = 0x80, 0x40, 0x02
_HEADER_BYTES = 2
_CLEAR_FEATURE, _GET_DESCRIPTOR, _GET_STATUS, _GET_CONFIGURATION = 1, 6, 0, 8
_SET_CUR, _GET_LEN, _GET_INFO = 0x01, 0x85, 0x86
_STREAMING_INTERFACE = 1
_PROBE, _COMMIT = 1, 2

log = logging.getLogger("system-test")


class Show(enum.Enum):
    """What the camera does when a frame is due."""

    PLAY = "the next picture"
    SAME = "the same picture again and again"
    NOTHING = "no frame at all, and no error"
    DAMAGED = "frames that the camera itself marks as bad"


class Webcam:
    """A camera that can be plugged in, pulled out, and told to misbehave by setting `show`."""

    vendor, product = VENDOR, PRODUCT

    def __init__(self, pictures: Pictures, *, serial: str = "A1") -> None:
        """`serial` is what tells it from another of the same make."""
        self._pictures = pictures
        self.serial = serial
        self.show = Show.PLAY
        self.sent_frames = 0
        """Whole frames that the host took."""
        self.skipped_frames = 0
        """Frames left out because the host had not taken those before them."""
        self._begun_s = time.monotonic()
        self._controls = uvc.ControlValues()
        self._probe = self._stream = uvc.Stream()
        self._restarted = threading.Event()
        self._server: UsbIpServer | None = None
        self._player: threading.Thread | None = None

    @property
    def node(self) -> str:
        """Where the guest's udev puts it."""
        return f"/dev/v4l/by-id/usb-{MAKER}_{NAME.replace(' ', '_')}_{self.serial}-video-index0"

    def plug(self, guest: Guest, *, timeout_s: float = 60.0) -> float:
        """Plugs it into `guest`; returns the guest's clock when the node was there, seconds of CLOCK_MONOTONIC."""
        if self._server is None:
            for size_px in uvc.SIZES:
                # Drawn or read now, not while the host waits for an answer.
                self._pictures(size_px)
            self._server = UsbIpServer(self)
        attach = f"usbip --tcp-port {self._server.port} attach --remote {HOST} --busid {BUS_ID}"
        look = f"[ -e {self.node} ] && exec cut -d' ' -f1 /proc/uptime"
        wait = f"for i in $(seq {round(timeout_s * 20)}); do {look}; sleep 0.05; done; exit 1"
        said = guest.run(f"modprobe -a vhci-hcd uvcvideo && {attach} && {wait}", timeout_s=timeout_s + 30.0)
        return float(said.split()[-1])

    def unplug(self) -> None:
        """Pulls the plug."""
        if self._server is not None:
            self._server.pull()

    def close(self) -> None:
        """Pulls the plug for good."""
        if self._server is not None:
            self._server.close()
            self._server = None

    def plugged(self, pipe: Pipe) -> None:
        """See `usbip.UsbDevice`."""
        self._player = threading.Thread(target=self._play, args=(pipe,), name="webcam", daemon=True)
        self._player.start()

    def unplugged(self) -> None:
        """See `usbip.UsbDevice`."""
        if self._player is not None:
            self._player.join(5.0)

    def control(self, setup: Setup, data: bytes) -> bytes | None:
        """See `usbip.UsbDevice`."""
        if setup.standard:
            return self._standard(setup)
        selector, unit = setup.value >> 8, setup.index >> 8
        if setup.index & 0xFF == _STREAMING_INTERFACE:
            return self._negotiate(setup.request, selector, data)
        return self._controls.answer(setup.request, (unit, selector), data)

    def _standard(self, setup: Setup) -> bytes | None:
        if setup.request == _GET_DESCRIPTOR:
            kind, index = setup.value >> 8, setup.value & 0xFF
            strings = (uvc.LANGUAGES, *map(uvc.string, (MAKER, NAME, self.serial)))
            known = {1: (uvc.device(VENDOR, PRODUCT),), 2: (uvc.configuration(),), 3: strings}.get(kind, ())
            return known[index] if index < len(known) else None
        if setup.request == _CLEAR_FEATURE:
            # The driver's way to end a stream of bulk transfers.
            self._restarted.set()
        return {_GET_STATUS: b"\0\0", _GET_CONFIGURATION: b"\1"}.get(setup.request, b"")

    def _negotiate(self, request: int, selector: int, data: bytes) -> bytes | None:
        if selector not in (_PROBE, _COMMIT):
            return None
        if request == _SET_CUR:
            self._probe = uvc.Stream.asked(data)
            if selector == _COMMIT:
                self._stream = self._probe
                self._restarted.set()
            return b""
        granted = self._probe.granted()
        return {_GET_INFO: b"\x03", _GET_LEN: len(granted).to_bytes(2, "little")}.get(request, granted)

    def _play(self, pipe: Pipe) -> None:
        number, toggle, held = 0, 0, 0
        while not pipe.closed:
            if pipe.wait(0.2) is None:
                continue
            stream = self._stream
            # The car drives on whatever the camera does: frames are due at multiples of the interval since the beginning.
            due = math.ceil((time.monotonic() - self._begun_s) / stream.interval_s - _LATEST)
            if self._restarted.is_set():
                self._restarted.clear()
            else:
                self.skipped_frames += max(0, due - number - 1)
                due = max(due, number + 1)
            number = due
            due_s = number * stream.interval_s
            time.sleep(max(0.0, self._begun_s + due_s - time.monotonic()))
            if self.show is not Show.SAME:
                held = round(due_s * PICTURES_PER_S)
            if self.show is not Show.NOTHING:
                toggle ^= 1
                self._send(pipe, self._picture(stream, held), toggle)

    def _send(self, pipe: Pipe, picture: bytes, toggle: int) -> None:
        at, flags = 0, _END_OF_HEADER | toggle | (_ERROR if self.show is Show.DAMAGED else 0)
        while at < len(picture) and not self._restarted.is_set():
            size = pipe.wait(0.2)
            if size is None:
                if pipe.closed:
                    return
                continue
            part = picture[at : at + min(size, uvc.PAYLOAD_BYTES) - _HEADER_BYTES]
            at += len(part)
            last = _END_OF_FRAME if at >= len(picture) else 0
            pipe.send(bytes((_HEADER_BYTES, flags | last)) + part)
        self.sent_frames += at >= len(picture)

    def _picture(self, stream: uvc.Stream, number: int) -> bytes:
        cycle = self._pictures(stream.size_px)
        jpeg = cycle[number % len(cycle)]
        return jpeg if stream.format == uvc.MJPEG else _yuyv(jpeg)


def _yuyv(jpeg: bytes) -> bytes:
    """The picture as YUV 4:2:2, packed."""
    y, v, u = cv2.split(
        cv2.cvtColor(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2YCrCb)
    )
    packed = np.empty((*y.shape, 2), dtype=np.uint8)
    packed[..., 0] = y
    packed[:, 0::2, 1], packed[:, 1::2, 1] = u[:, 0::2], v[:, 0::2]
    return packed.tobytes()
