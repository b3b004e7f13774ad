"""A USB device in user space: the server's side of USB/IP, as `usbip attach` and the kernel's vhci_hcd speak it.

By Documentation/usb/usbip_protocol.rst of the kernel. Knows one device with control transfers on endpoint 0 and one bulk
endpoint towards the host. Knows no camera: that is whoever implements `UsbDevice`.
"""

from __future__ import annotations

import contextlib
import logging
import socket
import struct
import threading
from collections import deque
from dataclasses import dataclass
from typing import Protocol

BUS_ID = "1-1"
"""The name under which the one device is offered."""

_VERSION = 0x0111
_REQUEST_IMPORT, _REPLY_IMPORT = 0x8003, 0x0003
_SUBMIT, _UNLINK, _SUBMITTED, _UNLINKED = 1, 2, 3, 4
_HIGH_SPEED = 3
_STALLED, _UNLINKED_STATUS = -32, -104
_DIRECTION_IN = 1

log = logging.getLogger("system-test")


@dataclass(frozen=True, slots=True)
class Setup:
    """The eight bytes that begin a control transfer."""

    kind: int
    """bmRequestType."""
    request: int
    value: int
    index: int
    length: int

    @property
    def to_host(self) -> bool:
        """Whether the device answers with data."""
        return bool(self.kind & 0x80)

    @property
    def standard(self) -> bool:
        """Whether every USB device understands it."""
        return self.kind & 0x60 == 0


class UsbDevice(Protocol):
    """What a device does when it is plugged in."""

    vendor: int
    product: int

    def control(self, setup: Setup, data: bytes) -> bytes | None:
        """Answers a transfer on endpoint 0: the data towards the host (empty for none), or None to stall."""

    def plugged(self, pipe: Pipe) -> None:
        """The host is connected; `pipe` takes bulk data until it is closed."""

    def unplugged(self) -> None:
        """It is not any more."""


class Pipe:
    """The bulk endpoint: the host asks for data by submitting requests, the device answers them in order."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        # Held from taking a request until its answer is sent: once the kernel was told that a request was taken back too late,
        # it hangs up on an answer that comes after that.
        self._sending = threading.RLock()
        self._waiting: deque[tuple[int, int]] = deque()
        self._changed = threading.Condition()
        self.closed = False

    def wait(self, timeout_s: float) -> int | None:
        """Size of the oldest request, bytes; None where none came in `timeout_s` or the pipe is closed."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self.closed, timeout_s)
            return self._waiting[0][1] if self._waiting and not self.closed else None

    def send(self, data: bytes) -> bool:
        """Answers the oldest request; False where there is none any more."""
        with self._sending:
            with self._changed:
                if self.closed or not self._waiting:
                    return False
                number, _ = self._waiting.popleft()
            return self.answer(number, 0, data)

    def answer(self, number: int, status: int, data: bytes = b"", *, length: int | None = None) -> bool:
        """Tells the host that request `number` is done; `length` where no data goes back."""
        head = struct.pack(">5I", _SUBMITTED, number, 0, 0, 0)
        body = struct.pack(">5i8x", status, len(data) if length is None else length, 0, 0, 0)
        return self._send(head + body + data)

    def ask(self, number: int, size: int) -> None:
        """The host wants `size` bytes."""
        with self._changed:
            self._waiting.append((number, size))
            self._changed.notify_all()

    def take_back(self, number: int, unlinked: int) -> None:
        """The host does not want the answer to `unlinked` any more, and is told whether that came in time."""
        with self._sending:
            with self._changed:
                before = len(self._waiting)
                self._waiting = deque(item for item in self._waiting if item[0] != unlinked)
                found = len(self._waiting) < before
            self._send(struct.pack(">5Ii24x", _UNLINKED, number, 0, 0, 0, _UNLINKED_STATUS if found else 0))

    def close(self) -> None:
        """Nothing is asked or answered any more."""
        with self._changed:
            self.closed = True
            self._waiting.clear()
            self._changed.notify_all()

    def _send(self, message: bytes) -> bool:
        try:
            with self._sending:
                self._connection.sendall(message)
        except OSError:
            return False
        return True


class UsbIpServer:
    """Offers one device on a TCP port of this machine's loopback; whoever imports it has it plugged in."""

    def __init__(self, device: UsbDevice) -> None:
        self._device = device
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = self._listening.getsockname()[1]
        self._connection: socket.socket | None = None
        self._closing = False
        self._thread = threading.Thread(target=self._serve, name="usbip", daemon=True)
        self._thread.start()

    def pull(self) -> None:
        """Pulls the plug: the connection breaks in the middle of whatever it is doing."""
        if self._connection is not None:
            with contextlib.suppress(OSError):
                self._connection.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Pulls the plug for good."""
        self._closing = True
        with contextlib.suppress(OSError):
            self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()
        self.pull()
        self._thread.join(5.0)

    def _serve(self) -> None:
        while not self._closing:
            try:
                connection, _ = self._listening.accept()
            except OSError:
                return
            with connection:
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._connection = connection
                try:
                    self._import(connection)
                except (EOFError, OSError) as end:
                    log.debug("usbip: %s", end)

    def _import(self, connection: socket.socket) -> None:
        """The greeting, then the transfers, until the connection ends."""
        _version, code, _status = struct.unpack(">HHI", _receive(connection, 8))
        if code != _REQUEST_IMPORT:
            return
        _receive(connection, 32)
        path = f"/sys/devices/played/{BUS_ID}".encode()
        described = struct.pack(
            ">256s32sIIIHHHBBBBBB",
            path, BUS_ID.encode(), 1, 2, _HIGH_SPEED, self._device.vendor, self._device.product, 0x0100,
            0xEF, 2, 1, 0, 1, 2,
        )  # fmt: skip
        connection.sendall(struct.pack(">HHI", _VERSION, _REPLY_IMPORT, 0) + described)
        pipe = Pipe(connection)
        self._device.plugged(pipe)
        try:
            while True:
                self._transfer(connection, pipe)
        finally:
            pipe.close()
            self._device.unplugged()

    def _transfer(self, connection: socket.socket, pipe: Pipe) -> None:
        head = _receive(connection, 48)
        command, number, _device, direction, endpoint = struct.unpack_from(">5I", head)
        if command == _UNLINK:
            pipe.take_back(number, struct.unpack_from(">I", head, 20)[0])
            return
        size = struct.unpack_from(">Ii", head, 20)[1]
        data = _receive(connection, size) if direction != _DIRECTION_IN and size else b""
        if endpoint != 0:
            pipe.ask(number, size)
            return
        setup = Setup(*struct.unpack("<BBHHH", head[40:48]))
        answer = self._device.control(setup, data)
        if answer is None:
            pipe.answer(number, _STALLED)
        elif setup.to_host:
            pipe.answer(number, 0, answer[: setup.length])
        else:
            pipe.answer(number, 0, length=len(data))


def _receive(connection: socket.socket, size: int) -> bytes:
    parts = bytearray()
    while len(parts) < size:
        part = connection.recv(size - len(parts))
        if not part:
            raise EOFError("the other side hung up")
        parts += part
    return bytes(parts)
