"""A vehicle by a serial line, or by a radio that is one: plugged in or not, opened again as soon as it is there.

Knows pyserial. Knows nothing of what lines say.
"""

from __future__ import annotations

import logging
import os
import termios
import time

import serial

from dnb_edge.vehicle.channel import Heard, Splitter

READ_BYTES = 4096
BACK_OFF_S = (0.5, 1.0, 2.0)
"""Between attempts to open it, the last one for ever."""
PORT_FAULTS = (serial.SerialException, OSError, termios.error)

log = logging.getLogger(__name__)


class SerialChannel:
    """The port at `path`. Whatever is at its other end hears all signals."""

    def __init__(self, path: str, baud: int) -> None:
        """A port that is not there is no error: it is waited for."""
        self.name = f"serial {path}"
        self.thrown_away = 0
        self._path = path
        self._baud = baud
        self._port: serial.Serial | None = None
        self._splitter = Splitter()
        self._due_s = 0.0
        self._tries = 0
        self.tend(time.monotonic())

    def fileno(self) -> int | None:
        """Of the port; None while it is away."""
        return None if self._port is None else int(self._port.fileno())

    def read(self) -> list[Heard]:
        """The whole lines that have come."""
        if self._port is None:
            return []
        try:
            data = os.read(self._port.fileno(), READ_BYTES)
        except BlockingIOError:
            return []
        except PORT_FAULTS as fault:
            self._lost(fault)
            return []
        if not data:
            self._lost(OSError(5, "it was unplugged"))
            return []
        came_ns = time.monotonic_ns()
        return [Heard(line=line, sender=self.name, came_ns=came_ns) for line in self._splitter.feed(data)]

    def registered(self, heard: Heard, car: int | None, now_s: float) -> None:
        """There is one other end, which hears all."""

    def tell(self, line: bytes, car: int | None, now_s: float) -> None:  # noqa: ARG002 there is one other end
        """What the port does not take at once is lost."""
        if self._port is None:
            return
        try:
            os.write(self._port.fileno(), line)
        except BlockingIOError:
            return
        except PORT_FAULTS as fault:
            self._lost(fault)

    def tend(self, now_s: float) -> None:
        """Opens the port where it is away and it is time to try."""
        if self._port is not None or now_s < self._due_s:
            return
        try:
            self._port = serial.Serial(self._path, self._baud, timeout=0, write_timeout=0, exclusive=True)
        except PORT_FAULTS as fault:
            self._lost(fault)
        else:
            log.info("%s: open", self.name)
            self._tries, self._splitter = 0, Splitter()

    def close(self) -> None:
        """Lets go of the port."""
        port, self._port = self._port, None
        if port is not None:
            # What nobody takes would hold up close() for half a minute.
            for step in (port.reset_output_buffer, port.close):
                try:
                    step()
                except PORT_FAULTS as fault:
                    log.debug("%s: %s", self.name, fault)

    def _lost(self, fault: Exception) -> None:
        if self._tries == 0:
            log.warning("%s: away (%s); it is tried again", self.name, fault)
        self._due_s = time.monotonic() + BACK_OFF_S[min(self._tries, len(BACK_OFF_S) - 1)]
        self._tries += 1
        self.close()
