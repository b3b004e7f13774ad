"""A stream of bytes to and from a driver's process, where every wait has a deadline.

Knows file descriptors: two ends of pipes or one socket, and perhaps a third on which a process complains. Knows neither what is
said nor who speaks. One thread; nothing blocks beyond the deadline, whatever the other side does or leaves undone.
"""

from __future__ import annotations

import os
import selectors
import time

MOST_LINE_BYTES = 65_536
MOST_COMPLAINT_BYTES = 4_096
_PIECE = 65_536


class Late(Exception):
    """The deadline passed."""


class Gone(Exception):
    """The other side has closed the stream, or broke it."""


class TooLong(Exception):
    """The other side sent more than a line has."""


class Stream:
    """Bytes to and from one driver."""

    def __init__(self, read_fd: int, write_fd: int, complaint_fd: int | None = None) -> None:
        """Takes descriptors that stay their owner's, and makes them non-blocking."""
        self._read_fd, self._write_fd, self._complaint_fd = read_fd, write_fd, complaint_fd
        for fd in {read_fd, write_fd, *([] if complaint_fd is None else [complaint_fd])}:
            os.set_blocking(fd, False)
        self._heard = bytearray()
        self._complaint = bytearray()
        self._ended = False

    def send(self, data: bytes, deadline_s: float) -> None:
        """Hands over `data`, listening meanwhile. `deadline_s` on time.monotonic's clock. Raises `Late`, `Gone`."""
        rest = memoryview(data)
        while rest:
            ready = self._wait(deadline_s, writing=True)
            if self._write_fd in ready:
                try:
                    rest = rest[os.write(self._write_fd, rest[:_PIECE]) :]
                except BlockingIOError:
                    continue
                except OSError as error:
                    raise Gone from error

    def line(self, deadline_s: float) -> bytes:
        """The next line, without its end. Raises `Late`, `Gone`, `TooLong`."""
        while (end := self._heard.find(b"\n")) < 0:
            if len(self._heard) >= MOST_LINE_BYTES:
                raise TooLong
            if self._ended:
                raise Gone
            self._wait(deadline_s, writing=False)
        found = bytes(self._heard[:end])
        del self._heard[: end + 1]
        return found

    def complaint(self) -> str:
        """The last line that was complained, in plain characters; empty where there was none."""
        if self._complaint_fd is not None:
            self._read_complaint()
        lines = self._complaint.decode("utf-8", "replace").split("\n")
        said = [line.strip() for line in lines if line.strip()]
        return "".join(one if one.isprintable() else "?" for one in said[-1]) if said else ""

    def _wait(self, deadline_s: float, *, writing: bool) -> set[int]:
        """Waits for something to do, and reads what there is. Returns the descriptors that were ready."""
        left_s = deadline_s - time.monotonic()
        if left_s <= 0.0:
            raise Late
        with selectors.DefaultSelector() as selector:
            wanted: dict[int, int] = {}
            if not self._ended and len(self._heard) < MOST_LINE_BYTES:
                wanted[self._read_fd] = selectors.EVENT_READ
            if writing:
                wanted[self._write_fd] = wanted.get(self._write_fd, 0) | selectors.EVENT_WRITE
            if self._complaint_fd is not None:
                wanted[self._complaint_fd] = selectors.EVENT_READ
            for fd, events in wanted.items():
                selector.register(fd, events)
            found = {key.fd: events for key, events in selector.select(left_s)}
        if self._complaint_fd in found:
            self._read_complaint()
        if found.get(self._read_fd, 0) & selectors.EVENT_READ:
            self._read()
        return {fd for fd, events in found.items() if events & selectors.EVENT_WRITE}

    def _read(self) -> None:
        try:
            heard = os.read(self._read_fd, _PIECE)
        except BlockingIOError:
            return
        except OSError:
            heard = b""  # a connection that was reset has ended as well
        self._ended = not heard
        self._heard += heard

    def _read_complaint(self) -> None:
        assert self._complaint_fd is not None
        while True:
            try:
                said = os.read(self._complaint_fd, _PIECE)
            except BlockingIOError:
                return
            if not said:
                self._complaint_fd = None
                return
            self._complaint += said
            del self._complaint[:-MOST_COMPLAINT_BYTES]
